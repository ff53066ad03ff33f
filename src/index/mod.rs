//! The contract of a structure, and the registry of all of them. Adding one is
//! a file beside this one and a row in [`Registry::builtin`], or in a crate of
//! one's own [`Registry::with`]; list, run, query, verify, benches and
//! conformance tests pick it up from there.

mod batch;
mod block_order;
mod box_by_box;
mod bsp;
mod bundles;
mod bvh;
mod by_plane;
mod by_tree;
mod cells;
mod centres;
mod erased;
mod execution;
mod foreign;
mod frontier;
mod grid;
mod id_rows;
mod info;
mod linear;
mod octree;
mod partition;
mod pass;
#[cfg(feature = "peers")]
pub mod peers;
mod plane_choice;
mod ploc;
mod quadtree;
mod registry;
mod replay;
mod stack;
mod textbook;
mod tiling;
mod tree;
mod treelets;
mod wide;

use std::ops::{ControlFlow, Range};

use glam::Vec3;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::geometry::{Aabb, PlaneTree};
use crate::kernel::{Isa, Kernel};
use crate::query::{ItemId, ManySink, NoRecorder, Recorder, Sink, View};
use crate::threads::Pool;

pub use block_order::BlockOrder;
pub use bsp::{Bsp, BspBuilder, BspParams};
pub(crate) use bundles::Leaves;
pub use bvh::{Bvh, BvhParams, BvhPreset};
pub use erased::DynIndex;
pub use execution::{By, Execution};
pub use foreign::caught;
pub use grid::{GridParams, UniformGrid};
pub use info::{Capabilities, Info, Kind, Origin};
pub use linear::{Linear, LinearScalar};
pub use octree::{CellParams, Octree};
pub use partition::{Part, Record, Splitter, build_top_down};
pub use quadtree::Quadtree;
pub use registry::{Registry, Row, StructureSpec};
pub use replay::Trace;
pub use textbook::{BspTextbook, BvhTextbook, OctreeTextbook, QuadtreeTextbook, TextbookParams};
pub use tree::{PackedTree, TreeNode, TreeWriter, scan_blocks};
pub use wide::{Wide, WideParams};

/// Why an index could not be built.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    #[error("item {item} has the bounds {bounds:?}; expected finite numbers")]
    NonFiniteItem { item: usize, bounds: Aabb },
    #[error("{count} items; expected at most {most}")]
    TooManyItems { count: usize, most: usize },
    /// The structure could, but not in reasonable time or memory.
    #[error("'{structure}' refuses these items: {reason}")]
    Refused {
        structure: &'static str,
        reason: String,
    },
    /// The structure's own code did.
    #[error("panicked: {message}")]
    Panicked { message: String },
    #[error("parameters of '{structure}': {reason}")]
    Params {
        structure: &'static str,
        reason: String,
    },
}

/// Heap bytes of an index. Temporary memory of the build does not count.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct MemoryUsage {
    pub node_bytes: usize,
    /// Copies of item bounds and the ids.
    pub item_bytes: usize,
}

impl MemoryUsage {
    pub fn total(&self) -> usize {
        self.node_bytes + self.item_bytes
    }
}

/// A structure built over item bounds.
///
/// Items are numbered by their place in the slice. An empty box (min > max)
/// is an item that no query ever returns. The order of answers is the
/// structure's own, but each id comes at most once.
pub trait RegionIndex: Sized + Send + Sync {
    /// Its name and what it declares of itself. The conformance suite checks
    /// what can be checked.
    const INFO: Info;
    /// Build parameters, `name:key=value` on the command line.
    type Params: Default + Serialize + DeserializeOwned;

    /// Builds the structure. Deterministic: the same items and parameters
    /// give the same structure.
    ///
    /// `own_tree` is a partition that the scene itself brings, if any; most
    /// structures have no use for it.
    ///
    /// # Errors
    /// An item with a NaN or infinite bound (named), more items than ids,
    /// parameters out of range.
    fn build(
        items: &[Aabb],
        own_tree: Option<&PlaneTree>,
        params: &Self::Params,
    ) -> Result<Self, BuildError>;

    /// [`RegionIndex::build`] with the threads of a pool: what
    /// [`StructureSpec`] calls. The structure is the same whatever their
    /// number. One that knows no threads leaves it out; one that does declares
    /// [`Capabilities::threaded_build`].
    ///
    /// # Errors
    /// As [`RegionIndex::build`].
    fn build_by(
        _: &Pool,
        items: &[Aabb],
        own_tree: Option<&PlaneTree>,
        params: &Self::Params,
    ) -> Result<Self, BuildError> {
        Self::build(items, own_tree, params)
    }

    fn memory(&self) -> MemoryUsage;

