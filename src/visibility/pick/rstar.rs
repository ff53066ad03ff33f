//! The crate rstar: it casts no rays; its selection function is given a slab
//! test, and the first is taken from all that lies on the ray.

use ::rstar::{AABB, RTree, SelectionFunction};
use glam::{DVec3, Vec3};

use super::contract::{BackEnd, Hit, NotBuilt, Pick, keep_nearest};
use super::rounded::RoundedRay;
use crate::geometry::Aabb;
use crate::index::Record;
use crate::kernel::Kernel;
use crate::visibility::{Guarantee, Ray, Solids};

/// The row of this file.
pub const ROW: BackEnd = BackEnd {
    name: "rstar",
    summary: "crate rstar, selection by a slab test, then the first",
    guarantee: Guarantee::Unproven,
    build,
    build_triangles: None,
};

struct Line(RoundedRay);

impl SelectionFunction<Record> for Line {
    #[inline(always)]
    fn should_unpack_parent(&self, envelope: &AABB<[f32; 3]>) -> bool {
        let corner = Vec3::from_array;
        let b = Aabb::new(corner(envelope.lower()), corner(envelope.upper()));
        self.0.meets(&b, self.0.far)
    }

    #[inline(always)]
    fn should_unpack_leaf(&self, item: &Record) -> bool {
        self.0.entry(&item.bounds).is_finite()
    }
}

/// Its tree, bulk-loaded.
pub struct PickRstar {
    tree: RTree<Record>,
    zero: DVec3,
}

/// Builds it for the table of back ends.
fn build(solids: &Solids, _: Kernel) -> Result<Box<dyn Pick>, NotBuilt> {
    Ok(Box::new(PickRstar {
        tree: RTree::bulk_load(Record::numbered(&solids.outer)),
        zero: solids.origin,
    }))
}

impl PickRstar {
    fn met(&self, ray: &Ray) -> impl Iterator<Item = Hit> {
        let rounded = RoundedRay::of(ray, self.zero);
        let found = self.tree.locate_with_selection_function(Line(rounded));
        found.map(move |item| Hit {
            item: item.id,
            depth: f64::from(rounded.entry(&item.bounds)),
        })
    }
}

impl Pick for PickRstar {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        self.met(ray).min_by(Hit::order)
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        hits.clear();
        hits.extend(self.met(ray));
        keep_nearest(hits, count);
    }
}
