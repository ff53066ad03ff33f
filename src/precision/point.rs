//! A point of the diagram: a structure with a culling, its errors and its time,
//! and when one point dominates another. How it is measured is in `points`.

use serde::ser::Error as _;
use serde::{Serialize, Serializer};

use super::judged::Judged;
use super::plane_test::Names;
use crate::index::MemoryUsage;
use crate::measure::{OverProcesses, Status};
use crate::statistics::{ALPHA, Rate, dominance, shows_less};
use crate::verify::ErrorCount;

/// Thread CPU time, over the processes as in a run; null where it has none.
#[derive(Clone, Copy, Default, PartialEq, Debug, Serialize)]
pub struct Times {
    /// Of a query.
    pub query_ns: Option<f64>,
    /// Lower end of the 95 % interval of `query_ns`.
    pub query_ns_lower: Option<f64>,
    /// Upper end of the 95 % interval of `query_ns`.
    pub query_ns_upper: Option<f64>,
    /// Its place among the tasks that were timed, if it has a time.
    #[serde(skip)]
    pub(super) task: Option<usize>,
}

impl Times {
    /// Of a task, per so many of its queries.
    pub(super) fn of(times: &OverProcesses, task: usize, per: f64) -> Times {
        let Some(found) = times.ns(task) else {
            return Times::default();
        };
        Times {
            query_ns: Some(found.value / per),
            query_ns_lower: Some(found.lower / per).filter(|ns| ns.is_finite()),
            query_ns_upper: Some(found.upper / per).filter(|ns| ns.is_finite()),
            task: Some(task),
        }
    }

    /// What has no time comes last.
    pub(super) fn order(&self) -> f64 {
        self.query_ns.unwrap_or(f64::INFINITY)
    }

    /// Whether a paired test over the processes shows it.
    pub(super) fn is_faster(&self, other: &Times, times: &OverProcesses) -> bool {
        let both = self.task.zip(other.task);
        both.is_some_and(|(own, other)| times.is_faster(own, other))
    }
}

/// One way to answer, with its error and its time.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Label of the structure.
    pub structure: String,
    /// What it is asked with.
    #[serde(flatten)]
    pub names: Names,
    /// How building, counting and timing ended.
    pub status: Status,
    /// Why, where the status is not ok, or why it has no time.
    pub reason: Option<String>,
    /// False positives / visible items, by camera.
    pub excess: Option<Rate>,
    /// Visible items that were not returned, in millionths.
    pub false_negative_ppm: Option<Rate>,
    /// Items that change from a camera to its neighbour on the path while their
    /// truth does not / visible items; null for a path of one camera.
    pub flicker: Option<Rate>,
    /// The same as counts; null for what is refused.
    #[serde(flatten, serialize_with = "counts_or_null")]
    pub errors: Option<ErrorCount>,
    /// How deep the deepest false negative reaches into the view, in pixels of a
    /// view 1080 pixels high.
    pub worst_miss_px: Option<f64>,
    /// Mean over the cameras.
    #[serde(flatten)]
    pub times: Times,
    /// `query_ns` / number of items.
    pub ns_per_item: Option<f64>,
    /// Memory of nodes and items / number of items.
    pub memory_bytes_per_item: Option<f64>,
    /// Index of a point of the front that is no worse in anything and better in
    /// something, where the samples show that it is dominated.
    pub dominated_by: Option<usize>,
    /// Whether it is dominated by the values alone: it shares the front.
    pub is_tie: bool,
    /// Whether no point is shown to dominate it.
    pub on_front: bool,
    /// By camera: false negatives, dropped touches, false positives, depth of the
    /// worst miss.
    #[serde(skip)]
    samples: [Vec<f64>; 4],
}

/// Every count by its name, null where there are none.
pub(super) fn counts_or_null<S: Serializer>(
    errors: &Option<ErrorCount>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let counts = serde_json::to_value(errors.unwrap_or_default()).map_err(S::Error::custom)?;
    let named = counts.as_object().into_iter().flatten();
    serializer.collect_map(named.map(|(name, count)| (name, errors.map(|_| count))))
}

