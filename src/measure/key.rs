//! Keys of groups, cells and tasks: everything that identifies a result.

use serde::{Deserialize, Serialize};

/// Key of a group: all settings that cells must share to be compared.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
pub struct GroupKey {
    /// Name of the scene, parameters included.
    pub scene: String,
    /// Name of the path, parameters included.
    pub path: String,
    /// "warm" or "cold".
    pub cache: String,
    /// Name of the culling test.
    pub test: String,
    /// Arithmetic of the culling test.
    pub arithmetic: String,
    /// Name of the method that derives the planes.
    pub planes: String,
    /// Factor c of the planes' epsilon.
    pub epsilon: f64,
    /// Name of the motion, parameters included; empty for a still scene.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub motion: String,
}

impl GroupKey {
    /// Text that is equal for equal keys, as a map key.
    pub fn id(&self) -> String {
        let mut key = self.clone();
        // Zero has two signs and one meaning. Old reports have an epsilon with f64.
        key.epsilon = match self.arithmetic.as_str() {
            "f64" => 0.0,
            _ => self.epsilon + 0.0,
        };
        serde_json::to_string(&key).unwrap_or_default()
    }

    /// The path column of samples.csv, with the motion.
    pub fn samples_path(&self) -> String {
        match self.motion.as_str() {
            "" => self.path.clone(),
            motion => format!("{} + {motion}", self.path),
        }
    }
}

/// Key of a cell: a structure in a group.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
pub struct CellKey {
    /// Group within which the cell is compared.
    #[serde(flatten)]
    pub group: GroupKey,
    /// Label of the structure, `bvh:leaf=4`.
    pub structure: String,
}

named! {
    /// Kind of query.
    #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub enum TaskKind {
        /// Frustum query: the items that the camera sees.
        Query = "query",
        /// Region search: the regions that contain the camera.
        Locate = "locate",
        /// Region search of all cameras of the path in one batch.
        LocateBatched = "locate_batched",
        /// Frustum queries of all cameras, shared among threads.
        Views = "views",
        /// Update of the index after the moves of a frame.
        Update = "update",
        /// Frustum query after the first one of a frame.
        Further = "further",
        /// Update and all queries of a frame.
        Frame = "frame",
    }
}

named! {
    /// The two passes of a group, counted and timed separately.
    #[derive(Clone, Copy, PartialEq, Eq, Debug)]
    pub(super) enum Pass {
        /// Frustum queries, one per camera; lower bounds take part.
        Queries = "camera",
        /// Region searches, one per eye.
        Searches = "point",
    }
}

impl Pass {
    /// The tasks that this pass times in a still scene.
    pub(super) fn tasks(self) -> &'static [TaskKind] {
        match self {
            Pass::Queries => &[TaskKind::Query, TaskKind::Views],
            Pass::Searches => &[TaskKind::Locate, TaskKind::LocateBatched],
        }
    }
}

/// Key of a task: label of a structure or a lower bound, and kind of query.
pub type TaskKey = (String, TaskKind);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_epsilon_beside_f64_is_no_part_of_the_key() {
        let id = |arithmetic: &str, epsilon| {
            let key = GroupKey {
                scene: String::new(),
                path: String::new(),
                cache: String::new(),
                test: String::new(),
                arithmetic: arithmetic.to_owned(),
                planes: String::new(),
                epsilon,
                motion: String::new(),
            };
            key.id()
        };
        assert_eq!(id("f64", 8.0), id("f64", -0.0));
        assert_ne!(id("f32", 8.0), id("f32", 0.0));
    }
}
