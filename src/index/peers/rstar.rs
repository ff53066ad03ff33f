//! The crate rstar: an R*-tree, bulk-loaded, its public nodes walked from the root.

use std::ops::ControlFlow;

use rstar::{AABB, ParentNode, RTree, RTreeNode, RTreeObject};

use crate::geometry::Aabb;
use crate::index::box_test::{BoxQuery, BoxTest, BoxTested};
use crate::index::items::Record;
use crate::index::{BuildError, Info, Kind, MemoryUsage, NoParams, Origin};
use crate::query::{Context, ItemId, Recorder};

impl RTreeObject for Record {
    type Envelope = AABB<[f32; 3]>;

    #[inline(always)]
    fn envelope(&self) -> AABB<[f32; 3]> {
        AABB::from_corners(self.bounds.min.to_array(), self.bounds.max.to_array())
    }
}

#[inline(always)]
fn bounds_of(envelope: &AABB<[f32; 3]>) -> Aabb {
    Aabb::new(envelope.lower().into(), envelope.upper().into())
}

/// Slots of a node and of its descendants.
fn slots(node: &ParentNode<Record>) -> usize {
    let below = node.children().iter().map(|child| match child {
        RTreeNode::Leaf(_) => 0,
        RTreeNode::Parent(parent) => slots(parent),
    });
    node.children().len() + below.sum::<usize>()
}

/// The crate's tree, with the items in its leaves.
pub struct PeerRstar {
    tree: RTree<Record>,
    /// Bounds in the tree by id, empty if absent; no entries before the first update.
    bounds: Vec<Aabb>,
}

/// An update bulk-loads once one item in this number has moved.
const BULK_SHARE: usize = 4;

impl BoxTested for PeerRstar {
    const ABOUT: Info = Info::new(
        "peer-rstar",
        "crate rstar, bulk-loaded, its nodes traversed from the root, whole subtrees accepted",
        Kind::Tree,
        Origin::Crate("rstar"),
    )
    .refits();
    type Params = NoParams;

    fn of(items: Vec<Record>, _: &NoParams) -> Result<Self, BuildError> {
        Ok(PeerRstar {
            tree: RTree::bulk_load(items),
            bounds: Vec::new(),
        })
    }

    /// `remove` and `insert` per item; `bulk_load` once a quarter has moved.
    fn follow(&mut self, items: &[Aabb], moved: &[ItemId]) -> Option<()> {
        if self.bounds.is_empty() {
            self.bounds = vec![Aabb::EMPTY; items.len()];
            for record in &self.tree {
                self.bounds[record.id as usize] = record.bounds;
            }
        }
        let bulk = moved.len() * BULK_SHARE >= self.tree.size();
        for &id in moved {
            let own = &mut self.bounds[id as usize];
            let old = std::mem::replace(own, items[id as usize]);
            if bulk {
                continue;
            }
            if !old.is_empty() {
                self.tree.remove(&Record { bounds: old, id });
            }
            if !own.is_empty() {
                self.tree.insert(Record { bounds: *own, id });
            }
        }
        if bulk {
            let mut held = Record::numbered(&self.bounds);
            held.retain(|record| !record.bounds.is_empty());
            self.tree = RTree::bulk_load(held);
        }
        Some(())
    }

    fn used(&self) -> MemoryUsage {
        let slot = size_of::<RTreeNode<Record>>();
        let item_bytes = self.tree.size() * slot;
        MemoryUsage {
            node_bytes: (slots(self.tree.root()) * slot).saturating_sub(item_bytes),
            item_bytes: item_bytes + size_of_val(&self.bounds[..]),
        }
    }

    /// Walks the nodes in the order of the crate's iterator.
    ///
    /// The subtree of an accepted node is not tested further.
    #[inline(always)]
    fn search<T: BoxTest + ?Sized, C: Context>(&self, ask: &mut BoxQuery<T, C>) -> ControlFlow<()> {
        let root = self.tree.root();
        if ask.rejects(&bounds_of(&root.envelope())) || root.children().is_empty() {
            return ControlFlow::Continue(());
        }
        let mut open = vec![(root, false)];
        while let Some((parent, inside)) = open.pop() {
            for child in parent.children() {
                match child {
                    RTreeNode::Leaf(item) if inside => {
                        ask.cx.recorder().subtree_accepted(1);
                        ask.cx.accept(std::slice::from_ref(&item.id))?;
                    }
                    RTreeNode::Leaf(item) => ask.item(&item.bounds, &item.id)?,
                    RTreeNode::Parent(node) if inside => open.push((node, true)),
                    RTreeNode::Parent(node) => {
                        let bounds = bounds_of(&node.envelope());
                        let (rejected, accepted) = ask.rejects_accepts(&bounds);
                        if !rejected {
                            open.push((node, accepted));
                        }
                    }
                }
            }
        }
        ControlFlow::Continue(())
    }
}