impl Point {
    pub(super) fn new(structure: &str, judged: &Judged) -> Point {
        let is_refused = judged.refused.is_some();
        let errors = (!is_refused).then(|| judged.errors());
        let untimed =
            (!judged.test.is_timed()).then(|| "emulated: errors without times".to_owned());
        let by_camera = |of: fn(&super::judged::CameraErrors) -> f64| -> Vec<f64> {
            judged.by_camera.iter().map(of).collect()
        };
        Point {
            structure: structure.to_owned(),
            names: judged.test.names(),
            status: match is_refused {
                true => Status::Refused,
                false if judged.errors().false_negatives > 0 => Status::Unsafe,
                false => Status::Ok,
            },
            reason: judged.refused.clone().or(untimed),
            excess: judged.rate_of(|c| c.errors.false_positives),
            false_negative_ppm: judged
                .rate_of(|c| c.errors.false_negatives)
                .map(|share| share.per(1e6)),
            flicker: judged.flicker(),
            errors,
            worst_miss_px: (!is_refused).then(|| judged.worst_miss_px()),
            times: Times::default(),
            ns_per_item: None,
            memory_bytes_per_item: None,
            dominated_by: None,
            is_tie: false,
            on_front: false,
            samples: [
                by_camera(|c| c.errors.false_negatives as f64),
                by_camera(|c| c.errors.touch_dropped as f64),
                by_camera(|c| c.errors.false_positives as f64),
                by_camera(|c| c.worst_miss_px),
            ],
        }
    }

    pub(super) fn memory(&mut self, usage: MemoryUsage, items: usize) {
        self.memory_bytes_per_item = (items > 0).then(|| usage.total() as f64 / items as f64);
    }

    /// Takes over the time of a task, or why it has none.
    pub(super) fn time(&mut self, times: &OverProcesses, task: usize, items: usize) {
        if let Some(wrong) = times.failure(task) {
            (self.status, self.reason) = (wrong.status, wrong.reason.clone());
        }
        self.times = Times::of(times, task, 1.0);
        let ns = self.times.query_ns.filter(|_| items > 0);
        self.ns_per_item = ns.map(|ns| ns / items as f64);
    }

    /// What less is better of: three errors, the depth of the worst miss, memory
    /// and time.
    fn values(&self) -> [f64; 6] {
        let e = self.errors.unwrap_or_default();
        let [missed, dropped, extra] =
            [e.false_negatives, e.touch_dropped, e.false_positives].map(|n| n as f64);
        let memory = self.memory_bytes_per_item.unwrap_or(f64::INFINITY);
        let depth = self.worst_miss_px.unwrap_or(f64::INFINITY);
        [missed, dropped, extra, depth, memory, self.times.order()]
    }
}

/// Marks the front of what has a time, and what is off it: errors are compared
/// camera by camera, times process by process, and memory is what it is.
pub(super) fn mark_dominated(points: &mut [Point], times: &OverProcesses) {
    mark(points, &|a, b| a.times.is_faster(&b.times, times));
}

