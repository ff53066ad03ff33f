//! A cell of a report: one structure on one scene, path and culling test.
//!
//! Scene and queries have digests, so that two reports can be checked for the same queries.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::key::{CellKey, GroupKey};
use super::{Judged, Status, Workload};
use crate::culling::Culling;
use crate::index::{Kind, Origin};
use crate::path::{self, CameraFacts};
use crate::scene::{self, Scene};
use crate::statistics::Estimate;

/// A structure, or a lower bound, on one scene, path and test.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ReportCell {
    /// The scene.
    pub scene: SceneInfo,
    /// The path, with caches, planes and arithmetic.
    pub path: PathInfo,
    /// Label of the structure or name of the bound.
    pub structure: String,
    /// Kind that the structure declares; null for a bound.
    pub kind: Option<Kind>,
    /// Origin that the structure declares; null for a bound.
    pub origin: Option<Origin>,
    /// Parameters of the structure, defaults included.
    pub params: Value,
    /// Name of the culling test.
    pub test: String,
    /// Status of building, counting and timing.
    pub status: Status,
    /// Reason, unless the status is ok.
    pub reason: Option<String>,
    /// Rank by time, 1 for the fastest; null without a time.
    ///
    /// Cells without a significant difference share a rank.
    pub rank: Option<usize>,
    /// Basis of the metrics of time.
    #[serde(default)]
    pub times: CellTimes,
    /// Metrics by name; one that was not measured is absent.
    pub metrics: BTreeMap<String, Metric>,
    /// Errors of the answers against the exact truth; null without answers.
    pub error: Option<Judged>,
    /// Digest of the ids returned to all frustum queries; absent if wrong.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub answers: Option<String>,
    /// Metrics that were not measured in an ok cell, each with its reason.
    pub left_out: Vec<String>,
    /// Location of the samples of this cell; null without samples.
    pub samples_ref: Option<SamplesRef>,
    /// Choice of an adaptive structure and the rejected options; else absent.
    ///
    /// Also the frames in which a structure was rebuilt because it could not refit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chose: Option<String>,
}

/// The cell's rows in samples.csv: those with its names.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SamplesRef {
    /// Name of the file, beside the report.
    pub file: String,
    /// Number of the cell's rows.
    pub rows: u64,
}

/// Basis of the times of a cell.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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
    /// Time in each process by metric, in the metric's unit.
    pub by_process: BTreeMap<String, Vec<f64>>,
}

/// A value, with its 95 % interval if it was sampled.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Metric {
    /// The mean, count or ratio.
    pub value: f64,
    /// Lower end of the interval; `None` without one.
    pub lower: Option<f64>,
    /// Upper end of the interval; `None` without one.
    pub upper: Option<f64>,
    /// Unit, as in `cullbench list metrics`.
    pub unit: String,
}

impl Metric {
    /// A metric with its unit.
    pub fn of(found: Estimate, unit: &str) -> Metric {
        Metric {
            value: found.value,
            lower: found.lower,
            upper: found.upper,
            unit: unit.to_owned(),
        }
    }

    /// Value and interval.
    pub fn estimate(&self) -> Estimate {
        Estimate {
            value: self.value,
            lower: self.lower,
            upper: self.upper,
        }
    }
}

/// A structure that was measured twice, with the ratio of its two times.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct TwinEntry {
    /// Name of the scene.
    pub scene: String,
    /// Name of the path.
    pub path: String,
    /// File name or spec of the motion; absent for a still scene.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub motion: String,
    /// "warm" or "cold".
    pub cache: String,
    /// Label of the structure.
    pub structure: String,
    /// Name of the culling test.
    pub test: String,
    /// Time of the second entry / time of the first.
    pub ratio: f64,
    /// Lower end of the ratio's 95 % interval.
    pub lower: Option<f64>,
    /// Upper end of the ratio's 95 % interval.
    pub upper: Option<f64>,
}

impl TwinEntry {
    /// True if the interval contains 1; `None` without one.
    pub fn holds_one(&self) -> Option<bool> {
        Some(self.lower? <= 1.0 && 1.0 <= self.upper?)
    }
}

impl ReportCell {
    /// The key that identifies this cell in another report.
    pub fn key(&self) -> CellKey {
        CellKey {
            group: GroupKey::new(&self.scene.name, &self.path, &self.test),
            structure: self.structure.clone(),
        }
    }

    /// Returns true if the structure is known to test every item.
    pub fn is_scan(&self) -> bool {
        self.kind == Some(Kind::Scan)
    }

