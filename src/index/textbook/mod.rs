//! The trees as lectures show them: child pointers and a recursive walk.
//!
//! One box at a time, no SIMD. Compared with the packed trees they show the effect of a layout;
//! compared with the scan, that of a tree. Node and walk are here; `divisions` has one division per
//! kind of tree.
//!
//! The walk does not depend on the instruction set, so it is compiled once for all.

mod divisions;

use std::marker::PhantomData;
use std::ops::ControlFlow;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::items::Record;
use super::{BuildError, Info, Input, Kind, MemoryUsage, RegionIndex, TreeCell, check_range};
use crate::geometry::{Aabb, Plane, PlaneMask};
use crate::kernel::pairs;
use crate::query::{Containment, Context, ItemId, Predicate, QueryVolume, Recorder, Sink};

pub use divisions::{BspTextbook, BvhTextbook, OctreeTextbook, QuadtreeTextbook};

defaults! {
    /// Parameters: `octree-textbook:leaf=8,depth=64`.
    #[derive(Clone, Copy, Debug, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct TextbookParams {
        /// Most items that are not divided any further (1 to 4096).
        pub leaf: u32 = 8,
        /// Most levels below the root (0 to 256): the depth of the recursion.
        ///
        /// Items that share a node at that depth, such as coincident ones, stay together.
        pub depth: u32 = 64,
    }
}

impl TextbookParams {
    /// Decides whether a group of items becomes a leaf at this level.
    fn ends_at(&self, items: usize, level: u32) -> bool {
        items <= self.leaf as usize || level == self.depth
    }
}

/// A node with its items and subtrees.
pub struct Node {
    /// Closed bounds that contain every item of the subtree, bit for bit.
    ///
    /// A verdict about the node holds for all of them (docs/NUMERICS.md).
    bounds: Aabb,
    /// Half-space on one side of a dividing plane.
    ///
    /// Contains all items of the subtree: a point outside is in none of them.
    half_space: Option<Plane>,
    /// The node's own items, and their ids.
    boxes: Vec<Aabb>,
    ids: Vec<ItemId>,
    children: Box<[Node]>,
}

impl Node {
    /// A node that keeps some items, without children.
    fn with(bounds: Aabb, records: &[Record]) -> Node {
        Node {
            bounds,
            half_space: None,
            boxes: records.iter().map(|r| r.bounds).collect(),
            ids: records.iter().map(|r| r.id).collect(),
            children: Box::default(),
        }
    }

    /// Passes the items of the subtree that a volume sees to the sink.
    ///
    /// None if the node is outside, all if it is inside; else it tests the node's own items one by
    /// one, then recurses into the children. O(log n + answers) if the volume and the items are
    /// small.
    fn walk<Q: QueryVolume, C: Context>(
        &self,
        volume: &Q,
        mask: PlaneMask,
        cx: &mut C,
    ) -> ControlFlow<()> {
        cx.recorder().nodes_tested(1);
        let (verdict, mask) = volume.classify(&self.bounds, mask, cx.recorder());
        match verdict {
            Containment::Outside => cx.recorder().subtrees_rejected(1),
            Containment::Inside => {
                let count = self.report(cx.sink())?;
                cx.recorder().subtree_accepted(count);
            }
            Containment::Straddles => {
                self.test_items(volume, mask, cx)?;
                for child in &self.children {
                    child.walk(volume, mask, cx)?;
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// Region search by dividing planes.
    ///
    /// The plane test is monotone: an item in front of a plane contains no point that the same
    /// arithmetic puts behind it.
    fn locate<C: Context>(&self, p: Vec3, cx: &mut C) -> ControlFlow<()> {
        cx.recorder().nodes_tested(1);
        self.test_items(&p, p.mask(), cx)?;
        for child in &self.children {
            // A point on the plane is on both sides; one whose value is NaN (beyond f32) on
            // neither.
            if child.half_space.is_none_or(|side| side.value_at(p) >= 0.0) {
                child.locate(p, cx)?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Passes a whole subtree to the sink without a test; returns its number of items.
    fn report<S: Sink>(&self, sink: &mut S) -> ControlFlow<(), usize> {
        if !self.ids.is_empty() {
            sink.accept(&self.ids)?;
        }
        let mut count = self.ids.len();
        for child in &self.children {
            count += child.report(sink)?;
        }
        ControlFlow::Continue(count)
    }

    /// Tests the node's own items one by one.
    fn test_items<Q: QueryVolume, C: Context>(
        &self,
        volume: &Q,
        mask: PlaneMask,
        cx: &mut C,
    ) -> ControlFlow<()> {
        for (bounds, id) in pairs(&self.boxes, &self.ids) {
            cx.recorder().items_tested(1);
            if volume.admits(bounds, mask, cx.recorder()) {
                cx.accept(std::slice::from_ref(id))?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Adds the cells of a subtree with their levels, depth first.
    fn add_cells<'a>(&'a self, level: u32, cells: &mut Vec<TreeCell<'a>>) {
        cells.push(TreeCell {
            level,
            bounds: self.bounds,
            half_space: self.half_space,
            items: &self.ids,
        });
        for child in &self.children {
            child.add_cells(level + 1, cells);
        }
    }
}

/// How one kind of tree divides its items.
pub trait Division: Send + Sync {
    /// Name of the structure.
    const NAME: &str;
    /// Summary of the structure.
    const SUMMARY: &str;
    /// True if region search descends by the half-spaces of nodes.
    const BY_HALF_SPACES: bool = false;

    /// The root over at least one item.
    fn root(input: &Input<'_>, records: Vec<Record>, params: &TextbookParams) -> Node;
}

/// A tree as lectures show it, divided by `D`.
pub struct Textbook<D> {
    root: Option<Node>,
    division: PhantomData<D>,
}

impl<D: Division> RegionIndex for Textbook<D> {
    const INFO: Info = Info::ours(D::NAME, D::SUMMARY, Kind::Tree).on_request();
    type Params = TextbookParams;

    fn build(input: &Input<'_>, params: &TextbookParams) -> Result<Self, BuildError> {
        check_range(D::NAME, "leaf", params.leaf.into(), 1.0, 4096.0)?;
        check_range(D::NAME, "depth", params.depth.into(), 0.0, 256.0)?;
        let records = Record::all(input.items)?;
        Ok(Textbook {
            root: (!records.is_empty()).then(|| D::root(input, records, params)),
            division: PhantomData,
        })
    }

    fn memory(&self) -> MemoryUsage {
        let cells = self.cells();
        let items: usize = cells.iter().map(|cell| cell.items.len()).sum();
        MemoryUsage {
            node_bytes: cells.len() * size_of::<Node>(),
            item_bytes: items * (size_of::<Aabb>() + size_of::<ItemId>()),
        }
    }

    fn cells(&self) -> Vec<TreeCell<'_>> {
        let mut cells = Vec::new();
        if let Some(root) = &self.root {
            root.add_cells(0, &mut cells);
        }
        cells
    }

    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        match (&self.root, volume.as_point()) {
            (Some(root), Some(p)) if D::BY_HALF_SPACES => root.locate(p, cx),
            (Some(root), _) => root.walk(volume, volume.mask(), cx),
            (None, _) => ControlFlow::Continue(()),
        }
    }
}
