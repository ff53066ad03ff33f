//! The octree: a cube split in the middle of all three axes, again and again.

use serde::{Deserialize, Serialize};

use super::by_tree::answered_by_tree;
use super::cells::{Cell, CellSplitter};
use super::partition::build_top_down;
use super::tree::PackedTree;
use super::{BuildError, Info, Input, Kind, Origin, RegionIndex, check_range, indexable};
use crate::geometry::Aabb;
use crate::query::ItemId;

/// An octree with fitted nodes (Meagher 1982, "Geometric modeling using octree
/// encoding"; loose variant Ulrich 2000).
///
/// A textbook octree keeps an item that crosses a split plane at the inner
/// node. In a flat city, or among needles, nearly everything crosses one and
/// the tree collapses into a list. Here every item goes down with its centre
/// and each node's bounds are the exact union of what it holds: crossing items
/// make neighbours overlap, nothing more. Levels in which all items take the
/// same child are skipped, and coincident items are halved by size below the
/// depth limit, so a leaf never exceeds its limit and the build never runs
/// away.
pub struct Octree {
    tree: PackedTree,
}

/// Parameters: `octree:leaf=32,depth=20,loose=2`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CellParams {
    /// Most items of a leaf (1 to 4096).
    pub leaf: u32,
    /// Most levels of cells (0 to 64).
    pub depth: u32,
    /// Looseness (1 to 16): 1 sends every item down with its centre; k > 1
    /// keeps items larger than k - 1 edges of the smaller cell where they are.
    pub loose: f32,
}

impl Default for CellParams {
    fn default() -> Self {
        CellParams {
            leaf: 32,
            depth: 24,
            loose: 1.0,
        }
    }
}

impl CellParams {
    /// Builds the tree that splits `axes`, for octree and quadtree alike.
    pub(super) fn build(
        &self,
        structure: &'static str,
        items: &[Aabb],
        ids: &[ItemId],
        axes: &[usize],
        column: Option<usize>,
    ) -> Result<PackedTree, BuildError> {
        check_range(structure, "leaf", self.leaf.into(), 1.0, 4096.0)?;
        check_range(structure, "depth", self.depth.into(), 0.0, 64.0)?;
        check_range(structure, "loose", self.loose.into(), 1.0, 16.0)?;
        let bounds = Aabb::union_of(items);
        let mut splitter = CellSplitter::new(axes, self.depth, self.loose);
        if let Some(axis) = column {
            splitter = splitter.with_columns(axis, self.leaf as usize);
        }
        let root = Cell::root(&bounds);
        Ok(build_top_down(
            items,
            ids,
            self.leaf as usize,
            root,
            &mut splitter,
        ))
    }
}

impl RegionIndex for Octree {
    const INFO: Info = Info::new(
        "octree",
        "octree with fitted nodes; loose=2 for the loose variant",
        Kind::Tree,
        Origin::Ours,
    )
    .refits()
    .ranges();
    type Params = CellParams;

    fn build(input: &Input<'_>, params: &CellParams) -> Result<Self, BuildError> {
        let items = input.items;
        let ids = indexable(items)?;
        let tree = params.build(Self::INFO.name, items, &ids, &[0, 1, 2], None)?;
        Ok(Octree { tree })
    }

    answered_by_tree!();
}
