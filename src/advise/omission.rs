//! An omission: a rule with its statistic and threshold, both sides of it as
//! measured, and what follows. The statistics themselves are in `rules`.

use serde::Serialize;

use crate::measure::Ask;
use crate::statistics::Estimate;
use crate::verify::ErrorCount;

/// Something that may be left out, and whether it should be.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Omission {
    /// Name of the rule, `plane-masks`.
    pub rule: &'static str,
    /// What is left out, in words.
    pub left_out: &'static str,
    /// What follows if it is left out, and if it is kept.
    #[serde(skip)]
    pub(super) advice: [&'static str; 2],
    /// What the rule looks at, and its unit.
    pub statistic_name: &'static str,
    /// Null where the rule has nothing to say about this scene.
    pub statistic: Option<f64>,
    /// Where the rule changes its mind; null without a statistic.
    pub threshold: Option<f64>,
    /// On which side of the threshold the rule leaves out.
    pub left_out_if: LeftOutIf,
    /// What statistic and threshold say.
    pub predicted: Option<bool>,
    /// Share of the time that leaving it out saves; negative where it costs.
    pub saving: Option<f64>,
    /// What came of statistic, clock and answers.
    pub decision: Decision,
    /// Whether the clock, or for the axes beyond six planes the test that is
    /// taken, says what the rule said; null for a tie, and where neither has a
    /// say.
    pub confirmed: Option<bool>,
    /// The decision in a sentence.
    pub reason: String,
    /// With the rule forced off and on; the first one decides.
    pub checks: Vec<Check>,
    #[serde(skip)]
    pub(super) by: By,
}

/// On which side of its threshold the statistic is when the rule leaves out.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LeftOutIf {
    /// Not above the threshold.
    AtMost,
    /// Not below the threshold.
    AtLeast,
}

/// Whether to leave something out.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Decision {
    /// It costs more than it brings.
    LeaveOut,
    /// It pays off, or nothing shows that it does not.
    Keep,
    /// There is nothing of the kind here.
    NotApplicable,
}

impl Decision {
    /// As tables have it.
    pub fn name(self) -> &'static str {
        match self {
            Decision::LeaveOut => "leave out",
            Decision::Keep => "keep",
            Decision::NotApplicable => "not applicable",
        }
    }
}

/// What decides.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum By {
    /// Both sides answer the same: the clock, and the rule where that is a tie.
    Time,
    /// The rule: the sides differ in more than time.
    Rule,
}

/// One rule forced off (kept) and on (left out), on one structure.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Check {
    /// What was asked, or done.
    pub on: String,
    /// Mean over the cameras, thread CPU time, over the processes as in a run.
    pub kept_ns: f64,
    /// The same without it.
    pub left_out_ns: f64,
    /// Time with it / time without: above 1, leaving out is faster. With its 95 %
    /// interval over the processes; NaN where there is none.
    pub ratio: f64,
    /// Lower end of the interval.
    pub ratio_lower: f64,
    /// Upper end of the interval.
    pub ratio_upper: f64,
    /// Whether every camera got the same set from both.
    pub same_answers: bool,
    /// Whether it had to.
    pub same_expected: bool,
    /// False positives / visible items; null where the truth was not asked.
    pub kept_excess: Option<f64>,
    /// The same without it.
    pub left_out_excess: Option<f64>,
    /// Visible items that were not returned, in millionths; null as above.
    pub kept_false_negative_ppm: Option<f64>,
    /// The same without it.
    pub left_out_false_negative_ppm: Option<f64>,
    /// Sums over the judged cameras, for rules that weigh them.
    #[serde(skip)]
    pub(super) errors: Option<[ErrorCount; 2]>,
    #[serde(skip)]
    pub(super) judged: usize,
    /// Whether leaving out is faster; `None` if the processes do not tell the two
    /// sides apart.
    #[serde(skip)]
    pub(super) pays: Option<bool>,
}

impl Check {
    /// Whether two sides that must answer the same did not.
    pub fn is_wrong(&self) -> bool {
        self.same_expected && !self.same_answers
    }

    /// Whether the side that leaves out misses more.
    fn loses(&self) -> bool {
        self.errors
            .is_some_and(|[kept, left]| left.false_negatives > kept.false_negatives)
    }

    /// False positives a query more when it is left out, mean.
    pub(super) fn more_false_positives(&self) -> Option<f64> {
        let [kept, left] = self.errors?;
        let more = left.false_positives as f64 - kept.false_positives as f64;
        (self.judged > 0).then(|| more / self.judged as f64)
    }
}

/// A way to answer every camera of the path.
pub(super) enum Way<'c> {
    /// As the advice would do it otherwise: the fastest tree, six planes, f32.
    Base,
    Other(Ask<'c>),
}

/// A rule forced off and on.
pub(super) struct Forced<'c> {
    pub on: String,
    pub kept: Way<'c>,
    pub left_out: Way<'c>,
    /// Whether both must answer the same.
    pub same: bool,
    /// Whether answers are about the scene's own items, so that its truth
    /// judges them.
    pub judged: bool,
}

