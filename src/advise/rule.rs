//! Rule of omission: its declaration, and both sides as tasks.
//!
//! Also contains the omission that follows from the rest of the advice.

use serde::Serialize;

use super::change::Change;
use super::choice::{MotionChoice, StructureChoice};
use super::tasks::{Basis, Decision, PairResult, TaskList, TaskPair, is_longer, of_costs};
use super::test_choice::TestChoice;
use crate::funnel::FunnelReport;
use crate::statistics::Estimate;

/// Row of the table of rules.
#[derive(Debug, Serialize)]
pub struct Rule {
    /// Name of the rule, such as `plane-masks`.
    #[serde(rename = "rule")]
    pub name: &'static str,
    /// Work that is needed or left out, in words.
    pub left_out: &'static str,
    /// Name and unit of the statistic.
    ///
    /// The rule leaves the work out if the statistic is at most the threshold.
    pub statistic_name: &'static str,
    #[serde(skip)]
    pub(super) by: Basis,
    /// Adds the tasks of both sides.
    #[serde(skip)]
    pub(super) enter: for<'c> fn(&mut TaskList<'c>) -> anyhow::Result<EnteredRule>,
}

/// Structure, test and features to leave out, with the evidence.
#[derive(Clone, Debug, Serialize)]
pub struct Advice {
    /// Cost of drawing an item that is not visible, ns.
    pub draw_ns: f64,
    /// Number of timed processes; an interval needs three or more.
    pub processes: usize,
    /// A/A check: time of a second copy of the base task / time of the first.
    ///
    /// The base task is the fastest tree; the interval should contain 1.
    pub twin: Option<Estimate>,
    /// Chosen structure.
    pub structure: StructureChoice,
    /// Chosen culling test.
    pub test: TestChoice,
    /// One omission per rule.
    pub omissions: Vec<Omission>,
    /// Update policy; null for a still scene.
    pub motion: Option<MotionChoice>,
    /// Numbers of items and shares from which another structure is faster.
    pub changes: Vec<Change>,
    /// Funnel of a few views, or the reason why there is none.
    #[serde(skip)]
    pub(super) funnel: Result<FunnelReport, String>,
}

impl Advice {
    /// Returns `true` if a structure or a side of a rule gave a wrong answer.
    pub fn found_wrong_answers(&self) -> bool {
        let mut structures = self.structure.rows.iter();
        structures.any(|row| row.status.is_failure())
            || self.omissions.iter().any(Omission::is_wrong)
    }
}

/// Statistic, threshold and reason of a rule, given the advice so far.
#[derive(Clone, Default)]
pub struct Finding {
    /// Statistic and threshold, unless the rule does not apply.
    pub compared: Option<[f64; 2]>,
    /// Decisive assumption or error, in a few words.
    ///
    /// Or the reason why the rule does not apply.
    pub reason: String,
    /// Times with and without, ns, if more than the check counts.
    pub cost_ns: Option<[f64; 2]>,
    pub is_tie: Option<bool>,
    /// Choice or measurement that overrides rule and clock.
    pub leaves_out: Option<bool>,
    /// Measurement of a rule without tasks of its own.
    pub check: Option<PairResult>,
}

impl Finding {
    pub fn new(statistic: f64, threshold: f64, reason: impl Into<String>) -> Finding {
        Finding {
            compared: Some([statistic, threshold]),
            ..Finding::none(reason)
        }
    }

    /// Finding of a rule that does not apply, with the reason.
    pub fn none(reason: impl Into<String>) -> Finding {
        Finding {
            reason: reason.into(),
            ..Finding::default()
        }
    }
}

/// Makes a finding from the advice so far and the rule's own measurement.
type Conclude = dyn FnOnce(&Advice, Option<&PairResult>) -> Finding;

/// A rule with its tasks added, before its times.
pub struct EnteredRule {
    pub sides: Option<TaskPair>,
    pub conclude: Box<Conclude>,
}

impl EnteredRule {
    /// EnteredRule whose finding does not depend on times.
    pub fn new(sides: impl Into<Option<TaskPair>>, finding: Finding) -> EnteredRule {
        EnteredRule::concluded(sides, move |_, _| finding)
    }

    /// Rule whose finding depends on the advice so far and on its measurement.
    pub fn concluded(
        sides: impl Into<Option<TaskPair>>,
        conclude: impl FnOnce(&Advice, Option<&PairResult>) -> Finding + 'static,
    ) -> EnteredRule {
        let (sides, conclude) = (sides.into(), Box::new(conclude));
        EnteredRule { sides, conclude }
    }
}

