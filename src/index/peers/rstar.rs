//! The crate rstar: an R*-tree, bulk-loaded, asked through a selection
//! function, either by its iterator or by a walk of its own over its nodes.

use std::ops::ControlFlow;

use glam::Vec3;
use rstar::{AABB, ParentNode, RTree, RTreeNode, RTreeObject};

use super::{BoxTest, BuildError, Record, Tally, peer_of_tree};
use crate::geometry::Aabb;
use crate::index::MemoryUsage;
use crate::query::{Recorder, Sink};

impl RTreeObject for Record {
    type Envelope = AABB<[f32; 3]>;

    #[inline(always)]
    fn envelope(&self) -> AABB<[f32; 3]> {
        AABB::from_corners(self.bounds.min.to_array(), self.bounds.max.to_array())
    }
}

#[inline(always)]
fn bounds_of(envelope: &AABB<[f32; 3]>) -> Aabb {
    Aabb::new(
        Vec3::from_array(envelope.lower()),
        Vec3::from_array(envelope.upper()),
    )
}

/// Slots of a node and of all below it.
fn slots(node: &ParentNode<Record>) -> usize {
    let below = node.children().iter().map(|child| match child {
        RTreeNode::Leaf(_) => 0,
        RTreeNode::Parent(parent) => slots(parent),
    });
    node.children().len() + below.sum::<usize>()
}

/// The tree, which keeps the items in its leaves.
struct Tree(RTree<Record>);

impl Tree {
    fn build(_: &'static str, items: Vec<Record>, (): ()) -> Result<Tree, BuildError> {
        Ok(Tree(RTree::bulk_load(items)))
    }

    fn memory(&self) -> MemoryUsage {
        let slot = size_of::<RTreeNode<Record>>();
        let item_bytes = self.0.size() * slot;
        MemoryUsage {
            node_bytes: (slots(self.0.root()) * slot).saturating_sub(item_bytes),
            item_bytes,
        }
    }

    /// Its public nodes from the root on, as its iterator goes through them;
    /// a node that is accepted hands its subtree down without further tests.
    #[inline(always)]
    fn walk<T: BoxTest, S: Sink, R: Recorder>(
        &self,
        test: &T,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let tally = Tally::new(recorder);
        let root = self.0.root();
        tally.node(test);
        if root.children().is_empty() || test.rejects(&bounds_of(&root.envelope())) {
            return ControlFlow::Continue(());
        }
        let mut open = vec![(root, false)];
        while let Some((parent, inside)) = open.pop() {
            for child in parent.children() {
                match child {
                    RTreeNode::Leaf(item) if inside => {
                        tally.count(|recorder| recorder.subtree_accepted(1));
                        sink.accept(std::slice::from_ref(&item.id))?;
                    }
                    RTreeNode::Leaf(item) => {
                        tally.item(test);
                        if test.admits(&item.bounds) {
                            sink.accept(std::slice::from_ref(&item.id))?;
                        }
                    }
                    RTreeNode::Parent(node) if inside => open.push((node, true)),
                    RTreeNode::Parent(node) => {
                        tally.node(test);
                        let bounds = bounds_of(&node.envelope());
                        let (rejected, accepted) = test.rejects_accepts(&bounds);
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

peer_of_tree!(
    /// Its nodes.
    PeerRstar,
    "peer-rstar",
    "crate rstar, bulk-loaded, its nodes walked from the root, whole subtrees accepted",
    "rstar",
    Tree,
    (),
    walk
);
