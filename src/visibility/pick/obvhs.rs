//! The crate obvhs by its own ray traversals, boxes or its own triangles as primitives:
//! over its binary tree, and over its eight-wide one with quantised nodes.

use std::ops::Range;

use super::contract::{BackEnd, Hit, NotBuilt, Pick, keep_nearest, keep_nearest_items};
use super::facets::Facets;
use super::rounded::{About, RoundedRay};
use crate::geometry::Aabb;
use crate::index::{caught, ploc};
use crate::query::ItemId;
use crate::visibility::{Guarantee, Ray, Solids};
use ::obvhs::bvh2::Bvh2;
use ::obvhs::cwbvh::CwBvh;
use ::obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use ::obvhs::ray::{Ray as TheirRay, RayHit};
use ::obvhs::triangle::Triangle as TheirTriangle;

/// The row of the binary tree.
pub const ROW: BackEnd = BackEnd {
    name: "obvhs",
    summary: "crate obvhs, binary tree, one item a leaf, its ray_traverse",
    // Rays, nodes and boxes are rounded to f32.
    guarantee: Guarantee::Unproven,
    build: |solids, _| Obvhs::<Bvh2>::boxed(solids, ROW.name),
    build_triangles: Some(|facets, _| ObvhsTriangles::<Bvh2>::boxed(facets, ROW.name)),
};

/// The row of the eight-wide tree.
pub const ROW_WIDE: BackEnd = BackEnd {
    name: "obvhs-cwbvh",
    summary: "crate obvhs, eight-wide quantised tree, its ray_traverse",
    guarantee: Guarantee::Unproven,
    build: |solids, _| Obvhs::<CwBvh>::boxed(solids, ROW_WIDE.name),
    build_triangles: Some(|facets, _| ObvhsTriangles::<CwBvh>::boxed(facets, ROW_WIDE.name)),
};

/// A tree of the crate that rays are cast through.
trait Cast: Sized + Send + Sync + 'static {
    /// The tree of the crate's binary one, whose levels are counted.
    fn of(binary: Bvh2, levels: usize) -> Result<Self, NotBuilt>;

    fn order(&self) -> &[u32];

    /// The first box that is entered.
    fn first(&self, ray: TheirRay, found: &mut RayHit, entry: impl FnMut(&TheirRay, usize) -> f32);

    /// All boxes that may be.
    fn all(&self, ray: TheirRay, visit: impl FnMut(&TheirRay, usize));
}

