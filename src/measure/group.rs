//! One process and one group of cells: ask, guard, compare, judge, time. The
//! first process counts, judges and plans; the others compare digests with what
//! it found, keep to its plan, and time.

use std::collections::BTreeMap;

use super::bounds::{Bound, Material};
use super::count::{Counted, count_pass, judge, note_scan};
use super::key::GroupKey;
use super::notice::{Notice, TIMING};
use super::part::{Known, Part, SubjectPart, TaskKey, TaskPart, TaskSamples};
use super::subject::TWIN;
use super::{
    Answer, Built, Judged, KeyedSchedule, PathInfo, Protocol, SceneInfo, Schedule, Status, Subject,
    TaskKind, Tasks, Timed, TimedTask, Verdict, Workload, guarded, timed,
};
use crate::index::Kind;
use crate::statistics::{interquartile_mean, median};

/// Verdicts of the oracle that a group may take: some 50 ns each.
const MOST_JUDGED: usize = 400_000;
/// Fewest groups of cameras that a tail is read off.
pub(super) const LEAST_TAIL: usize = 20;

/// Time of a task of region search / time of a frustum query's.
const LOCATE_SHARE: f64 = 1.0 / 3.0;

/// What a group is measured with.
pub struct GroupPlan<'a> {
    /// What reports say of the scene.
    pub scene: &'a SceneInfo,
    /// What reports say of the path.
    pub path: PathInfo,
    /// Number of this process; 0 counts and plans.
    pub process: u32,
    /// Rounds and times of the timed pass.
    pub protocol: Protocol,
    /// Lower bounds to be timed beside the structures.
    pub bounds: &'a [Bound],
    /// From the first process; `None` in the first process itself.
    pub known: Option<&'a Known>,
    /// Whether to count, check and plan only.
    pub plan_only: bool,
    /// Whether region search is timed as well.
    pub locate: bool,
}

/// Measures a group; `None` if stopped.
pub fn measure_part(
    workload: &Workload,
    subjects: &[Subject],
    plan: GroupPlan<'_>,
    notice: Notice,
    stop: &dyn Fn() -> bool,
) -> Option<(Part, Vec<TaskSamples>)> {
    let mut entries: Vec<Entry> = subjects.iter().map(Entry::new).collect();
    let mut judged = None;
    let answered = plan.known.filter(|known| !known.visible.is_empty());
    match answered {
        None => {
            count(workload, &mut entries, notice);
            judged = Some(judge(workload, MOST_JUDGED));
            hold_against_the_truth(&mut entries, judged.as_ref());
            leave_out_without_items(workload, &mut entries);
        }
        Some(known) => {
            for entry in &mut entries {
                entry.compare_digests(workload, known, notice);
            }
        }
    }
    if stop() {
        return None;
    }
    let answers = match answered {
        Some(known) => [known.visible.clone(), known.located.clone()],
        None => right_answers(&entries),
    };
    let visible: Vec<u64> = answers[0].iter().map(|a| a.count).collect();
    let mut part = Part {
        key: GroupKey::new(&plan.scene.name, &plan.path, workload.culling.test.name()),
        process: plan.process,
        scene: plan.scene.clone(),
        path: plan.path.clone(),
        known: None,
        judged,
        subjects: Vec::new(),
        failed: BTreeMap::new(),
        bounds: Vec::new(),
        tasks: Vec::new(),
    };
    let mut samples = Vec::new();
    let mut schedules = [None, None];
    let passes = [
        &[TaskKind::Query][..],
        &[TaskKind::Locate, TaskKind::LocateBatched],
    ];
    for (pass, kinds) in passes.into_iter().enumerate() {
        if pass == 1 && !plan.locate {
            break;
        }
        let mut entered = enter(workload, subjects, &entries, kinds, &answers);
        if pass == 0 && !visible.is_empty() {
            let material = Material {
                workload,
                subjects,
                visible: &visible,
            };
            for bound in plan.bounds {
                if let Some(task) = (bound.make)(&material) {
                    part.bounds.push(bound.name.to_owned());
                    entered.push((bound.name.to_owned(), TaskKind::Query), task);
                }
            }
        }
        let given = plan.known.and_then(|known| match pass {
            0 => known.query.as_ref(),
            _ => known.locate.as_ref(),
        });
        // Region search is not what structures are ranked by.
        let share = if pass == 0 { 1.0 } else { LOCATE_SHARE };
        let protocol = Protocol {
            task_ns: plan.protocol.task_ns * share,
            ..plan.protocol
        };
        let schedule = entered.schedule(given, workload.views.len(), &protocol);
        let labels = entered.keys().iter().map(|(label, _)| label);
        let structures: Vec<_> = labels.map(|l| structure_of(l, &part.bounds)).collect();
        let turn = |task: usize| {
            notice(structures[task], TIMING);
            stop()
        };
        let timed = match plan.plan_only {
            true => Vec::new(),
            false => timed(entered.tasks(), &schedule, &plan.protocol, &turn)?,
        };
        let largest = schedule.tasks.iter().map(|t| t.batch).max().unwrap_or(1) as usize;
        for ((label, kind), result) in entered.keys().iter().zip(timed) {
            let groups = match kind {
                TaskKind::Query => schedule.cameras.len().div_ceil(largest),
                _ => 0,
            };
            part.tasks
                .push(task_part(label, *kind, &result, groups, largest, &schedule));
            if let (Err(verdict), Some(entry)) = (
                &result,
                entries.iter_mut().find(|e| e.subject.label() == *label),
            ) {
                entry.verdict = verdict.clone();
            }
            samples.push((
                label.clone(),
                *kind,
                result.map(|t| t.samples).unwrap_or_default(),
            ));
        }
        schedules[pass] = Some(KeyedSchedule {
            keys: entered.keys().to_vec(),
            schedule,
        });
    }
    if answered.is_none() {
        let [visible, located] = answers;
        let [query, locate] = schedules;
        part.known = Some(Known {
            visible,
            located,
            query,
            locate,
            lens_scale: workload.lens_scale,
        });
    }
    part.subjects = entries.iter().map(|e| e.part(workload)).collect();
    Some((part, samples))
}

