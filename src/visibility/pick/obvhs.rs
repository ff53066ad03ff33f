//! The crate obvhs by its own ray traversals, boxes as primitives: over its binary
//! tree, and over its eight-wide one with quantised nodes.

use ::obvhs::bvh2::Bvh2;
use ::obvhs::cwbvh::CwBvh;
use ::obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use ::obvhs::ray::{Ray as TheirRay, RayHit};
use glam::DVec3;

use super::contract::{BackEnd, Hit, NotBuilt, Pick, keep_nearest, refuse_stacks};
use super::rounded::RoundedRay;
use crate::geometry::Aabb;
use crate::index::ploc;
use crate::query::ItemId;
use crate::visibility::{Guarantee, Ray, Solids};

/// The row of the binary tree.
pub const ROW: BackEnd = BackEnd {
    name: "obvhs",
    summary: "crate obvhs, binary tree, one item a leaf, its ray_traverse",
    // Rays, nodes and boxes are rounded to f32.
    guarantee: Guarantee::Unproven,
    build: |solids| Obvhs::<Bvh2>::boxed(solids, ROW.name),
};

/// The row of the eight-wide tree.
pub const ROW_WIDE: BackEnd = BackEnd {
    name: "obvhs-cwbvh",
    summary: "crate obvhs, eight-wide quantised tree, its ray_traverse",
    guarantee: Guarantee::Unproven,
    build: |solids| Obvhs::<CwBvh>::boxed(solids, ROW_WIDE.name),
};

/// A tree of the crate that rays are cast through.
trait Cast: Sized + Send + Sync + 'static {
    /// The tree over boxes, and the order of its primitives.
    fn of(boxes: &[Aabb]) -> Self;

    fn order(&self) -> &[u32];

    /// The first box that is entered.
    fn first(&self, ray: TheirRay, found: &mut RayHit, entry: impl FnMut(&TheirRay, usize) -> f32);

    /// All boxes that may be.
    fn all(&self, ray: TheirRay, visit: impl FnMut(&TheirRay, usize));
}

/// The binary tree, ready for its walks.
pub(super) fn binary_tree(boxes: &[Aabb]) -> Bvh2 {
    let mut tree = ploc::build(boxes, ploc::ONE_A_LEAF);
    tree.reorder_in_stack_traversal_order();
    // A walk keeps one entry a level; the crate's default is 96.
    if !tree.nodes.is_empty() {
        tree.max_depth = tree.max_depth.max(tree.depth(0) + 2);
    }
    tree
}

impl Cast for Bvh2 {
    fn of(boxes: &[Aabb]) -> Bvh2 {
        binary_tree(boxes)
    }

    fn order(&self) -> &[u32] {
        &self.primitive_indices
    }

    #[inline(always)]
    fn first(&self, ray: TheirRay, found: &mut RayHit, entry: impl FnMut(&TheirRay, usize) -> f32) {
        self.ray_traverse(ray, found, entry);
    }

    #[inline(always)]
    fn all(&self, ray: TheirRay, visit: impl FnMut(&TheirRay, usize)) {
        self.ray_traverse_anyhit(ray, visit);
    }
}

impl Cast for CwBvh {
    fn of(boxes: &[Aabb]) -> CwBvh {
        bvh2_to_cwbvh(&ploc::build(boxes, ploc::ONE_A_LEAF), 3, true, false)
    }

    fn order(&self) -> &[u32] {
        &self.primitive_indices
    }

    #[inline(always)]
    fn first(&self, ray: TheirRay, found: &mut RayHit, entry: impl FnMut(&TheirRay, usize) -> f32) {
        if !self.nodes.is_empty() {
            self.ray_traverse(ray, found, entry);
        }
    }

    #[inline(always)]
    fn all(&self, ray: TheirRay, visit: impl FnMut(&TheirRay, usize)) {
        if !self.nodes.is_empty() {
            self.ray_traverse_anyhit(ray, visit);
        }
    }
}

/// A tree, and the items in the order of its primitives.
struct Obvhs<T> {
    tree: T,
    boxes: Vec<Aabb>,
    ids: Vec<ItemId>,
    zero: DVec3,
}

impl<T: Cast> Obvhs<T> {
    fn boxed(solids: &Solids, name: &'static str) -> Result<Box<dyn Pick>, NotBuilt> {
        refuse_stacks(name, &solids.outer)?;
        let tree = T::of(&solids.outer);
        let ids = tree.order().to_vec();
        Ok(Box::new(Obvhs {
            boxes: ids.iter().map(|&id| solids.outer[id as usize]).collect(),
            ids,
            zero: solids.origin,
            tree,
        }))
    }
}

/// A ray as the crate takes it.
#[inline(always)]
pub(super) fn their_ray(ray: &RoundedRay) -> TheirRay {
    TheirRay::new(
        ray.origin.into(),
        ray.direction.into(),
        0.0,
        ray.far.next_up(),
    )
}

impl<T: Cast> Pick for Obvhs<T> {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let rounded = RoundedRay::of(ray, self.zero);
        let mut found = RayHit::none();
        let entry = |_: &TheirRay, place: usize| rounded.entry(&self.boxes[place]);
        self.tree.first(their_ray(&rounded), &mut found, entry);
        Some(Hit {
            item: *self.ids.get(found.primitive_id as usize)?,
            depth: f64::from(found.t),
        })
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let rounded = RoundedRay::of(ray, self.zero);
        hits.clear();
        let visit = |_: &TheirRay, place: usize| {
            hits.extend(rounded.hit(self.ids[place], &self.boxes[place]));
        };
        self.tree.all(their_ray(&rounded), visit);
        keep_nearest(hits, count);
    }
}