    /// Returns true for a scan, and for an adaptive structure that tested most items.
    pub fn scans(&self) -> bool {
        let tested = self.value("items_tested").filter(|_| self.chose.is_some());
        let half = 0.5 * self.scene.total_count as f64;
        self.is_scan() || tested.is_some_and(|tested| tested > half)
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

    /// ln of a time in each process, ns, by its metric; empty without one.
    pub fn ln_ns(&self, metric: &str) -> Vec<f64> {
        let own = self.times.by_process.get(metric).into_iter().flatten();
        own.map(|ns| ns.ln()).collect()
    }

    /// A metric's value, if the cell has it.
    pub fn value(&self, metric: &str) -> Option<f64> {
        self.metrics.get(metric).map(|m| m.value)
    }
}

/// The scene of a cell.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SceneInfo {
    /// File name or spec.
    pub name: String,
    /// Number of items.
    pub total_count: usize,
    /// Number of regions for region search.
    pub region_count: usize,
    /// Axis that points up, y or z; empty in older reports.
    #[serde(default)]
    pub up: String,
    /// Unit of coordinates; null if the file does not state it.
    pub unit: Option<String>,
    /// Scene-local origin in world coordinates.
    pub origin: [f64; 3],
    /// Smallest corner of all items, in world coordinates.
    pub bounds_min: [f64; 3],
    /// Largest corner of all items, in world coordinates.
    pub bounds_max: [f64; 3],
    /// Number of items left out because they could not be read.
    pub skipped_items: usize,
    /// SHA-256 over origin and item bounds.
    pub digest: String,
}

impl SceneInfo {
    /// A scene that could not be loaded.
    pub fn unknown(name: &str) -> SceneInfo {
        SceneInfo {
            name: name.to_owned(),
            ..SceneInfo::default()
        }
    }

    /// The facts of a loaded scene.
    pub fn of(scene: &Scene) -> SceneInfo {
        let bounds = scene.world_bounds();
        SceneInfo {
            name: scene.name.clone(),
            total_count: scene.items.len(),
            region_count: scene.regions.boxes(&scene.items).len(),
            up: scene.up.name().to_owned(),
            unit: scene.unit.map(str::to_owned),
            origin: scene.origin.to_array(),
            bounds_min: bounds.min.to_array(),
            bounds_max: bounds.max.to_array(),
            skipped_items: scene.skipped_items,
            digest: scene.digest(),
        }
    }
}

/// The queries of a cell.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct PathInfo {
    /// File name or spec.
    pub name: String,
    /// Number of cameras, timed or not.
    pub camera_count: usize,
    /// "warm" or "cold".
    pub cache: String,
    /// Name of the method that derives the planes.
    pub planes: String,
    /// Factor c of the planes' epsilon.
    pub epsilon: f64,
    /// Arithmetic of the culling test.
    pub arithmetic: String,
    /// SHA-256 over the cameras' frames and lenses; null in older reports.
    pub digest: Option<String>,
    /// Lenses as used, and how matrices were read; null in older reports.
    pub lens: Option<CameraFacts>,
    /// Warnings about the cameras, one line each.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// File name or spec of the motion; absent for a still scene.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub motion: String,
    /// Number of queries per frame of the motion; absent for a still scene.
    #[serde(default, skip_serializing_if = "is_default")]
    pub views_per_frame: usize,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl PathInfo {
    /// A path that could not be loaded.
    pub fn unknown(key: &GroupKey) -> PathInfo {
        PathInfo {
            name: key.path.clone(),
            cache: key.cache.clone(),
            planes: key.planes.clone(),
            epsilon: key.epsilon,
            arithmetic: key.arithmetic.clone(),
            motion: key.motion.clone(),
            ..PathInfo::default()
        }
    }

    /// The facts of a workload.
    pub fn of(workload: &Workload, cold: bool) -> PathInfo {
        let (path, motion) = (&workload.path, workload.motion.as_ref());
        let name = motion.map_or("", |motion| &motion.name);
        let key = GroupKey::of(&workload.scene.name, path, cold, &workload.culling, name);
        let views_per_frame = motion.map_or(0, |_| workload.views_per_frame);
        PathInfo {
            camera_count: workload.cameras.len(),
            digest: Some(workload.digest()),
            views_per_frame,
            lens: Some(CameraFacts::of(&workload.cameras, workload.scene.up)),
            warnings: path::warnings(workload.scene, path, &workload.cameras),
            ..PathInfo::unknown(&key)
        }
    }
}

impl Workload<'_> {
    /// SHA-256 over the cameras, and over the frames of a motion.
    pub fn digest(&self) -> String {
        let cameras = path::digest(&self.cameras);
        let Some(motion) = &self.motion else {
            return cameras;
        };
        let frames = format!("{cameras} {} {}", motion.digest(), self.views_per_frame);
        scene::hex(&hmac_sha256::Hash::hash(frames.as_bytes()))
    }
}

impl GroupKey {
    /// The key of a scene's queries along a path.
    ///
    /// The motion is empty for a still scene.
    pub fn of(scene: &str, path: &str, cold: bool, culling: &Culling, motion: &str) -> GroupKey {
        GroupKey {
            scene: scene.to_owned(),
            path: path.to_owned(),
            cache: if cold { "cold" } else { "warm" }.to_owned(),
            test: culling.test.name().to_owned(),
            arithmetic: culling.arithmetic.name().to_owned(),
            planes: culling.planes.method.name().to_owned(),
            epsilon: culling.epsilon(),
            motion: motion.to_owned(),
        }
    }

    /// The key of a path's queries by a culling test.
    pub fn new(scene: &str, path: &PathInfo, test: &str) -> GroupKey {
        GroupKey {
            scene: scene.to_owned(),
            path: path.name.clone(),
            cache: path.cache.clone(),
            test: test.to_owned(),
            arithmetic: path.arithmetic.clone(),
            planes: path.planes.clone(),
            epsilon: path.epsilon,
            motion: path.motion.clone(),
        }
    }
}
