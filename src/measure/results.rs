//! [`Group::of`]: the cells of a report from the parts of all processes.
//!
//! All values, intervals, ratios and ranks of times derive from the ln of the time of each
//! structure in each process, by the estimators of [`crate::statistics`].

use std::collections::BTreeMap;

use serde_json::Value;

use super::group::LEAST_TAIL;
use super::index_under_test::{MOST_UPDATED, TWIN};
use super::metrics::{METRICS, MetricInfo, Of};
use super::process_result::{Part, ReferenceResults, SubjectPart, TaskPart};
use super::{CellTimes, Judged, Metric, ReportCell, Status, TaskKind, TwinEntry, Verdict};
use crate::shown::hex;
use crate::statistics::{
    ALPHA, Estimate, interquartile_mean, median, one_run, quantile, ranks, ratio, sorted, speedup,
};

/// Label of the structure that speed-ups refer to.
pub const YARDSTICK: &str = "linear";

/// Fewest readings of a frame: with fewer, an interruption may be the median.
const LEAST_READINGS: usize = 3;

/// All cells of a group, and the results of lower bounds and the twin.
pub struct Group {
    /// Cells of the structures, in the order of the plan.
    pub cells: Vec<ReportCell>,
    /// Cells of the lower bounds, which are never ranked.
    pub bounds: Vec<ReportCell>,
    /// The structure that was measured twice; the interval should contain 1.
    pub twin: Option<TwinEntry>,
}

impl Group {
    /// Cells of a group from its parts, one per process, the first process first.
    ///
    /// # Panics
    /// Without parts.
    pub fn of(parts: &[Part]) -> Group {
        let merged = MergedParts::of(parts);
        let first = &parts[0];
        let subjects = first.subjects.iter();
        let subjects = subjects.filter(|s| !s.label.ends_with(TWIN));
        let cells = subjects.map(|subject| merged.cell(&subject.label, Some(subject)));
        let mut cells: Vec<ReportCell> = cells.collect();
        for (i, rank) in merged.ranks(&cells) {
            cells[i].rank = Some(rank);
        }
        let bounds = first.bounds.iter();
        let bounds = bounds.map(|name| merged.cell(name, None));
        Group {
            bounds: bounds.collect(),
            twin: merged.twin(),
            cells,
        }
    }
}

/// The parts of a group, with times by structure and task.
struct MergedParts<'p> {
    parts: &'p [Part],
    /// The first part that has loaded the scene, or else the first.
    loaded: &'p Part,
    /// Answers and schedules of the first process.
    known: Option<&'p ReferenceResults>,
    /// ln of the CPU ns per query in each process, by label and task.
    ln_ns: BTreeMap<(&'p str, TaskKind), Vec<f64>>,
    /// Label that times are paired with: [`YARDSTICK`], or else the first with times.
    reference: Option<&'p str>,
}

impl<'p> MergedParts<'p> {
    fn of(parts: &'p [Part]) -> MergedParts<'p> {
        let mut logs: BTreeMap<_, Vec<f64>> = BTreeMap::new();
        for task in parts.iter().flat_map(|part| &part.tasks) {
            let rounds: Vec<f64> = task.rounds_ns.iter().map(|ns| ns.ln()).collect();
            if let (Some(ln_ns), Status::Ok) = (interquartile_mean(&rounds), task.verdict.status) {
                let key = (task.label.as_str(), task.task);
                logs.entry(key).or_default().push(ln_ns);
            }
        }
        // Tasks without a time in some process cannot be paired.
        let processes = logs.values().map(Vec::len).max().unwrap_or(0);
        logs.retain(|_, own| own.len() == processes);
        let mut loaded = parts.iter().filter(|part| !part.scene.digest.is_empty());
        let mut merged = MergedParts {
            parts,
            loaded: loaded.next().unwrap_or(&parts[0]),
            known: parts.iter().find_map(|part| part.known.as_ref()),
            ln_ns: logs,
            reference: None,
        };
        let labels = parts[0].subjects.iter().map(|s| s.label.as_str());
        merged.reference = std::iter::once(YARDSTICK).chain(labels).find(|label| {
            let is_timed = merged.ln_ns.contains_key(&(*label, TaskKind::Query));
            is_timed && merged.verdict(label).is_ok()
        });
        merged
    }

    /// The task that structures are ranked by.
    fn ranked(&self) -> TaskKind {
        match self.parts[0].key.motion.is_empty() {
            true => TaskKind::Query,
            false => TaskKind::Frame,
        }
    }

    fn has_yardstick(&self) -> bool {
        self.reference == Some(YARDSTICK)
    }

    /// ln of the times of a task in each process, ns.
    fn ln_ns<'s>(&'s self, label: &'s str, task: TaskKind) -> Option<&'s [f64]> {
        self.ln_ns.get(&(label, task)).map(Vec::as_slice)
    }

    /// ln of the times of the reference and of a structure in each process, ns.
    fn paired<'s>(&'s self, label: &'s str, task: TaskKind) -> Option<[&'s [f64]; 2]> {
        Some([self.ln_ns(self.reference?, task)?, self.ln_ns(label, task)?])
    }

