//! Tasks of the rules and of the choice of a test.
//!
//! Every process adds them in the same order; one process runs and compares them; all time them
//! side by side. A check has both sides as measured; a tie shows in the interval of their ratio.

use std::ops::Deref;

use serde::Serialize;

use super::case::Case;
use crate::culling::CameraView;
use crate::index::DynIndex;
use crate::measure::{Answer, OverProcesses, QueryFn, TimedTask};
use crate::query::ItemId;
use crate::statistics::{Estimate, flat};
use crate::verify::ErrorCount;

/// Task that all others are compared with: the fastest tree, six planes, f32.
pub const BASE: usize = 0;

pub struct TaskList<'c> {
    pub case: &'c Case<'c>,
    /// Tasks, each with a flag that is true if it is compared with the truth.
    asks: Vec<(QueryFn<'c>, bool)>,
}

/// Answers of all tasks.
pub struct CheckedAnswers {
    /// Answers by task and camera.
    pub answers: Vec<Vec<Answer>>,
    /// Errors by camera with a truth, for tasks that are compared with it.
    pub(super) errors: Vec<Option<Vec<ErrorCount>>>,
}

impl<'c> TaskList<'c> {
    pub fn new(case: &'c Case<'c>) -> Self {
        let asks = Vec::new();
        let mut tasks = TaskList { case, asks };
        tasks.add_base();
        tasks
    }

    /// Adds the base task (again); returns its index.
    pub fn add_base(&mut self) -> usize {
        let case = self.case;
        self.index(&*case.index, &case.workload.views[..])
    }

    /// Adds a task; returns its index.
    ///
    /// `is_checked` is true if its answers are items in view, to be compared with the truth.
    pub fn enter(&mut self, is_checked: bool, ask: impl Fn(usize, &mut Vec<ItemId>) + 'c) -> usize {
        self.asks.push((Box::new(ask), is_checked));
        self.asks.len() - 1
    }

    /// Adds an index queried with the given views; returns the task's index.
    pub fn index(
        &mut self,
        index: impl Deref<Target = dyn DynIndex> + 'c,
        views: impl Deref<Target = [CameraView]> + 'c,
    ) -> usize {
        self.enter(true, move |camera, out| {
            index.query(views[camera].as_any(), out)
        })
    }

    /// Runs every task for every camera, and compares the answers with the truth.
    pub fn answered(&self) -> CheckedAnswers {
        let truths = self.case.truths();
        let mut out: Vec<ItemId> = Vec::new();
        let answered = self.asks.iter().map(|(ask, is_checked)| {
            let mut errors = is_checked.then(Vec::new);
            let mut truths = truths.iter().peekable();
            let answers = (0..self.case.workload.views.len()).map(|camera| {
                out.clear();
                ask(camera, &mut out);
                let truth = truths.next_if(|(judged, _)| *judged == camera);
                if let (Some(errors), Some((_, truth))) = (&mut errors, truth) {
                    errors.push(truth.errors(&self.case.workload.scene.items, &out));
                }
                Answer::of(&out)
            });
            let answers: Vec<Answer> = answers.collect();
            (answers, errors)
        });
        let (answers, errors) = answered.unzip();
        CheckedAnswers { answers, errors }
    }

    /// All tasks, to be timed.
    pub fn tasks(self, answers: &[Vec<Answer>]) -> Vec<TimedTask<'c>> {
        let asks = self.asks.into_iter().zip(answers);
        let tasks = asks.map(|((ask, _), answers)| {
            let counts = answers.iter().map(|answer| answer.count);
            TimedTask::new(counts.collect(), ask)
        });
        tasks.collect()
    }
}

impl CheckedAnswers {
    /// Errors of a task, summed over the cameras with a truth.
    pub fn errors(&self, task: usize) -> Option<ErrorCount> {
        Some(self.by_camera(task)?.iter().copied().sum())
    }

    /// False positives of a task per query, mean over the cameras with a truth.
    pub fn false_positives_per_query(&self, task: usize) -> Option<f64> {
        let judged = self.by_camera(task).filter(|own| !own.is_empty())?.len();
        Some(self.errors(task)?.false_positives as f64 / judged as f64)
    }

    /// Errors of a task, by camera with a truth.
    pub fn by_camera(&self, task: usize) -> Option<&[ErrorCount]> {
        self.errors[task].as_deref()
    }
}

