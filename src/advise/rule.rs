//! A rule of omission: its declaration, both sides as tasks, and the omission that
//! follows from the facts.

use serde::Serialize;

use super::change::Change;
use super::choice::{StructureChoice, TestChoice};
use super::omission::{By, Check, Decision, LeftOutIf, is_longer};
use super::trials::{Answered, Sides, Trials};
use crate::funnel::FunnelReport;
use crate::measure::OverProcesses;
use crate::statistics::Estimate;

/// A row of the table of rules.
#[derive(Debug, Serialize)]
pub struct Rule {
    /// Name of the rule, `plane-masks`.
    #[serde(rename = "rule")]
    pub name: &'static str,
    /// The feature that is left out, in words.
    pub left_out: &'static str,
    /// Feature that is needed or not, as the terminal names it.
    #[serde(skip)]
    pub feature: &'static str,
    /// `true` if the feature is what leaves out, not what is left out.
    #[serde(skip)]
    pub is_saving: bool,
    /// Name and unit of the statistic.
    pub statistic_name: &'static str,
    /// Side of the threshold on which the rule leaves out.
    pub left_out_if: LeftOutIf,
    #[serde(skip)]
    pub(super) by: By,
    /// Enters both sides.
    #[serde(skip)]
    pub(super) prepare: for<'c> fn(&mut Trials<'c>) -> anyhow::Result<Draft>,
}

/// Reason for which a rule does not apply to this scene or these cameras.
///
/// It is no failure.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Unfit(pub String);

pub fn not_applicable(reason: impl ToString) -> anyhow::Error {
    Unfit(reason.to_string()).into()
}

/// The funnel of a few views, or the reason for which there is none.
pub type Funnel = Result<FunnelReport, String>;

/// Facts of a rule: choices, and its own measurements.
pub struct Facts<'f> {
    pub checks: Vec<Check>,
    /// Times of [`Draft::once`], ns.
    pub once_ns: [f64; 2],
    /// Time of the second of these / time of the first.
    pub once_ratio: Option<Estimate>,
    pub structure: &'f StructureChoice,
    pub test: &'f TestChoice,
    pub changes: &'f [Change],
    pub funnel: &'f Funnel,
}

impl Facts<'_> {
    /// Share of the time that leaving out saves in the first check.
    fn saving(&self) -> Option<f64> {
        let check = self.checks.first()?;
        Some(1.0 - 1.0 / check.ratio?.value).filter(|saving: &f64| saving.is_finite())
    }
}

/// Statistic, threshold and reason of a rule, from its facts.
#[derive(Clone, Default)]
pub struct Finding {
    pub reason: String,
    /// Statistic and threshold, unless the rule does not apply.
    pub compared: Option<[f64; 2]>,
    /// Share of the time that leaving out saves; of the first check if none is given.
    pub saving: Option<f64>,
    /// Time with and without, where more than the first check counts, ns.
    pub cost_ns: Option<[f64; 2]>,
    pub is_tie: Option<bool>,
    /// Assumption or error that decides, in at most 30 characters.
    pub note: String,
    /// Measured side that replaces the prediction.
    pub measured: Option<bool>,
    pub confirmed: Option<bool>,
    /// Decision that replaces that of rule and clock.
    pub decision: Option<Decision>,
    /// Measurement of a rule without tasks of its own.
    pub check: Option<Check>,
}

impl Finding {
    pub fn new(statistic: f64, threshold: f64, reason: impl Into<String>) -> Finding {
        Finding {
            reason: reason.into(),
            compared: Some([statistic, threshold]),
            ..Finding::default()
        }
    }

    /// A rule that does not apply, for a reason.
    pub fn none(reason: String) -> Finding {
        Finding {
            reason,
            ..Finding::default()
        }
    }

    pub fn noted(mut self, note: String) -> Finding {
        self.note = note;
        self
    }

    /// The finding with the cost of both sides, drawing or updates included.
    pub fn costing(mut self, [kept, left_out]: [f64; 2]) -> Finding {
        self.saving = Some(1.0 - left_out / kept).filter(|saving| saving.is_finite());
        self.cost_ns = Some([kept, left_out]);
        self
    }
}

/// A rule with its tasks entered, before its times.
pub struct Draft {
    /// The first check decides.
    pub sides: Vec<Sides>,
    /// Index of the first of two things that are timed once in every process.
    pub once: Option<usize>,
    conclude: Box<dyn FnOnce(&Facts) -> Finding>,
}

impl Draft {
    /// A finding that does not depend on times.
    pub fn new(sides: Vec<Sides>, finding: Finding) -> Draft {
        Draft::concluded(sides, move |_| finding)
    }

    /// A finding from the facts.
    pub fn concluded(
        sides: Vec<Sides>,
        conclude: impl FnOnce(&Facts) -> Finding + 'static,
    ) -> Draft {
        Draft {
            sides,
            once: None,
            conclude: Box::new(conclude),
        }
    }
}

impl Rule {
    /// The omission that follows from the choices and the times.
    pub fn settled(
        &'static self,
        draft: Draft,
        answered: &Answered,
        times: &OverProcesses,
        choices: Facts,
    ) -> Omission {
        let sides = draft.sides.into_iter();
        let once = draft.once;
        let once_ns = |n| once.map_or(f64::NAN, |first| times.once_ns(first + n));
        let facts = Facts {
            checks: sides.map(|sides| sides.check(answered, times)).collect(),
            once_ns: [0, 1].map(once_ns),
            once_ratio: once.and_then(|first| times.once_ratio(first + 1, first)),
            ..choices
        };
        let mut finding = (draft.conclude)(&facts);
        finding.saving = finding.saving.or(facts.saving());
        let mut checks = facts.checks;
        checks.extend(finding.check.take());
        self.omission(finding, checks)
    }