impl Cast for Bvh2 {
    fn of(mut tree: Bvh2, levels: usize) -> Result<Bvh2, NotBuilt> {
        tree.reorder_in_stack_traversal_order();
        // A walk keeps one entry a level; the crate's default is 96.
        tree.max_depth = tree.max_depth.max(levels + 2);
        Ok(tree)
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
    fn of(binary: Bvh2, levels: usize) -> Result<CwBvh, NotBuilt> {
        refuse_deep(levels, MOST_BINARY)?;
        let tree = bvh2_to_cwbvh(&binary, 3, true, false);
        let children = |node: usize| {
            let node = &tree.nodes[node];
            let first = node.child_base_idx as usize;
            first..first + node.imask.count_ones() as usize
        };
        refuse_deep(levels_of(tree.nodes.len(), children), MOST_WIDE)?;
        Ok(tree)
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

/// Levels of a binary tree up to which the conversion, which calls itself once per level,
/// stays on a small stack.
const MOST_BINARY: usize = 500;
/// Levels of an eight-wide tree for which the crate's walk has memory.
const MOST_WIDE: usize = 32;

fn refuse_deep(levels: usize, most: usize) -> Result<(), NotBuilt> {
    let name = ROW_WIDE.name;
    match levels > most {
        true => Err(NotBuilt::TooDeep { name, levels, most }),
        false => Ok(()),
    }
}

/// Levels of a tree of some nodes, the first of which is the root.
fn levels_of(nodes: usize, children: impl Fn(usize) -> Range<usize>) -> usize {
    let mut open: Vec<(usize, usize)> = (0..nodes.min(1)).map(|root| (root, 1)).collect();
    let mut deepest = 0;
    while let Some((node, level)) = open.pop() {
        deepest = deepest.max(level);
        open.extend(children(node).map(|child| (child, level + 1)));
    }
    deepest
}

/// The tree over boxes; a panic of the crate is an error.
fn tree<T: Cast>(boxes: &[Aabb], name: &'static str) -> Result<T, NotBuilt> {
    let build = || {
        let binary = ploc::build(boxes, ploc::ONE_A_LEAF);
        let levels = levels_of(binary.nodes.len(), |node| {
            let node = &binary.nodes[node];
            let first = node.first_index as usize;
            first..first + if node.is_leaf() { 0 } else { 2 }
        });
        T::of(binary, levels)
    };
    caught(build).unwrap_or_else(|message| Err(NotBuilt::Panicked { name, message }))
}

/// A tree, and the items in the order of its primitives.
struct Obvhs<T> {
    tree: T,
    boxes: Vec<Aabb>,
    ids: Vec<ItemId>,
    about: About,
}

impl<T: Cast> Obvhs<T> {
    fn boxed(solids: &Solids, name: &'static str) -> Result<Box<dyn Pick>, NotBuilt> {
        let about = About::of(solids.origin, &solids.outer);
        let boxes: Vec<Aabb> = solids.outer.iter().map(|b| about.scaled(b)).collect();
        let tree: T = tree(&boxes, name)?;
        let ids = tree.order().to_vec();
        Ok(Box::new(Obvhs {
            boxes: ids.iter().map(|&id| boxes[id as usize]).collect(),
            ids,
            about,
            tree,
        }))
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
        let rounded = RoundedRay::of(ray, &self.about);
        let mut found = RayHit::none();
        let entry = |_: &TheirRay, place: usize| rounded.entry(&self.boxes[place]);
        self.tree.first(their_ray(&rounded), &mut found, entry);
        let item = *self.ids.get(found.primitive_id as usize)?;
        Some(self.about.hit(item, found.t))
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let rounded = RoundedRay::of(ray, &self.about);
        hits.clear();
        let visit = |_: &TheirRay, place: usize| {
            let depth = rounded.entry(&self.boxes[place]);
            if depth.is_finite() {
                hits.push(self.about.hit(self.ids[place], depth));
            }
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
    about: About,
    items: usize,
}

impl<T: Cast> ObvhsTriangles<T> {
    fn boxed(facets: &Facets, name: &'static str) -> Result<Box<dyn Pick>, NotBuilt> {
        let mut boxes = facets.bounds();
        let about = About::of(facets.origin, &boxes);
        boxes.iter_mut().for_each(|b| *b = about.scaled(b));
        let tree: T = tree(&boxes, name)?;
        let placed = tree.order().iter().map(|&place| {
            let facet = &facets.all[place as usize];
            let [v0, v1, v2] = facet.corners.map(|corner| (corner * about.scale).into());
            (TheirTriangle { v0, v1, v2 }, facet.two_sided, facet.item)
        });
        Ok(Box::new(ObvhsTriangles {
            triangles: placed.collect(),
            about,
            items: facets.items,
            tree,
        }))
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
        let rounded = RoundedRay::of(ray, &self.about);
        let mut found = RayHit::none();
        let entry = |ray: &TheirRay, place: usize| self.depth(ray, rounded.near, place);
        self.tree.first(their_ray(&rounded), &mut found, entry);
        let (_, _, item) = *self.triangles.get(found.primitive_id as usize)?;
        self.about.hit(item, found.t).counted(self.items)
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let rounded = RoundedRay::of(ray, &self.about);
        hits.clear();
        let visit = |ray: &TheirRay, place: usize| {
            let depth = self.depth(ray, rounded.near, place);
            let item = self.triangles[place].2;
            if depth <= rounded.far && (item as usize) < self.items {
                hits.push(self.about.hit(item, depth));
            }
        };
        self.tree.all(their_ray(&rounded), visit);
        keep_nearest_items(hits, count);
    }
}

#[cfg(test)]
mod tests {
    use ::obvhs::bvh2::node::Bvh2Node;
    use glam::Vec3;

    use super::*;

    /// A tree of one item per level.
    fn chain(levels: usize) -> Bvh2 {
        let bounds = Aabb::new(Vec3::ZERO, Vec3::ONE);
        let bounds = ::obvhs::aabb::Aabb::new(bounds.min.into(), bounds.max.into());
        let leaf = |item: usize| Bvh2Node::new(bounds, 1, item as u32);
        let mut tree = Bvh2 {
            nodes: vec![Bvh2Node::new(bounds, 0, 1)],
            ..Bvh2::default()
        };
        for item in 0..levels - 1 {
            let next = tree.nodes.len() as u32 + 2;
            let last = item == levels - 2;
            let below = if last {
                leaf(levels - 1)
            } else {
                Bvh2Node::new(bounds, 0, next)
            };
            tree.nodes.extend([leaf(item), below]);
        }
        tree.primitive_indices = (0..levels as u32).collect();
        tree
    }

    #[test]
    fn trees_that_are_too_deep_to_walk_are_refused() {
        let of = |levels| CwBvh::of(chain(levels), levels).err();
        assert_eq!(of(100), None);
        let too_deep = |levels, most| {
            let name = ROW_WIDE.name;
            Some(NotBuilt::TooDeep { name, levels, most })
        };
        assert_eq!(of(100_000), too_deep(100_000, MOST_BINARY));
        let wide = of(400);
        assert!(
            matches!(
                wide,
                Some(NotBuilt::TooDeep {
                    most: MOST_WIDE,
                    ..
                })
            ),
            "{wide:?}"
        );
        // The binary tree's walk has as much memory as it needs.
        assert_eq!(
            Bvh2::of(chain(100_000), 100_000).unwrap().max_depth,
            100_002
        );
    }
}
