//! Exact search along a ray, with the bodies of a scene in a binary tree.

use std::cmp::Ordering;
use std::ops::Range;

use glam::DVec3;

use super::super::rays::Along;
use super::body::{Bodies, Body, Boxes, Facet, Facets, SolidBox};
use crate::geometry::Aabb;
use crate::index::Record;
use crate::kernel::each;
use crate::query::ItemId;
use crate::scene::Surfaces;
use crate::visibility::sah::{Part, halve};
use crate::visibility::{Ray, Solids};

/// Most boxes of a leaf.
const LEAF: usize = 2;

/// Two children side by side, one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Pair {
    /// Lower and upper corner of each child, local f32.
    bounds: [[[f32; 3]; 2]; 2],
    /// First item of a leaf, or the pair of an inner node's children.
    first: [u32; 2],
    /// Items of a leaf; 0 is an inner node.
    count: [u32; 2],
}

/// A binary tree over boxes, halved by the surface area heuristic.
#[derive(Clone, Debug)]
pub(super) struct RayTree {
    pub origin: DVec3,
    /// Largest local coordinate of all.
    reach: f64,
    pairs: Vec<Pair>,
    /// Which box each place is, places of a leaf side by side.
    pub ids: Vec<u32>,
}

/// A ray as the tree's nodes need it.
struct Slabs {
    /// 1 where the ray goes down the axis: the side that it enters by.
    side: [usize; 3],
    inverse: [f64; 3],
    /// Subtracted from the bound that is entered, and from the one that is left.
    enter: [f64; 3],
    leave: [f64; 3],
    near: f64,
}

impl Slabs {
    /// With `rel` the origin about the tree's zero, `b` a bound and u = 2^-53, an
    /// entry `(b - (rel +- pad)) * inverse` is off by what the following do, as if
    /// the bound had moved: `rel` rounded u |rel|; the sum with pad u (|rel| + pad);
    /// the difference u (|b| + |rel| + pad); reciprocal and product 2.01 u of the
    /// same. Together below u (5.1 |rel| + 3.1 |b| + 4.1 pad), which is below
    /// pad = 8 u (|rel| + |b|): a node is never entered later or left earlier than
    /// it is.
    fn new(ray: &Ray, tree: &RayTree) -> Slabs {
        /// Stands for infinity, and times zero is zero.
        const STEEP: f64 = f64::from_bits((1023 + 400) << 52);
        let local = (ray.origin - tree.origin).to_array();
        let size = local.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let pad = (size + tree.reach) * (8.0 / (1u64 << 53) as f64) + f64::MIN_POSITIVE;
        let direction = ray.direction.to_array();
        let side = each(direction, |d| usize::from(d < 0.0));
        let signed = |axis: usize| if side[axis] == 0 { pad } else { -pad };
        let inverse = each(direction, |d| {
            if d == 0.0 {
                STEEP
            } else {
                (1.0 / d).clamp(-STEEP, STEEP)
            }
        });
        Slabs {
            inverse,
            enter: each([0, 1, 2], |axis| local[axis] + signed(axis)),
            leave: each([0, 1, 2], |axis| local[axis] - signed(axis)),
            near: ray.near,
            side,
        }
    }

    /// A depth that is not above the one where the ray enters the box, unless it
    /// certainly misses it, leaves it before near or enters it beyond `limit`.
    #[inline(always)]
    fn entry(&self, bounds: &[[f32; 3]; 2], limit: f64) -> Option<f64> {
        let (mut enters, mut leaves) = (f64::NEG_INFINITY, f64::INFINITY);
        for (axis, &side) in self.side.iter().enumerate() {
            let from = f64::from(bounds[side][axis]) - self.enter[axis];
            let to = f64::from(bounds[1 - side][axis]) - self.leave[axis];
            enters = enters.max(from * self.inverse[axis]);
            leaves = leaves.min(to * self.inverse[axis]);
        }
        (enters <= leaves && leaves >= self.near && enters <= limit).then_some(enters)
    }
}

