//! The crate parry3d by its tree's own `cast_ray`.

use ::parry3d::bounding_volume::Aabb as TheirBox;
use ::parry3d::math::Vector;
use ::parry3d::partitioning::{Bvh, BvhBuildStrategy, TraversalAction};
use ::parry3d::query::Ray as TheirRay;
use glam::{DVec3, Vec3};

use super::contract::{BackEnd, Hit, NotBuilt, Pick, keep_nearest};
use super::rounded::RoundedRay;
use crate::geometry::Aabb;
use crate::visibility::{Guarantee, Ray, Solids};

/// The row of this file.
pub const ROW: BackEnd = BackEnd {
    name: "parry3d",
    summary: "crate parry3d, binned build, its cast_ray",
    guarantee: Guarantee::Unproven,
    build,
};

/// Its tree; leaves are item ids.
pub struct Parry3d {
    tree: Bvh,
    boxes: Vec<Aabb>,
    zero: DVec3,
}

#[inline(always)]
fn vector(v: Vec3) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

/// Builds it for the table of back ends.
fn build(solids: &Solids) -> Result<Box<dyn Pick>, NotBuilt> {
    let theirs = |b: &Aabb| TheirBox::new(vector(b.min), vector(b.max));
    let leaves: Vec<TheirBox> = solids.outer.iter().map(theirs).collect();
    Ok(Box::new(Parry3d {
        tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves),
        boxes: solids.outer.clone(),
        zero: solids.origin,
    }))
}

impl Pick for Parry3d {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let rounded = RoundedRay::of(ray, self.zero);
        let theirs = TheirRay::new(vector(rounded.origin), vector(rounded.direction));
        let met = |leaf: u32, _| {
            let depth = rounded.entry(&self.boxes[leaf as usize]);
            depth.is_finite().then_some(depth)
        };
        let (item, depth) = self.tree.cast_ray(&theirs, rounded.far, met)?;
        let depth = f64::from(depth);
        Some(Hit { item, depth })
    }

    /// By its `traverse`, without an order.
    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let rounded = RoundedRay::of(ray, self.zero);
        let theirs = TheirRay::new(vector(rounded.origin), vector(rounded.direction));
        hits.clear();
        self.tree.traverse(|node| {
            // Its `cast_ray` of a node is the largest number for none.
            if node.cast_ray(&theirs, f32::MAX) == f32::MAX {
                return TraversalAction::Prune;
            }
            if let Some(item) = node.leaf_data() {
                hits.extend(rounded.hit(item, &self.boxes[item as usize]));
            }
            TraversalAction::Continue
        });
        keep_nearest(hits, count);
    }
}