fn mark(points: &mut [Point], is_faster: &dyn Fn(&Point, &Point) -> bool) {
    let timed: Vec<usize> = (0..points.len())
        .filter(|&i| points[i].times.task.is_some())
        .collect();
    let values: Vec<[f64; 6]> = timed.iter().map(|&i| points[i].values()).collect();
    let is_less = |a: usize, b: usize, k: usize| {
        let (a, b) = (&points[timed[a]], &points[timed[b]]);
        match k {
            4 => true,
            5 => is_faster(a, b),
            _ => shows_less(&a.samples[k], &b.samples[k], ALPHA),
        }
    };
    let found = dominance(&values, &is_less);
    for (&i, found) in timed.iter().zip(found) {
        points[i].dominated_by = found.dominated_by.map(|by| timed[by]);
        points[i].on_front = found.dominated_by.is_none();
        points[i].is_tie = found.is_tie;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::precision::plane_test::PlaneTest;

    /// A point with false negatives, dropped touches and false positives, each the
    /// same number at four cameras, and its time.
    fn point(errors: [u64; 3], ns: Option<f64>) -> Point {
        let [false_negatives, touch_dropped, false_positives] = errors;
        Point {
            structure: "linear".to_owned(),
            names: PlaneTest::Culling(Default::default()).names(),
            status: Status::Ok,
            reason: None,
            excess: None,
            false_negative_ppm: None,
            flicker: None,
            errors: Some(ErrorCount {
                false_negatives,
                touch_dropped,
                false_positives,
                ..ErrorCount::default()
            }),
            worst_miss_px: Some(0.0),
            times: Times {
                query_ns: ns,
                task: ns.map(|ns| ns as usize),
                ..Times::default()
            },
            ns_per_item: None,
            memory_bytes_per_item: Some(24.0),
            dominated_by: None,
            is_tie: false,
            on_front: false,
            samples: [
                vec![false_negatives as f64 / 4.0; 4],
                vec![touch_dropped as f64 / 4.0; 4],
                vec![false_positives as f64 / 4.0; 4],
                vec![0.0; 4],
            ],
        }
    }

    /// Times in steps of ten are told apart, those within a step are not.
    fn is_faster(a: &Point, b: &Point) -> bool {
        let step = |p: &Point| p.times.task.map(|task| task / 10);
        step(a) < step(b)
    }

    fn marked(points: &[Point]) -> Vec<(Option<usize>, bool, bool)> {
        let mut points = points.to_vec();
        mark(&mut points, &is_faster);
        let of = |p: &Point| (p.dominated_by, p.is_tie, p.on_front);
        points.iter().map(of).collect()
    }

    #[test]
    fn errors_are_not_traded_and_ties_share_the_front() {
        let (none, some) = ([0, 0, 5], [0, 0, 9]);
        let (front, tie, worse) = (
            (None, false, true),
            (None, true, true),
            (Some(0), false, false),
        );
        let cases = [
            // Equal errors: the faster one, shown or not.
            (none, 10.0, none, 20.0, [front, worse]),
            (none, 10.0, none, 11.0, [front, tie]),
            // Slower by a little, with fewer errors: both stay.
            (none, 11.0, some, 10.0, [front, front]),
            (none, 10.0, some, 11.0, [front, worse]),
            // One error more, another one fewer: both stay, however fast.
            ([1, 0, 0], 10.0, [0, 0, 9], 50.0, [front, front]),
            ([0, 1, 0], 10.0, [0, 0, 9], 50.0, [front, front]),
        ];
        for (errors_a, time_a, errors_b, time_b, wanted) in cases {
            let points = [point(errors_a, Some(time_a)), point(errors_b, Some(time_b))];
            let case = (errors_a, time_a, errors_b, time_b);
            assert_eq!(marked(&points), wanted, "{case:?}");
        }
    }

    #[test]
    fn memory_and_the_depth_of_a_miss_are_dimensions() {
        let mut small = point([0, 0, 5], Some(90.0));
        small.memory_bytes_per_item = Some(12.0);
        let mut shallow = point([1, 0, 5], Some(90.0));
        let mut deep = point([1, 0, 5], Some(10.0));
        (shallow.worst_miss_px, deep.worst_miss_px) = (Some(0.1), Some(30.0));
        let untimed = point([0, 0, 0], None);
        let found = marked(&[deep, point([0, 0, 5], Some(20.0)), small, shallow, untimed]);
        let on_front: Vec<bool> = found.iter().map(|(.., on_front)| *on_front).collect();
        assert_eq!(on_front, [true, true, true, false, false]);
        // What has no time is neither on it nor off it.
        assert_eq!(found[4], (None, false, false));
    }
}