    /// Time of a task over all processes, ns.
    fn ns(&self, label: &str, task: TaskKind) -> Option<Estimate> {
        let [reference, own] = self.paired(label, task)?;
        one_run(reference, own)
    }

    /// Verdict of a structure over all processes: the first failure.
    fn verdict(&self, label: &str) -> Verdict {
        let own = self.subjects(label).map(|s| &s.verdict);
        let tasks = self.parts.iter().flat_map(|part| &part.tasks);
        let timed = tasks.filter(|t| t.label == label).map(|t| &t.verdict);
        let mut all = own.chain(timed);
        let first = all.clone().next();
        let failed = all.find(|v| !v.is_ok());
        failed.or(first).cloned().unwrap_or_default()
    }

    /// Results of a structure in each process.
    fn subjects(&self, label: &str) -> impl Iterator<Item = &'p SubjectPart> + Clone {
        let all = self.parts.iter().flat_map(|part| &part.subjects);
        all.filter(move |s| s.label == label)
    }

    /// A task of a structure in each process.
    fn tasks(&self, label: &str, task: TaskKind) -> impl Iterator<Item = &'p TaskPart> {
        let all = self.parts.iter().flat_map(|part| &part.tasks);
        all.filter(move |t| t.label == label && t.task == task)
    }

    /// Mean number of items returned to the timed queries; per frame the first query.
    fn visible_when_timed(&self) -> Option<f64> {
        let known = self.known?;
        let cameras = &known.query.as_ref()?.schedule.cameras;
        let views = self.loaded.path.views_per_frame.max(1);
        let cameras = cameras.iter().step_by(views);
        let timed = cameras.len();
        let of_camera = |camera: &u32| Some(known.visible.get(*camera as usize)?.count as f64);
        let visible = cameras.map(of_camera).sum::<Option<f64>>()?;
        Some(visible / timed as f64)
    }

    /// The cell of a structure, without its rank, or of a lower bound.
    fn cell(&self, label: &str, subject: Option<&SubjectPart>) -> ReportCell {
        let first = &self.parts[0];
        let verdict = self.verdict(label);
        let is_right = verdict.is_ok();
        let is_answered = is_right || verdict.status == Status::Unsafe;
        let judged = subject.and(first.judged).filter(|_| is_answered);
        let bare = |why: String| why.trim_start_matches("panicked: ").to_owned();
        let left_out = subject.filter(|_| is_right).map(|_| self.left_out(label));
        ReportCell {
            scene: self.loaded.scene.clone(),
            path: self.loaded.path.clone(),
            structure: label.to_owned(),
            kind: subject.map(|subject| subject.kind),
            origin: subject.map(|subject| subject.origin.clone()),
            params: subject.map_or(Value::Null, |subject| subject.params.clone()),
            test: first.key.test.clone(),
            status: verdict.status,
            // The status shows that it panicked.
            reason: verdict.reason.map(bare),
            rank: None,
            times: self.times(label),
            metrics: self.metrics(label, subject, judged.as_ref(), is_right),
            error: judged,
            answers: subject.filter(|_| is_right).and(self.answers()),
            left_out: left_out.unwrap_or_default(),
            samples_ref: None,
            chose: self.subjects(label).find_map(|s| s.chose.clone()),
        }
    }

    /// Digest of the right answers of all frustum queries.
    fn answers(&self) -> Option<String> {
        let ids = self.known?.visible.iter();
        let bytes: Vec<u8> = ids.flat_map(|answer| answer.digest.to_le_bytes()).collect();
        (!bytes.is_empty()).then(|| hex(&hmac_sha256::Hash::hash(&bytes)))
    }

    /// Metrics that this cell lacks though its structure is right, with the reason.
    fn left_out(&self, label: &str) -> Vec<String> {
        let (moves, scene) = (self.ranked() == TaskKind::Frame, &self.loaded.scene);
        let has_few_groups = |task: &TaskPart| task.tail_ns.len() < LEAST_TAIL;
        let mut queries = self.tasks(label, TaskKind::Query);
        let is_untimed = |task| !moves && self.ln_ns(label, task).is_none();
        let has_few_readings = moves && self.readings(label) < LEAST_READINGS;
        let is_large = !moves && scene.total_count > MOST_UPDATED;
        let has_no_tail = !moves && queries.any(has_few_groups);
        let few = format!("worst_frame_ns: fewer than {LEAST_READINGS} readings per frame");
        let large = format!("update_ms: scenes of more than {MOST_UPDATED} items are not moved");
        let groups = format!("query_ns_p95: fewer than {LEAST_TAIL} comparable groups of cameras");
        let moving = "query_ns_p95, locate_ns: not measured of items that move";
        let untimed = "query_ns: no time in some process";
        let unsearched = "locate_ns: this suite times frustum queries only";
        let rebuilt = "ageing_10: not measured with rebuilds, after which it begins again";
        let reasons = [
            (moves, moving),
            (moves && label.contains("@every="), rebuilt),
            (has_few_readings, &few),
            (is_untimed(TaskKind::Query), untimed),
            (is_large, &large),
            (is_untimed(TaskKind::Locate), unsearched),
            (has_no_tail, &groups),
        ];
        let holds = reasons.into_iter().filter(|(holds, _)| *holds);
        holds.map(|(_, reason)| reason.to_owned()).collect()
    }

    fn times(&self, label: &str) -> CellTimes {
        let planned = self.known.and_then(|known| known.query.as_ref());
        let planned = planned.and_then(|plan| {
            let task = plan.plan_of(label, TaskKind::Query)?;
            Some((task.batch as usize, plan.schedule.cameras.len()))
        });
        let (batch, cameras_timed) = planned.unwrap_or_default();
        let builds: Vec<f64> = self.subjects(label).filter_map(|s| s.build_ms).collect();
        let by_process = METRICS.iter().filter_map(|metric| match metric.of {
            Of::Time(task) => {
                let times = self.ln_ns(label, task)?.iter();
                Some((metric.name.to_owned(), times.map(|x| x.exp()).collect()))
            }
            _ => None,
        });
        let by_process = by_process.chain([("build_ms".to_owned(), builds)]);
        let by_process = by_process.filter(|(_, times)| !times.is_empty());
        let queries = self.tasks(label, TaskKind::Query);
        let rounds = queries.map(|task| task.rounds_ns.len());
        CellTimes {
            processes: self.ln_ns(label, TaskKind::Query).map_or(0, <[f64]>::len),
            rounds: rounds.min().unwrap_or(0),
            cameras_timed,
            cameras_checked: self.known.map_or(0, |known| known.visible.len()),
            batch,
            by_process: by_process.collect(),
        }
    }

    /// Mean over processes of a positive value of a structure.
    fn over_processes(&self, label: &str, of: fn(&SubjectPart) -> Option<f64>) -> Option<Estimate> {
        let values = self.subjects(label).filter_map(of).filter(|v| *v > 0.0);
        let logs: Vec<f64> = values.map(f64::ln).collect();
        one_run(&logs, &logs)
    }

    /// Metrics of a structure or, without `subject`, of a lower bound.
    ///
    /// Only errors, builds and memory if the answers are not right. A missing or infinite value is
    /// absent, never 0 and never NaN.
    fn metrics(
        &self,
        label: &str,
        subject: Option<&SubjectPart>,
        judged: Option<&Judged>,
        is_right: bool,
    ) -> BTreeMap<String, Metric> {
        let items = self.loaded.scene.total_count as f64;
        let counted = |name: &str| {
            let count = subject.filter(|_| is_right)?.counts.get(name)?;
            Some(Estimate::exact(*count))
        };
        let logs = |own: Vec<f64>| one_run(&own, &own);
        let value = |info: &MetricInfo| match info.of {
            Of::Judged(of) => of(judged?),
            Of::Process(of) => self.over_processes(label, of),
            Of::Log(of) => logs(self.subjects(label).filter_map(of).collect()),
            Of::Bytes(of) => {
                let bytes = self.subjects(label).find_map(of)?;
                Some(Estimate::exact(bytes as f64 / items))
            }
            _ if !is_right && subject.is_some() => None,
            Of::Count => counted(info.name),
            Of::Time(task) => self.ns(label, task),
            Of::TimePerVisible => {
                let ns = self.ns(label, TaskKind::Query)?;
                Some(ns.per(self.visible_when_timed()?))
            }
            Of::Wall(task) => {
                let tasks = self.tasks(label, task);
                logs(tasks.filter_map(|task| task.wall_ln_ns).collect())
            }
            Of::Tail(q) => {
                let all = self.tail(label, TaskKind::Query)?;
                let all = Some(all).filter(|all| all.len() >= LEAST_TAIL)?;
                Some(Estimate::exact(quantile(&all, q)?))
            }
            Of::WorstFrame => {
                let worst = *self.tail(label, TaskKind::Frame)?.last()?;
                let is_known = self.readings(label) >= LEAST_READINGS;
                is_known.then(|| Estimate::exact(worst))
            }
            Of::Speedup(task) => {
                let [yardstick, own] = self.paired(label, task.unwrap_or(self.ranked()))?;
                speedup(yardstick, own).filter(|_| self.has_yardstick())
            }
            Of::Over(bound) => subject.and_then(|_| self.ratio(label, bound)),
            Of::BreakEven => self.break_even(label).map(Estimate::exact),
            Of::Report => None,
        };
        let found = METRICS.iter().filter_map(|info| {
            let found = value(info).filter(|found| found.value.is_finite())?;
            Some((info.name.to_owned(), Metric::of(found, info.unit)))
        });
        found.collect()
    }

    /// Number of readings of each frame.
    fn readings(&self, label: &str) -> usize {
        let tasks = self.tasks(label, TaskKind::Frame);
        tasks.map(|task| task.rounds_ns.len()).sum()
    }

    /// Median times of each group of cameras or each frame, ns, ascending.
    ///
    /// Scaled so that their mean is the reported time, which has another estimator.
    fn tail(&self, label: &str, task: TaskKind) -> Option<Vec<f64>> {
        let shown = self.ns(label, task)?.value;
        let tails: Vec<&[f64]> = self.tasks(label, task).map(|t| &t.tail_ns[..]).collect();
        let groups = tails.iter().map(|tail| tail.len()).min().unwrap_or(0);
        let of_group = |g: usize| median(&tails.iter().map(|t| t[g]).collect::<Vec<_>>());
        let all = sorted((0..groups).filter_map(of_group).collect());
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        Some(all.iter().map(|ns| ns / mean * shown).collect())
    }

    /// Number of queries after which the build is repaid against the yardstick.
    ///
    /// `None` if never, or if the structure is not shown to be faster.
    fn break_even(&self, label: &str) -> Option<f64> {
        let cost = |label: &str| -> Option<[f64; 2]> {
            let build = self.over_processes(label, |s| s.build_ms)?.value * 1e6;
            Some([build, self.ns(label, TaskKind::Query)?.value])
        };
        let is_paid = self.has_yardstick() && self.ranked() == TaskKind::Query;
        let [build, query] = cost(label).filter(|_| is_paid)?;
        let [linear_build, linear_query] = cost(YARDSTICK)?;
        let (price, gain) = (build - linear_build, linear_query - query);
        let [yardstick, own] = self.paired(label, TaskKind::Query)?;
        let is_faster = speedup(yardstick, own)?.exceeds(1.0) && gain > 0.0;
        is_faster.then(|| (price.max(0.0) / gain).ceil())
    }

    /// Time of `label` / time of `other`, equal to the ratio of the reported values.
    fn ratio(&self, label: &str, other: &str) -> Option<Estimate> {
        let [reference, own] = self.paired(label, self.ranked())?;
        ratio(reference, own, self.ln_ns(other, self.ranked())?)
    }

    fn twin(&self) -> Option<TwinEntry> {
        let mut labels = self.parts[0].subjects.iter().map(|s| s.label.as_str());
        let (twin, original) = labels.find_map(|l| Some((l, l.strip_suffix(TWIN)?)))?;
        let (ratio, key) = (self.ratio(twin, original)?, self.parts[0].key.clone());
        Some(TwinEntry {
            scene: key.scene,
            path: key.path,
            motion: key.motion,
            cache: key.cache,
            structure: original.to_owned(),
            test: key.test,
            ratio: ratio.value,
            lower: ratio.lower,
            upper: ratio.upper,
        })
    }

    /// Index and rank of each ok cell that has times.
    fn ranks(&self, cells: &[ReportCell]) -> Vec<(usize, usize)> {
        let ok = cells.iter().enumerate();
        let ok = ok.filter(|(_, cell)| cell.status == Status::Ok);
        let timed = ok.filter_map(|(i, cell)| {
            let [reference, own] = self.paired(&cell.structure, self.ranked())?;
            let relative = own.iter().zip(reference).map(|(own, r)| own - r);
            Some((i, relative.collect()))
        });
        let (positions, values): (Vec<usize>, Vec<Vec<f64>>) = timed.unzip();
        positions.into_iter().zip(ranks(&values, ALPHA)).collect()
    }
}

#[cfg(test)]
mod tests;
