//! Cells of a report from the parts of all processes.
//!
//! Every value, interval, ratio and rank comes from the same quantities, the logarithms
//! of time of each structure in each process, by the estimators of
//! [`crate::statistics`].

use std::collections::BTreeMap;

use serde_json::Value;

use super::bounds::{BOUNDS, Bound};
use super::group::{GroupPlan, LEAST_TAIL, measure_part};
use super::index_under_test::TWIN;
use super::metrics::{METRICS, Metrics};
use super::process_result::{Known, Part, SubjectPart, TaskPart};
use super::update::MOST_UPDATED;
use super::{
    CellTimes, Judged, PathInfo, Protocol, ReportCell, SceneInfo, Status, Subject, TaskKind,
    UPDATE_SHARES, Verdict, Workload,
};
use crate::statistics::{
    ALPHA, Estimate, interquartile_mean, median, one_run, quantile, ranks, ratio, sorted, speedup,
};

/// In the order of [`UPDATE_SHARES`].
const UPDATE_METRICS: [&str; UPDATE_SHARES.len()] = [
    "update_ms_0_1_percent",
    "update_ms",
    "update_ms_10_percent",
    "update_ms_100_percent",
];

/// Metrics of each task: its time, and its speed-up over the yardstick.
const TIME_METRICS: [(TaskKind, &str, Option<&str>); 3] = [
    (TaskKind::Query, "query_ns", Some("speedup")),
    (TaskKind::Locate, "locate_ns", Some("locate_speedup")),
    (TaskKind::LocateBatched, "locate_batched_ns", None),
];

