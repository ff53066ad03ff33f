//! The packed tree, which `bvh`, `bsp`, `octree` and `quadtree` share.
//!
//! [`Tree`] is the structure: a [`PackedTree`] made by a [`TreeBuilder`] (`index/build`),
//! which decides how items are grouped and, by its [`Descent`], how points descend.
//!
//! | file | contents |
//! |---|---|
//! | `node`, `packed` | nodes in depth-first order, stacks of them; layout, construction, refit |
//! | `wide_nodes` | the same nodes in blocks of sixteen, for queries by volumes |
//! | `search` | queries by volumes, by points, by many points |
//! | `partition` | top-down construction by a [`Splitter`] |
//! | `kd_treelets` | region search by axis-parallel planes, a descent of `bsp` |

pub mod kd_treelets;
pub mod node;
mod packed;
mod partition;
mod search;
mod wide_nodes;

use std::ops::ControlFlow;

use glam::Vec3;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{BuildError, Info, Input, MemoryUsage, RegionIndex, TreeCell};
use crate::geometry::Aabb;
use crate::kernel::Isa;
use crate::query::{Context, ItemId, ManySink, QueryVolume, Recorder, Sink};

pub use node::TreeNode;
pub use packed::PackedTree;
pub use partition::{Part, Splitter, build_top_down};

/// A builder of packed trees; [`Tree<Self>`](Tree) is the structure.
pub trait TreeBuilder: Send + Sync {
    /// [`RegionIndex::INFO`]; `refits` and `ranges` are capabilities of every tree.
    const INFO: Info;
    /// [`RegionIndex::Params`].
    type Params: Default + Serialize + DeserializeOwned;
    /// Descent of region search: `()` for nodes' bounds, or planes of the builder.
    type Descent: Descent;

    /// Builds the tree.
    ///
    /// # Errors
    /// The errors of [`RegionIndex::build`].
    fn build(
        input: &Input<'_>,
        params: &Self::Params,
    ) -> Result<(PackedTree, Self::Descent), BuildError>;
}

/// Descent of region search through a packed tree, from the root to the leaves.
pub trait Descent: Send + Sync {
    /// Heap bytes.
    fn bytes(&self) -> usize;

    /// Updates the planes of a node whose bounds have changed, after its children.
    fn refit(&mut self, tree: &PackedTree, node: usize);

    /// Passes every item whose closed box holds `p` to the sink, in tree order.
    fn locate<I: Isa, S: Sink, R: Recorder>(
        &self,
        isa: I,
        tree: &PackedTree,
        p: Vec3,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()>;

    /// Region search for many points, as [`RegionIndex::query_many`].
    #[inline(always)]
    fn locate_many<I: Isa, S: ManySink>(
        &self,
        isa: I,
        tree: &PackedTree,
        points: &[Vec3],
        sink: &mut S,
    ) -> ControlFlow<()> {
        tree.query_many(isa, points, sink)
    }
}

/// Descent by the bounds of the nodes.
impl Descent for () {
    fn bytes(&self) -> usize {
        0
    }

    fn refit(&mut self, _: &PackedTree, _: usize) {}

    #[inline(always)]
    fn locate<I: Isa, S: Sink, R: Recorder>(
        &self,
        isa: I,
        tree: &PackedTree,
        p: Vec3,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        tree.walk(isa, &p, sink, recorder)
    }
}

/// A packed tree by the builder `B`: [`Octree`](super::Octree),
/// [`Quadtree`](super::Quadtree), [`Bvh`](super::Bvh) and [`Bsp`](super::Bsp).
pub struct Tree<B: TreeBuilder> {
    pub(super) tree: PackedTree,
    descent: B::Descent,
}

impl<B: TreeBuilder> RegionIndex for Tree<B> {
    const INFO: Info = B::INFO.refits().ranges();
    type Params = B::Params;

    fn build(input: &Input<'_>, params: &B::Params) -> Result<Self, BuildError> {
        let (tree, descent) = B::build(input, params)?;
        Ok(Tree { tree, descent })
    }

    fn memory(&self) -> MemoryUsage {
        let mut memory = self.tree.memory();
        memory.node_bytes += self.descent.bytes();
        memory
    }

    #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        if Q::IS_POINT {
            let isa = cx.isa();
            let (sink, recorder) = cx.parts();
            return match volume.as_point() {
                Some(p) => self.descent.locate(isa, &self.tree, p, sink, recorder),
                None => ControlFlow::Continue(()),
            };
        }
        self.tree.query(volume, cx)
    }

    #[inline(always)]
    fn query_many<I: Isa, S: ManySink>(
        &self,
        isa: I,
        points: &[Vec3],
        sink: &mut S,
    ) -> ControlFlow<()> {
        self.descent.locate_many(isa, &self.tree, points, sink)
    }

    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        let descent = &mut self.descent;
        let fitted = |tree: &PackedTree, node| descent.refit(tree, node);
        self.tree.refit(items, moved, fitted)
    }

    fn cells(&self) -> Vec<TreeCell<'_>> {
        self.tree.cells()
    }

    fn tree_order(&self) -> Option<&[ItemId]> {
        Some(self.tree.ids())
    }
}
