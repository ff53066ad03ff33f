//! The crate bvh: its `traverse` with a slab test hands back all that lies on the
//! ray, from which the first is taken; triangles by its own test of one.

use ::bvh::aabb::{Aabb as TheirBox, IntersectsAabb};
use ::bvh::bvh::Bvh;
use ::bvh::ray::Ray as TheirRay;
use glam::{DVec3, Vec3};
use nalgebra::{Point3, Vector3};

use super::contract::{BackEnd, Hit, NotBuilt, Pick, keep_nearest, keep_nearest_items};
use super::facets::Facets;
use super::rounded::RoundedRay;
use crate::geometry::Aabb;
use crate::index::peers::{Shape, bounds_of};
use crate::index::{Record, ploc};
use crate::kernel::Kernel;
use crate::visibility::{Guarantee, Ray, Solids};

/// The row of this file.
pub const ROW: BackEnd = BackEnd {
    name: "bvh",
    summary: "crate bvh, its traverse: all items on the ray, then the first",
    guarantee: Guarantee::Unproven,
    build,
    build_triangles: Some(|facets, _| Ok(Box::new(BvhTriangles::of(facets)?))),
};

/// The line from the origin to the far plane. The crate's own ray has a
/// direction of length 1, whose depths would be others.
struct Line(RoundedRay);

impl IntersectsAabb<f32, 3> for Line {
    #[inline(always)]
    fn intersects_aabb(&self, b: &TheirBox<f32, 3>) -> bool {
        self.0.meets(&bounds_of(b), self.0.far)
    }
}

/// Its tree.
pub struct PickBvh {
    tree: Bvh<f32, 3>,
    shapes: Vec<Shape>,
    zero: DVec3,
}

fn tree(boxes: &[Aabb]) -> Result<(Bvh<f32, 3>, Vec<Shape>), NotBuilt> {
    if let Some(alike) = ploc::too_many_alike(boxes.iter()) {
        return Err(NotBuilt::Alike {
            name: ROW.name,
            alike,
            most: ploc::MOST_ALIKE,
        });
    }
    let records = Record::numbered(boxes).into_iter();
    let mut shapes: Vec<Shape> = records.map(Shape::from).collect();
    Ok((Bvh::build(&mut shapes), shapes))
}

/// Builds it for the table of back ends.
fn build(solids: &Solids, _: Kernel) -> Result<Box<dyn Pick>, NotBuilt> {
    let (tree, shapes) = tree(&solids.outer)?;
    Ok(Box::new(PickBvh {
        tree,
        shapes,
        zero: solids.origin,
    }))
}

impl PickBvh {
    fn met(&self, ray: &Ray) -> impl Iterator<Item = Hit> {
        let line = Line(RoundedRay::of(ray, self.zero));
        let found = self.tree.traverse(&line, &self.shapes);
        found.into_iter().filter_map(move |shape| {
            let Record { bounds, id } = &shape.item;
            line.0.hit(*id, bounds)
        })
    }
}

impl Pick for PickBvh {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        self.met(ray).min_by(Hit::order)
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        hits.clear();
        hits.extend(self.met(ray));
        keep_nearest(hits, count);
    }
}

/// Its tree over triangles; shapes are their places.
struct BvhTriangles {
    tree: Bvh<f32, 3>,
    shapes: Vec<Shape>,
    facets: Facets,
}

impl BvhTriangles {
    fn of(facets: &Facets) -> Result<BvhTriangles, NotBuilt> {
        let (tree, shapes) = tree(&facets.bounds())?;
        Ok(BvhTriangles {
            tree,
            shapes,
            facets: facets.clone(),
        })
    }

    /// Places of the triangles on the ray with their depths.
    fn met(&self, ray: &Ray) -> impl Iterator<Item = (usize, f32)> {
        let line = Line(RoundedRay::of(ray, self.facets.origin));
        let rounded = &line.0;
        let point = |v: Vec3| Point3::new(v.x, v.y, v.z);
        let direction = rounded.direction;
        let along = Vector3::new(direction.x, direction.y, direction.z);
        let theirs = TheirRay::new(point(rounded.origin), along);
        let unit = 1.0 / direction.length();
        let (near, far) = (rounded.near, rounded.far);
        let found = self.tree.traverse(&line, &self.shapes);
        found.into_iter().filter_map(move |shape| {
            let place = shape.item.id as usize;
            let facet = &self.facets.all[place];
            let [a, b, c] = facet.corners.map(point);
            let mut met = theirs.intersects_triangle(&a, &b, &c).distance;
            // Its test is of one side.
            if facet.two_sided && met.is_infinite() {
                met = theirs.intersects_triangle(&a, &c, &b).distance;
            }
            let depth = met * unit;
            (depth >= near && depth <= far).then_some((place, depth))
        })
    }
}

impl Pick for BvhTriangles {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let item = |place: usize| self.facets.all[place].item;
        let order = |a: &(usize, f32), b: &(usize, f32)| {
            a.1.total_cmp(&b.1).then(item(a.0).cmp(&item(b.0)))
        };
        let (place, depth) = self.met(ray).min_by(order)?;
        self.facets.hit(place, f64::from(depth))
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        hits.clear();
        let hit = |(place, depth)| self.facets.hit(place, f64::from(depth));
        hits.extend(self.met(ray).filter_map(hit));
        keep_nearest_items(hits, count);
    }
}
