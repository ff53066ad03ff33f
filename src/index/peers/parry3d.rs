//! The crate parry3d's BVH: built from leaves by either of its strategies,
//! asked through `leaves` with a test of its nodes, or through
//! `traverse_indexed`, which lets whole subtrees be accepted.

use std::ops::ControlFlow;

use glam::Vec3;
use parry3d::bounding_volume::Aabb as ParryAabb;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhNode, TraversalAction};

use super::{BoxTest, Record, Tally, peer_of_tree, refuse_stacks};
use crate::geometry::Aabb;
use crate::index::{BuildError, MemoryUsage};
use crate::query::{ItemId, Recorder, Sink};

/// A box of this reach has an area that is still a number in f32.
const LARGEST_FOR_PLOC: f32 = 1e18;

/// A tree whose leaves are the places of items.
struct Tree {
    bvh: Bvh,
    ids: Vec<ItemId>,
}

#[inline(always)]
fn bounds_of(node: &BvhNode) -> Aabb {
    let vector = |v: parry3d::math::Vector| Vec3::new(v.x, v.y, v.z);
    Aabb::new(vector(node.mins()), vector(node.maxs()))
}

impl Tree {
    fn build(
        structure: &'static str,
        items: Vec<Record>,
        strategy: BvhBuildStrategy,
    ) -> Result<Tree, BuildError> {
        let ploc = strategy == BvhBuildStrategy::Ploc;
        if ploc {
            refuse_stacks(structure, &items)?;
        }
        let scene = Aabb::union_of(items.iter().map(|item| &item.bounds));
        // PLOC compares areas, and panics where they overflow.
        let strategy = match ploc && scene.reach().max_element() > LARGEST_FOR_PLOC {
            true => BvhBuildStrategy::Binned,
            false => strategy,
        };
        let vector = |v: Vec3| parry3d::math::Vector::new(v.x, v.y, v.z);
        let leaves = items
            .iter()
            .map(|item| ParryAabb::new(vector(item.bounds.min), vector(item.bounds.max)));
        let leaves: Vec<ParryAabb> = leaves.collect();
        Ok(Tree {
            bvh: Bvh::from_leaves(strategy, &leaves),
            ids: items.iter().map(|item| item.id).collect(),
        })
    }

    fn memory(&self) -> MemoryUsage {
        // The crate counts the place of a leaf as a number; it keeps an Option.
        let uncounted = self.ids.len() * (size_of::<Option<usize>>() - size_of::<usize>());
        // Half of the nodes are the leaves.
        let leaves = self.ids.len() * size_of::<BvhNode>();
        MemoryUsage {
            node_bytes: (self.bvh.heap_memory_size() + uncounted).saturating_sub(leaves),
            item_bytes: leaves + size_of_val(&self.ids[..]),
        }
    }

    /// `traverse_indexed`: a subtree that is accepted is gone through once
    /// more, without tests.
    #[inline(always)]
    fn traverse<T: BoxTest, S: Sink, R: Recorder>(
        &self,
        test: &T,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let tally = Tally::new(recorder);
        let mut flow = ControlFlow::Continue(());
        self.bvh.traverse_indexed(None, |node, at| {
            if let Some(place) = node.leaf_data() {
                tally.item(test);
                if test.admits(&bounds_of(node)) {
                    flow = sink.accept(&self.ids[place as usize..=place as usize]);
                }
                return match flow {
                    ControlFlow::Continue(()) => TraversalAction::Continue,
                    ControlFlow::Break(()) => TraversalAction::EarlyExit,
                };
            }
            tally.node(test);
            let bounds = bounds_of(node);
            let (rejected, accepted) = test.rejects_accepts(&bounds);
            if rejected {
                tally.count(R::subtree_rejected);
                return TraversalAction::Prune;
            }
            if !accepted {
                return TraversalAction::Continue;
            }
            let mut accepted = 0;
            self.bvh.traverse_indexed(Some(at), |node, _| {
                if let Some(place) = node.leaf_data() {
                    accepted += 1;
                    flow = sink.accept(&self.ids[place as usize..=place as usize]);
                    if flow.is_break() {
                        return TraversalAction::EarlyExit;
                    }
                }
                TraversalAction::Continue
            });
            tally.count(|recorder| recorder.subtree_accepted(accepted));
            match flow {
                ControlFlow::Continue(()) => TraversalAction::Prune,
                ControlFlow::Break(()) => TraversalAction::EarlyExit,
            }
        });
        flow
    }
}

peer_of_tree!(
    /// Its default build; subtrees that are wholly inside are not tested further.
    PeerParry3d,
    "peer-parry3d",
    "crate parry3d, binned build, asked through traverse_indexed, whole subtrees accepted",
    "parry3d",
    Tree,
    BvhBuildStrategy::Binned,
    traverse
);