/// Two sides of a check, by the indices of their tasks.
pub struct TaskPair {
    on: String,
    kept: usize,
    left_out: usize,
}

impl TaskPair {
    pub fn new(on: impl ToString, kept: usize, left_out: usize) -> TaskPair {
        let on = on.to_string();
        TaskPair { on, kept, left_out }
    }

    /// Measured check; NaN if a task has no time, after a panic.
    pub fn check(self, answered: &CheckedAnswers, times: &OverProcesses) -> PairResult {
        let side = |task| {
            let errors = answered.errors(task);
            TaskResult {
                ns: times.ns(task).map_or(f64::NAN, |found| found.value),
                excess: errors.and_then(|e| e.excess()),
                false_positives_per_query: answered.false_positives_per_query(task),
                false_negative_ppm: errors.and_then(|e| e.false_negative_ppm()),
            }
        };
        PairResult {
            kept: side(self.kept),
            left_out: side(self.left_out),
            ratio: times.ratio(self.kept, self.left_out),
            on: self.on,
            same_answers: answered.answers[self.kept] == answered.answers[self.left_out],
        }
    }
}

/// Least significant ratio: times tie unless their interval lies beyond it.
///
/// The layout of memory and code alone makes differences of some percent, which the next run on the
/// same machine may reverse.
pub(super) const MIN_RATIO: f64 = 1.05;

/// Returns `true` if a ratio shows its first time to be the longer one.
///
/// `None` for a tie. Without an interval the value decides.
pub(super) fn is_longer(ratio: Estimate) -> Option<bool> {
    let is_clear = |[lower, upper]: [f64; 2]| lower > MIN_RATIO || upper < 1.0 / MIN_RATIO;
    let is_significant = ratio.ends().is_none_or(is_clear);
    is_significant.then_some(ratio.value > 1.0)
}

/// Ratio of two costs, from the ratio of the times that they include.
///
/// Each side is `[time, cost]`.
pub(super) fn of_costs(times: Estimate, own: [f64; 2], other: [f64; 2]) -> Estimate {
    let ([own_ns, own], [other_ns, other]) = (own, other);
    let of = |ratio: f64| (ratio * other_ns + own - own_ns) / other;
    Estimate {
        value: own / other,
        lower: times.lower.map(of),
        upper: times.upper.map(of),
    }
}

/// Decision about a feature.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Decision {
    /// The feature costs more than it saves.
    LeaveOut,
    /// The feature pays, or nothing shows that it does not.
    Keep,
    /// The rule does not apply to the scene or the path.
    NotApplicable,
}

/// Criterion of a rule's decision.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Basis {
    /// Times decide if both sides give the same answers; the rule decides a tie.
    Time,
    /// The rule decides by a cost, as the sides differ in more than time.
    Rule,
    /// The rule decides by an error; a tie of costs does not matter.
    Error,
}

/// Times and answers with the work of a rule (kept) and without it (left out).
#[derive(Clone, Debug, Default, Serialize)]
pub struct PairResult {
    /// Structure or work that was measured.
    pub on: String,
    /// TaskResult with the work.
    pub kept: TaskResult,
    /// TaskResult without it.
    pub left_out: TaskResult,
    /// Time with it / time without: above 1, leaving out is faster.
    ///
    /// `None` without times.
    #[serde(flatten, serialize_with = "flat::ratio")]
    pub ratio: Option<Estimate>,
    /// `true` if both sides gave the same set for every camera.
    pub same_answers: bool,
}

/// One side of a check; errors are null if not compared with the truth.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TaskResult {
    /// Thread CPU time per camera, mean over cameras and processes, ns.
    pub ns: f64,
    /// False positives / visible items.
    pub excess: Option<f64>,
    /// Mean over the cameras with a truth.
    pub false_positives_per_query: Option<f64>,
    /// False negatives per million visible items.
    pub false_negative_ppm: Option<f64>,
}

