//! The measurement of one group by one process: [`queries`] of a still scene.
//!
//! The first process counts, checks with the oracle, makes the schedules, and times. The others
//! compare the digests of answers with those of the first, and time by its schedules. The group as
//! a result, [`Group`](super::Group), is in `results`.

use std::collections::BTreeMap;

use super::bounds::Bound;
use super::count::{Counted, MOST_JUDGED, count_pass, judge};
use super::index_under_test::original;
use super::key::{GroupKey, Pass, TaskKey};
use super::process_result::{Measured, Part, ReferenceResults, SubjectPart, TaskPart};
use super::schedule::scheduled;
use super::{
    Answer, Judged, KeyedSchedule, Notice, PathInfo, Protocol, SceneInfo, Schedule, Status,
    Subject, TIMING, TaskKind, Timed, TimedTask, Verdict, Workload, guarded, timed,
};
use crate::kernel::Kernel;
use crate::query::QueryCost;
use crate::statistics::{interquartile_mean, median};

/// Reason of omissions in a scene without items.
pub const NO_ITEMS: &str = "the scene has no items: there is nothing to time";
/// Fewest groups of cameras for quantiles of the query time.
pub(super) const LEAST_TAIL: usize = 20;

/// Settings of the measurement of one group by one process.
pub struct GroupPlan<'a> {
    /// The scene, in the form of reports.
    pub scene: &'a SceneInfo,
    /// The path, in the form of reports.
    pub path: PathInfo,
    /// Number of this process; 0 counts and plans.
    pub process: u32,
    /// Rounds and times of the timed pass.
    pub protocol: Protocol,
    /// Lower bounds timed beside the structures.
    pub bounds: &'a [Bound],
    /// Answers and schedules of the first process; `None` in that process.
    pub known: Option<&'a ReferenceResults>,
    /// True to count, check and plan without timing.
    pub plan_only: bool,
    /// True if region search is timed as well.
    pub locate: bool,
    /// Callback for each step.
    pub notice: Notice<'a>,
}

impl<'a> GroupPlan<'a> {
    /// The plan of a single process, for warm or cold caches.
    ///
    /// It times region search as well, and no lower bounds.
    pub fn new(workload: &Workload, scene: &'a SceneInfo, protocol: Protocol) -> GroupPlan<'a> {
        GroupPlan {
            path: PathInfo::of(workload, protocol.cold),
            scene,
            process: 0,
            protocol,
            bounds: &[],
            known: None,
            plan_only: false,
            locate: true,
            notice: &|_, _| (),
        }
    }

    /// The answers of the first process, if it had any.
    pub(super) fn answered(&self) -> Option<&'a ReferenceResults> {
        self.known.filter(|known| !known.visible.is_empty())
    }

    /// The part of this process without results.
    ///
    /// With its answers and schedules if none were known.
    pub(super) fn part(
        self,
        workload: &Workload,
        [visible, located]: [Vec<Answer>; 2],
        [query, locate]: [Option<KeyedSchedule>; 2],
    ) -> Part {
        let known = self.answered().is_none().then_some(ReferenceResults {
            visible,
            located,
            query,
            locate,
            lens_scale: workload.lens_scale,
        });
        Part {
            key: GroupKey::new(&self.scene.name, &self.path, workload.culling.test.name()),
            process: self.process,
            scene: self.scene.clone(),
            path: self.path,
            known,
            ..Part::default()
        }
    }
}

/// A structure under test with its results so far.
struct Entry<'a> {
    subject: &'a Subject,
    part: SubjectPart,
    /// Answers and costs; in the first process only.
    counted: Option<Counted>,
}