impl RayTree {
    /// Builds the tree over boxes about an origin. O(n log n).
    pub fn build(boxes: &[Aabb], origin: DVec3) -> RayTree {
        let mut items = Record::numbered(boxes);
        let mut pairs: Vec<Pair> = Vec::with_capacity(boxes.len() / LEAF + 1);
        // A set to be halved, and the side of the pair that is to lead to its halves.
        let mut open = Vec::new();
        if !items.is_empty() {
            open.push((Part::of(&items, 0..items.len()), None));
        }
        while let Some((part, above)) = open.pop() {
            let at = pairs.len() as u32;
            if let Some((pair, side)) = above {
                let pair: &mut Pair = &mut pairs[pair];
                pair.first[side] = at;
            }
            // A tree of one box gets a pair whose other half is empty.
            let middle = match part.len() {
                1 => part.range.end,
                _ => part.range.start + halve(&mut items[part.range.clone()]),
            };
            let halves = [part.range.start..middle, middle..part.range.end];
            let halves = halves.map(|range| Part::of(&items, range));
            let is_leaf = |half: &Part| half.len() <= LEAF;
            pairs.push(Pair {
                bounds: [0, 1].map(|side: usize| corners(&halves[side].bounds)),
                first: [0, 1].map(|side: usize| halves[side].range.start as u32),
                count: [0, 1].map(|side: usize| match is_leaf(&halves[side]) {
                    true => halves[side].len() as u32,
                    false => 0,
                }),
            });
            for (side, half) in halves.into_iter().enumerate() {
                if !is_leaf(&half) {
                    open.push((half, Some((at as usize, side))));
                }
            }
        }
        RayTree {
            origin,
            reach: f64::from(Aabb::union_of(boxes).reach().max_element()),
            pairs,
            ids: items.iter().map(|item| item.id).collect(),
        }
    }

    /// Shows `leaf` the places, in the order of `ids`, of what the ray may meet from
    /// near to the limit that it gave last, nearest nodes first.
    #[inline]
    pub fn walk(
        &self,
        ray: &Ray,
        stack: &mut Vec<(f64, u32)>,
        mut leaf: impl FnMut(Range<usize>) -> f64,
    ) {
        let slabs = Slabs::new(ray, self);
        let mut limit = ray.far;
        stack.clear();
        if self.pairs.is_empty() {
            return;
        }
        stack.push((f64::NEG_INFINITY, 0));
        while let Some((from, at)) = stack.pop() {
            if from > limit {
                continue;
            }
            let pair = &self.pairs[at as usize];
            let mut open = each([0, 1], |side: usize| slabs.entry(&pair.bounds[side], limit));
            let order = match open {
                [Some(a), Some(b)] if b < a => [1, 0],
                _ => [0, 1],
            };
            for side in order {
                let (first, count) = (pair.first[side] as usize, pair.count[side] as usize);
                if open[side].is_some_and(|from| from <= limit) && count > 0 {
                    limit = leaf(first..first + count);
                    open[side] = None;
                } else if count > 0 {
                    open[side] = None;
                }
            }
            for side in [order[1], order[0]] {
                if let Some(from) = open[side] {
                    stack.push((from, pair.first[side]));
                }
            }
        }
    }
}

/// Lower and upper corner.
fn corners(b: &Aabb) -> [[f32; 3]; 2] {
    [b.min.to_array(), b.max.to_array()]
}

/// A tree over the bounds of bodies with the bodies in its leaves.
#[derive(Clone, Debug)]
pub struct BodyIndex<B> {
    tree: RayTree,
    /// In tree order.
    bodies: Vec<B>,
    items: usize,
}

/// An index of solid boxes.
pub type RayIndex = BodyIndex<SolidBox>;

/// An index of triangles. Clear ones and cut-outs hide nothing.
pub type SurfaceIndex = BodyIndex<Facet>;

/// The items that are seen along a ray.
#[derive(Clone, PartialEq, Debug)]
#[non_exhaustive]
pub struct Front<At> {
    /// Items that the ray meets first among those that hide, ascending.
    ///
    /// Several are a tie. Empty if the ray meets none from near to far.
    pub front: Vec<ItemId>,
    /// Items that hide nothing and are met before these or with them, ascending.
    pub before: Vec<ItemId>,
    /// Point where the ray meets the front items.
    pub meeting: Option<At>,
}

impl RayIndex {
    /// Builds the index of solid boxes. O(n log n).
    pub fn build(solids: &Solids) -> RayIndex {
        BodyIndex::of(&Boxes::of(solids))
    }
}

impl SurfaceIndex {
    /// Builds the index of triangles. O(t log t).
    pub fn build(surfaces: &Surfaces) -> SurfaceIndex {
        BodyIndex::of(&Facets::of(surfaces))
    }
}

impl<B: Body> BodyIndex<B> {
    /// Builds the index. O(n log n).
    pub fn of(bodies: &Bodies<B>) -> BodyIndex<B> {
        let tree = RayTree::build(&bodies.bounds, bodies.origin);
        let placed = tree.ids.iter().map(|&id| bodies.all[id as usize]);
        BodyIndex {
            bodies: placed.collect(),
            items: bodies.items,
            tree,
        }
    }