    /// Region search: hands every item whose closed box holds `p` to the
    /// sink. `Break` if the sink ended the query.
    fn locate<S: Sink, R: Recorder>(
        &self,
        p: Vec3,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()>;

    /// Region search for many points: for every point, in ascending order,
    /// exactly what [`RegionIndex::locate`] hands over, in the same order, in
    /// one slice. `Break` if the sink ended the batch.
    ///
    /// The default asks one point after the other; a structure that overlaps
    /// the waits of several descents overrides it.
    #[inline(always)]
    fn locate_many<S: ManySink>(&self, points: &[Vec3], sink: &mut S) -> ControlFlow<()> {
        let mut ids = Vec::new();
        for (&p, point) in points.iter().zip(0..) {
            ids.clear();
            // A Vec never breaks off.
            let _ = self.locate(p, &mut ids, &mut NoRecorder);
            sink.accept(point, &ids)?;
        }
        ControlFlow::Continue(())
    }

    /// [`RegionIndex::locate`] with the vectors of an instruction set: what
    /// [`DynIndex`] calls. A structure that has no use for them leaves it out.
    #[inline(always)]
    fn locate_by<I: Isa, S: Sink, R: Recorder>(
        &self,
        _: I,
        p: Vec3,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        self.locate(p, sink, recorder)
    }

    /// [`RegionIndex::locate_many`] likewise.
    #[inline(always)]
    fn locate_many_by<I: Isa, S: ManySink>(
        &self,
        _: I,
        points: &[Vec3],
        sink: &mut S,
    ) -> ControlFlow<()> {
        self.locate_many(points, sink)
    }

    /// Takes over the new bounds of `moved` items (`items` holds all bounds,
    /// the new ones included; they are finite) without building anew. False,
    /// with the structure unchanged, if it cannot; the caller then rebuilds.
    /// A structure that declares [`Capabilities::refits`] declines only where
    /// an item becomes or ceases to be empty; one that does not, always.
    fn refit(&mut self, _items: &[Aabb], _moved: &[ItemId]) -> bool {
        false
    }
}

/// A structure that finds what a camera sees.
pub trait FrustumQuery: RegionIndex {
    /// Hands every item that the view admits to the sink: exactly the set
    /// `{ i : view.sees(items[i]) }`, bit for bit. For a
    /// [`ConvexVolume`](crate::geometry::ConvexVolume) these are the items
    /// that its planes (six of a frustum, or as many as there are) do not
    /// exclude.
    ///
    /// Mark it and what it calls `#[inline(always)]`: [`DynIndex`] compiles it
    /// for each [`Kernel`], and a call that stays a call
    /// runs portable code.
    fn visible<V: View, S: Sink, R: Recorder>(
        &self,
        view: &V,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()>;

    /// [`FrustumQuery::visible`] with the vectors of an instruction set: what
    /// [`DynIndex`] calls. A structure that has no use for them leaves it out.
    #[inline(always)]
    fn visible_by<I: Isa, V: View, S: Sink, R: Recorder>(
        &self,
        _: I,
        view: &V,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        self.visible(view, sink, recorder)
    }

    /// Item ids in the structure's own order, if it keeps them in one that its
    /// answers can be ranges of: [`Capabilities::ranges`]. Such a structure is
    /// a [`TreeOrder`] as well.
    fn tree_order(&self) -> Option<&[ItemId]> {
        None
    }
}

/// A structure that keeps its items in an order of its own, and can answer with
/// ranges of that order: for callers whose data lie in it too.
pub trait TreeOrder: FrustumQuery {
    /// Item ids in tree order.
    fn ids(&self) -> &[ItemId];

    /// [`FrustumQuery::visible`] as ranges of [`TreeOrder::ids`], appended to
    /// `out`; together they hold each visible item once. Adjoining ranges that
    /// follow each other are one. By the best [`Kernel`] of this machine.
    fn visible_ranges<V: View>(&self, view: &V, out: &mut Vec<Range<u32>>) {
        self.visible_ranges_by(Kernel::best(), view, out);
    }

    /// [`TreeOrder::visible_ranges`] by a kernel.
    fn visible_ranges_by<V: View>(&self, kernel: Kernel, view: &V, out: &mut Vec<Range<u32>>) {
        erased::see_ranges(kernel, self, view, out);
    }
}

/// A parameter in its range, or the error that names both.
pub(crate) fn check_range(
    structure: &'static str,
    name: &str,
    value: f64,
    low: f64,
    high: f64,
) -> Result<(), BuildError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(BuildError::Params {
        structure,
        reason: format!("{name}={value}; expected {low} to {high}"),
    })
}

/// The items a structure has to hold: finite and not empty, with their ids.
///
/// # Errors
/// As [`RegionIndex::build`].
pub fn indexable(items: &[Aabb]) -> Result<Vec<ItemId>, BuildError> {
    // The top id stays free as a mark of "none".
    let most = ItemId::MAX as usize - 1;
    if items.len() > most {
        return Err(BuildError::TooManyItems {
            count: items.len(),
            most,
        });
    }
    // One look at each item: large scenes do not fit the cache.
    let (mut count, mut all_finite) = (0, true);
    for b in items {
        count += usize::from(!b.is_empty());
        all_finite &= b.is_finite();
    }
    if !all_finite && let Some(item) = items.iter().position(|b| !b.is_finite()) {
        return Err(BuildError::NonFiniteItem {
            item,
            bounds: items[item],
        });
    }
    if count == items.len() {
        return Ok((0..count as ItemId).collect());
    }
    let sound = items.iter().zip(0..).filter(|(b, _)| !b.is_empty());
    // A structure keeps this list, so no slack.
    let mut ids = Vec::with_capacity(count);
    ids.extend(sound.map(|(_, id)| id));
    Ok(ids)
}
