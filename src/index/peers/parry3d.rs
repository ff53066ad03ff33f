//! The crate parry3d's BVH: its default build, queried through `traverse_indexed`,
//! which lets whole subtrees be accepted.

use std::ops::ControlFlow;

use glam::Vec3;
use parry3d::bounding_volume::Aabb as ParryAabb;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhNode, BvhWorkspace, TraversalAction};

use super::{place_of, placed};
use crate::geometry::Aabb;
use crate::index::box_test::{BoxTest, BoxTested, Tally};
use crate::index::items::Record;
use crate::index::{BuildError, Info, Kind, MemoryUsage, Origin};
use crate::query::{ItemId, Recorder, Sink};

/// The crate's tree by its binned builder, whose leaves are indices of items.
///
/// Subtrees that are wholly inside are not tested further.
pub struct PeerParry3d {
    bvh: Bvh,
    ids: Vec<ItemId>,
    workspace: BvhWorkspace,
}

fn crate_box(b: &Aabb) -> ParryAabb {
    let vector = |v: Vec3| parry3d::math::Vector::new(v.x, v.y, v.z);
    ParryAabb::new(vector(b.min), vector(b.max))
}

/// An update refits all nodes from one moved item in as many on.
const ALL_SHARE: usize = 16;

#[inline(always)]
fn bounds_of(node: &BvhNode) -> Aabb {
    let vector = |v: parry3d::math::Vector| Vec3::new(v.x, v.y, v.z);
    Aabb::new(vector(node.mins()), vector(node.maxs()))
}

impl BoxTested for PeerParry3d {
    const ABOUT: Info = Info::new(
        "peer-parry3d",
        "crate parry3d, binned build, queried through traverse_indexed, whole subtrees accepted",
        Kind::Tree,
        Origin::Crate("parry3d"),
    )
    .refits();

    fn of(items: Vec<Record>) -> Result<Self, BuildError> {
        let leaves: Vec<ParryAabb> = items.iter().map(|item| crate_box(&item.bounds)).collect();
        Ok(PeerParry3d {
            bvh: Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves),
            ids: items.iter().map(|item| item.id).collect(),
            workspace: BvhWorkspace::default(),
        })
    }

    /// `insert_or_update_partially`, then `refit_partial`.
    ///
    /// `refit` in its place from one moved item in sixteen on.
    fn follow(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        let Some(placed) = placed(|id| place_of(&self.ids, |id| *id, id), items, moved) else {
            return false;
        };
        for (leaf, bounds) in &placed {
            (self.bvh).insert_or_update_partially(crate_box(bounds), *leaf as u32, 0.0);
        }
        if placed.len() * ALL_SHARE < self.ids.len() {
            let leaves: Vec<u32> = placed.iter().map(|(leaf, _)| *leaf as u32).collect();
            self.bvh.refit_partial(&[], &leaves);
        } else {
            self.bvh.refit(&mut self.workspace);
        }
        true
    }

    fn used(&self) -> MemoryUsage {
        // The crate counts the index of a leaf as a number; it stores an Option.
        let uncounted = self.ids.len() * (size_of::<Option<usize>>() - size_of::<usize>());
        // Half of the nodes are the leaves.
        let leaves = self.ids.len() * size_of::<BvhNode>();
        MemoryUsage {
            node_bytes: (self.bvh.heap_memory_size() + uncounted).saturating_sub(leaves),
            item_bytes: leaves + size_of_val(&self.ids[..]),
        }
    }

    /// Traverses an accepted subtree once more, without tests.
    #[inline(always)]
    fn search<T: BoxTest + ?Sized, S: Sink, R: Recorder>(
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
                tally.count(|recorder| recorder.subtrees_rejected(1));
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
