//! The crate bvh: its `traverse` with a slab test hands back all that lies on the
//! ray, from which the first is taken.

use ::bvh::aabb::{Aabb as TheirBox, Bounded, IntersectsAabb};
use ::bvh::bounding_hierarchy::BHShape;
use ::bvh::bvh::{Bvh, BvhNode};
use glam::{DVec3, Vec3};
use nalgebra::Point3;

use super::contract::{About, Hit, NotBuilt, Pick, keep_nearest, refuse_stacks};
use super::rounded::RoundedRay;
use crate::geometry::Aabb;
use crate::index::Origin;
use crate::query::ItemId;
use crate::visibility::{Guarantee, Ray, Solids};

/// As typed on the command line.
pub const NAME: &str = "bvh";
/// One line for tables and help.
pub const SUMMARY: &str = "crate bvh, its traverse: all items on the ray, then the first";

/// What it declares of itself.
pub const ABOUT: About = About {
    name: NAME,
    summary: SUMMARY,
    origin: Origin::Crate("bvh"),
    guarantee: Guarantee::Unproven,
};

/// An item that the crate tells where it put it.
#[derive(Clone, Copy)]
struct Shape {
    bounds: Aabb,
    id: ItemId,
    node: usize,
}

impl Bounded<f32, 3> for Shape {
    fn aabb(&self) -> TheirBox<f32, 3> {
        let point = |v: Vec3| Point3::new(v.x, v.y, v.z);
        TheirBox {
            min: point(self.bounds.min),
            max: point(self.bounds.max),
        }
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }
    fn bh_node_index(&self) -> usize {
        self.node
    }
}

/// The line from the origin to the far plane. The crate's own ray has a
/// direction of length 1, whose depths would be others.
struct Line(RoundedRay);

impl IntersectsAabb<f32, 3> for Line {
    #[inline(always)]
    fn intersects_aabb(&self, b: &TheirBox<f32, 3>) -> bool {
        let corner = |p: Point3<f32>| Vec3::new(p.x, p.y, p.z);
        self.0
            .meets(&Aabb::new(corner(b.min), corner(b.max)), self.0.far)
    }
}

/// Its tree.
pub struct PickBvh {
    tree: Bvh<f32, 3>,
    shapes: Vec<Shape>,
    zero: DVec3,
}

/// Builds it for the table of back ends.
pub(super) fn build(solids: &Solids) -> Result<Box<dyn Pick>, NotBuilt> {
    refuse_stacks(NAME, &solids.outer)?;
    let shape = |(id, &bounds): (usize, &Aabb)| Shape {
        bounds,
        id: id as ItemId,
        node: 0,
    };
    let mut shapes: Vec<Shape> = solids.outer.iter().enumerate().map(shape).collect();
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
            let depth = line.0.entry(&shape.bounds);
            let hit = Hit {
                item: shape.id,
                depth: f64::from(depth),
            };
            depth.is_finite().then_some(hit)
        })
    }
}

impl Pick for PickBvh {
    fn about(&self) -> About {
        ABOUT
    }

    fn first(&self, ray: &Ray) -> Option<Hit> {
        self.met(ray)
            .min_by(|a, b| a.depth.total_cmp(&b.depth).then(a.item.cmp(&b.item)))
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        hits.clear();
        hits.extend(self.met(ray));
        keep_nearest(hits, count);
    }

    fn memory(&self) -> usize {
        self.tree.nodes.capacity() * size_of::<BvhNode<f32, 3>>() + size_of_val(&self.shapes[..])
    }
}
