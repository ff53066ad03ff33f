//! The crate parry3d by its tree's own `cast_ray`, for triangles with its own test of one.

use ::parry3d::bounding_volume::Aabb as TheirBox;
use ::parry3d::math::Vector;
use ::parry3d::partitioning::{Bvh, BvhBuildStrategy, TraversalAction};
use ::parry3d::query::Ray as TheirRay;
use ::parry3d::query::details::local_ray_intersection_with_triangle;
use ::parry3d::shape::FeatureId;
use glam::{DVec3, Vec3};

use super::contract::{BackEnd, Hit, NotBuilt, Pick, keep_nearest, keep_nearest_items};
use super::facets::Facets;
use super::rounded::RoundedRay;
use crate::geometry::Aabb;
use crate::kernel::Kernel;
use crate::visibility::{Guarantee, Ray, Solids};

/// The row of this file.
pub const ROW: BackEnd = BackEnd {
    name: "parry3d",
    summary: "crate parry3d, binned build, its cast_ray",
    guarantee: Guarantee::Unproven,
    build,
    build_triangles: Some(|facets, _| Ok(Box::new(Parry3dTriangles::of(facets)))),
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

fn tree(boxes: &[Aabb]) -> Bvh {
    let theirs = |b: &Aabb| TheirBox::new(vector(b.min), vector(b.max));
    let leaves: Vec<TheirBox> = boxes.iter().map(theirs).collect();
    Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves)
}

fn their_ray(ray: &RoundedRay) -> TheirRay {
    TheirRay::new(vector(ray.origin), vector(ray.direction))
}

/// Shows the leaves that the ray may meet, in no order.
fn each_leaf(tree: &Bvh, ray: &TheirRay, mut leaf: impl FnMut(u32)) {
    tree.traverse(|node| {
        // Its `cast_ray` of a node is the largest number for none.
        if node.cast_ray(ray, f32::MAX) == f32::MAX {
            return TraversalAction::Prune;
        }
        if let Some(item) = node.leaf_data() {
            leaf(item);
        }
        TraversalAction::Continue
    });
}

/// Builds it for the table of back ends.
fn build(solids: &Solids, _: Kernel) -> Result<Box<dyn Pick>, NotBuilt> {
    Ok(Box::new(Parry3d {
        tree: tree(&solids.outer),
        boxes: solids.outer.clone(),
        zero: solids.origin,
    }))
}

impl Pick for Parry3d {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let rounded = RoundedRay::of(ray, self.zero);
        let theirs = their_ray(&rounded);
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
        hits.clear();
        each_leaf(&self.tree, &their_ray(&rounded), |item| {
            hits.extend(rounded.hit(item, &self.boxes[item as usize]));
        });
        keep_nearest(hits, count);
    }
}

/// Its tree over triangles; leaves are their places.
struct Parry3dTriangles {
    tree: Bvh,
    facets: Facets,
}

impl Parry3dTriangles {
    fn of(facets: &Facets) -> Parry3dTriangles {
        Parry3dTriangles {
            tree: tree(&facets.bounds()),
            facets: facets.clone(),
        }
    }

    /// Depth at which a triangle is met from near to far, from its front if it is
    /// one-sided.
    #[inline(always)]
    fn depth(&self, ray: &RoundedRay, theirs: &TheirRay, place: u32) -> Option<f32> {
        let facet = &self.facets.all[place as usize];
        let [a, b, c] = facet.corners.map(vector);
        let (met, _) = local_ray_intersection_with_triangle(a, b, c, theirs)?;
        // Face 0 is the one that turns counter-clockwise.
        let is_seen = facet.two_sided || met.feature == FeatureId::Face(0);
        let depth = met.time_of_impact;
        (is_seen && depth >= ray.near && depth <= ray.far).then_some(depth)
    }
}

impl Pick for Parry3dTriangles {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let rounded = RoundedRay::of(ray, self.facets.origin);
        let theirs = their_ray(&rounded);
        let met = |leaf: u32, _| self.depth(&rounded, &theirs, leaf);
        let (place, depth) = self.tree.cast_ray(&theirs, rounded.far, met)?;
        self.facets.hit(place as usize, f64::from(depth))
    }

    /// By its `traverse`, without an order.
    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let rounded = RoundedRay::of(ray, self.facets.origin);
        let theirs = their_ray(&rounded);
        hits.clear();
        each_leaf(&self.tree, &theirs, |place| {
            let depth = self.depth(&rounded, &theirs, place);
            hits.extend(depth.and_then(|depth| self.facets.hit(place as usize, f64::from(depth))));
        });
        keep_nearest_items(hits, count);
    }
}
