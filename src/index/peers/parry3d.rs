//! The crate parry3d's BVH with its default builder.
//!
//! Queried through `traverse_indexed`, which lets whole subtrees be accepted.

use std::ops::ControlFlow;

use glam::Vec3;
use parry3d::bounding_volume::Aabb as ParryAabb;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhNode, BvhWorkspace, TraversalAction};
use serde::{Deserialize, Serialize};

use crate::geometry::Aabb;
use crate::index::box_test::{BoxQuery, BoxTest, BoxTested};
use crate::index::items::Record;
use crate::index::{BuildError, Info, Kind, MemoryUsage, Origin};
use crate::query::{Context, ItemId, Recorder};

/// Parameters: `peer-parry3d:update=reinsert`.
#[derive(Clone, Copy, Default, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Parry3dParams {
    /// The crate's calls of an update.
    pub update: Parry3dUpdate,
}

/// Calls of the crate after items have moved.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Parry3dUpdate {
    /// `insert_or_update_partially`, then `refit_partial`.
    ///
    /// `refit` instead, once one item in eight has moved.
    #[default]
    Refit,
    /// `insert_or_update_partially`, `refit`, then `optimize_incremental`.
    ///
    /// The crate forbids `refit_partial` after an `optimize_incremental`.
    Optimize,
    /// `reinsert_or_update_with_change_detection`.
    Reinsert,
}

/// The crate's tree by its binned builder, with ids as leaves.
///
/// Subtrees wholly inside are not tested further.
pub struct PeerParry3d {
    bvh: Bvh,
    update: Parry3dUpdate,
    workspace: BvhWorkspace,
}

/// Most distinct centres within too narrow an extent.
///
/// The crate's builder splits them off one by one and recurses for each; 2 MiB of stack suffice.
const MOST_NARROW: usize = 2048;
/// Extent of centres below which eight bins overflow the builder's f32 scale.
const TOO_NARROW: f32 = 8.0 / f32::MAX;

/// Refuses items that would overflow the stack of the builder. O(n log n).
fn refuse_narrow(structure: &'static str, items: &[Record]) -> Result<(), BuildError> {
    for axis in 0..3 {
        let centres = items.iter().map(|item| item.bounds.centre()[axis]);
        // Distinct numbers farther from zero differ by more than the extent.
        let mut centres: Vec<f32> = centres.filter(|c| c.abs() < 1e-30).collect();
        centres.sort_unstable_by(f32::total_cmp);
        centres.dedup();
        let is_narrow = |some: &[f32]| some[MOST_NARROW] - some[0] < TOO_NARROW;
        if centres.windows(MOST_NARROW + 1).any(is_narrow) {
            let reason = format!(
                "its builder recurses for each of more than {MOST_NARROW} items within {TOO_NARROW:e} \
                 of each other; expected fewer"
            );
            return Err(BuildError::Refused { structure, reason });
        }
    }
    Ok(())
}

fn crate_box(b: &Aabb) -> ParryAabb {
    let vector = |v: Vec3| parry3d::math::Vector::new(v.x, v.y, v.z);
    ParryAabb::new(vector(b.min), vector(b.max))
}

/// An update refits all nodes once one item in this number has moved.
const ALL_SHARE: usize = 8;

#[inline(always)]
fn bounds_of(node: &BvhNode) -> Aabb {
    let vector = |v: parry3d::math::Vector| Vec3::new(v.x, v.y, v.z);
    Aabb::new(vector(node.mins()), vector(node.maxs()))
}

/// The action for the crate; stops the traversal if the sink ended the query.
#[inline(always)]
fn unless_ended(flow: ControlFlow<()>, action: TraversalAction) -> TraversalAction {
    match flow {
        ControlFlow::Continue(()) => action,
        ControlFlow::Break(()) => TraversalAction::EarlyExit,
    }
}

impl BoxTested for PeerParry3d {
    const ABOUT: Info = Info::new(
        "peer-parry3d",
        "crate parry3d, binned build, queried through traverse_indexed, whole subtrees accepted",
        Kind::Tree,
        Origin::Crate("parry3d"),
    )
    .refits();
    type Params = Parry3dParams;

