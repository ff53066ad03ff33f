//! From the parts of all processes to the cells of a report: every value, its
//! interval, every ratio and every rank come from the same quantities, the
//! logarithms of time of each structure in each process, by the estimators of
//! [`crate::statistics`].

use std::collections::BTreeMap;

use serde_json::Value;

use super::bounds::{BOUNDS, Bound};
use super::group::{GroupPlan, LEAST_TAIL, measure_part};
use super::metrics::{METRICS, Metric, Metrics};
use super::part::{Known, Part, SubjectPart, TaskPart};
use super::subject::TWIN;
use super::update::MOST_UPDATED;
use super::{
    CellTimes, Judged, PathInfo, Protocol, ReportCell, SceneInfo, Status, Subject, TaskKind,
    UPDATE_SHARES, Verdict, Workload,
};
use crate::statistics::{
    ALPHA, Estimate, interquartile_mean, median, one_run, quantile, ranks, ratio, sorted,
};

/// In the order of [`UPDATE_SHARES`].
const UPDATE_METRICS: [&str; UPDATE_SHARES.len()] = [
    "update_ms_0_1_percent",
    "update_ms",
    "update_ms_10_percent",
    "update_ms_100_percent",
];

/// The structure that speed-ups refer to.
pub const YARDSTICK: &str = "linear";

/// All cells of a group, with what was measured beside them.
#[non_exhaustive]
pub struct Group {
    /// Structures in the order of the plan.
    pub cells: Vec<ReportCell>,
    /// Lower bounds: no structures, never ranked.
    pub bounds: Vec<ReportCell>,
    /// Structure and ratio of the one that was entered twice: 1 is to lie in
    /// the interval.
    pub twin: Option<(String, Metric)>,
    /// The ranks of structures by their times of region search.
    pub located: Vec<(String, usize)>,
}

/// Measures a group in this process alone: values and ranks by order, without
/// intervals. `None` if stopped.
pub fn measure_group(
    workload: &Workload,
    subjects: &[Subject],
    bounds: &[Bound],
    protocol: &Protocol,
    stop: &dyn Fn() -> bool,
) -> Option<Group> {
    let scene = SceneInfo::of(workload.scene);
    let plan = GroupPlan {
        path: PathInfo::of(&workload.path, workload, protocol.cold),
        scene: &scene,
        process: 0,
        protocol: *protocol,
        bounds,
        known: None,
        plan_only: false,
        locate: true,
    };
    let (part, _) = measure_part(workload, subjects, plan, &|_, _| (), stop)?;
    Some(Group::of(&[part]))
}

/// ln ns per query in each process, by label and task.
type Logs<'p> = BTreeMap<(&'p str, TaskKind), Vec<f64>>;

impl Group {
    /// Of the parts of one group, one for each process, the first process first.
    ///
    /// # Panics
    /// Without parts.
    pub fn of(parts: &[Part]) -> Group {
        let facts = Facts::of(parts);
        let first = &parts[0];
        let mut cells: Vec<ReportCell> = first
            .subjects
            .iter()
            .filter(|s| !s.label.ends_with(TWIN))
            .map(|subject| facts.cell(subject))
            .collect();
        for (i, rank) in facts.ranks(&cells, TaskKind::Query) {
            cells[i].rank = Some(rank);
        }
        let located = facts.ranks(&cells, TaskKind::Locate).into_iter();
        Group {
            bounds: first.bounds.iter().map(|name| facts.bound(name)).collect(),
            twin: facts.twin(),
            located: located
                .map(|(i, rank)| (cells[i].structure.clone(), rank))
                .collect(),
            cells,
        }
    }
}

/// The parts of a group in the form that cells are read off.
struct Facts<'p> {
    parts: &'p [Part],
    /// Structures whose timed pass is not what the plan asks for.
    contradictions: Vec<(&'p str, Verdict)>,
    logs: Logs<'p>,
    /// ln ns of the yardstick for each task, or of the first structure that has
    /// times where there is no yardstick.
    reference: BTreeMap<TaskKind, &'p str>,
    has_yardstick: bool,
}

