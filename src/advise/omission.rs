//! Decisions of omissions: both sides as measured, and their judge.

use serde::Serialize;

use crate::statistics::{Estimate, flat};
use crate::verify::ErrorCount;

/// Two times are a tie unless the interval of their ratio lies beyond this.
///
/// The layout of memory and code alone makes differences of some percent, which the next
/// run on the same machine may reverse.
pub(super) const TIE: f64 = 1.05;

/// Returns true if the first of two times is the longer one, from their ratio.
///
/// `None` for a tie. Without an interval the value decides.
pub(super) fn is_longer(ratio: Estimate) -> Option<bool> {
    match (ratio.lower, ratio.upper) {
        (Some(lower), Some(upper)) => {
            (lower > TIE || upper < 1.0 / TIE).then_some(ratio.value > 1.0)
        }
        _ => Some(ratio.value > 1.0),
    }
}

/// Side of its threshold on which a statistic leaves out.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LeftOutIf {
    /// Not above the threshold.
    AtMost,
    /// Not below the threshold.
    AtLeast,
}

impl LeftOutIf {
    /// Returns `true` if a statistic is on this side of a threshold; `None` for NaN.
    pub(super) fn holds(self, [statistic, threshold]: [f64; 2]) -> Option<bool> {
        let order = statistic.partial_cmp(&threshold)?;
        Some(match self {
            LeftOutIf::AtMost => order.is_le(),
            LeftOutIf::AtLeast => order.is_ge(),
        })
    }
}

/// Decision about a feature.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Decision {
    /// It costs more than it saves.
    LeaveOut,
    /// It pays, or nothing shows that it does not.
    Keep,
    /// The scene or the path has nothing of the kind.
    NotApplicable,
}

impl Decision {
    pub(super) fn of(leave_out: bool) -> Decision {
        [Decision::Keep, Decision::LeaveOut][usize::from(leave_out)]
    }
}

/// The judge of a rule.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum By {
    /// Both sides answer the same: the clock, and the rule where that is a tie.
    Time,
    /// The sides differ in more than time: the rule.
    Rule,
}

/// Times and answers with a feature (kept) and without it (left out).
#[derive(Clone, Debug, Default, Serialize)]
pub struct Check {
    /// The structure or the work that was measured.
    pub on: String,
    /// Thread CPU time of a camera, mean over cameras and processes, ns.
    pub kept_ns: f64,
    /// The same without the feature.
    pub left_out_ns: f64,
    /// Time with it / time without: above 1, leaving out is faster.
    ///
    /// `None` without times.
    #[serde(flatten, serialize_with = "flat::ratio")]
    pub ratio: Option<Estimate>,
    /// `true` if every camera got the same set from both.
    pub same_answers: bool,
    /// `true` if both sets must be the same.
    pub same_expected: bool,
    /// False positives / visible items; null without a comparison with the truth.
    pub kept_excess: Option<f64>,
    /// The same without the feature.
    pub left_out_excess: Option<f64>,
    /// Visible items that were not returned, in millionths; null as above.
    pub kept_false_negative_ppm: Option<f64>,
    /// The same without the feature.
    pub left_out_false_negative_ppm: Option<f64>,
    /// Sums over the cameras that are compared with the truth.
    #[serde(skip)]
    pub(super) errors: Option<[ErrorCount; 2]>,
    /// Number of these cameras.
    #[serde(skip)]
    pub(super) judged: usize,
    /// `true` if leaving out is faster; `None` for a tie.
    #[serde(skip)]
    pub(super) pays: Option<bool>,
}

impl Check {
    /// Returns `true` if two sides that must answer the same did not.
    pub fn is_wrong(&self) -> bool {
        self.same_expected && !self.same_answers
    }

    /// Returns `true` if the side that leaves out misses more.
    pub(super) fn loses(&self) -> bool {
        self.errors
            .is_some_and(|[kept, left]| left.false_negatives > kept.false_negatives)
    }

    /// Additional false positives per query without the feature, mean.
    pub(super) fn more_false_positives(&self) -> Option<f64> {
        let [kept, left] = self.errors?;
        let more = left.false_positives as f64 - kept.false_positives as f64;
        (self.judged > 0).then(|| more / self.judged as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::super::rule::{Finding, Omission, some_rule};
    use super::*;

    /// A check with the given ratio and decision of the clock.
    fn check(ratio: f64, pays: Option<bool>) -> Check {
        Check {
            on: "wide".to_owned(),
            kept_ns: ratio * 100.0,
            left_out_ns: 100.0,
            ratio: Some(Estimate::exact(ratio)),
            same_answers: true,
            same_expected: true,
            judged: 10,
            pays,
            ..Check::default()
        }
    }

    fn settled(by: By, statistic: f64, check: Check) -> Omission {
        let rule = some_rule(LeftOutIf::AtMost, by);
        rule.omission(Finding::new(statistic, 1.0, ""), vec![check])
    }

    #[test]
    fn the_clock_decides_where_it_can_and_the_rule_where_it_cannot() {
        let (small, large) = (0.5, 2.0);
        let of = |statistic, pays| {
            let omission = settled(By::Time, statistic, check(1.2, pays));
            (omission.decision, omission.confirmed)
        };
        assert_eq!(of(small, Some(true)), (Decision::LeaveOut, Some(true)));
        assert_eq!(of(large, Some(true)), (Decision::LeaveOut, Some(false)));
        assert_eq!(of(small, Some(false)), (Decision::Keep, Some(false)));
        assert_eq!(of(large, Some(false)), (Decision::Keep, Some(true)));
        assert_eq!(of(small, None), (Decision::LeaveOut, None));
        assert_eq!(of(large, None), (Decision::Keep, None));
    }

    #[test]
    fn where_more_than_time_differs_the_rule_decides() {
        for (statistic, wanted) in [(0.5, Decision::LeaveOut), (2.0, Decision::Keep)] {
            for pays in [true, false] {
                let omission = settled(By::Rule, statistic, check(1.5, Some(pays)));
                assert_eq!((omission.decision, omission.confirmed), (wanted, None));
            }
        }
    }

    #[test]
    fn what_would_be_missed_is_kept_however_fast() {
        let count = |false_negatives| ErrorCount {
            false_negatives,
            ..ErrorCount::default()
        };
        let mut blind = check(6.0, Some(true));
        blind.errors = Some([count(1), count(2)]);
        let mut other = check(6.0, Some(true));
        other.same_answers = false;
        for check in [blind, other] {
            for by in [By::Time, By::Rule] {
                let omission = settled(by, 0.5, check.clone());
                assert_eq!(omission.decision, Decision::Keep, "{check:?}");
                assert!(omission.reason.contains("missed"));
            }
        }
        let mut equally_blind = check(6.0, Some(true));
        equally_blind.errors = Some([count(2), count(2)]);
        let omission = settled(By::Time, 0.5, equally_blind);
        assert_eq!(omission.decision, Decision::LeaveOut);
    }

    #[test]
    fn a_rule_without_a_statistic_does_not_apply() {
        let rule = some_rule(LeftOutIf::AtLeast, By::Time);
        let omission = rule.omission(Finding::none("for a reason".to_owned()), Vec::new());
        assert_eq!(omission.decision, Decision::NotApplicable);
        assert_eq!((omission.predicted, omission.saving), (None, None));
        // An infinite threshold cannot be written, but compares.
        let rule = some_rule(LeftOutIf::AtMost, By::Time);
        let omission = rule.omission(Finding::new(3.0, f64::INFINITY, ""), Vec::new());
        assert_eq!((omission.threshold, omission.predicted), (None, Some(true)));
    }
}
