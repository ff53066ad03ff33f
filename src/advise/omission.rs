//! An omission: a rule with its statistic and threshold, both sides of it as
//! measured, and what follows. How a rule comes to its statistic is its own
//! business, in `rules`.

use serde::Serialize;

use crate::measure::Ask;
use crate::verify::ErrorCount;

/// Something that may be left out, and whether it should be.
#[derive(Clone, Debug, Serialize)]
pub struct Omission {
    pub rule: &'static str,
    /// What is left out, in words.
    pub left_out: &'static str,
    /// What the rule looks at, and its unit.
    pub statistic_name: &'static str,
    /// Null where the rule has nothing to say about this scene.
    pub statistic: Option<f64>,
    pub threshold: Option<f64>,
    pub left_out_if: LeftOutIf,
    /// What statistic and threshold say.
    pub predicted: Option<bool>,
    /// Share of the time that leaving it out saves; negative where it costs.
    pub saving: Option<f64>,
    pub decision: Decision,
    /// Whether the clock, or for the axes beyond six planes the test that is
    /// taken, says what the rule said; null for a tie, and where neither has a
    /// say.
    pub confirmed: Option<bool>,
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
    AtMost,
    AtLeast,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Decision {
    LeaveOut,
    Keep,
    /// There is nothing of the kind here.
    NotApplicable,
}

impl Decision {
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
pub struct Check {
    /// What was asked, or done.
    pub on: String,
    /// Mean over the cameras, median over the rounds, thread CPU time.
    pub kept_ns: f64,
    pub left_out_ns: f64,
    /// Time with it / time without, paired by round: above 1, leaving out is
    /// faster. Interval of 95 %.
    pub ratio: f64,
    pub ratio_lower: f64,
    pub ratio_upper: f64,
    /// Whether every camera got the same set from both.
    pub same_answers: bool,
    /// Whether it had to.
    pub same_expected: bool,
    /// False positives / visible items; null where the truth was not asked.
    pub kept_excess: Option<f64>,
    pub left_out_excess: Option<f64>,
    pub kept_false_negative_ppm: Option<f64>,
    pub left_out_false_negative_ppm: Option<f64>,
    /// Sums over the judged cameras, for rules that weigh them.
    #[serde(skip)]
    pub(super) errors: Option<[ErrorCount; 2]>,
    #[serde(skip)]
    pub(super) judged: usize,
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

    /// What the clock says of leaving out, beyond the noise: `None` is a tie.
    fn pays(&self, floor: f64) -> Option<bool> {
        if self.ratio_lower > 1.0 + floor {
            return Some(true);
        }
        (self.ratio_upper * (1.0 + floor) < 1.0).then_some(false)
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

/// Completes an omission from its checks.
pub(super) type Finish<'c> = Box<dyn FnOnce(&mut Omission) + 'c>;

/// An omission before the clock.
pub(super) struct Draft<'c> {
    pub omission: Omission,
    /// Taken when it is entered into the trials.
    pub forced: Vec<Forced<'c>>,
    pub finish: Option<Finish<'c>>,
}

impl Omission {
    pub(super) fn new(
        rule: &'static str,
        left_out: &'static str,
        statistic_name: &'static str,
        left_out_if: LeftOutIf,
        by: By,
    ) -> Omission {
        Omission {
            rule,
            left_out,
            statistic_name,
            statistic: None,
            threshold: None,
            left_out_if,
            predicted: None,
            saving: None,
            decision: Decision::NotApplicable,
            confirmed: None,
            reason: String::new(),
            checks: Vec::new(),
            by,
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
            finish: None,
        }
    }
}

impl<'c> Draft<'c> {
    pub(super) fn finished_by(mut self, finish: impl FnOnce(&mut Omission) + 'c) -> Self {
        self.finish = Some(Box::new(finish));
        self
    }