impl<'p> Facts<'p> {
    fn of(parts: &'p [Part]) -> Facts<'p> {
        let mut logs: Logs = BTreeMap::new();
        for task in parts.iter().flat_map(|part| &part.tasks) {
            let rounds: Vec<f64> = task.rounds_ns.iter().map(|ns| ns.ln()).collect();
            if let (Some(ln_ns), Status::Ok) = (interquartile_mean(&rounds), task.verdict.status) {
                logs.entry((&task.label, task.task))
                    .or_default()
                    .push(ln_ns);
            }
        }
        // What is not there in every process is paired with nothing.
        let processes = logs.values().map(Vec::len).max().unwrap_or(0);
        logs.retain(|_, own| own.len() == processes);
        let known = parts.iter().find_map(|part| part.known.as_ref());
        let contradictions = known.map_or_else(Vec::new, |known| {
            let of_part = |part: &'p Part| part.contradictions(known);
            parts.iter().flat_map(of_part).collect()
        });
        let mut facts = Facts {
            parts,
            contradictions,
            logs,
            reference: BTreeMap::new(),
            has_yardstick: false,
        };
        let right = |label: &str| facts.verdict(label).status == Status::Ok;
        let labels = parts[0].subjects.iter().map(|s| s.label.as_str());
        let has_yardstick =
            right(YARDSTICK) && facts.logs.contains_key(&(YARDSTICK, TaskKind::Query));
        let reference = match has_yardstick {
            true => Some(YARDSTICK),
            false => labels
                .filter(|label| right(label))
                .find(|label| facts.logs.contains_key(&(*label, TaskKind::Query))),
        };
        let tasks = [TaskKind::Query, TaskKind::Locate, TaskKind::LocateBatched];
        let reference = reference
            .iter()
            .flat_map(|label| tasks.map(|task| (task, *label)));
        facts.reference = reference.collect();
        facts.has_yardstick = has_yardstick;
        facts
    }

    fn log<'s>(&'s self, label: &'s str, task: TaskKind) -> Option<&'s [f64]> {
        self.logs.get(&(label, task)).map(Vec::as_slice)
    }

    fn reference(&self, task: TaskKind) -> Option<&[f64]> {
        self.log(self.reference.get(&task)?, task)
    }

    /// What became of a structure over all processes: the first that failed.
    fn verdict(&self, label: &str) -> Verdict {
        let subjects = self.parts.iter().flat_map(|part| &part.subjects);
        let own = subjects.filter(|s| s.label == label).map(|s| &s.verdict);
        let tasks = self.parts.iter().flat_map(|part| &part.tasks);
        let timed = tasks.filter(|t| t.label == label).map(|t| &t.verdict);
        let contradictions = self.contradictions.iter();
        let contradicted = contradictions.filter(|c| c.0 == label).map(|c| &c.1);
        let mut all = own.chain(timed).chain(contradicted);
        let first = all.clone().next().cloned().unwrap_or_else(Verdict::ok);
        all.find(|v| v.status != Status::Ok)
            .cloned()
            .unwrap_or(first)
    }

    fn subjects(&self, label: &str) -> impl Iterator<Item = &'p SubjectPart> {
        let all = self.parts.iter().flat_map(|part| &part.subjects);
        all.filter(move |s| s.label == label)
    }