/// Quantiles over groups of cameras.
const TAIL_METRICS: [(&str, f64); 4] = [
    ("query_ns_p5", 0.05),
    ("query_ns_p95", 0.95),
    ("query_ns_p99", 0.99),
    ("query_ns_max", 1.0),
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
    /// The structure that was entered twice, and second time / first time: the
    /// interval should contain 1.
    pub twin: Option<(String, Estimate)>,
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

impl Group {
    /// Cells of a group from its parts, one per process, the first process first.
    ///
    /// # Panics
    /// Without parts.
    pub fn of(parts: &[Part]) -> Group {
        let facts = Facts::of(parts);
        let first = &parts[0];
        let subjects = first.subjects.iter();
        let mut cells: Vec<ReportCell> = subjects
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
    known: Option<&'p Known>,
    /// Structures whose timed pass is not what the plan asks for.
    contradictions: Vec<(&'p str, Verdict)>,
    /// ln ns per query in each process, by label and task.
    logs: BTreeMap<(&'p str, TaskKind), Vec<f64>>,
    /// The yardstick; without one, the first structure that has times.
    reference: Option<&'p str>,
}

impl<'p> Facts<'p> {
    fn of(parts: &'p [Part]) -> Facts<'p> {
        let mut logs: BTreeMap<_, Vec<f64>> = BTreeMap::new();
        for task in parts.iter().flat_map(|part| &part.tasks) {
            let rounds: Vec<f64> = task.rounds_ns.iter().map(|ns| ns.ln()).collect();
            if let (Some(ln_ns), Status::Ok) = (interquartile_mean(&rounds), task.verdict.status) {
                let key = (task.label.as_str(), task.task);
                logs.entry(key).or_default().push(ln_ns);
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
            known,
            contradictions,
            logs,
            reference: None,
        };
        let labels = parts[0].subjects.iter().map(|s| s.label.as_str());
        facts.reference = std::iter::once(YARDSTICK).chain(labels).find(|label| {
            let is_timed = facts.logs.contains_key(&(*label, TaskKind::Query));
            is_timed && facts.verdict(label).status == Status::Ok
        });
        facts
    }

    fn has_yardstick(&self) -> bool {
        self.reference == Some(YARDSTICK)
    }

    fn log<'s>(&'s self, label: &'s str, task: TaskKind) -> Option<&'s [f64]> {
        self.logs.get(&(label, task)).map(Vec::as_slice)
    }

    /// Times of a structure and of the reference, ln ns in each process.
    fn paired<'s>(&'s self, label: &'s str, task: TaskKind) -> Option<[&'s [f64]; 2]> {
        Some([self.log(self.reference?, task)?, self.log(label, task)?])
    }

    fn ns(&self, label: &str, task: TaskKind) -> Option<Estimate> {
        let [reference, own] = self.paired(label, task)?;
        one_run(reference, own)
    }

    /// Verdict of a structure over all processes: the first failure.
    fn verdict(&self, label: &str) -> Verdict {
        let own = self.subjects(label).map(|s| &s.verdict);
        let tasks = self.parts.iter().flat_map(|part| &part.tasks);
        let timed = tasks.filter(|t| t.label == label).map(|t| &t.verdict);
        let contradictions = self.contradictions.iter();
        let contradicted = contradictions.filter(|c| c.0 == label).map(|c| &c.1);
        let mut all = own.chain(timed).chain(contradicted);
        let first = all.clone().next();
        let failed = all.find(|v| v.status != Status::Ok);
        failed.or(first).cloned().unwrap_or_else(Verdict::ok)
    }

    fn subjects<'l>(
        &self,
        label: &'l str,
    ) -> impl Iterator<Item = &'p SubjectPart> + Clone + use<'p, 'l> {
        let all = self.parts.iter().flat_map(|part| &part.subjects);
        all.filter(move |s| s.label == label)
    }

    /// The frustum queries of a structure in each process.
    fn queries<'l>(&self, label: &'l str) -> impl Iterator<Item = &'p TaskPart> + use<'p, 'l> {
        let all = self.parts.iter().flat_map(|part| &part.tasks);
        all.filter(move |t| t.label == label && t.task == TaskKind::Query)
    }

    /// Visible items of a timed camera, mean.
    fn visible_when_timed(&self) -> Option<f64> {
        let known = self.known?;
        let cameras = &known.query.as_ref()?.schedule.cameras;
        let of_camera = |camera: &u32| Some(known.visible.get(*camera as usize)?.count as f64);
        let visible = cameras.iter().map(of_camera).sum::<Option<f64>>()?;
        Some(visible / cameras.len() as f64)
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
        if let Some(judged) = &judged {
            error_metrics(&mut metrics, judged);
        }
        let mut left_out = Vec::new();
        if right {
            // A stream may hold others.
            for metric in METRICS {
                metrics.set(metric.name, subject.counts.get(metric.name).copied());
            }
            self.time_metrics(&mut metrics, label);
            metrics.set("break_even_queries", self.break_even(label));
            for bound in BOUNDS {
                metrics.estimate(bound.ratio, self.ratio(label, bound.name));
            }
            left_out = self.left_out(label);
        }
        ReportCell {
            kind: Some(subject.kind),
            origin: Some(subject.origin.clone()),
            params: subject.params.clone(),
            error: judged,
            left_out,
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
        let first = &self.parts[0];
        ReportCell {
            scene: first.scene.clone(),
            path: first.path.clone(),
            structure: label.to_owned(),
            kind: None,
            origin: None,
            params: Value::Null,
            test: first.key.test.clone(),
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
        let is_large = self.parts[0].scene.total_count > MOST_UPDATED;
        let has_few_groups = |task: &TaskPart| task.tail_ns.len() < LEAST_TAIL;
        let reasons = [
            is_large.then(|| {
                format!("update_ms: scenes of more than {MOST_UPDATED} items are not moved")
            }),
            (self.log(label, TaskKind::Locate).is_none())
                .then(|| "locate_ns: this suite times frustum queries only".to_owned()),
            (self.queries(label).any(has_few_groups)).then(|| {
                format!("query_ns_p95: fewer than {LEAST_TAIL} comparable groups of cameras")
            }),
        ];
        reasons.into_iter().flatten().collect()
    }

    fn times(&self, label: &str) -> CellTimes {
        let planned = self.known.and_then(|known| known.query.as_ref());
        let planned = planned.and_then(|plan| {
            let own =
                |(other, task): &(String, TaskKind)| other == label && *task == TaskKind::Query;
            let task = plan.schedule.tasks.get(plan.keys.iter().position(own)?)?;
            Some((task.batch as usize, plan.schedule.cameras.len()))
        });
        let (batch, cameras_timed) = planned.unwrap_or_default();
        let mut by_process = BTreeMap::new();
        for (task, metric, _) in TIME_METRICS {
            if let Some(own) = self.log(label, task) {
                by_process.insert(metric.to_owned(), own.iter().map(|x| x.exp()).collect());
            }
        }
        let builds: Vec<f64> = self.subjects(label).filter_map(|s| s.build_ms).collect();
        if !builds.is_empty() {
            by_process.insert("build_ms".to_owned(), builds);
        }
        CellTimes {
            processes: self.log(label, TaskKind::Query).map_or(0, <[f64]>::len),
            rounds: (self.queries(label).map(|t| t.rounds_ns.len()).min()).unwrap_or(0),
            cameras_timed,
            cameras_checked: self.known.map_or(0, |known| known.visible.len()),
            batch,
            by_process,
        }
    }

    /// A positive value of a structure over the processes that have it.
    fn over_processes(
        &self,
        label: &str,
        of: impl Fn(&SubjectPart) -> Option<f64>,
    ) -> Option<Estimate> {
        let values = self.subjects(label).filter_map(of).filter(|v| *v > 0.0);
        let logs: Vec<f64> = values.map(f64::ln).collect();
        one_run(&logs, &logs)
    }

    fn build_metrics(&self, metrics: &mut Metrics, label: &str) {
        metrics.estimate("build_ms", self.over_processes(label, |s| s.build_ms));
        for (share, name) in UPDATE_METRICS.into_iter().enumerate() {
            let update = self.over_processes(label, |s| s.update_ms.get(share).copied());
            metrics.estimate(name, update);
        }
        let worn: Vec<f64> = self.subjects(label).filter_map(|s| s.refitted_ln).collect();
        metrics.estimate("refitted_over_rebuilt", one_run(&worn, &worn));
        let items = self.parts[0].scene.total_count as f64;
        let bytes = self.subjects(label).find_map(|s| s.memory_bytes);
        metrics.set(
            "memory_bytes_per_item",
            bytes.map(|bytes| bytes as f64 / items),
        );
    }

    fn time_metrics(&self, metrics: &mut Metrics, label: &str) {
        for (task, time, faster) in TIME_METRICS {
            let Some([reference, own]) = self.paired(label, task) else {
                continue;
            };
            let ns = one_run(reference, own);
            metrics.estimate(time, ns);
            if task == TaskKind::Query {
                let visible = self.visible_when_timed();
                metrics.estimate("ns_per_visible", ns.zip(visible).map(|(ns, v)| ns.per(v)));
            }
            if let Some(faster) = faster.filter(|_| self.has_yardstick()) {
                metrics.estimate(faster, speedup(reference, own));
            }
        }
        let wall: Vec<f64> = self.queries(label).filter_map(|t| t.wall_ln_ns).collect();
        metrics.estimate("query_wall_ns", one_run(&wall, &wall));
        let tails: Vec<&[f64]> = self.queries(label).map(|t| &t.tail_ns[..]).collect();
        let groups = tails.iter().map(|tail| tail.len()).min().unwrap_or(0);
        if groups >= LEAST_TAIL {
            let of_group = |g: usize| median(&tails.iter().map(|t| t[g]).collect::<Vec<_>>());
            let all = sorted((0..groups).filter_map(of_group).collect());
            for (name, q) in TAIL_METRICS {
                metrics.set(name, quantile(&all, q));
            }
        }
    }

    /// Queries after which the build is repaid against the yardstick, `None` if never,
    /// from the times that are shown.
    fn break_even(&self, label: &str) -> Option<f64> {
        let cost = |label: &str| -> Option<[f64; 2]> {
            let build = self.over_processes(label, |s| s.build_ms)?.value * 1e6;
            Some([build, self.ns(label, TaskKind::Query)?.value])
        };
        let [build, query] = cost(label).filter(|_| self.has_yardstick())?;
        let [linear_build, linear_query] = cost(YARDSTICK)?;
        let (price, gain) = (build - linear_build, linear_query - query);
        (gain > 0.0 && price > 0.0).then(|| (price / gain).ceil())
    }

    /// Time of `label` / time of `other`: the ratio of the two shown values.
    fn ratio(&self, label: &str, other: &str) -> Option<Estimate> {
        let [reference, own] = self.paired(label, TaskKind::Query)?;
        ratio(reference, own, self.log(other, TaskKind::Query)?)
    }

    fn twin(&self) -> Option<(String, Estimate)> {
        let mut labels = self.parts[0].subjects.iter().map(|s| s.label.as_str());
        let (twin, original) = labels.find_map(|l| Some((l, l.strip_suffix(TWIN)?)))?;
        Some((original.to_owned(), self.ratio(twin, original)?))
    }

    /// Position and rank of each ok cell that has times of a task.
    fn ranks(&self, cells: &[ReportCell], task: TaskKind) -> Vec<(usize, usize)> {
        let ok = cells.iter().enumerate();
        let ok = ok.filter(|(_, cell)| cell.status == Status::Ok);
        let timed = ok.filter_map(|(i, cell)| {
            let [reference, own] = self.paired(&cell.structure, task)?;
            let relative = own.iter().zip(reference).map(|(own, r)| own - r);
            Some((i, relative.collect()))
        });
        let (positions, values): (Vec<usize>, Vec<Vec<f64>>) = timed.unzip();
        positions.into_iter().zip(ranks(&values, ALPHA)).collect()
    }
}

fn error_metrics(metrics: &mut Metrics, judged: &Judged) {
    let (errors, queries) = (&judged.errors, judged.judged_queries as f64);
    metrics.set("judged_queries", queries);
    let interval = judged.excess_interval;
    metrics.estimate(
        "excess",
        errors.excess().map(|value| Estimate {
            value,
            lower: interval.map(|ends| ends[0]),
            upper: interval.map(|ends| ends[1]),
        }),
    );
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
