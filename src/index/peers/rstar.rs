//! The crate rstar: an R*-tree, bulk-loaded, asked through a selection
//! function, either by its iterator or by a walk of its own over its nodes.

use std::ops::ControlFlow;

use glam::Vec3;
use rstar::{
    AABB, ParentNode, RStarInsertionStrategy, RTree, RTreeNode, RTreeObject, RTreeParams,
    SelectionFunction,
};

use super::{BoxTest, Item, PeerParams, Tally, indexable, located_box_by_box, seen_box_by_box};
use crate::geometry::{Aabb, PlaneTree};
use crate::index::{BuildError, MemoryUsage, RegionIndex};
use crate::query::{Recorder, Sink};

impl RTreeObject for Item {
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

/// A test as rstar takes it.
struct Selected<'a, 'r, T, R> {
    test: &'a T,
    tally: &'a Tally<'r, R>,
}

impl<T: BoxTest, R: Recorder> SelectionFunction<Item> for Selected<'_, '_, T, R> {
    #[inline(always)]
    fn should_unpack_parent(&self, envelope: &AABB<[f32; 3]>) -> bool {
        self.tally.node(self.test);
        !self.test.rejects(&bounds_of(envelope))
    }

    #[inline(always)]
    fn should_unpack_leaf(&self, item: &Item) -> bool {
        self.tally.item(self.test);
        self.test.admits(&item.bounds)
    }
}

/// Nodes of up to 16: fewer, larger ones than rstar's own 6.
pub struct LargeNodes;

impl RTreeParams for LargeNodes {
    const MIN_SIZE: usize = 6;
    const MAX_SIZE: usize = 16;
    const REINSERTION_COUNT: usize = 4;
    type DefaultInsertionStrategy = RStarInsertionStrategy;
}

fn memory<P: RTreeParams>(tree: &RTree<Item, P>) -> MemoryUsage {
    fn places(node: &ParentNode<Item>) -> usize {
        let below = node.children().iter().map(|child| match child {
            RTreeNode::Leaf(_) => 0,
            RTreeNode::Parent(parent) => places(parent),
        });
        node.children().len() + below.sum::<usize>()
    }
    let (all, item_bytes) = (
        places(tree.root()) * size_of::<RTreeNode<Item>>(),
        tree.size() * size_of::<RTreeNode<Item>>(),
    );
    MemoryUsage {
        node_bytes: all.saturating_sub(item_bytes),
        item_bytes,
    }
}

macro_rules! peer {
    ($(#[$doc:meta])* $peer:ident, $name:literal, $summary:literal, $params:ty) => {
        $(#[$doc])*
        pub struct $peer(RTree<Item, $params>);

        impl $peer {
            #[inline(always)]
            fn search<T: BoxTest, S: Sink, R: Recorder>(
                &self,
                test: &T,
                sink: &mut S,
                recorder: &mut R,
            ) -> ControlFlow<()> {
                let tally = Tally::new(recorder);
                let selected = Selected { test, tally: &tally };
                for item in self.0.locate_with_selection_function(selected) {
                    sink.accept(std::slice::from_ref(&item.id))?;
                }
                ControlFlow::Continue(())
            }
        }

        impl RegionIndex for $peer {
            const NAME: &'static str = $name;
            const SUMMARY: &'static str = $summary;
            type Params = PeerParams;

            fn build(
                items: &[Aabb],
                _: Option<&PlaneTree>,
                _: &PeerParams,
            ) -> Result<Self, BuildError> {
                Ok($peer(RTree::bulk_load_with_params(indexable(items)?)))
            }

            fn memory(&self) -> MemoryUsage {
                memory(&self.0)
            }

            located_box_by_box!();
        }

        seen_box_by_box!($peer);
    };
}

peer!(
    /// Its defaults: nodes of up to six.
    PeerRstar,
    "peer-rstar",
    "crate rstar, bulk-loaded, nodes of 6, asked through a selection function",
    rstar::DefaultParams
);

peer!(
    /// Larger nodes.
    PeerRstarTuned,
    "peer-rstar-tuned",
    "crate rstar, bulk-loaded, nodes of 16, asked through a selection function",
    LargeNodes
);
