//! What a report says of one structure on one scene, path and test.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{CellKey, GroupKey, Judged, Metric, PathInfo, SceneInfo, Status};
use crate::index::{Kind, Origin};

/// A structure, or a lower bound, on one scene, path and test.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct ReportCell {
    /// The scene.
    pub scene: SceneInfo,
    /// The path, with caches, planes and arithmetic.
    pub path: PathInfo,
    /// Label of the structure or name of the bound.
    pub structure: String,
    /// As the structure declares; null for a bound and in older reports.
    #[serde(default)]
    pub kind: Option<Kind>,
    /// Likewise.
    #[serde(default)]
    pub origin: Option<Origin>,
    /// Parameters of the structure, defaults included.
    pub params: Value,
    /// Name of the culling test.
    pub test: String,
    /// How building, counting and timing ended.
    pub status: Status,
    /// Why, where the status is not ok.
    pub reason: Option<String>,
    /// Fastest first; cells that no test tells apart share a rank. Null where
    /// there is no time.
    #[serde(default)]
    pub rank: Option<usize>,
    /// What the metrics of time were made from.
    #[serde(default)]
    pub times: CellTimes,
    /// By name; a metric that was not measured is not there.
    pub metrics: BTreeMap<String, Metric>,
    /// How the answers differ from the exact truth; null where nothing was
    /// answered.
    pub error: Option<Judged>,
    /// What was not measured of an ok cell, each with its reason.
    pub left_out: Vec<String>,
    /// Where the samples of this cell are; null without samples.
    pub samples_ref: Option<SamplesRef>,
}

/// The cell's rows in samples.csv: those that have its names.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct SamplesRef {
    /// Name of the file, beside the report.
    pub file: String,
    /// Number of the cell's rows.
    pub rows: u64,
}

/// What the times of a cell rest on.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct CellTimes {
    /// Processes that were timed; an interval needs three or more.
    pub processes: usize,
    /// Rounds in each process.
    pub rounds: usize,
    /// Cameras in the timed pass.
    pub cameras_timed: usize,
    /// Cameras whose answers were compared with the reference.
    pub cameras_checked: usize,
    /// Queries per clock reading.
    pub batch: usize,
    /// By metric: the time in each process, ns.
    pub by_process: BTreeMap<String, Vec<f64>>,
}

impl ReportCell {
    /// What the cell is found by in another report.
    pub fn key(&self) -> CellKey {
        CellKey {
            group: GroupKey::new(&self.scene.name, &self.path, &self.test),
            structure: self.structure.clone(),
        }
    }

    /// Whether the structure looks at every item, as far as it is known.
    pub fn is_scan(&self) -> bool {
        self.kind == Some(Kind::Scan)
    }

    /// A metric's value, if the cell has it.
    pub fn value(&self, metric: &str) -> Option<f64> {
        self.metrics.get(metric).map(|m| m.value)
    }
}