impl Rule {
    /// Combines statistic, clock and answers; keeps work without which items are lost.
    pub fn omission(&'static self, finding: Finding, check: Option<PairResult>) -> Omission {
        let check = check.or(finding.check);
        let timed = check.as_ref().map(|c| [c.kept.ns, c.left_out.ns]);
        let cost_ns = finding.compared.and(finding.cost_ns.or(timed));
        let both = check.as_ref().zip(cost_ns);
        let ratio = both.and_then(|(check, [kept, left_out])| {
            let sides = [[check.kept.ns, kept], [check.left_out.ns, left_out]];
            Some(of_costs(check.ratio?, sides[0], sides[1]))
        });
        let is_tie = ratio.is_some_and(|ratio| is_longer(ratio).is_none());
        let saving = cost_ns.map(|[kept, left_out]| 1.0 - left_out / kept);
        let [statistic, threshold] = [0, 1].map(|i| finding.compared.map(|both| both[i]));
        let mut omission = Omission {
            rule: self,
            statistic,
            threshold,
            saving: saving.filter(|saving| saving.is_finite()),
            decision: Decision::NotApplicable,
            is_tie: finding.is_tie.unwrap_or(is_tie),
            reason: finding.reason,
            cost_ns,
            check,
        };
        let check = omission.check.as_ref();
        let by_clock = check.filter(|_| self.by != Basis::Rule);
        let by_clock = by_clock.and_then(|check| is_longer(check.ratio?));
        // An error decides, unless work that it does not need saves time.
        let by_clock = by_clock.filter(|longer| self.by == Basis::Time || !longer);
        let is_lost = omission.loses_items();
        let compared = finding.compared;
        let order = compared.and_then(|[own, most]| own.partial_cmp(&most));
        if let Some(order) = order {
            let leaves_out = finding.leaves_out.or(by_clock).unwrap_or(order.is_le());
            let is_left_out = leaves_out && !is_lost;
            omission.decision = [Decision::Keep, Decision::LeaveOut][usize::from(is_left_out)];
            if is_lost {
                "without, items are missed".clone_into(&mut omission.reason);
            }
        }
        omission
    }
}

/// Work that may be left out, with the decision.
#[derive(Clone, Debug, Serialize)]
pub struct Omission {
    /// Rule, with the names of work and statistic.
    #[serde(flatten)]
    pub rule: &'static Rule,
    /// Null if the rule does not apply to this scene.
    pub statistic: Option<f64>,
    /// Null without a statistic.
    pub threshold: Option<f64>,
    /// Share of the time that the omission saves; negative if it costs.
    pub saving: Option<f64>,
    /// Decision from statistic, clock and answers.
    pub decision: Decision,
    /// `true` if the costs with and without it tie.
    #[serde(rename = "tie")]
    pub is_tie: bool,
    /// Decisive assumption or error, in a few words.
    pub reason: String,
    /// Total cost with the work and without it, ns.
    pub cost_ns: Option<[f64; 2]>,
    /// Measurement with and without the work; null without one.
    pub check: Option<PairResult>,
}

impl Omission {
    /// Returns yes, no, or either for a tie; empty if the rule does not apply.
    pub fn answer(&self) -> &'static str {
        let by_cost = self.rule.by != Basis::Error && !self.loses_items();
        match self.decision {
            Decision::NotApplicable => "",
            _ if self.is_tie && by_cost => "either",
            Decision::Keep => "yes",
            Decision::LeaveOut => "no",
        }
    }

    /// Returns `true` if items are missed without the work, or the sides differ.
    fn loses_items(&self) -> bool {
        let misses = |c: &PairResult| c.left_out.false_negative_ppm > c.kept.false_negative_ppm;
        self.check.as_ref().is_some_and(misses) || self.is_wrong()
    }

    /// Returns `true` if two sides that must agree did not.
    pub fn is_wrong(&self) -> bool {
        let check = self.check.as_ref().filter(|_| self.rule.by == Basis::Time);
        check.is_some_and(|check| !check.same_answers)
    }
}

#[cfg(test)]
pub use tests::some_rule;

#[cfg(test)]
mod tests {
    use super::*;

    /// A rule without tasks.
    pub fn some_rule(by: Basis) -> &'static Rule {
        Box::leak(Box::new(Rule {
            name: "rule",
            left_out: "something",
            statistic_name: "its size",
            by,
            enter: |_| Ok(EnteredRule::new(None, Finding::default())),
        }))
    }
}
