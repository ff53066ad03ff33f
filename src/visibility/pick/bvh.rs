//! The crate bvh: its `traverse` with a slab test hands back all that lies on the
//! ray, from which the first is taken.

use ::bvh::aabb::{Aabb as TheirBox, IntersectsAabb};
use ::bvh::bvh::Bvh;
use glam::DVec3;

use super::contract::{BackEnd, Hit, NotBuilt, Pick, keep_nearest, refuse_stacks};
use super::rounded::RoundedRay;
use crate::index::Record;
use crate::index::peers::{Shape, bounds_of};
use crate::visibility::{Guarantee, Ray, Solids};

/// The row of this file.
pub const ROW: BackEnd = BackEnd {
    name: "bvh",
    summary: "crate bvh, its traverse: all items on the ray, then the first",
    guarantee: Guarantee::Unproven,
    build,
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

/// Builds it for the table of back ends.
fn build(solids: &Solids) -> Result<Box<dyn Pick>, NotBuilt> {
    refuse_stacks(ROW.name, &solids.outer)?;
    let records = Record::numbered(&solids.outer).into_iter();
    let mut shapes: Vec<Shape> = records.map(Shape::from).collect();
    Ok(Box::new(PickBvh {
        tree: Bvh::build(&mut shapes),
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
