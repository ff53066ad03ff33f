//! A point of the diagram: a structure with a culling, its errors and its time.
//!
//! Also decides whether one point dominates another.

use serde::Serialize;

use super::culling_result::{CullingResult, Names, counts_or_null};
use crate::measure::{OverProcesses, Status, Verdict};
use crate::statistics::{ALPHA, Estimate, dominance, flat, is_less, rate_of, shows_less};
use crate::verify::ErrorCount;

/// A structure with a culling, its errors and its time.
#[derive(Clone, Default, Debug, Serialize)]
pub struct Point {
    /// Label of the structure.
    pub structure: String,
    /// Test, arithmetic and planes.
    #[serde(flatten)]
    pub names: Names,
    /// False positives / visible items, by camera.
    pub excess: Option<Estimate>,
    /// False negatives per million visible items.
    pub false_negative_ppm: Option<Estimate>,
    /// Error counts; null if the culling was refused.
    #[serde(flatten, serialize_with = "counts_or_null")]
    pub counts: Option<ErrorCount>,
    /// Depth of the deepest false negative in the view, in pixels at 1080p.
    pub worst_miss_px: Option<f64>,
    /// `query_ns` / number of items.
    pub ns_per_item: Option<f64>,
    /// Memory of nodes and items / number of items.
    pub memory_bytes_per_item: f64,
    /// Outcome of building, counting and timing.
    pub status: Status,
    /// Reason, unless the status is ok.
    pub reason: Option<String>,
    /// Thread CPU time per query, mean over the cameras.
    #[serde(flatten, serialize_with = "flat::query_ns")]
    pub time: Option<Estimate>,
    /// Index of a front point that significantly dominates this one.
    ///
    /// The front point is no worse in any dimension and better in one, as the samples show.
    pub dominated_by: Option<usize>,
    /// True if the values are dominated, but not significantly: it shares the front.
    pub is_tie: bool,
    /// True if no point significantly dominates it.
    pub on_front: bool,
    /// False negatives, dropped touches, false positives, depths, at each camera.
    #[serde(skip)]
    by_camera: [Vec<f64>; 4],
    /// ln of the time in each process, ns; empty without times.
    #[serde(skip)]
    pub ln_ns: Vec<f64>,
}

impl Point {
    /// Point for a structure with a culling's errors, without a time.
    pub(super) fn of(result: &CullingResult, structure: &str, memory_bytes_per_item: f64) -> Point {
        let (errors, depths) = (&result.errors[..], &result.worst_miss_px);
        let is_made = result.refused.is_none();
        let counts: ErrorCount = errors.iter().copied().sum();
        let missed = rate_of(errors, |e| [e.false_negatives, e.visible]);
        let of = |count: fn(&ErrorCount) -> u64| -> Vec<f64> {
            errors.iter().map(|e| count(e) as f64).collect()
        };
        let by_camera = [
            of(|c| c.false_negatives),
            of(|c| c.touch_dropped),
            of(|c| c.false_positives),
            depths.clone(),
        ];
        Point {
            structure: structure.to_owned(),
            names: Names::of(&result.culling),
            excess: rate_of(errors, |e| [e.false_positives, e.visible]),
            false_negative_ppm: missed.map(|share| share.of_share().times(1e6)),
            counts: is_made.then_some(counts),
            worst_miss_px: depths.iter().copied().reduce(f64::max),
            memory_bytes_per_item,
            status: match is_made {
                false => Status::Refused,
                true if counts.false_negatives > 0 => Status::Unsafe,
                true => Status::Ok,
            },
            reason: result.refused.clone(),
            by_camera,
            ..Point::default()
        }
    }

    /// Copies a failure into status and reason; returns true if there is none.
    pub(super) fn accepts(&mut self, wrong: Option<&Verdict>) -> bool {
        if let Some(wrong) = wrong {
            (self.status, self.reason) = (wrong.status, wrong.reason.clone());
        }
        wrong.is_none()
    }

    /// Stores the time of a task, or the reason why it has none.
    pub(super) fn time(&mut self, times: &OverProcesses<(usize, bool)>, task: usize, items: usize) {
        self.accepts(times.failure((task, false)));
        self.time = times.ns((task, false));
        self.ln_ns = times.ln_ns((task, false));
        self.ns_per_item = self.query_ns().map(|ns| ns / items as f64);
    }

    /// Returns true if it is significantly faster than another.
    pub fn is_faster(&self, other: &Point) -> bool {
        is_less(&self.ln_ns, &other.ln_ns, ALPHA)
    }

