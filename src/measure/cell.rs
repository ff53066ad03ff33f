//! From passes to figures: the cells of a report with their named metrics,
//! and the ratio of the twin that gives the run its noise floor. It owns how
//! metrics are computed; how they are written is the report's business.

use std::collections::BTreeMap;

use serde_json::Value;

use super::bounds::{Bound, Material};
use super::metrics::{Metric, Metrics};
use super::{
    Built, Competitor, Contender, Counted, Judged, Protocol, Sample, Status, Task, Timed, Verdict,
    Workload, count_pass, judge, timed_rounds,
};
use crate::statistics::{Estimate, bootstrap_median, median, quantile, sorted};

/// In the order of [`super::UPDATE_SHARES`].
const UPDATE_METRICS: [&str; 4] = [
    "update_ms_0_1_percent",
    "update_ms",
    "update_ms_10_percent",
    "update_ms_100_percent",
];

/// One structure on one scene and path.
#[derive(Clone, PartialEq, Debug)]
pub struct Cell {
    pub structure: String,
    pub params: Value,
    pub verdict: Verdict,
    pub metrics: BTreeMap<String, Metric>,
    /// The errors behind the metrics, as totals.
    pub judged: Option<Judged>,
}

/// The same structure measured twice: what a ratio of 1 looks like here.
#[derive(Clone, PartialEq, Debug)]
pub struct TwinRatio {
    pub structure: String,
    pub ratio: Estimate,
}

/// All cells of a scene and path, with their samples.
pub struct Group {
    pub cells: Vec<Cell>,
    /// The bounds that were measured beside them: no structures, never ranked.
    pub bounds: Vec<Cell>,
    pub twin: Option<TwinRatio>,
    /// Label of the contender (a twin is told apart), task and sample.
    pub samples: Vec<(String, Task, Sample)>,
}

/// Verdicts of the oracle that a group may take: some 50 ns each.
const MOST_JUDGED: usize = 400_000;

/// Counts, verifies, judges and times all contenders, frustum queries beside
/// the bounds; ratios are against the one named `yardstick`, if it is there.
/// `None` if stopped.
pub fn measure_group(
    workload: &Workload,
    contenders: &[Contender],
    bounds: &[Bound],
    yardstick: &str,
    protocol: &Protocol,
    stop: &dyn Fn() -> bool,
) -> Option<Group> {
    let mut entries: Vec<Entry> = contenders.iter().map(Entry::new).collect();
    let built: Vec<&Built> = contenders
        .iter()
        .filter_map(|c| c.built.as_ref().ok())
        .collect();
    let mut counted = count_pass(workload, &built).into_iter();
    for entry in entries.iter_mut().filter(|e| e.contender.built.is_ok()) {
        entry.counted = counted.next();
        if let Some(counted) = &entry.counted {
            entry.verdict = counted.verdict.clone();
        }
    }
    let judged = judge(workload, MOST_JUDGED);
    for entry in entries.iter_mut().filter(|e| e.runs()) {
        entry.judged = Some(judged);
        let errors = &judged.errors;
        if errors.false_negatives > 0 {
            let reason = format!(
                "{} of {} visible items are missed at camera level, the deepest by {:e}",
                errors.false_negatives, errors.visible, errors.worst_miss
            );
            entry.verdict = Verdict::new(Status::Unsafe, reason);
        }
    }
    let visible = visible_counts(&entries);
    let material = Material {
        workload,
        contenders,
        visible: &visible,
    };
    let mut limits: Vec<Limit> = Vec::new();
    // Single and batched region search share their rounds.
    for tasks in [&[Task::Query][..], &[Task::Locate, Task::LocateBatched]] {
        let places: Vec<usize> = (0..entries.len()).filter(|&i| entries[i].runs()).collect();
        let mut competitors: Vec<Competitor> = Vec::new();
        for &task in tasks {
            let running = places.iter().filter_map(|&i| entries[i].passed());
            competitors.extend(
                running.map(|(built, counted)| Competitor::of(task, workload, built, counted)),
            );
        }
        let mut made: Vec<&Bound> = Vec::new();
        if tasks.contains(&Task::Query) && !visible.is_empty() {
            for bound in bounds {
                if let Some(competitor) = (bound.make)(&material) {
                    competitors.push(competitor);
                    made.push(bound);
                }
            }
        }
        let timed = timed_rounds(workload.views.len(), &competitors, protocol, stop)?;
        let mut timed = timed.into_iter();
        for &task in tasks {
            for (&i, result) in places.iter().zip(timed.by_ref().take(places.len())) {
                match result {
                    Ok(timed) => entries[i].set(task, timed),
                    Err(verdict) => entries[i].verdict = verdict,
                }
            }
        }
        limits.extend(
            made.into_iter()
                .zip(timed)
                .map(|(bound, timed)| Limit { bound, timed }),
        );
    }
    let yardstick = entries
        .iter()
        .find(|e| e.contender.spec.label == yardstick && !e.contender.is_twin);
    let twin = entries
        .iter()
        .find(|e| e.contender.is_twin)
        .and_then(|twin| {
            let original = entries.iter().find(|e| {
                !e.contender.is_twin && e.contender.spec.label == twin.contender.spec.label
            })?;
            Some(TwinRatio {
                structure: twin.contender.spec.label.clone(),
                ratio: paired_ratio(original.query.as_ref()?, twin.query.as_ref()?)?,
            })
        });
    let cells = entries
        .iter()
        .filter(|e| !e.contender.is_twin)
        .map(|e| e.cell(workload, yardstick, &limits))
        .collect();
    let of_bounds = limits.iter().flat_map(|limit| {
        let samples = limit.timed.iter().flat_map(|t| t.samples.iter());
        samples.map(|s| (limit.bound.name.to_owned(), Task::Query, *s))
    });
    let samples = entries
        .iter()
        .flat_map(|e| {
            let tasks = [
                (Task::Query, &e.query),
                (Task::Locate, &e.locate),
                (Task::LocateBatched, &e.locate_batched),
            ];
            tasks.into_iter().flat_map(move |(task, timed)| {
                let samples = timed.iter().flat_map(|t| t.samples.iter());
                samples.map(move |s| (e.contender.label(), task, *s))
            })
        })
        .chain(of_bounds)
        .collect();
    Some(Group {
        cells,
        bounds: limits.iter().map(Limit::cell).collect(),
        twin,
        samples,
    })
}

