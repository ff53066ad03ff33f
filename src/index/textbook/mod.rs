//! The trees as lectures show them: nodes with child pointers, a recursive walk,
//! one box at a time, no SIMD. Beside the packed trees they show what a layout
//! brings; beside the scan, what a tree does. A file has a structure's nodes and
//! how they are divided; here is the walk, which is the same for all of them.
//!
//! A recursive function stays a call, so it runs portable code whatever the
//! kernel of the query.

mod bsp;
mod bvh;
mod octree;
mod quadtree;

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use super::partition::Record;
use super::{BuildError, MemoryUsage, check_range};
use crate::geometry::{Aabb, PlaneMask};
use crate::kernel::pairs;
use crate::query::{Containment, Context, ItemId, QueryVolume, Recorder, Sink};

pub use bsp::BspTextbook;
pub use bvh::BvhTextbook;
pub use octree::OctreeTextbook;
pub use quadtree::QuadtreeTextbook;

/// Parameters: `octree-textbook:leaf=8,depth=64`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TextbookParams {
    /// So few items are not divided any further (1 to 4096).
    pub leaf: u32,
    /// Most levels below the root (0 to 256), and so the depth of the recursion:
    /// what is still together there, such as coincident items, stays so.
    pub depth: u32,
}

impl Default for TextbookParams {
    fn default() -> Self {
        TextbookParams { leaf: 8, depth: 64 }
    }
}

impl TextbookParams {
    fn check(&self, structure: &'static str) -> Result<(), BuildError> {
        check_range(structure, "leaf", self.leaf.into(), 1.0, 4096.0)?;
        check_range(structure, "depth", self.depth.into(), 0.0, 256.0)
    }

    /// Whether a group of items at a level stays together.
    fn ends_at(&self, items: usize, level: u32) -> bool {
        items <= self.leaf as usize || level == self.depth
    }
}

/// Items that a node keeps: their ids are one slice.
#[derive(Default)]
struct Items {
    boxes: Vec<Aabb>,
    ids: Vec<ItemId>,
}

impl Items {
    fn of(records: &[Record]) -> Items {
        Items {
            boxes: records.iter().map(|r| r.bounds).collect(),
            ids: records.iter().map(|r| r.id).collect(),
        }
    }

    #[inline]
    fn all(&self) -> Slice<'_> {
        (&self.boxes, &self.ids)
    }
}

/// Bounds and ids of some items.
type Slice<'t> = (&'t [Aabb], &'t [ItemId]);

/// A node of a tree, as the walk sees it.
trait Node: Copy {
    /// Holds every item from here on down, bit for bit: what makes a verdict
    /// about the node one about all of them (docs/NUMERICS.md).
    fn bounds(&self) -> Aabb;
    /// The items that the node itself keeps.
    fn items(&self) -> Slice<'_>;
    /// Its subtrees.
    fn children(self) -> impl Iterator<Item = Self>;
}

/// Hands over what a volume sees of a subtree: nothing of a node that lies
/// outside, all of one that lies inside; else the node's own items are tested
/// one by one, and then its children in the same way. O(log n + answers) where
/// the volume is small and the items are.
fn walk<N: Node, Q: QueryVolume, C: Context>(
    node: N,
    volume: &Q,
    mask: PlaneMask,
    cx: &mut C,
) -> ControlFlow<()> {
    cx.recorder().node_tested();
    let (verdict, mask) = volume.classify(&node.bounds(), mask, cx.recorder());
    match verdict {
        Containment::Outside => cx.recorder().subtree_rejected(),
        Containment::Inside => {
            let count = report(node, cx.sink())?;
            cx.recorder().subtree_accepted(count);
        }
        Containment::Straddles => {
            test_items(node.items(), volume, mask, cx)?;
            for child in node.children() {
                walk(child, volume, mask, cx)?;
            }
        }
    }
    ControlFlow::Continue(())
}

/// Hands over a whole subtree without a test; how many items it has.
fn report<N: Node, S: Sink>(node: N, sink: &mut S) -> ControlFlow<(), usize> {
    let (_, ids) = node.items();
    if !ids.is_empty() {
        sink.accept(ids)?;
    }
    let mut count = ids.len();
    for child in node.children() {
        count += report(child, sink)?;
    }
    ControlFlow::Continue(count)
}

/// Hands over those of some items that a volume sees.
#[inline]
fn test_items<Q: QueryVolume, C: Context>(
    (boxes, ids): Slice<'_>,
    volume: &Q,
    mask: PlaneMask,
    cx: &mut C,
) -> ControlFlow<()> {
    for (bounds, id) in pairs(boxes, ids) {
        cx.recorder().items_tested(1);
        if volume.admits(bounds, mask, cx.recorder()) {
            cx.accept(std::slice::from_ref(id))?;
        }
    }
    ControlFlow::Continue(())
}

/// What a tree of nodes with pointers takes.
fn memory_of<N: Node>(root: Option<N>, bytes_per_node: usize) -> MemoryUsage {
    let Some(root) = root else {
        return MemoryUsage::default();
    };
    let (boxes, ids) = root.items();
    let own = MemoryUsage {
        node_bytes: bytes_per_node,
        item_bytes: size_of_val(boxes) + size_of_val(ids),
    };
    root.children().fold(own, |sum, child| {
        let below = memory_of(Some(child), bytes_per_node);
        MemoryUsage {
            node_bytes: sum.node_bytes + below.node_bytes,
            item_bytes: sum.item_bytes + below.item_bytes,
        }
    })
}

/// The walk from the root, if there is one.
fn query<N: Node, Q: QueryVolume, C: Context>(
    root: Option<N>,
    volume: &Q,
    cx: &mut C,
) -> ControlFlow<()> {
    match root {
        Some(root) => walk(root, volume, volume.mask(), cx),
        None => ControlFlow::Continue(()),
    }
}

/// What a structure with a method `root` answers by the walk.
macro_rules! answered_by_walk {
    () => {
        fn query<Q: $crate::query::QueryVolume, C: $crate::query::Context>(
            &self,
            volume: &Q,
            cx: &mut C,
        ) -> std::ops::ControlFlow<()> {
            super::query(self.root(), volume, cx)
        }
    };
}
use answered_by_walk;
