//! A point of the diagram: a structure with a culling, its errors and its time,
//! and when one point dominates another. How it is measured is in `points`.

use serde::{Serialize, Serializer};

use super::judged::Judged;
use crate::culling::Culling;
use crate::index::MemoryUsage;
use crate::measure::{Status, Timed, Verdict};
use crate::statistics::{Estimate, bootstrap_median, median};
use crate::verify::ErrorCount;

/// One way to answer, with its error and its time.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    pub structure: String,
    pub test: &'static str,
    pub arithmetic: &'static str,
    pub planes: &'static str,
    pub epsilon: f64,
    #[serde(serialize_with = "by_name")]
    pub status: Status,
    pub reason: Option<String>,
    /// False positives / visible items.
    pub excess: Option<f64>,
    pub false_negative_ppm: Option<f64>,
    #[serde(flatten)]
    pub errors: ErrorCount,
    /// Mean over the cameras, median over the rounds, thread CPU time.
    pub query_ns: Option<f64>,
    pub query_ns_lower: Option<f64>,
    pub query_ns_upper: Option<f64>,
    pub ns_per_item: Option<f64>,
    pub memory_bytes_per_item: Option<f64>,
    /// Index of a point that is no worse in anything and better in something.
    pub dominated_by: Option<usize>,
    pub on_front: bool,
}

fn by_name<S: Serializer>(status: &Status, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(status.name())
}

impl Point {
    pub(super) fn new(structure: &str, judged: &Judged) -> Point {
        let (culling, errors) = (&judged.culling, judged.errors);
        let refused = judged.refused.is_some();
        Point {
            structure: structure.to_owned(),
            test: culling.test.name(),
            arithmetic: culling.arithmetic.name(),
            planes: culling.planes.method.name(),
            epsilon: culling.planes.epsilon,
            status: match refused {
                true => Status::Refused,
                false if errors.false_negatives > 0 => Status::Unsafe,
                false => Status::Ok,
            },
            reason: judged.refused.clone(),
            excess: errors.excess().filter(|_| !refused),
            false_negative_ppm: errors.false_negative_ppm().filter(|_| !refused),
            errors,
            query_ns: None,
            query_ns_lower: None,
            query_ns_upper: None,
            ns_per_item: None,
            memory_bytes_per_item: None,
            dominated_by: None,
            on_front: false,
        }
    }

    pub(super) fn memory(&mut self, usage: MemoryUsage, items: usize) {
        self.memory_bytes_per_item = (items > 0).then(|| usage.total() as f64 / items as f64);
    }

    pub(super) fn time(&mut self, timed: &Timed, items: usize) {
        let Some(Estimate {
            value,
            lower,
            upper,
        }) = bootstrap_median(&timed.round_means(|s| s.cpu_ns), 1)
        else {
            return;
        };
        self.query_ns = Some(value);
        self.query_ns_lower = Some(lower);
        self.query_ns_upper = Some(upper);
        self.ns_per_item = (items > 0).then(|| value / items as f64);
    }

    /// No worse in any error and no slower, and better in one of them. Times
    /// whose intervals come within the noise floor of each other are equal:
    /// what noise decides is no advantage.
    pub(super) fn dominates(&self, other: &Point, floor: f64) -> bool {
        let (Some(upper), Some(other_lower)) = (self.query_ns_upper, other.query_ns_lower) else {
            return false;
        };
        let (Some(lower), Some(other_upper)) = (self.query_ns_lower, other.query_ns_upper) else {
            return false;
        };
        let of = |p: &Point| {
            let e = p.errors;
            [e.false_negatives, e.touch_dropped, e.false_positives]
        };
        let (mine, others) = (of(self), of(other));
        let no_worse = mine.iter().zip(&others).all(|(a, b)| a <= b);
        let faster = upper * (1.0 + floor) < other_lower;
        let not_slower = lower <= other_upper * (1.0 + floor);
        no_worse && not_slower && (faster || mine != others)
    }
}

/// How far apart a structure and its twin lie at most.
pub(super) fn noise_floor(points: &[Point], twins: &[Result<Timed, Verdict>]) -> f64 {
    let standard = Culling::default();
    let originals = points.iter().filter(|p| {
        p.test == standard.test.name()
            && p.arithmetic == standard.arithmetic.name()
            && p.planes == standard.planes.method.name()
            && p.epsilon == standard.planes.epsilon
    });
    let mut floor = 0.0f64;
    for (original, twin) in originals.zip(twins) {
        let again = twin
            .as_ref()
            .ok()
            .and_then(|t| median(&t.round_means(|s| s.cpu_ns)));
        if let (Some(first), Some(again)) = (original.query_ns, again) {
            floor = floor.max((again / first - 1.0).abs());
        }
    }
    floor
}