/// Items that each camera sees, as everyone who passed has counted them; empty
/// if nobody has.
fn visible_counts(entries: &[Entry]) -> Vec<u64> {
    let passed = entries.iter().find(|e| e.runs());
    let counted = passed.and_then(|e| e.counted.as_ref());
    let frames = counted.iter().flat_map(|c| &c.frames);
    frames.map(|frame| frame.visible).collect()
}

/// A bound with what was timed.
struct Limit<'a> {
    bound: &'a Bound,
    timed: Result<Timed, Verdict>,
}

impl Limit<'_> {
    fn cell(&self) -> Cell {
        let mut metrics = Metrics::default();
        if let Ok(timed) = &self.timed {
            time_metrics(&mut metrics, timed, &Timed::default());
        }
        Cell {
            structure: self.bound.name.to_owned(),
            params: Value::Null,
            verdict: self
                .timed
                .as_ref()
                .err()
                .cloned()
                .unwrap_or_else(Verdict::ok),
            metrics: metrics.0,
            judged: None,
        }
    }
}

/// A contender on its way through the passes.
struct Entry<'a> {
    contender: &'a Contender,
    verdict: Verdict,
    counted: Option<Counted>,
    judged: Option<Judged>,
    query: Option<Timed>,
    locate: Option<Timed>,
    locate_batched: Option<Timed>,
}

impl<'a> Entry<'a> {
    fn new(contender: &'a Contender) -> Self {
        let verdict = match &contender.built {
            Ok(_) => Verdict::ok(),
            Err(verdict) => verdict.clone(),
        };
        Entry {
            contender,
            verdict,
            counted: None,
            judged: None,
            query: None,
            locate: None,
            locate_batched: None,
        }
    }

    fn runs(&self) -> bool {
        self.verdict.status == Status::Ok && self.passed().is_some()
    }

    fn passed(&self) -> Option<(&'a Built, &Counted)> {
        Some((self.contender.built.as_ref().ok()?, self.counted.as_ref()?))
    }

    fn set(&mut self, task: Task, timed: Timed) {
        match task {
            Task::Query => self.query = Some(timed),
            Task::Locate => self.locate = Some(timed),
            Task::LocateBatched => self.locate_batched = Some(timed),
        }
    }