    fn of(items: Vec<Record>, params: &Parry3dParams) -> Result<Self, BuildError> {
        refuse_narrow(Self::ABOUT.name, &items)?;
        let leaf = |item: &Record| (item.id as usize, crate_box(&item.bounds));
        let leaves = items.iter().map(leaf);
        let bvh = match items.len() {
            // With up to two items the builder ignores the ids and numbers the leaves 0 and 1.
            0..=2 => {
                let mut bvh = Bvh::new();
                leaves.for_each(|(id, bounds)| bvh.insert(bounds, id as u32));
                bvh
            }
            _ => Bvh::from_iter(BvhBuildStrategy::Binned, leaves),
        };
        Ok(PeerParry3d {
            bvh,
            update: params.update,
            workspace: BvhWorkspace::default(),
        })
    }

    fn follow(&mut self, items: &[Aabb], moved: &[ItemId]) -> Option<()> {
        // After a removal the crate forbids `refit_partial`.
        let mut removes = false;
        for &leaf in moved {
            if items[leaf as usize].is_empty() {
                removes |= self.bvh.leaf_node(leaf).is_some();
                self.bvh.remove(leaf);
                continue;
            }
            let bounds = crate_box(&items[leaf as usize]);
            // A leaf that contains the new bounds would keep its old ones.
            let holds = || (self.bvh.leaf_node(leaf)).is_some_and(|n| n.contains_aabb(&bounds));
            if self.update == Parry3dUpdate::Reinsert && !holds() {
                (self.bvh).reinsert_or_update_with_change_detection(bounds, leaf, 0.0);
            } else {
                self.bvh.insert_or_update_partially(bounds, leaf, 0.0);
            }
        }
        if self.update == Parry3dUpdate::Reinsert {
            return Some(());
        }
        let is_refit = self.update == Parry3dUpdate::Refit;
        if is_refit && !removes && moved.len() * ALL_SHARE < self.bvh.leaf_count() as usize {
            self.bvh.refit_partial(&[], moved);
        } else {
            self.bvh.refit(&mut self.workspace);
        }
        if self.update == Parry3dUpdate::Optimize {
            self.bvh.optimize_incremental(&mut self.workspace);
        }
        Some(())
    }

    fn used(&self) -> MemoryUsage {
        // The crate counts a leaf's index as a number but stores an Option.
        let held = self.bvh.leaf_count() as usize;
        let uncounted = held * (size_of::<Option<usize>>() - size_of::<usize>());
        // Half of the nodes are leaves.
        let leaves = held * size_of::<BvhNode>();
        MemoryUsage {
            node_bytes: (self.bvh.heap_memory_size() + uncounted).saturating_sub(leaves),
            item_bytes: leaves,
        }
    }

    /// Traverses an accepted subtree a second time, without tests.
    #[inline(always)]
    fn search<T: BoxTest + ?Sized, C: Context>(&self, ask: &mut BoxQuery<T, C>) -> ControlFlow<()> {
        let mut flow = ControlFlow::Continue(());
        self.bvh.traverse_indexed(None, |node, at| {
            if let Some(id) = node.leaf_data() {
                flow = ask.item(&bounds_of(node), &id);
                return unless_ended(flow, TraversalAction::Continue);
            }
            let (rejected, accepted) = ask.rejects_accepts(&bounds_of(node));
            if rejected {
                ask.cx.recorder().subtrees_rejected(1);
                return TraversalAction::Prune;
            }
            if !accepted {
                return TraversalAction::Continue;
            }
            let mut accepted = 0;
            self.bvh.traverse_indexed(Some(at), |node, _| {
                if let Some(id) = node.leaf_data() {
                    accepted += 1;
                    flow = ask.cx.accept(&[id]);
                }
                unless_ended(flow, TraversalAction::Continue)
            });
            ask.cx.recorder().subtree_accepted(accepted);
            unless_ended(flow, TraversalAction::Prune)
        });
        flow
    }
}