/// Measures a group of queries of a still scene.
pub fn queries(workload: &Workload, subjects: &[Subject], plan: GroupPlan) -> Measured {
    let notice = plan.notice;
    let (mut entries, judged, answers) = match plan.answered() {
        None => count(workload, subjects, notice),
        Some(known) => {
            let entry = |subject| {
                let differs = compare_digests(subject, workload, known, notice).err();
                Entry {
                    subject,
                    part: SubjectPart::of(subject, differs.unwrap_or_default()),
                    counted: None,
                }
            };
            let answers = [known.visible.clone(), known.located.clone()];
            (subjects.iter().map(entry).collect(), None, answers)
        }
    };
    let (mut bounds, mut tasks, mut samples) = (Vec::new(), Vec::new(), Vec::new());
    let mut schedules = [None, None];
    for &pass in &Pass::ALL[..1 + usize::from(plan.locate)] {
        let asked = tasks_of(workload, &entries, &plan, pass, &answers[pass as usize]);
        let is_bound = |label: &str| plan.bounds.iter().any(|bound| bound.name == label);
        let labels = asked.iter().map(|((label, _), _)| label);
        bounds.extend(labels.filter(|label| is_bound(label)).cloned());
        let given = plan.known.and_then(|known| known.pass(pass).0);
        let mut protocol = plan.protocol;
        // Region search gets less time, because structures are ranked by frustum queries.
        protocol.task_ns *= [1.0, 1.0 / 3.0][pass as usize];
        let (planned, asked) = scheduled(asked, given, workload.views.len(), &protocol);
        let (keys, schedule) = (&planned.keys, &planned.schedule);
        let labels = keys.iter().map(|(label, _)| label.as_str());
        let structure = |label| (!is_bound(label)).then(|| original(label));
        let structures: Vec<Option<&str>> = labels.map(structure).collect();
        let turn = |task: usize| notice(structures[task], TIMING);
        let timed = match plan.plan_only {
            true => Vec::new(),
            false => timed(&asked, schedule, &plan.protocol, &turn),
        };
        let alone = keys.iter().zip(&schedule.tasks);
        // Lower bounds take less time than a query, and so have larger batches.
        let is_alone = |(label, kind): &TaskKey| *kind != TaskKind::Views && !is_bound(label);
        let alone = alone.filter(|(key, _)| is_alone(key));
        let largest = alone.map(|(_, task)| task.batch).max().unwrap_or(1) as usize;
        for (key, result) in keys.iter().zip(timed) {
            let groups = schedule.cameras.len().div_ceil(largest);
            let has_tail = key.1 == TaskKind::Query && is_alone(key) && groups >= LEAST_TAIL;
            let largest = has_tail.then_some(largest);
            tasks.push(task_part(key, &result, schedule, largest));
            let mut own = entries.iter_mut().filter(|e| e.part.label == key.0);
            if let (Err(verdict), Some(entry)) = (&result, own.next()) {
                entry.part.verdict = verdict.clone();
            }
            let own = result.map(|timed| timed.samples).unwrap_or_default();
            samples.push((key.0.clone(), key.1, own));
        }
        schedules[pass as usize] = Some(planned);
    }
    let part = Part {
        judged,
        subjects: entries.into_iter().map(|entry| entry.part).collect(),
        bounds,
        tasks,
        ..plan.part(workload, answers, schedules)
    };
    (part, samples)
}

/// The tasks of a pass: those of all right structures, then lower bounds.
fn tasks_of<'a>(
    workload: &'a Workload,
    entries: &[Entry<'a>],
    plan: &GroupPlan,
    pass: Pass,
    answers: &[Answer],
) -> Vec<(TaskKey, TimedTask<'a>)> {
    let mut tasks = Vec::new();
    for &kind in pass.tasks() {
        for entry in entries.iter().filter(|entry| entry.part.verdict.is_ok()) {
            let Ok(built) = &entry.subject.built else {
                continue;
            };
            let least_ns = entry.counted.as_ref().map(|c| c.least_ns(pass));
            let spec = &entry.subject.spec;
            // Views are shared if builds are, unless each query is shared already. One sweep for
            // all of them would compare warm views with cold queries.
            let are_shared = spec.execution.threads > 1 && spec.query_threads() < 2;
            if kind == TaskKind::Views && (!are_shared || plan.protocol.cold) {
                continue;
            }
            let task = TimedTask::of(kind, spec, workload, built, answers, least_ns);
            tasks.push(((entry.subject.label(), kind), task));
        }
    }
    let kernel = entries.first().map(|e| e.subject.spec.execution.kernel);
    let kernel = kernel.unwrap_or_else(Kernel::best);
    let visible: Vec<u64> = answers.iter().map(|a| a.count).collect();
    let have_bounds = pass == Pass::Queries && !visible.is_empty();
    for bound in plan.bounds.iter().filter(|_| have_bounds) {
        let task = (bound.make)(workload, kernel, &visible);
        tasks.extend(task.map(|task| ((bound.name.to_owned(), TaskKind::Query), task)));
    }
    tasks
}

/// The times of a task, from its samples; tail by groups of `largest` cameras.
pub(super) fn task_part(
    key: &TaskKey,
    result: &Result<Timed, Verdict>,
    schedule: &Schedule,
    largest: Option<usize>,
) -> TaskPart {
    let nothing = Timed::default();
    let timed = result.as_ref().unwrap_or(&nothing);
    let wall = timed.round_means(|s| s.wall_ns).into_iter().map(f64::ln);
    let tail_ns = largest.map(|largest| tail(timed, largest, schedule));
    TaskPart {
        label: key.0.clone(),
        task: key.1,
        verdict: result.as_ref().err().cloned().unwrap_or_default(),
        rounds_ns: timed.round_means(|s| s.cpu_ns),
        wall_ln_ns: interquartile_mean(&wall.collect::<Vec<_>>()),
        tail_ns: tail_ns.unwrap_or_default(),
    }
}

