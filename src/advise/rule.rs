//! What a rule of omission is: what it says of itself, and how it comes to a draft.

use super::AdviseError;
use super::case::Case;
use super::omission::{By, Decision, Draft, LeftOutIf, Omission};
use crate::index::BuildError;
use crate::input::InputError;

/// A row of the table of rules.
pub(super) struct Rule {
    pub name: &'static str,
    /// What is left out, in words.
    pub left_out: &'static str,
    /// What to do if it is left out, and if it is kept.
    pub advice: [&'static str; 2],
    pub statistic_name: &'static str,
    pub left_out_if: LeftOutIf,
    pub by: By,
    pub prepare: for<'c> fn(&'c Case<'c>, Omission) -> Result<Draft<'c>, Unfit>,
}

/// Why a rule has no draft of its own.
#[derive(Debug, thiserror::Error)]
pub(super) enum Unfit {
    /// It does not apply to this scene or these cameras.
    #[error("{0}")]
    NotApplicable(String),
    #[error(transparent)]
    Build(#[from] BuildError),
    #[error(transparent)]
    Input(#[from] InputError),
}

/// For what says why a rule does not apply.
pub(super) fn not_applicable(reason: impl ToString) -> Unfit {
    Unfit::NotApplicable(reason.to_string())
}

impl Rule {
    /// Nothing found out yet.
    pub fn omission(&self) -> Omission {
        Omission {
            rule: self.name,
            left_out: self.left_out,
            advice: self.advice,
            statistic_name: self.statistic_name,
            statistic: None,
            threshold: None,
            left_out_if: self.left_out_if,
            predicted: None,
            saving: None,
            decision: Decision::NotApplicable,
            confirmed: None,
            reason: String::new(),
            checks: Vec::new(),
            by: self.by,
        }
    }

    /// Both sides of the rule; neither where it does not apply.
    pub fn draft<'c>(&self, case: &'c Case<'c>) -> Result<Draft<'c>, AdviseError> {
        match (self.prepare)(case, self.omission()) {
            Ok(draft) => Ok(draft),
            Err(Unfit::NotApplicable(why)) => Ok(self.omission().because(why).draft(Vec::new())),
            Err(Unfit::Build(error)) => Err(error.into()),
            Err(Unfit::Input(error)) => Err(error.into()),
        }
    }
}

/// The omission of some rule.
#[cfg(test)]
pub(super) fn unsettled(left_out_if: LeftOutIf, by: By) -> Omission {
    let rule = Rule {
        name: "rule",
        left_out: "something",
        advice: ["", ""],
        statistic_name: "its size",
        left_out_if,
        by,
        prepare: |_, omission| Ok(omission.draft(Vec::new())),
    };
    rule.omission()
}