    fn tasks(&self, label: &str, task: TaskKind) -> impl Iterator<Item = &'p TaskPart> {
        let all = self.parts.iter().flat_map(|part| &part.tasks);
        all.filter(move |t| t.label == label && t.task == task)
    }

    /// Visible items of a timed camera, mean.
    fn visible_when_timed(&self) -> Option<f64> {
        let known = self.known()?;
        let cameras = &known.query.as_ref()?.schedule.cameras;
        let of_camera = |camera: &u32| Some(known.visible.get(*camera as usize)?.count as f64);
        let visible = cameras.iter().map(of_camera).sum::<Option<f64>>()?;
        Some(visible / cameras.len() as f64)
    }

    fn known(&self) -> Option<&'p Known> {
        self.parts.iter().find_map(|part| part.known.as_ref())
    }

    fn cell(&self, subject: &SubjectPart) -> ReportCell {
        let label = subject.label.as_str();
        let verdict = self.verdict(label);
        let right = verdict.status == Status::Ok;
        let judged = self.parts[0]
            .judged
            .filter(|_| right || verdict.status == Status::Unsafe);
        let mut metrics = Metrics::default();
        self.build_metrics(&mut metrics, label);
        // A stream may hold others.
        for metric in METRICS.iter().filter(|_| right) {
            metrics.maybe(metric.name, subject.counts.get(metric.name).copied());
        }
        if let Some(judged) = &judged {
            error_metrics(&mut metrics, judged);
        }
        if right {
            self.time_metrics(&mut metrics, label);
            self.break_even(&mut metrics, label);
            for bound in BOUNDS {
                metrics.estimate(bound.ratio, self.ratio(label, bound.name));
            }
        }
        let left_out = right.then(|| self.left_out(label));
        ReportCell {
            kind: Some(subject.kind),
            origin: Some(subject.origin.clone()),
            params: subject.params.clone(),
            error: judged,
            left_out: left_out.unwrap_or_default(),
            ..self.timed(label, verdict, metrics)
        }
    }

    fn bound(&self, name: &str) -> ReportCell {
        let mut metrics = Metrics::default();
        self.time_metrics(&mut metrics, name);
        self.timed(name, self.verdict(name), metrics)
    }

    /// A cell with what structures and lower bounds have in common.
    fn timed(&self, label: &str, verdict: Verdict, metrics: Metrics) -> ReportCell {
        let Part {
            scene, path, key, ..
        } = &self.parts[0];
        ReportCell {
            scene: scene.clone(),
            path: path.clone(),
            structure: label.to_owned(),
            kind: None,
            origin: None,
            params: Value::Null,
            test: key.test.clone(),
            status: verdict.status,
            reason: verdict.reason,
            rank: None,
            times: self.times(label),
            metrics: metrics.0,
            error: None,
            left_out: Vec::new(),
            samples_ref: None,
        }
    }

    /// Metrics that an ok cell has elsewhere and not here.
    fn left_out(&self, label: &str) -> Vec<String> {
        let mut left_out = Vec::new();
        let items = self.parts[0].scene.total_count;
        if items > MOST_UPDATED {
            left_out.push(format!(
                "update_ms: scenes of more than {MOST_UPDATED} items are not moved"
            ));
        }
        if self.log(label, TaskKind::Locate).is_none() {
            left_out.push("locate_ns: this suite times frustum queries only".to_owned());
        }
        let mut queries = self.tasks(label, TaskKind::Query);
        if queries.any(|task| task.tail_ns.len() < LEAST_TAIL) {
            left_out.push(format!(
                "query_ns_p95: fewer than {LEAST_TAIL} comparable groups of cameras"
            ));
        }
        left_out
    }

    fn times(&self, label: &str) -> CellTimes {
        let known = self.known();
        let named = known.and_then(|known| known.query.as_ref());
        let plan = named.and_then(|named| {
            let place = named
                .keys
                .iter()
                .position(|(l, task)| l == label && *task == TaskKind::Query)?;
            Some((named.schedule.tasks.get(place)?, &named.schedule))
        });
        let mut by_process = BTreeMap::new();
        for (metric, task) in [
            ("query_ns", TaskKind::Query),
            ("locate_ns", TaskKind::Locate),
            ("locate_batched_ns", TaskKind::LocateBatched),
        ] {
            if let Some(own) = self.log(label, task) {
                by_process.insert(metric.to_owned(), own.iter().map(|x| x.exp()).collect());
            }
        }
        let builds: Vec<f64> = self.subjects(label).filter_map(|s| s.build_ms).collect();
        if !builds.is_empty() {
            by_process.insert("build_ms".to_owned(), builds);
        }
        let rounds = self
            .tasks(label, TaskKind::Query)
            .map(|t| t.rounds_ns.len())
            .min();
        CellTimes {
            processes: self.log(label, TaskKind::Query).map_or(0, <[f64]>::len),
            rounds: rounds.unwrap_or(0),
            cameras_timed: plan.map_or(0, |(_, schedule)| schedule.cameras.len()),
            cameras_checked: known.map_or(0, |known| known.visible.len()),
            batch: plan.map_or(0, |(task, _)| task.batch as usize),
            by_process,
        }
    }

    fn build_metrics(&self, metrics: &mut Metrics, label: &str) {
        let ln = |values: Vec<f64>| -> Vec<f64> {
            let positive = values.into_iter().filter(|v| *v > 0.0);
            positive.map(f64::ln).collect()
        };
        let over = |values: Vec<f64>| {
            let logs = ln(values);
            shown(&logs, &logs)
        };
        let builds = self.subjects(label).filter_map(|s| s.build_ms).collect();
        metrics.estimate("build_ms", over(builds));
        for (share, name) in UPDATE_METRICS.into_iter().enumerate() {
            let updates = self
                .subjects(label)
                .filter_map(|s| s.update_ms.get(share).copied());
            metrics.estimate(name, over(updates.collect()));
        }
        let worn: Vec<f64> = self.subjects(label).filter_map(|s| s.refitted_ln).collect();
        metrics.estimate("refitted_over_rebuilt", shown(&worn, &worn));
        let items = self.parts[0].scene.total_count as f64;
        let bytes = self.subjects(label).find_map(|s| s.memory_bytes);
        if let Some(bytes) = bytes {
            metrics.set("memory_bytes_per_item", bytes as f64 / items);
        }
    }

    fn time_metrics(&self, metrics: &mut Metrics, label: &str) {
        for (task, time, speedup) in [
            (TaskKind::Query, "query_ns", Some("speedup")),
            (TaskKind::Locate, "locate_ns", Some("locate_speedup")),
            (TaskKind::LocateBatched, "locate_batched_ns", None),
        ] {
            let (Some(own), Some(reference)) = (self.log(label, task), self.reference(task)) else {
                continue;
            };
            let Some(shown) = one_run(reference, own) else {
                continue;
            };
            metrics.insert(time, shown.value, shown.lower.zip(shown.upper));
            if let (TaskKind::Query, Some(visible)) = (task, self.visible_when_timed()) {
                let interval = shown.lower.zip(shown.upper);
                let interval = interval.map(|(lower, upper)| (lower / visible, upper / visible));
                metrics.insert("ns_per_visible", shown.value / visible, interval);
            }
            if let (Some(speedup), true) = (speedup, self.has_yardstick) {
                let interval = shown.speedup_lower.zip(shown.speedup_upper);
                metrics.insert(speedup, shown.speedup, interval);
            }
        }
        let queries = || self.tasks(label, TaskKind::Query);
        let wall: Vec<f64> = queries().filter_map(|t| t.wall_ln_ns).collect();
        metrics.estimate("query_wall_ns", shown(&wall, &wall));
        let tails: Vec<&Vec<f64>> = queries().map(|t| &t.tail_ns).collect();
        let groups = tails.iter().map(|t| t.len()).min().unwrap_or(0);
        if groups >= LEAST_TAIL {
            let of_group = |g: usize| median(&tails.iter().map(|t| t[g]).collect::<Vec<_>>());
            let all = sorted((0..groups).filter_map(of_group).collect());
            for (name, q) in [
                ("query_ns_p5", 0.05),
                ("query_ns_p95", 0.95),
                ("query_ns_p99", 0.99),
                ("query_ns_max", 1.0),
            ] {
                metrics.maybe(name, quantile(&all, q));
            }
        }
    }

    /// Queries after which a build is repaid against the yardstick, from the
    /// times that are shown.
    fn break_even(&self, metrics: &mut Metrics, label: &str) {
        if !self.has_yardstick {
            return;
        }
        let cost = |label: &str| -> Option<(f64, f64)> {
            let reference = self.reference(TaskKind::Query)?;
            let query = one_run(reference, self.log(label, TaskKind::Query)?)?.value;
            let mut built = Metrics::default();
            self.build_metrics(&mut built, label);
            Some((built.0.get("build_ms")?.value * 1e6, query))
        };
        if let (Some((build, query)), Some((linear_build, linear_query))) =
            (cost(label), cost(YARDSTICK))
        {
            let (price, gain) = (build - linear_build, linear_query - query);
            if gain > 0.0 && price > 0.0 {
                metrics.set("break_even_queries", (price / gain).ceil());
            }
        }
    }

    /// Time of `label` / time of `other`: the ratio of the two shown values.
    fn ratio(&self, label: &str, other: &str) -> Option<Estimate> {
        let reference = self.reference(TaskKind::Query)?;
        let (own, base) = (
            self.log(label, TaskKind::Query)?,
            self.log(other, TaskKind::Query)?,
        );
        ratio(reference, own, base)
    }

    fn twin(&self) -> Option<(String, Metric)> {
        let mut labels = self.parts[0].subjects.iter().map(|s| s.label.as_str());
        let twin = labels.find(|label| label.ends_with(TWIN))?;
        let original = twin.strip_suffix(TWIN)?;
        let ratio = self.ratio(twin, original)?;
        let interval = |bound: f64| Some(bound).filter(|b| b.is_finite());
        let metric = Metric {
            value: ratio.value,
            lower: interval(ratio.lower),
            upper: interval(ratio.upper),
            unit: "1".to_owned(),
        };
        Some((original.to_owned(), metric))
    }

    /// The ranks of those cells that have times of a task.
    fn ranks(&self, cells: &[ReportCell], task: TaskKind) -> Vec<(usize, usize)> {
        let Some(reference) = self.reference(task) else {
            return Vec::new();
        };
        let mut ranked = Vec::new();
        let mut values = Vec::new();
        for (i, cell) in cells.iter().enumerate() {
            let own = self.log(&cell.structure, task);
            if let (Some(own), Status::Ok) = (own, cell.status) {
                ranked.push(i);
                values.push(own.iter().zip(reference).map(|(own, r)| own - r).collect());
            }
        }
        ranked.into_iter().zip(ranks(&values, ALPHA)).collect()
    }
}

/// A value over processes from its logarithms.
pub(super) fn shown(reference: &[f64], own: &[f64]) -> Option<Estimate> {
    let found = one_run(reference, own)?;
    Some(Estimate {
        value: found.value,
        lower: found.lower.unwrap_or(f64::NAN),
        upper: found.upper.unwrap_or(f64::NAN),
    })
}

fn error_metrics(metrics: &mut Metrics, judged: &Judged) {
    let (errors, queries) = (&judged.errors, judged.judged_queries as f64);
    metrics.set("judged_queries", queries);
    if let Some(excess) = errors.excess() {
        metrics.insert("excess", excess, judged.excess_interval.map(Into::into));
    }
    for (name, count) in [
        ("false_positive_count", errors.false_positives),
        ("false_negative_count", errors.false_negatives),
        ("touch_dropped_count", errors.touch_dropped),
        ("undecided_count", errors.undecided),
    ] {
        metrics.set(name, count as f64 / queries);
    }
    metrics.set("worst_miss", errors.worst_miss);
}

#[cfg(test)]
mod tests;