/// The structure whose task this is: a twin's original, no bound's.
fn structure_of<'l>(label: &'l str, bounds: &[String]) -> Option<&'l str> {
    let is_bound = bounds.iter().any(|bound| bound == label);
    (!is_bound).then(|| label.strip_suffix(TWIN).unwrap_or(label))
}

fn enter<'a>(
    workload: &'a Workload,
    subjects: &'a [Subject],
    entries: &[Entry],
    kinds: &[TaskKind],
    answers: &[Vec<Answer>; 2],
) -> Tasks<'a, TaskKey> {
    let mut entered = Tasks::default();
    for &kind in kinds {
        let answers = match kind {
            TaskKind::Query => &answers[0],
            TaskKind::Locate | TaskKind::LocateBatched => &answers[1],
        };
        for (subject, entry) in subjects.iter().zip(entries) {
            let (Ok(built), true) = (&subject.built, entry.runs()) else {
                continue;
            };
            let least_ns = entry.counted.as_ref().map(|c| c.least_ns(kind));
            let label = &subject.spec.label;
            let task = TimedTask::of(kind, label, workload, built, answers, least_ns);
            entered.push((subject.label(), kind), task);
        }
    }
    entered
}

fn task_part(
    label: &str,
    kind: TaskKind,
    result: &Result<Timed, Verdict>,
    groups: usize,
    largest: usize,
    schedule: &Schedule,
) -> TaskPart {
    let nothing = Timed::default();
    let (timed, verdict) = match result {
        Ok(timed) => (timed, Verdict::ok()),
        Err(verdict) => (&nothing, verdict.clone()),
    };
    let wall: Vec<f64> = timed
        .round_means(|s| s.wall_ns)
        .iter()
        .map(|ns| ns.ln())
        .collect();
    TaskPart {
        label: label.to_owned(),
        task: kind,
        verdict,
        rounds_ns: timed.round_means(|s| s.cpu_ns),
        wall_ln_ns: interquartile_mean(&wall),
        tail_ns: match groups >= LEAST_TAIL {
            true => tail(timed, largest, schedule),
            false => Vec::new(),
        },
        returned: timed.samples.iter().map(|s| s.returned).sum(),
    }
}

/// Per group of `largest` consecutive timed cameras the median over the rounds
/// of the mean CPU ns per query.
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
        median(
            &rounds
                .values()
                .map(|(spent, queries)| spent / queries)
                .collect::<Vec<_>>(),
        )
    };
    groups.values().filter_map(middle).collect()
}

/// Counts, and compares every answer with the reference.
fn count(workload: &Workload, entries: &mut [Entry], notice: Notice) {
    let built: Vec<(String, &Built)> = entries
        .iter()
        .filter_map(|e| Some((e.subject.label(), e.subject.built.as_ref().ok()?)))
        .collect();
    let mut counted = count_pass(workload, &built, notice).into_iter();
    for entry in entries.iter_mut().filter(|e| e.subject.built.is_ok()) {
        entry.counted = counted.next();
        if let Some(counted) = &mut entry.counted
            && entry.subject.spec.info().kind != Kind::Scan
        {
            note_scan(counted, workload.items.len());
        }
        if let Some(counted) = &entry.counted {
            entry.verdict = counted.verdict.clone();
        }
    }
}

/// All right answers are the same set, and so are its errors.
fn hold_against_the_truth(entries: &mut [Entry], judged: Option<&Judged>) {
    let Some(errors) = judged.map(|j| &j.errors).filter(|e| e.false_negatives > 0) else {
        return;
    };
    for entry in entries.iter_mut().filter(|e| e.runs()) {
        let reason = format!(
            "{} of {} visible items are missed at camera level, the deepest by {:e}",
            errors.false_negatives, errors.visible, errors.worst_miss
        );
        entry.verdict = Verdict::new(Status::Unsafe, reason);
    }
}

/// Among no items nothing is found faster.
fn leave_out_without_items(workload: &Workload, entries: &mut [Entry]) {
    if workload.scene.items.is_empty() {
        for entry in entries.iter_mut().filter(|e| e.runs()) {
            let reason = "the scene has no items: there is nothing to time";
            entry.verdict = Verdict::new(Status::LeftOut, reason);
        }
    }
}