    /// What follows from the rule and from what was measured.
    pub(super) fn settled(self, checks: Vec<Check>, floor: f64) -> Omission {
        let mut omission = self.omission;
        omission.checks = checks;
        if let Some(check) = omission.checks.first() {
            omission.saving = Some(1.0 - 1.0 / check.ratio).filter(|saving| saving.is_finite());
        }
        if let Some(finish) = self.finish {
            finish(&mut omission);
        }
        omission.decide(floor);
        omission
    }
}

impl Omission {
    fn decide(&mut self, floor: f64) {
        let Some(predicted) = self.predicted else {
            return;
        };
        let mut leave_out = predicted;
        if let Some(check) = self.checks.first() {
            let pays = check.pays(floor);
            if self.by == By::Time {
                self.confirmed = pays.map(|pays| pays == predicted);
                leave_out = pays.unwrap_or(predicted);
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

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Ten queries' worth of a check with such an interval of its ratio.
    pub fn check([ratio_lower, ratio, ratio_upper]: [f64; 3]) -> Check {
        Check {
            on: "wide".to_owned(),
            kept_ns: ratio * 100.0,
            left_out_ns: 100.0,
            ratio,
            ratio_lower,
            ratio_upper,
            same_answers: true,
            same_expected: true,
            kept_excess: None,
            left_out_excess: None,
            kept_false_negative_ppm: None,
            left_out_false_negative_ppm: None,
            errors: None,
            judged: 10,
        }
    }

    fn settled(by: By, statistic: f64, check: Check) -> Omission {
        let rule = Omission::new("rule", "something", "its size", LeftOutIf::AtMost, by);
        let draft = rule.compares(statistic, 1.0).draft(Vec::new());
        draft.settled(vec![check], 0.1)
    }

    #[test]
    fn the_clock_decides_beyond_the_noise_and_the_rule_within() {
        let (faster, slower) = ([1.2, 1.5, 1.8], [0.5, 0.6, 0.8]);
        let ties = [[1.05, 1.2, 1.4], [0.7, 0.9, 0.95], [0.8, 1.0, 1.3]];
        let (small, large) = (0.5, 2.0);
        let of = |statistic, interval| {
            let omission = settled(By::Time, statistic, check(interval));
            (omission.decision, omission.confirmed)
        };
        assert_eq!(of(small, faster), (Decision::LeaveOut, Some(true)));
        assert_eq!(of(large, faster), (Decision::LeaveOut, Some(false)));
        assert_eq!(of(small, slower), (Decision::Keep, Some(false)));
        assert_eq!(of(large, slower), (Decision::Keep, Some(true)));
        for tie in ties {
            assert_eq!(of(small, tie), (Decision::LeaveOut, None), "{tie:?}");
            assert_eq!(of(large, tie), (Decision::Keep, None), "{tie:?}");
        }
    }

    #[test]
    fn where_more_than_time_differs_the_rule_decides() {
        for (statistic, wanted) in [(0.5, Decision::LeaveOut), (2.0, Decision::Keep)] {
            for interval in [[1.2, 1.5, 1.8], [0.5, 0.6, 0.8]] {
                let omission = settled(By::Rule, statistic, check(interval));
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
        let mut blind = check([5.0, 6.0, 7.0]);
        blind.errors = Some([count(1), count(2)]);
        let mut other = check([5.0, 6.0, 7.0]);
        other.same_answers = false;
        for check in [blind, other] {
            for by in [By::Time, By::Rule] {
                let omission = settled(by, 0.5, check.clone());
                assert_eq!(omission.decision, Decision::Keep, "{check:?}");
                assert!(omission.reason.contains("missed"));
            }
        }
        let mut equally_blind = check([5.0, 6.0, 7.0]);
        equally_blind.errors = Some([count(2), count(2)]);
        let omission = settled(By::Time, 0.5, equally_blind);
        assert_eq!(omission.decision, Decision::LeaveOut);
    }

    #[test]
    fn a_rule_without_a_statistic_says_nothing() {
        let rule = Omission::new("rule", "x", "y", LeftOutIf::AtLeast, By::Time);
        let omission = rule.draft(Vec::new()).settled(Vec::new(), 0.0);
        assert_eq!(omission.decision, Decision::NotApplicable);
        assert_eq!((omission.predicted, omission.saving), (None, None));
        // An infinite threshold is none that can be written, but compares.
        let rule = Omission::new("rule", "x", "y", LeftOutIf::AtMost, By::Time);
        let omission = rule.compares(3.0, f64::INFINITY);
        assert_eq!((omission.threshold, omission.predicted), (None, Some(true)));
    }

    #[test]
    fn the_saving_is_the_share_of_the_time() {
        let omission = settled(By::Time, 0.5, check([3.9, 4.0, 4.1]));
        assert_eq!(omission.saving, Some(0.75));
    }
}
