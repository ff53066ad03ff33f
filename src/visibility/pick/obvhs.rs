//! The crate obvhs by its own ray traversals, boxes or its own triangles as primitives:
//! over its binary tree, and over its eight-wide one with quantised nodes.

use ::obvhs::bvh2::Bvh2;
use ::obvhs::cwbvh::CwBvh;
use ::obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use ::obvhs::ray::{Ray as TheirRay, RayHit};
use ::obvhs::triangle::Triangle as TheirTriangle;
use glam::DVec3;

use super::contract::{BackEnd, Hit, Pick, keep_nearest, keep_nearest_items};
use super::facets::Facets;
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
    build: |solids, _| Ok(Obvhs::<Bvh2>::boxed(solids)),
    build_triangles: Some(|facets, _| Ok(ObvhsTriangles::<Bvh2>::boxed(facets))),
};

/// The row of the eight-wide tree.
pub const ROW_WIDE: BackEnd = BackEnd {
    name: "obvhs-cwbvh",
    summary: "crate obvhs, eight-wide quantised tree, its ray_traverse",
    guarantee: Guarantee::Unproven,
    build: |solids, _| Ok(Obvhs::<CwBvh>::boxed(solids)),
    build_triangles: Some(|facets, _| Ok(ObvhsTriangles::<CwBvh>::boxed(facets))),
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

impl Cast for Bvh2 {
    fn of(boxes: &[Aabb]) -> Bvh2 {
        let mut tree = ploc::build(boxes, ploc::ONE_A_LEAF);
        tree.reorder_in_stack_traversal_order();
        // A walk keeps one entry a level; the crate's default is 96.
        if !tree.nodes.is_empty() {
            tree.max_depth = tree.max_depth.max(tree.depth(0) + 2);
        }
        tree
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
    fn boxed(solids: &Solids) -> Box<dyn Pick> {
        let tree = T::of(&solids.outer);
        let ids = tree.order().to_vec();
        Box::new(Obvhs {
            boxes: ids.iter().map(|&id| solids.outer[id as usize]).collect(),
            ids,
            zero: solids.origin,
            tree,
        })
    }
}

/// A ray as the crate takes it.
#[inline(always)]
fn their_ray(ray: &RoundedRay) -> TheirRay {
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

/// A tree over triangles.
struct ObvhsTriangles<T> {
    tree: T,
    /// In the order of its primitives, as it takes them.
    triangles: Vec<(TheirTriangle, bool, ItemId)>,
    zero: DVec3,
    items: usize,
}

impl<T: Cast> ObvhsTriangles<T> {
    fn boxed(facets: &Facets) -> Box<dyn Pick> {
        let boxes = facets.bounds();
        let tree = T::of(&boxes);
        let placed = tree.order().iter().map(|&place| {
            let facet = &facets.all[place as usize];
            let [v0, v1, v2] = facet.corners.map(Into::into);
            (TheirTriangle { v0, v1, v2 }, facet.two_sided, facet.item)
        });
        Box::new(ObvhsTriangles {
            triangles: placed.collect(),
            zero: facets.origin,
            items: facets.items,
            tree,
        })
    }

    /// Depth at which a triangle is met, infinite if it is not.
    #[inline(always)]
    fn depth(&self, ray: &TheirRay, near: f32, place: usize) -> f32 {
        let (triangle, two_sided, _) = &self.triangles[place];
        let [u, v] = [triangle.v1 - triangle.v0, triangle.v2 - triangle.v0];
        let is_behind = u.cross(v).dot(ray.direction) >= 0.0;
        let depth = triangle.intersect(ray);
        match depth >= near && (*two_sided || !is_behind) {
            true => depth,
            false => f32::INFINITY,
        }
    }
}

impl<T: Cast> Pick for ObvhsTriangles<T> {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let rounded = RoundedRay::of(ray, self.zero);
        let mut found = RayHit::none();
        let entry = |ray: &TheirRay, place: usize| self.depth(ray, rounded.near, place);
        self.tree.first(their_ray(&rounded), &mut found, entry);
        let (_, _, item) = *self.triangles.get(found.primitive_id as usize)?;
        let depth = f64::from(found.t);
        Hit { item, depth }.counted(self.items)
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let rounded = RoundedRay::of(ray, self.zero);
        hits.clear();
        let visit = |ray: &TheirRay, place: usize| {
            let depth = self.depth(ray, rounded.near, place);
            let item = self.triangles[place].2;
            if depth <= rounded.far && (item as usize) < self.items {
                let depth = f64::from(depth);
                hits.push(Hit { item, depth });
            }
        };
        self.tree.all(their_ray(&rounded), visit);
        keep_nearest_items(hits, count);
    }
}