/// What every structure that is right has answered; empty if none is.
fn right_answers(entries: &[Entry]) -> [Vec<Answer>; 2] {
    let right = entries.iter().find(|e| e.runs());
    let counted = right.and_then(|e| e.counted.as_ref());
    counted.map_or_else(Default::default, |c| [c.frames.clone(), c.located.clone()])
}

/// A structure on its way through the passes.
struct Entry<'a> {
    subject: &'a Subject,
    verdict: Verdict,
    counted: Option<Counted>,
}

impl<'a> Entry<'a> {
    fn new(subject: &'a Subject) -> Self {
        let verdict = match &subject.built {
            Ok(_) => Verdict::ok(),
            Err(verdict) => verdict.clone(),
        };
        Entry {
            subject,
            verdict,
            counted: None,
        }
    }

    fn runs(&self) -> bool {
        self.verdict.status == Status::Ok && self.subject.built.is_ok()
    }

    /// Queries with every camera that will be timed. The answers must be those of the
    /// first process, which compared them with the reference.
    fn compare_digests(&mut self, workload: &Workload, known: &Known, notice: Notice) {
        let Ok(built) = &self.subject.built else {
            return;
        };
        notice(Some(&self.subject.label()), "comparing answers");
        let (cameras, points) = (workload.views.len(), workload.points.len());
        if (known.visible.len(), known.located.len()) != (cameras, points) {
            let reason = format!(
                "{cameras} cameras and {points} points; the first process of the run has answers \
                 for {} and {}",
                known.visible.len(),
                known.located.len()
            );
            self.verdict = Verdict::new(Status::Wrong, reason);
            return;
        }
        let mut out = Vec::new();
        let mut differs = |what: &str, n: usize, found: Result<Answer, Verdict>, wanted: Answer| {
            self.verdict = match found {
                Ok(found) if found == wanted => return false,
                Ok(found) => Verdict::new(
                    Status::Wrong,
                    format!(
                        "{what} {n}: {} ids of digest {:016x}; the first process of the run has \
                         {} of {:016x}",
                        found.count, found.digest, wanted.count, wanted.digest
                    ),
                ),
                Err(panicked) => panicked,
            };
            true
        };
        let timed = |named: &Option<KeyedSchedule<TaskKey>>| {
            let cameras = named.iter().flat_map(|named| &named.schedule.cameras);
            cameras.map(|&camera| camera as usize).collect::<Vec<_>>()
        };
        for n in timed(&known.query) {
            let (view, wanted) = (&workload.views[n], known.visible[n]);
            out.clear();
            let found = guarded(|| built.items.query(view.as_any(), &mut out));
            if differs("camera", n, found.map(|()| Answer::of(&out)), wanted) {
                return;
            }
        }
        for n in timed(&known.locate) {
            let (index, wanted) = (built.regions(), known.located[n]);
            out.clear();
            let found = guarded(|| workload.search(n, &mut out, |p, out| index.locate(p, out)));
            if differs("point", n, found.map(|()| Answer::of(&out)), wanted) {
                return;
            }
        }
    }

    fn part(&self, workload: &Workload) -> SubjectPart {
        let built = self.subject.built.as_ref().ok();
        let counted = self.counted.as_ref().filter(|_| self.runs());
        SubjectPart {
            label: self.subject.label(),
            build_ms: built.map(|b| b.build_ms),
            memory_bytes: built.map(|b| b.memory.total() as u64),
            update_ms: built.map(|b| b.update_ms.clone()).unwrap_or_default(),
            counts: counted
                .map(|c| counts(c, workload.scene.items.len()))
                .unwrap_or_default(),
            ..SubjectPart::unknown(&self.subject.spec, self.verdict.clone())
        }
    }
}

/// Means per query of what was counted.
fn counts(counted: &Counted, items: usize) -> BTreeMap<String, f64> {
    let queries = counted.frames.len() as f64;
    let visible: u64 = counted.frames.iter().map(|f| f.count).sum();
    let (cost, searches) = (&counted.cost, counted.located.len() as f64);
    let found: u64 = counted.located.iter().map(|f| f.count).sum();
    let mut means = vec![("visible_count", visible as f64 / queries)];
    if items > 0 {
        means.push(("cull_rate", 1.0 - visible as f64 / (queries * items as f64)));
    }
    for (name, sum) in [
        ("nodes_tested", cost.nodes_tested),
        ("planes_tested", cost.planes_tested),
        ("items_tested", cost.items_tested),
        ("items_accepted_untested", cost.items_accepted_untested),
    ] {
        means.push((name, sum as f64 / queries));
    }
    means.push((
        "comparisons",
        counted.locate_cost.comparisons() as f64 / searches,
    ));
    means.push(("regions_found", found as f64 / searches));
    let measured = means.into_iter().filter(|(_, mean)| mean.is_finite());
    measured
        .map(|(name, mean)| (name.to_owned(), mean))
        .collect()
}

#[cfg(test)]
mod tests;
