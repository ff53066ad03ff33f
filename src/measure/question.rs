//! What a cell was asked: its scene and the queries along its path, each with a
//! digest, so that two reports can tell whether they asked the same.

use serde::{Deserialize, Serialize};

use super::{GroupKey, Workload};
use crate::path;
use crate::scene::Scene;

/// The scene of a cell.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SceneInfo {
    pub name: String,
    pub total_count: usize,
    pub region_count: usize,
    pub origin: [f64; 3],
    pub bounds_min: [f64; 3],
    pub bounds_max: [f64; 3],
    pub skipped_items: usize,
    /// SHA-256 over origin and item bounds.
    pub digest: String,
}

impl SceneInfo {
    /// Of a scene that could not be looked at.
    pub fn unknown(name: &str) -> SceneInfo {
        SceneInfo {
            name: name.to_owned(),
            total_count: 0,
            region_count: 0,
            origin: [0.0; 3],
            bounds_min: [0.0; 3],
            bounds_max: [0.0; 3],
            skipped_items: 0,
            digest: String::new(),
        }
    }

    pub fn of(scene: &Scene) -> SceneInfo {
        let bounds = scene.world_bounds();
        SceneInfo {
            name: scene.name.clone(),
            total_count: scene.items.len(),
            region_count: scene.regions.boxes(&scene.items).len(),
            origin: scene.origin.to_array(),
            bounds_min: bounds.min.to_array(),
            bounds_max: bounds.max.to_array(),
            skipped_items: scene.skipped_items,
            digest: scene.digest(),
        }
    }
}

/// The queries of a cell.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct PathInfo {
    pub name: String,
    pub camera_count: usize,
    /// "warm" or "cold".
    pub cache: String,
    /// Where the planes come from, and the factor c of their epsilon.
    pub planes: String,
    pub epsilon: f64,
    /// The numbers that the culling test is carried out in.
    pub arithmetic: String,
    /// SHA-256 over the cameras' frames and lenses; null in older reports.
    #[serde(default)]
    pub digest: Option<String>,
}

impl PathInfo {
    /// Of a path that could not be looked at.
    pub fn unknown(key: &GroupKey) -> PathInfo {
        PathInfo {
            name: key.path.clone(),
            camera_count: 0,
            cache: key.cache.clone(),
            planes: key.planes.clone(),
            epsilon: key.epsilon,
            arithmetic: key.arithmetic.clone(),
            digest: None,
        }
    }

    pub fn of(path: &str, workload: &Workload, cold: bool) -> PathInfo {
        let culling = &workload.culling;
        PathInfo {
            name: path.to_owned(),
            camera_count: workload.cameras.len(),
            cache: if cold { "cold" } else { "warm" }.to_owned(),
            planes: culling.planes.method.name().to_owned(),
            epsilon: culling.planes.epsilon,
            arithmetic: culling.arithmetic.name().to_owned(),
            digest: Some(path::digest(&workload.cameras)),
        }
    }
}

impl GroupKey {
    pub fn new(scene: &str, path: &PathInfo, test: &str) -> GroupKey {
        GroupKey {
            scene: scene.to_owned(),
            path: path.name.clone(),
            cache: path.cache.clone(),
            test: test.to_owned(),
            arithmetic: path.arithmetic.clone(),
            planes: path.planes.clone(),
            epsilon: path.epsilon,
        }
    }
}