    /// Number of items, see [`Bodies::items`].
    pub fn items(&self) -> usize {
        self.items
    }

    /// Prepares a ray for exact tests against these bodies.
    pub fn probe(&self, ray: &Ray) -> B::Probe {
        B::probe(ray, self.tree.origin)
    }

    /// Searches for what is seen along a ray, exactly.
    pub fn front_of(&self, ray: &Ray) -> Front<B::At> {
        let mut search = Search::new();
        let meeting = search.front(self, ray, &|_, _, _| true);
        Front {
            front: search.front,
            before: search.before,
            meeting,
        }
    }

    /// Every meeting of a ray with a body from near to far, in no order.
    pub fn all_along(&self, ray: &Ray) -> Vec<(ItemId, B::At)> {
        let probe = self.probe(ray);
        let mut met = Vec::new();
        self.tree.walk(ray, &mut Vec::new(), |places| {
            let bodies = self.bodies[places].iter();
            met.extend(bodies.filter_map(|b| Some((b.item(), b.meet(&probe, ray.far)?))));
            ray.far
        });
        met
    }
}

/// Memory of a search, kept from ray to ray.
pub(super) struct Search<At> {
    stack: Vec<(f64, u32)>,
    through: Vec<(ItemId, At)>,
    /// [`Front::front`] of the last ray.
    pub front: Vec<ItemId>,
    /// [`Front::before`] of the last ray.
    pub before: Vec<ItemId>,
}

impl<At: Copy> Search<At> {
    pub fn new() -> Search<At> {
        Search {
            stack: Vec::new(),
            through: Vec::new(),
            front: Vec::new(),
            before: Vec::new(),
        }
    }

    /// Sets `front` and `before`; returns where the ray meets the front items.
    ///
    /// Rays pass through points of bodies that are not `is_opaque`.
    #[inline]
    pub fn front<B: Body<At = At>>(
        &mut self,
        index: &BodyIndex<B>,
        ray: &Ray,
        is_opaque: &impl Fn(&B, &B::Probe, &At) -> bool,
    ) -> Option<At> {
        let probe = index.probe(ray);
        let (front, through) = (&mut self.front, &mut self.through);
        front.clear();
        through.clear();
        let mut best: Option<At> = None;
        let mut limit = ray.far;
        index.tree.walk(ray, &mut self.stack, |places| {
            for body in &index.bodies[places] {
                let Some(at) = body.meet(&probe, limit) else {
                    continue;
                };
                if !body.hides() {
                    through.push((body.item(), at));
                    continue;
                }
                match best.map_or(Ordering::Less, |best| probe.order(&at, &best)) {
                    Ordering::Greater => continue,
                    _ if !is_opaque(body, &probe, &at) => continue,
                    Ordering::Less => {
                        front.clear();
                        best = Some(at);
                        limit = limit.min(B::Probe::at_most(&at));
                    }
                    Ordering::Equal => {}
                }
                front.push(body.item());
            }
            limit
        });
        let reached = |at: &At| best.is_none_or(|best| probe.order(at, &best).is_le());
        self.before.clear();
        let before = through.iter().filter(|(_, at)| reached(at));
        self.before.extend(before.map(|(item, _)| *item));
        for items in [&mut self.front, &mut self.before] {
            items.sort_unstable();
            items.dedup();
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// Neither clustering nor a cut between centres parts boxes that are all alike.
    #[test]
    fn a_stack_of_equal_boxes_is_halved() {
        for n in [1, 2, 3, 5, 4096] {
            let boxes = vec![Aabb::new(Vec3::ZERO, Vec3::ONE); n];
            let tree = RayTree::build(&boxes, DVec3::ZERO);
            let (mut held, mut deepest, mut open) = (0, 0, vec![(0, 1)]);
            while let Some((at, depth)) = open.pop() {
                let pair = &tree.pairs[at as usize];
                deepest = deepest.max(depth);
                for side in 0..2 {
                    held += pair.count[side] as usize;
                    // A half that is empty leads nowhere.
                    if pair.count[side] == 0 && pair.bounds[side][0][0] <= pair.bounds[side][1][0] {
                        open.push((pair.first[side], depth + 1));
                    }
                }
            }
            assert_eq!(held, n);
            assert!(deepest <= n.ilog2() as usize + 1, "{n}: {deepest} deep");
        }
    }
}
