//! What a cell is called by: everything that a result is of.

use serde::{Deserialize, Serialize};

/// What is common to the cells that are compared with each other.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct GroupKey {
    pub scene: String,
    pub path: String,
    /// "warm" or "cold".
    pub cache: String,
    pub test: String,
    pub arithmetic: String,
    pub planes: String,
    pub epsilon: f64,
}

/// A cell: a structure in a group.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct CellKey {
    #[serde(flatten)]
    pub group: GroupKey,
    pub structure: String,
}
