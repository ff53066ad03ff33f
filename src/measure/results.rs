//! [`Group::of`]: the cells of a report from the parts of all processes.
//!
//! Every value, interval, ratio and rank of times comes from the same quantities, the
//! ln of the time of each structure in each process, by the estimators of
//! [`crate::statistics`].

use std::collections::BTreeMap;

use serde_json::Value;

use super::bounds::BOUNDS;
use super::group::LEAST_TAIL;
use super::index_under_test::TWIN;
use super::metrics::{METRICS, Metrics, WALL_METRICS};
use super::moving::AGES;
use super::process_result::{Known, Part, SubjectPart, TaskPart};
use super::update::MOST_UPDATED;
use super::{CellTimes, Judged, ReportCell, Status, TaskKind, UPDATE_SHARES, Verdict};
use crate::statistics::{
    ALPHA, Estimate, interquartile_mean, median, one_run, quantile, ranks, ratio, sorted, speedup,
};

/// Metrics of updates, in the order of [`UPDATE_SHARES`].
const UPDATE_METRICS: [&str; UPDATE_SHARES.len()] = [
    "update_ms_0_1_percent",
    "update_ms",
    "update_ms_10_percent",
    "update_ms_100_percent",
];

/// Metrics of each task: its time, and its speed-up over the yardstick.
/// The last speed-up counts: that of whole frames where items move.
const TIME_METRICS: [(TaskKind, &str, Option<&str>); 7] = [
    (TaskKind::Query, "query_ns", Some("speedup")),
    (TaskKind::Locate, "locate_ns", Some("locate_speedup")),
    (TaskKind::LocateBatched, "locate_batched_ns", None),
    (TaskKind::Views, "views_ns", None),
    (TaskKind::Update, "update_ns", None),
    (TaskKind::Further, "further_query_ns", None),
    (TaskKind::Frame, "frame_ns", Some("speedup")),
];

/// Metrics of ageing, in the order of [`AGES`].
const AGE_METRICS: [&str; AGES.len()] = ["ageing_1", "ageing_10", "ageing_100", "ageing_1000"];

/// Metrics that are quantiles over groups of cameras, each with its quantile.
const TAIL_METRICS: [(&str, f64); 4] = [
    ("query_ns_p5", 0.05),
    ("query_ns_p95", 0.95),
    ("query_ns_p99", 0.99),
    ("query_ns_max", 1.0),
];

/// Label of the structure that speed-ups refer to.
pub const YARDSTICK: &str = "linear";

/// All cells of a group, and the results of lower bounds and the twin.
#[non_exhaustive]
pub struct Group {
    /// Cells of the structures, in the order of the plan.
    pub cells: Vec<ReportCell>,
    /// Cells of the lower bounds, which are never ranked.
    pub bounds: Vec<ReportCell>,
    /// Label of the structure that was measured twice, and time of its twin / its own.
    ///
    /// The interval should contain 1.
    pub twin: Option<(String, Estimate)>,
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
        let mut cells: Vec<ReportCell> = subjects
            .filter(|s| !s.label.ends_with(TWIN))
            .map(|subject| merged.cell(subject))
            .collect();
        for (i, rank) in merged.ranks(&cells) {
            cells[i].rank = Some(rank);
        }
        Group {
            bounds: first.bounds.iter().map(|name| merged.bound(name)).collect(),
            twin: merged.twin(),
            cells,
        }
    }
}