impl PairResult {
    /// PairResult of times only, for two sides with the same answers.
    pub(super) fn of_times(on: String, ns: [f64; 2], ratio: Option<Estimate>) -> PairResult {
        let [kept, left_out] = ns.map(|ns| TaskResult {
            ns,
            ..TaskResult::default()
        });
        PairResult {
            on,
            kept,
            left_out,
            ratio,
            same_answers: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::rule::{Finding, Omission, some_rule};
    use super::*;

    /// A check with a ratio of times and the misses of each side.
    fn check(ratio: f64, missed: [f64; 2]) -> PairResult {
        let times = Some(Estimate::exact(ratio));
        let mut check = PairResult::of_times("wide".to_owned(), [ratio * 100.0, 100.0], times);
        check.kept.false_negative_ppm = Some(missed[0]);
        check.left_out.false_negative_ppm = Some(missed[1]);
        check
    }

    fn settled(by: Basis, statistic: f64, check: PairResult) -> Omission {
        some_rule(by).omission(Finding::new(statistic, 1.0, ""), Some(check))
    }

    #[test]
    fn the_clock_decides_where_it_can_and_the_rule_where_it_cannot() {
        let (small, large) = (0.5, 2.0);
        let of = |statistic, ratio: f64, ends| {
            let mut check = check(ratio, [0.0; 2]);
            check.ratio = Some(Estimate::within(ratio, ends));
            settled(Basis::Time, statistic, check).decision
        };
        let (slower, faster) = ([1.1, 1.3], [0.7, 0.9]);
        assert_eq!(of(small, 1.2, slower), Decision::LeaveOut);
        assert_eq!(of(large, 1.2, slower), Decision::LeaveOut);
        assert_eq!(of(small, 0.8, faster), Decision::Keep);
        assert_eq!(of(large, 0.8, faster), Decision::Keep);
        let tie = [0.9, 1.1];
        assert_eq!(of(small, 1.0, tie), Decision::LeaveOut);
        assert_eq!(of(large, 1.0, tie), Decision::Keep);
    }

    #[test]
    fn where_more_than_time_differs_the_rule_decides() {
        for (statistic, wanted) in [(0.5, Decision::LeaveOut), (2.0, Decision::Keep)] {
            for ratio in [1.5, 0.5] {
                let mut check = check(ratio, [0.0; 2]);
                check.same_answers = false;
                let omission = settled(Basis::Rule, statistic, check);
                assert!(omission.decision == wanted && !omission.is_wrong());
            }
        }
    }

    #[test]
    fn a_tie_in_costs_leaves_the_choice_but_not_where_an_error_decides() {
        let of = |by, statistic, missed: [f64; 2]| {
            let mut check = check(1.0, missed);
            check.ratio = Some(Estimate::within(1.0, [0.9, 1.1]));
            settled(by, statistic, check).answer()
        };
        for by in [Basis::Time, Basis::Rule] {
            assert_eq!([0.5, 2.0].map(|size| of(by, size, [0.0; 2])), ["either"; 2]);
            assert_eq!(of(by, 0.5, [1.0, 2.0]), "yes");
        }
        let by_error = [0.5, 2.0].map(|size| of(Basis::Error, size, [0.0; 2]));
        assert_eq!(by_error, ["no", "yes"]);
        // Work that is not needed saves time.
        let faster = settled(Basis::Error, 0.5, check(0.7, [0.0; 2]));
        assert_eq!(faster.answer(), "yes");
        let clear = settled(Basis::Rule, 2.0, check(1.5, [0.0; 2]));
        assert_eq!(clear.answer(), "yes");
    }

    #[test]
    fn what_would_be_missed_is_kept_however_fast() {
        let blind = check(6.0, [1.0, 2.0]);
        let mut other = check(6.0, [0.0; 2]);
        other.same_answers = false;
        for (by, check) in [
            (Basis::Time, &blind),
            (Basis::Rule, &blind),
            (Basis::Time, &other),
        ] {
            let omission = settled(by, 0.5, check.clone());
            assert_eq!(omission.decision, Decision::Keep, "{check:?}");
            assert!(omission.reason.contains("missed"));
        }
        let omission = settled(Basis::Time, 0.5, check(6.0, [2.0; 2]));
        assert_eq!(omission.decision, Decision::LeaveOut);
    }

    #[test]
    fn a_rule_without_a_statistic_does_not_apply() {
        let rule = some_rule(Basis::Time);
        let omission = rule.omission(Finding::none("for a reason"), None);
        assert_eq!(omission.decision, Decision::NotApplicable);
        assert_eq!((omission.statistic, omission.saving), (None, None));
        let omission = rule.omission(Finding::new(3.0, f64::INFINITY, ""), None);
        assert_eq!(omission.decision, Decision::LeaveOut);
    }
}
