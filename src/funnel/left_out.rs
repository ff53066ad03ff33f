//! Rows that a study leaves out, each with its reason.

use serde::{Serialize, Serializer};

use super::back_ends::MOST_EXACT_LINEDEFS;
use crate::scene::Dispute;

/// Why rows are left out.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Reason {
    /// A map whose sectors do not divide the plane.
    #[error(transparent)]
    Disputed(#[from] Dispute),
    /// A map that is too large to find out which sectors see each other.
    #[error("{0} linedefs; expected at most {MOST_EXACT_LINEDEFS}")]
    TooManyLinedefs(usize),
}

/// What is left out of a section of the report.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[non_exhaustive]
pub struct LeftOutRow {
    /// The section: `stages`.
    pub section: &'static str,
    /// The back end, or the stage of which all are left out.
    pub name: &'static str,
    /// Why.
    #[serde(serialize_with = "as_text")]
    pub reason: Reason,
}

impl LeftOutRow {
    /// A back end of a section.
    pub fn of(section: &'static str, name: &'static str, reason: impl Into<Reason>) -> Self {
        let reason = reason.into();
        LeftOutRow {
            section,
            name,
            reason,
        }
    }
}

fn as_text<S: Serializer>(reason: &Reason, out: S) -> Result<S::Ok, S::Error> {
    out.collect_str(reason)
}