    fn cell(&self, workload: &Workload, yardstick: Option<&Entry>, limits: &[Limit]) -> Cell {
        let mut metrics = Metrics::default();
        if let Ok(built) = &self.contender.built {
            let items = workload.scene.items.len();
            metrics.set("build_ms", built.build_ms);
            for (name, &ms) in UPDATE_METRICS.into_iter().zip(&built.update_ms) {
                metrics.set(name, ms);
            }
            metrics.ratio(
                "memory_bytes_per_item",
                built.memory.total() as f64,
                items as f64,
            );
            if let Some(counted) = self.counted.as_ref().filter(|_| self.runs()) {
                count_metrics(&mut metrics, counted, items);
            }
            if let Some(judged) = &self.judged {
                error_metrics(&mut metrics, judged);
            }
        }
        if let (true, Some(query), Some(locate)) = (self.runs(), &self.query, &self.locate) {
            time_metrics(&mut metrics, query, locate);
            if let Some(batched) = &self.locate_batched {
                let each = bootstrap_median(&batched.round_means(), 1);
                metrics.estimate("locate_batched_ns", each);
            }
            if let Some(linear) = yardstick.filter(|y| y.runs()) {
                self.compare(&mut metrics, linear);
            }
            for limit in limits {
                if let Ok(timed) = &limit.timed {
                    metrics.estimate(limit.bound.ratio, paired_ratio(query, timed));
                }
            }
        }
        Cell {
            structure: self.contender.spec.label.clone(),
            params: self.contender.spec.params.clone(),
            verdict: self.verdict.clone(),
            metrics: metrics.0,
            judged: self.judged,
        }
    }

    fn compare(&self, metrics: &mut Metrics, linear: &Entry) {
        let both = |base: &Option<Timed>, this: &Option<Timed>| {
            paired_ratio(base.as_ref()?, this.as_ref()?)
        };
        metrics.estimate("ratio_to_linear", both(&linear.query, &self.query));
        metrics.estimate("locate_ratio_to_linear", both(&linear.locate, &self.locate));
        let cost = |e: &Entry| -> Option<(f64, f64)> {
            let built = e.contender.built.as_ref().ok()?;
            let per_round = e.query.as_ref()?.round_means();
            Some((built.build_ms * 1e6, median(&per_round)?))
        };
        if let (Some((build, query)), Some((linear_build, linear_query))) =
            (cost(self), cost(linear))
        {
            let (price, gain) = (build - linear_build, linear_query - query);
            if gain > 0.0 && price > 0.0 {
                metrics.set("break_even_queries", (price / gain).ceil());
            }
        }
    }
}

fn count_metrics(metrics: &mut Metrics, counted: &Counted, items: usize) {
    let queries = counted.frames.len() as f64;
    let visible: u64 = counted.frames.iter().map(|f| f.visible).sum();
    metrics.ratio("visible_count", visible as f64, queries);
    if items > 0 && queries > 0.0 {
        metrics.set("cull_rate", 1.0 - visible as f64 / (queries * items as f64));
    }
    let cost = &counted.cost;
    for (name, value) in [
        ("nodes_tested", cost.nodes_tested),
        ("planes_tested", cost.planes_tested),
        ("items_tested", cost.items_tested),
        ("items_accepted_untested", cost.items_accepted_untested),
    ] {
        metrics.ratio(name, value as f64, queries);
    }
    let searches = counted.locate.found.len() as f64;
    metrics.ratio(
        "comparisons",
        counted.locate.cost.comparisons() as f64,
        searches,
    );
    metrics.ratio(
        "regions_found",
        counted.locate.found.iter().sum::<u64>() as f64,
        searches,
    );
}

fn error_metrics(metrics: &mut Metrics, judged: &Judged) {
    let (errors, queries) = (&judged.errors, judged.judged_queries as f64);
    metrics.set("judged_queries", queries);
    metrics.maybe("excess", errors.excess());
    for (name, count) in [
        ("false_positive_count", errors.false_positives),
        ("false_negative_count", errors.false_negatives),
        ("touch_dropped_count", errors.touch_dropped),
        ("undecided_count", errors.undecided),
    ] {
        metrics.ratio(name, count as f64, queries);
    }
    metrics.set("worst_miss", errors.worst_miss);
}

