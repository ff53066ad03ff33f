//! A point of the diagram: a structure with a culling, its errors and its time,
//! and when one point dominates another. How it is measured is in `points`.

use serde::{Serialize, Serializer};

use super::judged::Judged;
use crate::index::MemoryUsage;
use crate::measure::{OverProcesses, Status};
use crate::verify::ErrorCount;

/// One way to answer, with its error and its time.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Label of the structure.
    pub structure: String,
    /// Name of the culling test.
    pub test: &'static str,
    /// Name of the arithmetic.
    pub arithmetic: &'static str,
    /// Name of the derivation of the planes.
    pub planes: &'static str,
    /// Factor c of the planes' epsilon.
    pub epsilon: f64,
    /// How building, counting and timing ended.
    #[serde(serialize_with = "by_name")]
    pub status: Status,
    /// Why, where the status is not ok.
    pub reason: Option<String>,
    /// False positives / visible items.
    pub excess: Option<f64>,
    /// Visible items that were not returned, in millionths.
    pub false_negative_ppm: Option<f64>,
    /// The same as counts.
    #[serde(flatten)]
    pub errors: ErrorCount,
    /// Mean over the cameras, thread CPU time, over the processes as in a run.
    pub query_ns: Option<f64>,
    /// Lower end of the 95 % interval of `query_ns`.
    pub query_ns_lower: Option<f64>,
    /// Upper end of the 95 % interval of `query_ns`.
    pub query_ns_upper: Option<f64>,
    /// `query_ns` / number of items.
    pub ns_per_item: Option<f64>,
    /// Memory of nodes and items / number of items.
    pub memory_bytes_per_item: Option<f64>,
    /// Index of a point that is no worse in anything and better in something.
    pub dominated_by: Option<usize>,
    /// Whether no point dominates it.
    pub on_front: bool,
    /// Its place among the tasks that were timed, if it has a time.
    #[serde(skip)]
    pub(super) task: Option<usize>,
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
            task: None,
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
        let Some(found) = times.ns(task) else {
            return;
        };
        self.task = Some(task);
        self.query_ns = Some(found.value);
        self.query_ns_lower = Some(found.lower).filter(|ns| ns.is_finite());
        self.query_ns_upper = Some(found.upper).filter(|ns| ns.is_finite());
        self.ns_per_item = (items > 0).then(|| found.value / items as f64);
    }

    /// No worse in any error and no slower, and better in one of them. Times that
    /// the processes do not tell apart are equal.
    fn dominates(&self, other: &Point, is_faster: IsFaster) -> bool {
        let (Some(task), Some(others_task)) = (self.task, other.task) else {
            return false;
        };
        let of = |p: &Point| {
            let e = p.errors;
            [e.false_negatives, e.touch_dropped, e.false_positives]
        };
        let (mine, others) = (of(self), of(other));
        let no_worse = mine.iter().zip(&others).all(|(a, b)| a <= b);
        no_worse
            && !is_faster(others_task, task)
            && (mine != others || is_faster(task, others_task))
    }
}

/// Whether a timed task is faster than another.
type IsFaster<'f> = &'f dyn Fn(usize, usize) -> bool;

pub(super) fn mark_dominated(points: &mut [Point], is_faster: IsFaster) {
    for i in 0..points.len() {
        let better = (0..points.len()).find(|&k| points[k].dominates(&points[i], is_faster));
        points[i].on_front = better.is_none() && points[i].task.is_some();
        points[i].dominated_by = better;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point with false negatives, dropped touches and false positives, and
    /// its place among the times.
    fn point(errors: [u64; 3], task: Option<usize>) -> Point {
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
            query_ns: None,
            query_ns_lower: None,
            query_ns_upper: None,
            ns_per_item: None,
            memory_bytes_per_item: None,
            dominated_by: None,
            on_front: false,
            task,
        }
    }

    /// Times in steps of ten are told apart, those within a step are not.
    fn is_faster(a: usize, b: usize) -> bool {
        a / 10 < b / 10
    }

    #[test]
    fn times_not_told_apart_are_equal_and_errors_are_not_traded() {
        let (none, some) = ([0, 0, 5], [0, 0, 9]);
        let cases = [
            // Equal errors: only what is faster dominates.
            (none, 10, none, 20, [true, false]),
            (none, 10, none, 11, [false, false]),
            // A tie in time is decided by the errors.
            (none, 10, some, 11, [true, false]),
            (none, 11, some, 10, [true, false]),
            // Fewer errors for more time: both stay.
            (none, 20, some, 10, [false, false]),
            // One error more, another one fewer: both stay, however fast.
            ([1, 0, 0], 10, [0, 0, 9], 50, [false, false]),
            ([0, 1, 0], 10, [0, 0, 9], 50, [false, false]),
            ([0, 1, 9], 50, [0, 1, 8], 10, [false, true]),
        ];
        for (errors_a, time_a, errors_b, time_b, wanted) in cases {
            let (a, b) = (point(errors_a, Some(time_a)), point(errors_b, Some(time_b)));
            let found = [a.dominates(&b, &is_faster), b.dominates(&a, &is_faster)];
            assert_eq!(found, wanted, "{:?}", (errors_a, time_a, errors_b, time_b));
        }
    }

    #[test]
    fn the_front_is_what_nothing_dominates() {
        let mut points = [
            point([0, 0, 9], Some(10)),
            point([0, 0, 9], Some(15)),
            point([0, 0, 9], Some(30)),
            point([0, 0, 0], Some(50)),
            point([0, 0, 1], Some(50)),
            // One that was never timed has no say and no place.
            point([0, 0, 0], None),
        ];
        mark_dominated(&mut points, &is_faster);
        assert_eq!(
            points.each_ref().map(|p| p.dominated_by),
            [None, None, Some(0), None, Some(3), None]
        );
        assert_eq!(
            points.each_ref().map(|p| p.on_front),
            [true, true, false, true, false, false]
        );
    }
}