    /// Time per query, ns.
    pub fn query_ns(&self) -> Option<f64> {
        Some(self.time?.value)
    }

    /// Values of which less is better: errors, depth of misses, memory, time.
    fn values(&self) -> [f64; 6] {
        let counts = self.counts.unwrap_or_default();
        [
            counts.false_negatives as f64,
            counts.touch_dropped as f64,
            counts.false_positives as f64,
            self.worst_miss_px.unwrap_or(0.0),
            self.memory_bytes_per_item,
            self.query_ns().unwrap_or(0.0),
        ]
    }
}

/// Sorts the points by time, untimed ones last, and marks the front.
///
/// Errors are compared camera by camera, times process by process.
pub(super) fn sort_and_mark(points: &mut [Point]) {
    let order = |p: &Point| p.query_ns().unwrap_or(f64::INFINITY);
    points.sort_by(|a, b| order(a).total_cmp(&order(b)));
    let timed = points.partition_point(|p| p.time.is_some());
    let values: Vec<[f64; 6]> = points[..timed].iter().map(Point::values).collect();
    let is_less = |a: usize, b: usize, k: usize| {
        let (a, b) = (&points[a], &points[b]);
        match k {
            0..4 => shows_less(&a.by_camera[k], &b.by_camera[k], ALPHA),
            // Memory has no sampling error.
            4 => true,
            _ => a.is_faster(b),
        }
    };
    let found = dominance(&values, &is_less);
    for (point, found) in points.iter_mut().zip(found) {
        point.dominated_by = found.dominated_by;
        point.on_front = found.dominated_by.is_none();
        point.is_tie = found.is_tie;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Point with the given errors, depth of its worst miss, memory and time.
    ///
    /// `errors` are false negatives, dropped touches and false positives, spread evenly over four
    /// cameras.
    fn point(errors: [u64; 3], depth: f64, memory: f64, ns: Option<f64>) -> Point {
        let [missed, dropped, extra] = errors.map(|count| vec![count as f64 / 4.0; 4]);
        Point {
            structure: "linear".to_owned(),
            counts: Some(ErrorCount {
                false_negatives: errors[0],
                touch_dropped: errors[1],
                false_positives: errors[2],
                ..ErrorCount::default()
            }),
            worst_miss_px: Some(depth),
            memory_bytes_per_item: memory,
            time: ns.map(Estimate::exact),
            by_camera: [missed, dropped, extra, vec![0.0; 4]],
            ln_ns: ns.iter().map(|ns| (ns / 10.0).floor()).collect(),
            ..Point::default()
        }
    }

    /// Times differ significantly if they lie in different tens.
    fn marked(points: &[Point]) -> Vec<(Option<usize>, bool, bool)> {
        let mut points = points.to_vec();
        sort_and_mark(&mut points);
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
            // Equal errors: the faster one dominates, or ties if the difference is not significant.
            (none, 10.0, none, 20.0, [front, worse]),
            (none, 10.0, none, 11.0, [front, tie]),
            // Slightly slower, with fewer errors: both stay.
            (some, 10.0, none, 11.0, [front, front]),
            (none, 10.0, some, 11.0, [front, worse]),
            // One kind of error more, another less: both stay, however fast.
            ([1, 0, 0], 10.0, [0, 0, 9], 50.0, [front, front]),
            ([0, 1, 0], 10.0, [0, 0, 9], 50.0, [front, front]),
        ];
        for (errors_a, time_a, errors_b, time_b, wanted) in cases {
            let points = [
                point(errors_b, 0.0, 24.0, Some(time_b)),
                point(errors_a, 0.0, 24.0, Some(time_a)),
            ];
            let case = (errors_a, time_a, errors_b, time_b);
            assert_eq!(marked(&points), wanted, "{case:?}");
        }
    }

    #[test]
    fn memory_and_the_depth_of_a_miss_are_dimensions() {
        let (none, some) = ([0, 0, 5], [1, 0, 5]);
        let deep = point(some, 30.0, 24.0, Some(10.0));
        let plain = point(none, 0.0, 24.0, Some(20.0));
        let small = point(none, 0.0, 12.0, Some(90.0));
        let shallow = point(some, 0.1, 24.0, Some(95.0));
        let untimed = point([0; 3], 0.0, 24.0, None);
        let found = marked(&[untimed, deep, plain, small, shallow]);
        let on_front: Vec<bool> = found.iter().map(|(.., on_front)| *on_front).collect();
        assert_eq!(on_front, [true, true, true, false, false]);
        // Points without a time come last, not on the front.
        assert_eq!(found[4], (None, false, false));
    }
}
