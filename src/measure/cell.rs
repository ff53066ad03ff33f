//! A cell of a report: one structure on one scene, path and culling test.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{CellKey, GroupKey, Judged, Metric, PathInfo, SceneInfo, Status, Verdict};
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
    /// Kind that the structure declares; null for a bound and in older reports.
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
    /// Basis of the metrics of time.
    #[serde(default)]
    pub times: CellTimes,
    /// Metrics by name; one that was not measured is absent.
    pub metrics: BTreeMap<String, Metric>,
    /// How the answers differ from the exact truth; null where nothing was
    /// answered.
    pub error: Option<Judged>,
    /// Metrics that were not measured of an ok cell, each with its reason.
    pub left_out: Vec<String>,
    /// Location of the samples of this cell; null without samples.
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

/// Basis of the times of a cell.
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
    /// Time in each process, ns, by metric.
    pub by_process: BTreeMap<String, Vec<f64>>,
}

impl ReportCell {
    /// The key by which another report is searched for the same cell.
    pub fn key(&self) -> CellKey {
        CellKey {
            group: GroupKey::new(&self.scene.name, &self.path, &self.test),
            structure: self.structure.clone(),
        }
    }

    /// Status with its reason.
    pub fn verdict(&self) -> Verdict {
        Verdict {
            status: self.status,
            reason: self.reason.clone(),
        }
    }

    /// Returns true if the structure is known to test every item.
    pub fn is_scan(&self) -> bool {
        self.kind == Some(Kind::Scan)
    }

    /// Name of the metric that structures are ranked by.
    ///
    /// Time of a query, or of a frame of a motion.
    pub fn ranked_by(&self) -> &'static str {
        match self.path.motion.is_empty() {
            true => "query_ns",
            false => "frame_ns",
        }
    }

    /// The metric of [`ReportCell::ranked_by`], if the cell has it.
    pub fn time(&self) -> Option<&Metric> {
        self.metrics.get(self.ranked_by())
    }

    /// A metric's value, if the cell has it.
    pub fn value(&self, metric: &str) -> Option<f64> {
        self.metrics.get(metric).map(|m| m.value)
    }
}