/// The parts of a group, with times by structure and task.
struct MergedParts<'p> {
    parts: &'p [Part],
    /// Answers and schedules of the first process.
    known: Option<&'p Known>,
    /// Structures whose timed pass differs from the schedule.
    contradictions: Vec<(&'p str, Verdict)>,
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
        let known = parts.iter().find_map(|part| part.known.as_ref());
        let contradictions = known.map_or_else(Vec::new, |known| {
            let of_part = |part: &'p Part| part.contradictions(known);
            parts.iter().flat_map(of_part).collect()
        });
        let mut merged = MergedParts {
            parts,
            known,
            contradictions,
            ln_ns: logs,
            reference: None,
        };
        let labels = parts[0].subjects.iter().map(|s| s.label.as_str());
        merged.reference = std::iter::once(YARDSTICK).chain(labels).find(|label| {
            let is_timed = merged.ln_ns.contains_key(&(*label, TaskKind::Query));
            is_timed && merged.verdict(label).status == Status::Ok
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
        let contradictions = self.contradictions.iter();
        let contradicted = contradictions.filter(|c| c.0 == label).map(|c| &c.1);
        let mut all = own.chain(timed).chain(contradicted);
        let first = all.clone().next();
        let failed = all.find(|v| v.status != Status::Ok);
        failed.or(first).cloned().unwrap_or_else(Verdict::ok)
    }

    /// Results of a structure in each process.
    fn subjects<'l>(
        &self,
        label: &'l str,
    ) -> impl Iterator<Item = &'p SubjectPart> + Clone + use<'p, 'l> {
        let all = self.parts.iter().flat_map(|part| &part.subjects);
        all.filter(move |s| s.label == label)
    }

    /// The frustum queries of a structure in each process.
    fn queries<'l>(&self, label: &'l str) -> impl Iterator<Item = &'p TaskPart> + use<'p, 'l> {
        self.tasks(label, TaskKind::Query)
    }

    /// A task of a structure in each process.
    fn tasks<'l>(
        &self,
        label: &'l str,
        task: TaskKind,
    ) -> impl Iterator<Item = &'p TaskPart> + use<'p, 'l> {
        let all = self.parts.iter().flat_map(|part| &part.tasks);
        all.filter(move |t| t.label == label && t.task == task)
    }

    /// Mean number of visible items of the timed cameras.
    fn visible_when_timed(&self) -> Option<f64> {
        let known = self.known?;
        let cameras = &known.query.as_ref()?.schedule.cameras;
        let of_camera = |camera: &u32| Some(known.visible.get(*camera as usize)?.count as f64);
        let visible = cameras.iter().map(of_camera).sum::<Option<f64>>()?;
        Some(visible / cameras.len() as f64)
    }

    /// The cell of a structure, its rank excluded.
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
            // Listed metrics only: a stream may hold others.
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
            chose: self.subjects(label).find_map(|s| s.chose.clone()),
            ..self.timed(label, verdict, metrics)
        }
    }

    /// The cell of a lower bound.
    fn bound(&self, name: &str) -> ReportCell {
        let mut metrics = Metrics::default();
        self.time_metrics(&mut metrics, name);
        self.timed(name, self.verdict(name), metrics)
    }

    /// A cell with the fields that structures and lower bounds have in common.
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
            chose: None,
        }
    }

    /// Metrics that this cell lacks though its structure is right, with the reason.
    fn left_out(&self, label: &str) -> Vec<String> {
        if self.ranked() == TaskKind::Frame {
            let left_out = "query_ns_p95, locate_ns, excess: not measured of items that move";
            return vec![left_out.to_owned()];
        }
        let is_large = self.parts[0].scene.total_count > MOST_UPDATED;
        let has_few_groups = |task: &TaskPart| task.tail_ns.len() < LEAST_TAIL;
        let reasons = [
            is_large.then(|| {
                format!("update_ms: scenes of more than {MOST_UPDATED} items are not moved")
            }),
            (self.ln_ns(label, TaskKind::Locate).is_none())
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
            if let Some(own) = self.ln_ns(label, task) {
                by_process.insert(metric.to_owned(), own.iter().map(|x| x.exp()).collect());
            }
        }
        let builds: Vec<f64> = self.subjects(label).filter_map(|s| s.build_ms).collect();
        if !builds.is_empty() {
            by_process.insert("build_ms".to_owned(), builds);
        }
        CellTimes {
            processes: self.ln_ns(label, TaskKind::Query).map_or(0, <[f64]>::len),
            rounds: (self.queries(label).map(|t| t.rounds_ns.len()).min()).unwrap_or(0),
            cameras_timed,
            cameras_checked: self.known.map_or(0, |known| known.visible.len()),
            batch,
            by_process,
        }
    }

    /// Mean over processes of a positive value of a structure.
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
        let refitted: Vec<f64> = self.subjects(label).filter_map(|s| s.refitted_ln).collect();
        metrics.estimate("refitted_over_rebuilt", one_run(&refitted, &refitted));
        for (age, name) in AGES.iter().zip(AGE_METRICS) {
            let own = self.subjects(label).filter_map(|s| s.ageing_ln.get(age));
            let own: Vec<f64> = own.copied().collect();
            metrics.estimate(name, one_run(&own, &own));
        }
        let items = self.parts[0].scene.total_count as f64;
        let bytes = self.subjects(label).find_map(|s| s.memory_bytes);
        let after = self.subjects(label).find_map(|s| s.memory_after_bytes);
        for (name, bytes) in [
            ("memory_bytes_per_item", bytes),
            ("memory_after_bytes_per_item", after),
        ] {
            metrics.set(name, bytes.map(|bytes| bytes as f64 / items));
        }
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
        for (name, task) in WALL_METRICS {
            let tasks = self.tasks(label, task);
            let wall: Vec<f64> = tasks.filter_map(|t| t.wall_ln_ns).collect();
            metrics.estimate(name, one_run(&wall, &wall));
        }
        let all = self.tail(label, TaskKind::Query);
        let all = &all[..if all.len() < LEAST_TAIL { 0 } else { all.len() }];
        for (name, q) in TAIL_METRICS {
            metrics.set(name, quantile(all, q));
        }
        let worst = self.tail(label, TaskKind::Frame).last().copied();
        metrics.set("worst_frame_ns", worst);
    }

    /// Median times of each group of cameras or each frame, ns, ascending.
    fn tail(&self, label: &str, task: TaskKind) -> Vec<f64> {
        let tails: Vec<&[f64]> = self.tasks(label, task).map(|t| &t.tail_ns[..]).collect();
        let groups = tails.iter().map(|tail| tail.len()).min().unwrap_or(0);
        let of_group = |g: usize| median(&tails.iter().map(|t| t[g]).collect::<Vec<_>>());
        sorted((0..groups).filter_map(of_group).collect())
    }

    /// Queries after which the build is repaid against the yardstick; `None` if never.
    fn break_even(&self, label: &str) -> Option<f64> {
        let cost = |label: &str| -> Option<[f64; 2]> {
            let build = self.over_processes(label, |s| s.build_ms)?.value * 1e6;
            Some([build, self.ns(label, TaskKind::Query)?.value])
        };
        let is_paid = self.has_yardstick() && self.ranked() == TaskKind::Query;
        let [build, query] = cost(label).filter(|_| is_paid)?;
        let [linear_build, linear_query] = cost(YARDSTICK)?;
        let (price, gain) = (build - linear_build, linear_query - query);
        (gain > 0.0 && price > 0.0).then(|| (price / gain).ceil())
    }

    /// Time of `label` / time of `other`, equal to the ratio of the two shown values.
    fn ratio(&self, label: &str, other: &str) -> Option<Estimate> {
        let [reference, own] = self.paired(label, self.ranked())?;
        ratio(reference, own, self.ln_ns(other, self.ranked())?)
    }

    fn twin(&self) -> Option<(String, Estimate)> {
        let mut labels = self.parts[0].subjects.iter().map(|s| s.label.as_str());
        let (twin, original) = labels.find_map(|l| Some((l, l.strip_suffix(TWIN)?)))?;
        Some((original.to_owned(), self.ratio(twin, original)?))
    }

    /// Index and rank of each ok cell that has times.
    fn ranks(&self, cells: &[ReportCell]) -> Vec<(usize, usize)> {
        let ok = cells.iter().enumerate();
        let ok = ok.filter(|(_, cell)| cell.status == Status::Ok);
        // Fat bounds answer another question: no rank beside exact ones.
        let is_exact = |cell: &ReportCell| cell.value("false_positive_count").unwrap_or(0.0) == 0.0;
        let ok = ok.filter(|(_, c)| c.path.motion.is_empty() || is_exact(c));
        let timed = ok.filter_map(|(i, cell)| {
            let [reference, own] = self.paired(&cell.structure, self.ranked())?;
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
