//! The stiff and extreme suite: every test vector on every structure, at
//! planes and at camera level. It defines the rows that come out and what counts
//! as passed; what is typed and printed is the command line's.

pub mod extremes;
mod margin;
mod replay;
mod sheet;
mod vector;
mod vectors;

use serde::Serialize;

use crate::camera::Surroundings;
use crate::geometry::Aabb;
use glam::DVec3;

use margin::slack;
pub use replay::{Replay, replay};
pub use vector::{Names, Vector, VectorCamera, VectorPoint};
pub use vectors::{BUILT_IN, BUILT_IN_NAME, built_in, read_vectors, read_vectors_file};

/// What is taken to be exact: the planes, or the camera's numbers.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// The f32 planes are exact.
    Planes,
    /// The camera's f64 numbers are exact; planes are rounded.
    Camera,
}

/// How a check came out.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// As declared.
    Pass,
    /// Not as declared.
    Fail,
    /// Impossible, and refused as it must be.
    Refused,
}

impl Level {
    /// As JSON has it.
    pub fn name(self) -> &'static str {
        match self {
            Level::Planes => "planes",
            Level::Camera => "camera",
        }
    }
}

/// Names of boxes, or words.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
#[serde(untagged)]
pub enum Said {
    /// A set of boxes.
    Names(Vec<String>),
    /// An outcome in words.
    Text(String),
}

impl From<&Names> for Said {
    fn from(names: &Names) -> Said {
        Said::Names(names.iter().cloned().collect())
    }
}

impl From<String> for Said {
    fn from(text: String) -> Said {
        Said::Text(text)
    }
}

impl From<&str> for Said {
    fn from(text: &str) -> Said {
        Said::Text(text.to_owned())
    }
}

impl std::fmt::Display for Said {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Said::Names(names) => write!(f, "{{{}}}", names.join(", ")),
            Said::Text(text) => f.write_str(text),
        }
    }
}

/// One check: a case asked of a structure with a culling test.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Row {
    /// A case, or a case and the box that went wrong.
    pub id: String,
    /// What was taken to be exact.
    pub level: Level,
    /// Name of the structure.
    pub structure: String,
    /// Name of the culling test.
    pub test: String,
    /// How it came out.
    pub status: Status,
    /// What was declared.
    pub expected: Said,
    /// What the structure answered.
    pub got: Said,
}

/// Checks that belong together: a category of vectors, a family of extremes.
#[derive(Clone, Default, Debug)]
pub struct Section {
    /// Category or family.
    pub name: String,
    /// Number of cases.
    pub cases: u64,
    /// Boxes asked about.
    pub boxes: u64,
    /// What the oracle said of them (extremes at camera level).
    pub tally: extremes::Tally,
    /// Checks with their outcome.
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

/// What the planes must know of boxes about the scene origin zero.
fn surroundings(items: &[Aabb]) -> Surroundings {
    Surroundings {
        origin: DVec3::ZERO,
        reach: Aabb::union_of(items).reach(),
    }
}
