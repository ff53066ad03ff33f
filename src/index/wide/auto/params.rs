//! Parameters of `auto`: choices to fix.

use serde::{Deserialize, Serialize};

use crate::index::BlockOrder;

/// Parameters: `auto:use=linear,update=rebuild`.
#[derive(Clone, Copy, Default, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AutoParams {
    /// The structure: `linear`, `wide` or `moving`; `auto` for the cheapest.
    #[serde(rename = "use")]
    pub structure: Use,
    /// Updates by `refit` or `rebuild`; `auto` for the cheapest.
    pub update: Update,
    /// The order of the items: `median` or `morton`.
    pub order: BlockOrder,
}

/// Structure that [`Auto`] uses.
#[derive(Clone, Copy, Default, PartialEq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Use {
    /// The cheaper of a scan and a tree.
    #[default]
    Auto,
    /// A scan of all items.
    Linear,
    /// A tree.
    Wide,
    /// A tree of resting items beside a tree of moving ones.
    Moving,
}

/// Updates of [`Auto`] after items have moved.
#[derive(Clone, Copy, Default, PartialEq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Update {
    /// The cheapest.
    #[default]
    Auto,
    /// New bounds in the same structure.
    Refit,
    /// A new structure.
    Rebuild,
}