fn time_metrics(metrics: &mut Metrics, query: &Timed, locate: &Timed) {
    let frames = frame_medians(query, |s| s.cpu_ns);
    let per_round: Vec<f64> = (0..query.rounds)
        .filter_map(|round| median(&query.of_round(round).map(|s| s.cpu_ns).collect::<Vec<_>>()))
        .collect();
    let interval = bootstrap_median(&per_round, 1);
    if let (Some(middle), Some(interval)) = (quantile(&frames, 0.5), interval) {
        metrics.estimate(
            "query_ns",
            Some(Estimate {
                value: middle,
                ..interval
            }),
        );
    }
    for (name, q) in [
        ("query_ns_p5", 0.05),
        ("query_ns_p95", 0.95),
        ("query_ns_p99", 0.99),
        ("query_ns_max", 1.0),
    ] {
        metrics.maybe(name, quantile(&frames, q));
    }
    metrics.maybe(
        "query_wall_ns",
        quantile(&frame_medians(query, |s| s.wall_ns), 0.5),
    );
    let returned: u64 = query.samples.iter().map(|s| s.returned).sum();
    let spent: f64 = query
        .samples
        .iter()
        .map(|s| s.cpu_ns * f64::from(s.queries))
        .sum();
    metrics.ratio("ns_per_visible", spent, returned as f64);
    metrics.estimate("locate_ns", bootstrap_median(&locate.round_means(), 1));
}

/// Per clock reading along the path the median over the rounds, ascending.
fn frame_medians(timed: &Timed, value: impl Fn(&Sample) -> f64) -> Vec<f64> {
    let mut by_frame: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
    for sample in &timed.samples {
        by_frame
            .entry(sample.frame)
            .or_default()
            .push(value(sample));
    }
    sorted(
        by_frame
            .values()
            .filter_map(|values| median(values))
            .collect(),
    )
}

/// Time of `base` / time of `other`, round by round: both saw the same state
/// of the machine. `None` without rounds.
pub fn paired_ratio(base: &Timed, other: &Timed) -> Option<Estimate> {
    let pairs = base.round_means().into_iter().zip(other.round_means());
    let ratios: Vec<f64> = pairs
        .map(|(b, o)| b / o)
        .filter(|r| r.is_finite())
        .collect();
    bootstrap_median(&ratios, 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timed(rounds: &[[f64; 2]]) -> Timed {
        let samples = rounds.iter().zip(0..).flat_map(|(frames, round)| {
            frames.iter().zip(0..).map(move |(&ns, frame)| Sample {
                round,
                frame,
                queries: 1,
                cpu_ns: ns,
                wall_ns: 2.0 * ns,
                returned: 10,
            })
        });
        Timed {
            samples: samples.collect(),
            rounds: rounds.len(),
        }
    }

    #[test]
    fn frames_take_the_median_over_rounds_then_quantiles_over_frames() {
        // One round was disturbed; the medians do not move.
        let query = timed(&[[10.0, 30.0], [500.0, 700.0], [10.0, 30.0]]);
        let mut metrics = Metrics::default();
        time_metrics(&mut metrics, &query, &query);
        assert_eq!(metrics.0["query_ns"].value, 20.0);
        assert_eq!(metrics.0["query_ns_max"].value, 30.0);
        assert_eq!(metrics.0["query_wall_ns"].value, 40.0);
    }

    #[test]
    fn ratios_are_paired_by_round() {
        // The machine slows down threefold; the ratio does not.
        let slow = timed(&[[40.0, 40.0], [120.0, 120.0], [40.0, 40.0]]);
        let fast = timed(&[[10.0, 10.0], [30.0, 30.0], [10.0, 10.0]]);
        let ratio = paired_ratio(&slow, &fast).unwrap();
        assert_eq!((ratio.value, ratio.lower, ratio.upper), (4.0, 4.0, 4.0));
    }

    #[test]
    fn what_was_not_measured_is_absent() {
        let mut metrics = Metrics::default();
        metrics.ratio("ns_per_visible", 5.0, 0.0);
        metrics.estimate(
            "ratio_to_linear",
            paired_ratio(&Timed::default(), &Timed::default()),
        );
        assert!(metrics.0.is_empty());
    }
}
