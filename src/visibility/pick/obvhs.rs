//! The crate obvhs by its own ray traversals, boxes as primitives: over its binary
//! tree, and over its eight-wide one with quantised nodes.

use ::obvhs::BvhBuildParams;
use ::obvhs::bvh2::Bvh2;
use ::obvhs::bvh2::node::Bvh2Node;
use ::obvhs::cwbvh::CwBvh;
use ::obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use ::obvhs::cwbvh::node::CwBvhNode;
use ::obvhs::ray::{Ray as TheirRay, RayHit};
use glam::DVec3;

use super::contract::{About, Hit, NotBuilt, Pick, keep_nearest, refuse_stacks};
use super::rounded::RoundedRay;
use crate::geometry::Aabb;
use crate::index::{Origin, ploc};
use crate::query::ItemId;
use crate::visibility::{Guarantee, Ray, Solids};

/// As typed on the command line.
pub const NAME: &str = "obvhs";
/// One line for tables and help.
pub const SUMMARY: &str = "crate obvhs, binary tree, one item a leaf, its ray_traverse";

/// What it declares of itself.
pub const ABOUT: About = about(NAME, SUMMARY);

/// The eight-wide tree, as typed on the command line.
pub const NAME_WIDE: &str = "obvhs-cwbvh";
/// One line for tables and help.
pub const SUMMARY_WIDE: &str = "crate obvhs, eight-wide quantised tree, its ray_traverse";

/// What the eight-wide tree declares of itself.
pub const ABOUT_WIDE: About = about(NAME_WIDE, SUMMARY_WIDE);

const fn about(name: &'static str, summary: &'static str) -> About {
    About {
        name,
        summary,
        origin: Origin::Crate("obvhs"),
        // Rays, nodes and boxes are rounded to f32.
        guarantee: Guarantee::Unproven,
    }
}

/// Its best preset, one item a leaf.
const PARAMS: BvhBuildParams = BvhBuildParams {
    max_prims_per_leaf: 1,
    pre_split: false,
    ..BvhBuildParams::very_slow_build()
};

/// Items in the order of the tree's primitives.
#[derive(Clone)]
struct Items {
    boxes: Vec<Aabb>,
    ids: Vec<ItemId>,
    zero: DVec3,
}

impl Items {
    fn of(solids: &Solids, order: &[u32]) -> Items {
        Items {
            boxes: order.iter().map(|&id| solids.outer[id as usize]).collect(),
            ids: order.to_vec(),
            zero: solids.origin,
        }
    }

    fn hit(&self, found: &RayHit) -> Option<Hit> {
        let item = *self.ids.get(found.primitive_id as usize)?;
        let depth = f64::from(found.t);
        Some(Hit { item, depth })
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.boxes[..]) + size_of_val(&self.ids[..])
    }
}

#[inline(always)]
fn their_ray(ray: &RoundedRay) -> TheirRay {
    TheirRay::new(
        ray.origin.into(),
        ray.direction.into(),
        0.0,
        ray.far.next_up(),
    )
}

/// Its binary tree.
#[derive(Clone)]
pub struct Obvhs {
    tree: Bvh2,
    items: Items,
}

impl Obvhs {
    /// Builds its tree.
    ///
    /// # Errors
    /// [`NotBuilt::Alike`].
    pub fn of(solids: &Solids) -> Result<Obvhs, NotBuilt> {
        refuse_stacks(NAME, &solids.outer)?;
        let mut tree = ploc::build(&solids.outer, PARAMS);
        tree.reorder_in_stack_traversal_order();
        // A walk keeps one entry a level; the crate's default is 96.
        if !tree.nodes.is_empty() {
            tree.max_depth = tree.max_depth.max(tree.depth(0) + 2);
        }
        let items = Items::of(solids, &tree.primitive_indices);
        Ok(Obvhs { tree, items })
    }
}

/// Builds it for the table of back ends.
pub(super) fn build(solids: &Solids) -> Result<Box<dyn Pick>, NotBuilt> {
    Ok(Box::new(Obvhs::of(solids)?))
}

impl Pick for Obvhs {
    fn about(&self) -> About {
        ABOUT
    }

    fn first(&self, ray: &Ray) -> Option<Hit> {
        let rounded = RoundedRay::of(ray, self.items.zero);
        let mut found = RayHit::none();
        let boxes = &self.items.boxes[..];
        self.tree
            .ray_traverse(their_ray(&rounded), &mut found, |_, place| {
                rounded.entry(&boxes[place])
            });
        self.items.hit(&found)
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let rounded = RoundedRay::of(ray, self.items.zero);
        hits.clear();
        let all = |_: &TheirRay, place: usize| {
            let depth = rounded.entry(&self.items.boxes[place]);
            if depth.is_finite() {
                let item = self.items.ids[place];
                let depth = f64::from(depth);
                hits.push(Hit { item, depth });
            }
        };
        self.tree.ray_traverse_anyhit(their_ray(&rounded), all);
        keep_nearest(hits, count);
    }

    fn memory(&self) -> usize {
        self.tree.nodes.capacity() * size_of::<Bvh2Node>()
            + size_of_val(&self.tree.primitive_indices[..])
            + self.items.bytes()
    }
}

/// Its eight-wide tree.
#[derive(Clone)]
pub struct ObvhsWide {
    tree: CwBvh,
    items: Items,
}

impl ObvhsWide {
    /// Builds its tree.
    ///
    /// # Errors
    /// [`NotBuilt::Alike`].
    pub fn of(solids: &Solids) -> Result<ObvhsWide, NotBuilt> {
        refuse_stacks(NAME_WIDE, &solids.outer)?;
        let tree = bvh2_to_cwbvh(&ploc::build(&solids.outer, PARAMS), 3, true, false);
        let items = Items::of(solids, &tree.primitive_indices);
        Ok(ObvhsWide { tree, items })
    }
}

/// Builds it for the table of back ends.
pub(super) fn build_wide(solids: &Solids) -> Result<Box<dyn Pick>, NotBuilt> {
    Ok(Box::new(ObvhsWide::of(solids)?))
}

impl Pick for ObvhsWide {
    fn about(&self) -> About {
        ABOUT_WIDE
    }

    fn first(&self, ray: &Ray) -> Option<Hit> {
        if self.tree.nodes.is_empty() {
            return None;
        }
        let rounded = RoundedRay::of(ray, self.items.zero);
        let mut found = RayHit::none();
        let boxes = &self.items.boxes[..];
        self.tree
            .ray_traverse(their_ray(&rounded), &mut found, |_, place| {
                rounded.entry(&boxes[place])
            });
        self.items.hit(&found)
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        hits.clear();
        if self.tree.nodes.is_empty() {
            return;
        }
        let rounded = RoundedRay::of(ray, self.items.zero);
        let all = |_: &TheirRay, place: usize| {
            let depth = rounded.entry(&self.items.boxes[place]);
            if depth.is_finite() {
                let item = self.items.ids[place];
                let depth = f64::from(depth);
                hits.push(Hit { item, depth });
            }
        };
        self.tree.ray_traverse_anyhit(their_ray(&rounded), all);
        keep_nearest(hits, count);
    }

    fn memory(&self) -> usize {
        self.tree.nodes.capacity() * size_of::<CwBvhNode>()
            + size_of_val(&self.tree.primitive_indices[..])
            + self.items.bytes()
    }
}