/// Times of a rule beside its checks, over the processes.
#[derive(Default)]
pub(super) struct Aside {
    /// Of [`Draft::pairs`]: time of the first / time of the second.
    pub ratios: Vec<f64>,
    /// Of [`Draft::once_ns`].
    pub once_ns: Vec<f64>,
    /// Time of the second of these / time of the first, where there are two.
    pub once_ratio: Option<Estimate>,
}

/// Completes an omission from its checks and from what was timed beside them.
pub(super) type Finish = Box<dyn FnOnce(&mut Omission, &Aside)>;

/// An omission before the clock.
pub(super) struct Draft<'c> {
    pub omission: Omission,
    pub forced: Vec<Forced<'c>>,
    /// Further ways that are compared, two by two.
    pub pairs: Vec<[Way<'c>; 2]>,
    /// CPU time of what is done once: taken by every process while it prepares.
    pub once_ns: Vec<f64>,
    pub finish: Option<Finish>,
}

impl Omission {
    /// What to do, in words; `None` where the rule does not apply.
    pub fn advice(&self) -> Option<&'static str> {
        match self.decision {
            Decision::LeaveOut => Some(self.advice[0]),
            Decision::Keep => Some(self.advice[1]),
            Decision::NotApplicable => None,
        }
    }

    pub(super) fn because(mut self, reason: impl Into<String>) -> Self {
        self.reason = reason.into();
        self
    }

    pub(super) fn compares(mut self, statistic: f64, threshold: f64) -> Self {
        self.weigh(statistic, threshold);
        self
    }

    pub(super) fn weigh(&mut self, statistic: f64, threshold: f64) {
        self.statistic = statistic.is_finite().then_some(statistic);
        self.threshold = threshold.is_finite().then_some(threshold);
        self.predicted =
            (!statistic.is_nan() && !threshold.is_nan()).then_some(match self.left_out_if {
                LeftOutIf::AtMost => statistic <= threshold,
                LeftOutIf::AtLeast => statistic >= threshold,
            });
    }

    pub(super) fn draft<'c>(self, forced: Vec<Forced<'c>>) -> Draft<'c> {
        Draft {
            omission: self,
            forced,
            pairs: Vec::new(),
            once_ns: Vec::new(),
            finish: None,
        }
    }
}

impl Draft<'_> {
    pub(super) fn finished_by(
        mut self,
        finish: impl FnOnce(&mut Omission, &Aside) + 'static,
    ) -> Self {
        self.finish = Some(Box::new(finish));
        self
    }
}

impl Omission {
    /// What follows from the rule and from what was measured.
    pub(super) fn settled(
        mut self,
        checks: Vec<Check>,
        aside: &Aside,
        finish: Option<Finish>,
    ) -> Omission {
        self.checks = checks;
        if let Some(check) = self.checks.first() {
            self.saving = Some(1.0 - 1.0 / check.ratio).filter(|saving| saving.is_finite());
        }
        if let Some(finish) = finish {
            finish(&mut self, aside);
        }
        self.decide();
        self
    }

    fn decide(&mut self) {
        let Some(predicted) = self.predicted else {
            return;
        };
        let mut leave_out = predicted;
        if let Some(check) = self.checks.first() {
            if self.by == By::Time {
                self.confirmed = check.pays.map(|pays| pays == predicted);
                leave_out = check.pays.unwrap_or(predicted);
            }
            if check.loses() || check.is_wrong() {
                leave_out = false;
                self.reason
                    .push_str("; left out, something that is seen would be missed");
            }
        }
        self.decision = match leave_out {
            true => Decision::LeaveOut,
            false => Decision::Keep,
        };
    }
}

/// A check with such a ratio, and what the clock says of leaving out.
#[cfg(test)]
pub(super) fn check(ratio: f64, pays: Option<bool>) -> Check {
    Check {
        on: "wide".to_owned(),
        kept_ns: ratio * 100.0,
        left_out_ns: 100.0,
        ratio,
        ratio_lower: f64::NAN,
        ratio_upper: f64::NAN,
        same_answers: true,
        same_expected: true,
        kept_excess: None,
        left_out_excess: None,
        kept_false_negative_ppm: None,
        left_out_false_negative_ppm: None,
        errors: None,
        judged: 10,
        pays,
    }
}

#[cfg(test)]
mod tests {
    use super::super::rule::unsettled;
    use super::*;

    fn settled(by: By, statistic: f64, check: Check) -> Omission {
        let rule = unsettled(LeftOutIf::AtMost, by);
        let rule = rule.compares(statistic, 1.0);
        rule.settled(vec![check], &Aside::default(), None)
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
    fn a_rule_without_a_statistic_says_nothing() {
        let rule = unsettled(LeftOutIf::AtLeast, By::Time);
        let omission = rule.settled(Vec::new(), &Aside::default(), None);
        assert_eq!(omission.decision, Decision::NotApplicable);
        assert_eq!((omission.predicted, omission.saving), (None, None));
        // An infinite threshold is none that can be written, but compares.
        let rule = unsettled(LeftOutIf::AtMost, By::Time);
        let omission = rule.compares(3.0, f64::INFINITY);
        assert_eq!((omission.threshold, omission.predicted), (None, Some(true)));
    }

    #[test]
    fn the_saving_is_the_share_of_the_time() {
        let omission = settled(By::Time, 0.5, check(4.0, Some(true)));
        assert_eq!(omission.saving, Some(0.75));
    }
}