pub(super) fn mark_dominated(points: &mut [Point], floor: f64) {
    for i in 0..points.len() {
        let better = (0..points.len()).find(|&k| points[k].dominates(&points[i], floor));
        points[i].on_front = better.is_none() && points[i].query_ns.is_some();
        points[i].dominated_by = better;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point with false negatives, dropped touches and false positives, and
    /// the interval of its time.
    fn point(errors: [u64; 3], time: [f64; 2]) -> Point {
        let [false_negatives, touch_dropped, false_positives] = errors;
        Point {
            structure: "linear".to_owned(),
            test: "six-plane",
            arithmetic: "f32",
            planes: "frame",
            epsilon: 0.0,
            status: Status::Ok,
            reason: None,
            excess: None,
            false_negative_ppm: None,
            errors: ErrorCount {
                false_negatives,
                touch_dropped,
                false_positives,
                ..ErrorCount::default()
            },
            query_ns: Some((time[0] + time[1]) / 2.0),
            query_ns_lower: Some(time[0]),
            query_ns_upper: Some(time[1]),
            ns_per_item: None,
            memory_bytes_per_item: None,
            dominated_by: None,
            on_front: false,
        }
    }

    #[test]
    fn times_that_overlap_are_equal_and_errors_are_not_traded() {
        let (none, some) = ([0, 0, 5], [0, 0, 9]);
        let cases = [
            // Equal errors: only what is clearly faster dominates.
            (none, [1.0, 2.0], none, [3.0, 4.0], [true, false]),
            (none, [1.0, 3.0], none, [2.0, 4.0], [false, false]),
            (none, [1.0, 2.0], none, [2.0, 4.0], [false, false]),
            // A tie in time is decided by the errors.
            (none, [1.0, 3.0], some, [2.0, 4.0], [true, false]),
            (none, [2.0, 4.0], some, [1.0, 3.0], [true, false]),
            // Fewer errors for more time: both stay.
            (none, [5.0, 6.0], some, [1.0, 2.0], [false, false]),
            // One error more, another one fewer: both stay, however fast.
            ([1, 0, 0], [1.0, 2.0], [0, 0, 9], [5.0, 6.0], [false, false]),
            ([0, 1, 0], [1.0, 2.0], [0, 0, 9], [5.0, 6.0], [false, false]),
            ([0, 1, 9], [5.0, 6.0], [0, 1, 8], [1.0, 2.0], [false, true]),
        ];
        for (errors_a, time_a, errors_b, time_b, wanted) in cases {
            let (a, b) = (point(errors_a, time_a), point(errors_b, time_b));
            let found = [a.dominates(&b, 0.0), b.dominates(&a, 0.0)];
            assert_eq!(found, wanted, "{:?}", (errors_a, time_a, errors_b, time_b));
        }
    }

    #[test]
    fn the_front_is_what_nothing_dominates() {
        let mut points = [
            point([0, 0, 9], [1.0, 2.0]),
            point([0, 0, 9], [1.5, 2.5]),
            point([0, 0, 9], [3.0, 4.0]),
            point([0, 0, 0], [5.0, 6.0]),
            point([0, 0, 1], [5.0, 6.0]),
            point([0, 0, 0], [0.0, 0.0]),
        ];
        // One that was never timed has no say and no place.
        let untimed = &mut points[5];
        (untimed.query_ns, untimed.query_ns_lower) = (None, None);
        untimed.query_ns_upper = None;
        mark_dominated(&mut points, 0.0);
        assert_eq!(
            points.each_ref().map(|p| p.dominated_by),
            [None, None, Some(0), None, Some(3), None]
        );
        assert_eq!(
            points.each_ref().map(|p| p.on_front),
            [true, true, false, true, false, false]
        );
    }

    #[test]
    fn what_lies_within_the_noise_floor_is_no_faster() {
        let (a, b) = (point([0; 3], [1.0, 2.0]), point([0; 3], [2.2, 4.0]));
        assert!(a.dominates(&b, 0.05) && !a.dominates(&b, 0.15));
        // And not slower either: fewer errors win.
        let dear = point([0, 0, 1], [1.0, 2.0]);
        assert!(!b.dominates(&dear, 0.05) && b.dominates(&dear, 0.15));
    }
}
