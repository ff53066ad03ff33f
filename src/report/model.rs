//! report.json: one run with everything needed to judge it.
//!
//! Readers ignore unknown fields; the JSON Schema in docs/ is generated from these types.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::measure::{Machine, ReportCell, Source, Status, Toolchain, TwinEntry};

/// Raised when a field changes its meaning or is removed.
pub const SCHEMA_VERSION: u32 = 2;

/// The contents of report.json: a run, what it ran on, and its cells.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Report {
    /// Raised when a field changes its meaning or is removed.
    pub schema_version: u32,
    /// The command and when it ran.
    pub run: RunInfo,
    /// The machine.
    pub machine: Machine,
    /// Compiler, flags and features of the program.
    pub toolchain: Toolchain,
    /// Version and commit of the program.
    pub source: Source,
    /// Differences between repeated measurements of the same thing.
    pub noise: Noise,
    /// Structures, by scene, path and test.
    pub cells: Vec<ReportCell>,
    /// Lower bounds, measured in the same rounds as the cells of their scene and path.
    ///
    /// Not structures and never ranked, therefore a separate list.
    #[serde(default)]
    pub bounds: Vec<ReportCell>,
}

impl Report {
    /// Warnings about cameras, each once.
    pub fn input_warnings(&self) -> BTreeSet<&String> {
        let cells = self.cells.iter();
        cells.flat_map(|cell| &cell.path.warnings).collect()
    }

    /// Returns true if an answer is wrong, or if no structure has answered.
    ///
    /// Exit code 1; without structures, none has to answer.
    pub fn has_failed(&self) -> bool {
        let any = |is: fn(Status) -> bool| self.cells.iter().any(|cell| is(cell.status));
        let tried = any(|status| status != Status::LeftOut);
        any(Status::is_failure) || tried && !any(|status| status == Status::Ok)
    }
}

/// A run as a whole.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct RunInfo {
    /// The start in UTC and four random digits.
    pub id: String,
    /// RFC 3339, UTC.
    pub started_at: String,
    /// Null while the run continues, and for a run that was stopped.
    pub finished_at: Option<String>,
    /// The command line, arguments separated by blanks.
    pub command: String,
    /// Seed of the order in which structures are measured.
    pub seed: u64,
    /// Name of the suite; null for scenes and paths chosen by hand.
    pub suite: Option<String>,
    /// The random generator of scenes and paths.
    pub generator: String,
    /// Planned number of processes that share the rounds.
    #[serde(default = "one")]
    pub processes: u32,
    /// Threads of a build, and of views that share threads.
    #[serde(default = "one")]
    pub threads: u32,
    /// `i/n` if only a shard of the plan was run.
    pub shard: Option<String>,
    /// Scenes and paths of the plan without any measurement.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<String>,
    /// Omitted scenes of the suite, and the reason; null for a whole suite.
    #[serde(default)]
    pub left_out: Option<String>,
}

fn one() -> u32 {
    1
}

/// Differences between repeated measurements of the same thing in this run.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Noise {
    /// Geometric mean of all twin ratios: 1 unless the order is unfair.
    pub aa_ratio: Option<f64>,
    /// The twin ratio of each scene and path.
    ///
    /// Checked for intervals that contain 1; nothing is derived from it.
    pub twins: Vec<TwinEntry>,
    /// Causes of noisy times that the run noticed, with advice.
    #[serde(default)]
    pub warnings: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `UPDATE_SCHEMA=1 cargo test schema` writes the file.
    #[test]
    fn the_committed_schema_is_the_one_of_the_code() {
        let schema = schemars::schema_for!(Report);
        let text = serde_json::to_string_pretty(&schema).unwrap() + "\n";
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/report.schema.json");
        if std::env::var_os("UPDATE_SCHEMA").is_some() {
            std::fs::write(file, &text).unwrap();
        }
        let committed = std::fs::read_to_string(file).unwrap_or_default();
        assert!(committed == text, "run: UPDATE_SCHEMA=1 cargo test schema");
    }
}
