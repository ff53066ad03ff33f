//! Keys of cells: everything that identifies a result.

use serde::{Deserialize, Serialize};

/// Key of a group: the part in common to cells that are compared.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct GroupKey {
    /// Name of the scene, parameters included.
    pub scene: String,
    /// Name of the path, parameters included.
    pub path: String,
    /// "warm" or "cold".
    pub cache: String,
    /// Name of the culling test.
    pub test: String,
    /// Name of the arithmetic that the test is carried out in.
    pub arithmetic: String,
    /// Name of the method that planes are derived by.
    pub planes: String,
    /// Factor c of the planes' epsilon.
    pub epsilon: f64,
}

impl GroupKey {
    /// Text that is equal for equal keys, as a key of maps.
    pub fn id(&self) -> String {
        let key = GroupKey {
            // Zero has two signs and one meaning.
            epsilon: self.epsilon + 0.0,
            ..self.clone()
        };
        serde_json::to_string(&key).unwrap_or_default()
    }
}

/// A cell: a structure in a group.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct CellKey {
    /// Group that the cell is compared within.
    #[serde(flatten)]
    pub group: GroupKey,
    /// Label of the structure, `bvh:leaf=4`.
    pub structure: String,
}