/// CPU ns per query of each group of `largest` consecutive timed cameras.
///
/// The median over the rounds of a group's mean; `largest` is the largest batch of all tasks, so
/// that the groups are the same for all.
fn tail(timed: &Timed, largest: usize, schedule: &Schedule) -> Vec<f64> {
    let position: BTreeMap<u32, usize> = schedule.cameras.iter().copied().zip(0..).collect();
    let mut groups: BTreeMap<usize, BTreeMap<u32, (f64, f64)>> = BTreeMap::new();
    for s in &timed.samples {
        let group = position.get(&s.frame).map_or(0, |at| at / largest);
        let sums = groups.entry(group).or_default().entry(s.round).or_default();
        sums.0 += s.cpu_ns * f64::from(s.queries);
        sums.1 += f64::from(s.queries);
    }
    let middle = |rounds: &BTreeMap<u32, (f64, f64)>| {
        let means = rounds.values().map(|(spent, queries)| spent / queries);
        median(&means.collect::<Vec<_>>())
    };
    groups.values().filter_map(middle).collect()
}

/// Entries, errors, and the right answers of both passes.
type Count<'a> = (Vec<Entry<'a>>, Option<Judged>, [Vec<Answer>; 2]);

/// Compares all answers with the reference, and the reference with the oracle.
///
/// The right answers are those of the first right structure; empty if there is none.
fn count<'a>(workload: &Workload, subjects: &'a [Subject], notice: Notice) -> Count<'a> {
    let counted = count_pass(workload, subjects, notice);
    let judged = judge(workload, MOST_JUDGED);
    // All right answers are the same set, and so are its errors.
    let of_all = match workload.scene.items.is_empty() {
        // Without items no structure is faster.
        true => Some(Verdict::new(Status::LeftOut, NO_ITEMS)),
        false => judged.unsafe_verdict(),
    };
    let entries = subjects.iter().zip(counted);
    let entries = entries.map(|(subject, counted)| {
        let is_ok = counted.verdict.is_ok();
        let verdict = of_all.clone().filter(|_| is_ok);
        let verdict = verdict.unwrap_or_else(|| counted.verdict.clone());
        let mut part = SubjectPart::of(subject, verdict);
        let items = workload.scene.items.len();
        part.counts = counts(&counted.answers, &counted.costs, items);
        Entry {
            subject,
            part,
            counted: Some(counted),
        }
    });
    let entries: Vec<Entry> = entries.collect();
    let right = entries.iter().find(|entry| entry.part.verdict.is_ok());
    let right = right.and_then(|entry| Some(entry.counted.as_ref()?.answers.clone()));
    (entries, Some(judged), right.unwrap_or_default())
}

/// Compares the answers for all scheduled cameras with the first process's.
///
/// The first process has compared its answers with the reference.
fn compare_digests(
    subject: &Subject,
    workload: &Workload,
    known: &ReferenceResults,
    notice: Notice,
) -> Result<(), Verdict> {
    let built = subject.built.as_ref().map_err(Verdict::clone)?;
    notice(Some(&subject.spec.label), "comparing answers");
    let (cameras, points) = (workload.views.len(), workload.points.len());
    if (known.visible.len(), known.located.len()) != (cameras, points) {
        let reason = format!(
            "{cameras} cameras and {points} points; the first process of the run has answers \
             for {} and {}",
            known.visible.len(),
            known.located.len()
        );
        return Err(Verdict::new(Status::Wrong, reason));
    }
    let mut out = Vec::new();
    for pass in Pass::ALL {
        let (planned, answers) = known.pass(pass);
        for &n in planned.iter().flat_map(|plan| &plan.schedule.cameras) {
            let (n, wanted) = (n as usize, answers[n as usize]);
            out.clear();
            guarded(|| built.answer(workload, pass, n, &mut out))?;
            let found = Answer::of(&out);
            if found != wanted {
                let reason = format!(
                    "{} {n}: {} ids of digest {:016x}; the first process of the run has {} of \
                     {:016x}",
                    pass.name(),
                    found.count,
                    found.digest,
                    wanted.count,
                    wanted.digest
                );
                return Err(Verdict::new(Status::Wrong, reason));
            }
        }
    }
    Ok(())
}

/// Metrics of the count pass by name, means per query.
pub(super) fn counts(
    answers: &[Vec<Answer>; 2],
    [cost, locate_cost]: &[QueryCost; 2],
    items: usize,
) -> BTreeMap<String, f64> {
    let [queries, searches] = answers.each_ref().map(|own| own.len() as f64);
    let sum = |own: &Vec<Answer>| own.iter().map(|answer| answer.count).sum::<u64>() as f64;
    let [visible, found] = answers.each_ref().map(sum);
    let accepted = cost.items_accepted_untested;
    let mean = |count: u64| count as f64 / queries;
    let means = [
        ("visible_count", visible / queries),
        ("cull_rate", 1.0 - visible / (queries * items as f64)),
        ("nodes_tested", mean(cost.nodes_tested)),
        ("planes_tested", mean(cost.planes_tested)),
        ("items_tested", mean(cost.items_tested)),
        ("items_accepted_untested", mean(accepted)),
        ("comparisons", locate_cost.comparisons() as f64 / searches),
        ("regions_found", found / searches),
    ];
    let measured = means.into_iter().filter(|(_, mean)| mean.is_finite());
    let measured = measured.map(|(name, mean)| (name.to_owned(), mean));
    measured.collect()
}

#[cfg(test)]
mod tests;
