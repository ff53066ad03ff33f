//! Ray traversals of the crate obvhs: boxes, or its own triangles, as primitives.
//!
//! Its eight-wide tree has quantised nodes. Rays and bodies are rounded to f32, without
//! bounds on rounding.

use std::ops::Range;

use ::obvhs::bvh2::Bvh2;
use ::obvhs::cwbvh::CwBvh;
use ::obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use ::obvhs::ray::{Ray as TheirRay, RayHit};
use ::obvhs::triangle::Triangle;
use glam::{DVec3, Vec3};

use super::exactly::kept;
use super::{Hit, Pick};
use crate::geometry::Aabb;
use crate::index::{caught, ploc, scale_for};
use crate::kernel::each;
use crate::query::ItemId;
use crate::visibility::Ray;
use crate::visibility::truth::{Bodies, Body, Facet, SolidBox};

/// Least component of a direction that is divided by.
const LEAST: f32 = 1e-20;

/// Local coordinates in which no area or product of a scene overflows.
#[derive(Clone, Copy, Debug)]
pub(super) struct About {
    zero: DVec3,
    /// A power of two, 1 for all but very large and very small scenes.
    scale: f32,
}

impl About {
    /// A box in these coordinates.
    pub fn scaled(&self, b: &Aabb) -> Aabb {
        Aabb::new(b.min * self.scale, b.max * self.scale)
    }

    /// A hit at a depth of these coordinates.
    #[inline(always)]
    pub fn hit(&self, item: ItemId, depth: f32) -> Hit {
        let depth = f64::from(depth) / f64::from(self.scale);
        Hit { item, depth }
    }
}

/// A ray in local coordinates, rounded to f32.
#[derive(Clone, Copy, Debug)]
pub(super) struct RoundedRay {
    /// The same ray as the crate takes it.
    theirs: TheirRay,
    inverse: Vec3,
    near: f32,
    far: f32,
}

impl RoundedRay {
    #[inline(always)]
    pub fn of(ray: &Ray, about: &About) -> RoundedRay {
        let scale = f64::from(about.scale);
        let origin = ((ray.origin - about.zero) * scale).as_vec3();
        let direction = ray.direction.as_vec3();
        let far = ((ray.far * scale) as f32).min(f32::MAX);
        let inverse = |d: f32| match d.abs() < LEAST {
            true => 1.0 / LEAST.copysign(d),
            false => 1.0 / d,
        };
        RoundedRay {
            theirs: TheirRay::new(origin.into(), direction.into(), 0.0, far.next_up()),
            inverse: direction.map(inverse),
            near: (ray.near * scale) as f32,
            far,
        }
    }
}

/// A body as a leaf of the crate's trees holds it.
pub trait Primitive: Body {
    /// The body in f32.
    type Rounded: Send + Sync;

    /// Rounds the body, whose box is `bounds`, to the coordinates of a tree.
    fn rounded(&self, bounds: &Aabb, about: &About) -> Self::Rounded;

    /// Depth at which the ray enters the body, infinite if it does not meet it.
    fn depth(body: &Self::Rounded, ray: &RoundedRay, theirs: &TheirRay) -> f32;
}

impl Primitive for SolidBox {
    type Rounded = Aabb;

    fn rounded(&self, bounds: &Aabb, about: &About) -> Aabb {
        about.scaled(bounds)
    }

    #[inline(always)]
    fn depth(b: &Aabb, ray: &RoundedRay, _: &TheirRay) -> f32 {
        let origin = Vec3::from(ray.theirs.origin);
        let [a, b] = each([b.min, b.max], |p| (p - origin) * ray.inverse);
        let (enters, leaves) = (a.min(b).max_element(), a.max(b).min_element());
        match enters <= leaves && enters >= ray.near && enters <= ray.far {
            true => enters,
            false => f32::INFINITY,
        }
    }
}

impl Primitive for Facet {
    /// The triangle, and whether it is met from behind too.
    type Rounded = (Triangle, bool);

    fn rounded(&self, _: &Aabb, about: &About) -> (Triangle, bool) {
        let [v0, v1, v2] = self.corners.map(|corner| (corner * about.scale).into());
        (Triangle { v0, v1, v2 }, self.two_sided)
    }

    #[inline(always)]
    fn depth((triangle, two_sided): &(Triangle, bool), ray: &RoundedRay, theirs: &TheirRay) -> f32 {
        let [u, v] = [triangle.v1 - triangle.v0, triangle.v2 - triangle.v0];
        let is_behind = u.cross(v).dot(theirs.direction) >= 0.0;
        let depth = triangle.intersect(theirs);
        match depth >= ray.near && (*two_sided || !is_behind) {
            true => depth,
            false => f32::INFINITY,
        }
    }
}

