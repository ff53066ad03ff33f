//! Stress suite: test vectors and generated extremes.
//!
//! Runs on every structure, at planes and at camera level. This file defines the rows of the
//! result.

pub mod extremes;
mod level_results;
mod replay;
mod vectors;

use serde::Serialize;

pub(crate) use level_results::ORACLE;
pub use replay::{Replay, replay};
pub use vectors::{Name, Vector, VectorBox, VectorCamera, VectorPoint, built_in, read_vectors};
pub(crate) use vectors::{Names, read_vectors_file};

named! {
    /// Numbers that count as exact.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Level {
        /// The f32 planes; the camera is not used.
        Planes = "planes",
        /// The camera's f64 numbers; planes are rounded.
        Camera = "camera",
    }
}

/// Outcome of a check.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// The declared outcome.
    Pass,
    /// Another outcome.
    Fail,
    /// Impossible, and refused as required.
    Refused,
}

impl Status {
    fn of(is_right: bool) -> Status {
        if is_right { Status::Pass } else { Status::Fail }
    }
}

/// Content of an answer: names of boxes, or words.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize)]
#[serde(untagged)]
pub enum Answer {
    /// A set of boxes.
    Names(Vec<String>),
    /// An outcome in words.
    Text(String),
}

impl Answer {
    fn of_names<'n>(names: impl IntoIterator<Item = &'n Name>) -> Answer {
        Answer::Names(names.into_iter().map(|name| name.0.clone()).collect())
    }
}

impl<T: Into<String>> From<T> for Answer {
    fn from(text: T) -> Answer {
        Answer::Text(text.into())
    }
}

impl std::fmt::Display for Answer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Answer::Names(names) => write!(f, "{{{}}}", names.join(", ")),
            Answer::Text(text) => f.write_str(text),
        }
    }
}

/// One check: a case on a structure with a culling test.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Row {
    /// Id of the case, with the name of the faulty box if there is one.
    pub id: String,
    /// Numbers that count as exact.
    pub level: Level,
    /// Name of the structure.
    pub structure: String,
    /// Name of the culling test.
    pub test: String,
    /// Outcome of the check.
    pub status: Status,
    /// Declared outcome.
    pub expected: Answer,
    /// Answer of the structure.
    pub got: Answer,
    /// Instruction set, if it is not the chosen one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kernel: Option<&'static str>,
}

/// Group of checks: a category of vectors, or a family of extremes.
#[derive(Clone, Default, Debug)]
pub struct Section {
    /// Category or family.
    pub name: String,
    /// Number of cases.
    pub cases: u64,
    /// Number of boxes in all cases.
    pub boxes: u64,
    /// Verdicts of the oracle (extremes at camera level).
    pub verdicts: extremes::VerdictCounts,
    /// Checks with their outcomes.
    pub rows: Vec<Row>,
}

impl Section {
    /// A section without checks.
    pub fn new(name: &str) -> Section {
        Section {
            name: name.to_owned(),
            ..Section::default()
        }
    }

    /// Number of checks with this status.
    pub fn count(&self, status: Status) -> usize {
        self.rows.iter().filter(|row| row.status == status).count()
    }
}
