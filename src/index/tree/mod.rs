//! The packed tree, which `bvh`, `bsp`, `octree` and `quadtree` share.
//!
//! [`Tree`] is the structure: a [`PackedTree`] made by a [`TreeBuilder`] (`index/build`), which
//! decides how items are grouped and whether points descend by planes.
//!
//! | file | contents |
//! |---|---|
//! | `node`, `packed` | nodes in depth-first order, stacks of them; layout, construction, refit |
//! | `wide_nodes` | the same nodes in blocks of sixteen, for queries by volumes |
//! | `search` | queries by volumes and by points |
//! | `partition` | top-down construction by a [`Splitter`] |
//! | `splits` | region search by dividing planes, for `bsp` |
//! | `tests_recorder` | a hand-written region search, for `scripts/check-recorder.sh` |

pub mod node;
mod packed;
mod partition;
mod search;
mod splits;
#[cfg(test)]
mod tests_recorder;
mod wide_nodes;

use std::marker::PhantomData;
use std::ops::ControlFlow;

use glam::Vec3;
use serde::Serialize;
use serde::de::DeserializeOwned;

use self::splits::Split;
use super::{BuildError, Info, Input, MemoryUsage, RegionIndex, TreeCell};
use crate::geometry::Aabb;
use crate::query::{Context, ItemId, QueryVolume};

pub use packed::PackedTree;
pub use partition::{Part, Splitter, build_top_down};

/// A tree, and a normal per node or none at all.
pub type Built = Result<(PackedTree, Vec<Vec3>), BuildError>;

/// A builder of packed trees; [`Tree<Self>`](Tree) is the structure.
pub trait TreeBuilder: Send + Sync {
    /// [`RegionIndex::INFO`]; `refits` and `ranges` are capabilities of every tree.
    const INFO: Info;
    /// [`RegionIndex::Params`].
    type Params: Default + Serialize + DeserializeOwned;
    /// True if points descend by the normals that the build returns.
    const BY_PLANES: bool = false;

    /// Builds the tree, and a normal per node if [`TreeBuilder::BY_PLANES`].
    ///
    /// A tree with normals is binary: a plane with the normal of an inner node divides its items,
    /// those on the back first.
    ///
    /// # Errors
    /// The errors of [`RegionIndex::build`].
    fn build(input: &Input<'_>, params: &Self::Params) -> Built;
}

/// A packed tree by the builder `B`.
///
/// [`Octree`](super::Octree), [`Quadtree`](super::Quadtree), [`Bvh`](super::Bvh) and
/// [`Bsp`](super::Bsp).
pub struct Tree<B: TreeBuilder> {
    pub(super) tree: PackedTree,
    /// One per node with [`TreeBuilder::BY_PLANES`], else none.
    splits: Vec<Split>,
    builder: PhantomData<B>,
}

impl<B: TreeBuilder> RegionIndex for Tree<B> {
    const INFO: Info = B::INFO.refits().ranges();
    type Params = B::Params;

    fn build(input: &Input<'_>, params: &B::Params) -> Result<Self, BuildError> {
        let (tree, normals) = B::build(input, params)?;
        let splits = Split::all(&tree, normals);
        Ok(Tree {
            tree,
            splits,
            builder: PhantomData,
        })
    }

    fn memory(&self) -> MemoryUsage {
        let mut memory = self.tree.memory();
        memory.node_bytes += size_of_val(&self.splits[..]);
        memory
    }

    #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        match volume.as_point() {
            Some(p) if B::BY_PLANES => splits::locate(&self.tree, &self.splits, p, cx),
            _ => self.tree.query(volume, cx),
        }
    }

    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        let splits = &mut self.splits;
        let fitted = |tree: &PackedTree, node: usize| {
            if let Some(split) = splits.get_mut(node) {
                split.fit(tree, node);
            }
        };
        self.tree.refit(items, moved, fitted)
    }

    fn cells(&self) -> Vec<TreeCell<'_>> {
        self.tree.cells()
    }

    fn tree_order(&self) -> Option<&[ItemId]> {
        Some(self.tree.ids())
    }
}