/// Name of the row of the eight-wide tree.
pub const NAME: &str = "obvhs-cwbvh";

/// Most levels of a binary tree to be converted: the conversion recurses per level.
const MOST_BINARY: usize = 500;
/// Levels of an eight-wide tree for which the crate's walk has memory.
const MOST_WIDE: usize = 32;

fn refuse_deep(levels: usize, most: usize) -> Result<(), String> {
    match levels > most {
        true => Err(format!(
            "the tree of '{NAME}' has {levels} levels; expected at most {most}"
        )),
        false => Ok(()),
    }
}

/// The eight-wide tree of a binary one, whose levels are counted.
fn widened(binary: &Bvh2, levels: usize) -> Result<CwBvh, String> {
    refuse_deep(levels, MOST_BINARY)?;
    let tree = bvh2_to_cwbvh(binary, 3, true, false);
    let children = |node: usize| {
        let node = &tree.nodes[node];
        let first = node.child_base_idx as usize;
        first..first + node.imask.count_ones() as usize
    };
    refuse_deep(levels_of(tree.nodes.len(), children), MOST_WIDE)?;
    Ok(tree)
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

/// A tree of the crate over bodies.
pub struct Obvhs<B: Primitive> {
    tree: CwBvh,
    /// In the order of the tree's primitives.
    bodies: Vec<B::Rounded>,
    ids: Vec<ItemId>,
    about: About,
    items: usize,
}

impl<B: Primitive> Obvhs<B> {
    /// Builds the tree; a panic of the crate is an error.
    pub fn boxed(all: &Bodies<B>) -> Result<Box<dyn Pick>, String> {
        let (zero, scale) = (all.origin, scale_for(&all.bounds));
        let about = About { zero, scale };
        let boxes: Vec<Aabb> = all.bounds.iter().map(|b| about.scaled(b)).collect();
        let build = || {
            let binary = ploc::build(&boxes, ploc::ONE_A_LEAF);
            let levels = levels_of(binary.nodes.len(), |node| {
                let node = &binary.nodes[node];
                let first = node.first_index as usize;
                first..first + if node.is_leaf() { 0 } else { 2 }
            });
            widened(&binary, levels)
        };
        let panicked = |message: String| Err(format!("'{NAME}' panicked: {message}"));
        let tree = caught(build).unwrap_or_else(panicked)?;
        let order = tree.primitive_indices.iter().map(|&place| place as usize);
        let rounded = |place: usize| all.all[place].rounded(&all.bounds[place], &about);
        Ok(Box::new(Obvhs::<B> {
            bodies: order.clone().map(rounded).collect(),
            ids: order.map(|place| all.all[place].item()).collect(),
            about,
            items: all.items,
            tree,
        }))
    }
}

impl<B: Primitive> Pick for Obvhs<B> {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let rounded = RoundedRay::of(ray, &self.about);
        let mut found = RayHit::none();
        let entry = |ray: &TheirRay, place: usize| B::depth(&self.bodies[place], &rounded, ray);
        // The crate's walk begins at a root that an empty tree does not have.
        if !self.ids.is_empty() {
            self.tree.ray_traverse(rounded.theirs, &mut found, entry);
        }
        let item = *self.ids.get(found.primitive_id as usize)?;
        ((item as usize) < self.items).then(|| self.about.hit(item, found.t))
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let rounded = RoundedRay::of(ray, &self.about);
        hits.clear();
        let visit = |ray: &TheirRay, place: usize| {
            let depth = B::depth(&self.bodies[place], &rounded, ray);
            let item = self.ids[place];
            if depth <= rounded.far && (item as usize) < self.items {
                hits.push(self.about.hit(item, depth));
            }
        };
        if !self.ids.is_empty() {
            self.tree.ray_traverse_anyhit(rounded.theirs, visit);
        }
        if !B::IS_BOX {
            hits.sort_unstable_by(|a, b| a.item.cmp(&b.item).then(a.order(b)));
            hits.dedup_by_key(|hit| hit.item);
        }
        hits.sort_unstable_by(Hit::order);
        hits.truncate(kept(hits, count, |hit, last| hit.depth <= last.depth));
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
        let of = |levels| widened(&chain(levels), levels).err().map(|e| e.to_string());
        assert_eq!(of(100), None);
        let refused = "has 100000 levels; expected at most 500";
        assert!(of(100_000).is_some_and(|error| error.ends_with(refused)));
        assert!(of(400).is_some_and(|error| error.ends_with("expected at most 32")));
    }
}