    /// Weighs statistic, clock and answers.
    pub fn omission(&'static self, finding: Finding, checks: Vec<Check>) -> Omission {
        let compared = finding.compared;
        let predicted = compared.and_then(|both| self.left_out_if.holds(both));
        let agrees = finding.measured.zip(predicted).map(|(a, b)| a == b);
        let [statistic, threshold] = [0, 1].map(|i| compared.map(|both| both[i]));
        let first = checks.first();
        let timed = first.map(|check| [check.kept_ns, check.left_out_ns]);
        let cost_ns = finding.cost_ns.or(timed);
        // Both costs are times of the first check and what follows from counts.
        let ratio = first.zip(cost_ns).and_then(|(check, [kept, left_out])| {
            let measured = check.ratio?;
            let fixed = kept - check.kept_ns;
            let of = |ratio: f64| (ratio * check.left_out_ns + fixed) / left_out;
            Some(Estimate {
                value: kept / left_out,
                lower: measured.lower.map(of),
                upper: measured.upper.map(of),
            })
        });
        let is_tie = ratio.is_some_and(|ratio| is_longer(ratio).is_none());
        let mut omission = Omission {
            rule: self,
            cost_ns,
            note: finding.note,
            is_chosen: finding.decision.is_some(),
            statistic: statistic.filter(|x| x.is_finite()),
            threshold: threshold.filter(|x| x.is_finite()),
            predicted,
            saving: finding.saving,
            decision: Decision::NotApplicable,
            confirmed: finding.confirmed.or(agrees),
            reason: finding.reason,
            checks,
            is_tie: finding.is_tie.unwrap_or(is_tie),
        };
        if let Some(leaves_out) = finding.measured.or(predicted) {
            omission.decide(leaves_out);
        }
        if let Some(chosen) = finding.decision {
            omission.decision = chosen;
            let foreseen = predicted.filter(|_| !omission.is_tie);
            omission.confirmed = foreseen.map(|leaves_out| Decision::of(leaves_out) == chosen);
        }
        omission
    }
}

/// A feature that may be left out, with the decision.
#[derive(Clone, Debug, Serialize)]
pub struct Omission {
    /// Its rule: names of feature and statistic.
    #[serde(flatten)]
    pub rule: &'static Rule,
    /// Time kept and left out, with all that follows from it, ns.
    #[serde(skip)]
    pub cost_ns: Option<[f64; 2]>,
    /// Assumption or error that decides, in a few words.
    #[serde(skip)]
    pub note: String,
    /// `true` if the choice of the structure or test decides, not the clock.
    #[serde(skip)]
    pub is_chosen: bool,
    /// Null where the rule does not apply to this scene.
    pub statistic: Option<f64>,
    /// Null without a statistic.
    pub threshold: Option<f64>,
    /// `true` if statistic and threshold leave out.
    pub predicted: Option<bool>,
    /// Share of the time that leaving it out saves; negative where it costs.
    pub saving: Option<f64>,
    /// Decision from statistic, clock and answers.
    pub decision: Decision,
    /// `true` if the measurement agrees with the rule.
    ///
    /// The clock, or for the axes beyond six planes the test that is taken. Null for a tie,
    /// and where neither decides.
    pub confirmed: Option<bool>,
    /// The decision in a sentence.
    pub reason: String,
    /// Measurements with and without the feature; the first one decides.
    pub checks: Vec<Check>,
    /// `true` if the processes do not tell the costs with and without it apart.
    #[serde(rename = "tie")]
    pub is_tie: bool,
}

impl Omission {
    /// Returns `true` if the feature is needed; `None` where the rule does not apply.
    pub fn is_needed(&self) -> Option<bool> {
        match self.decision {
            Decision::LeaveOut => Some(self.rule.is_saving),
            Decision::Keep => Some(!self.rule.is_saving),
            Decision::NotApplicable => None,
        }
    }

    /// Time with and without the feature, with all that follows from it, ns.
    pub fn sides_ns(&self) -> [f64; 2] {
        let mut sides = self.cost_ns.unwrap_or([f64::NAN; 2]);
        if self.rule.is_saving {
            sides.reverse();
        }
        sides
    }

    /// Decides by the clock or the rule; a side that misses more is never taken.
    pub(super) fn decide(&mut self, predicted: bool) {
        let mut leave_out = predicted;
        if let Some(check) = self.checks.first() {
            if self.rule.by == By::Time {
                self.confirmed = check.pays.map(|pays| pays == predicted);
                leave_out = check.pays.unwrap_or(predicted);
            }
            if check.loses() || check.is_wrong() {
                leave_out = false;
                self.reason += "; without it, something visible would be missed";
                self.note = "without, items are missed".to_owned();
            }
        }
        self.decision = Decision::of(leave_out);
    }
}

#[cfg(test)]
pub use tests::some_rule;

#[cfg(test)]
mod tests {
    use super::*;

    /// A rule that enters nothing.
    pub fn some_rule(left_out_if: LeftOutIf, by: By) -> &'static Rule {
        Box::leak(Box::new(Rule {
            name: "rule",
            left_out: "something",
            feature: "something",
            is_saving: false,
            statistic_name: "its size",
            left_out_if,
            by,
            prepare: |_| Ok(Draft::new(Vec::new(), Finding::default())),
        }))
    }
}
