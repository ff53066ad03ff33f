//! A binary tree for rays over boxes of any things: no node that a ray meets is ever
//! left out. What the things are, and what a ray does at them, is left to the caller.

use std::ops::Range;

use glam::DVec3;
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;

use crate::geometry::Aabb;
use crate::visibility::Ray;

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

/// A binary tree over boxes (crate obvhs: PLOC, Meister and Bittner 2018).
#[derive(Clone, Debug)]
pub(super) struct RayTree {
    origin: DVec3,
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
    /// What is taken from the bound that is entered, and from the one that is left.
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
        let side = direction.map(|d| usize::from(d < 0.0));
        let signed = |axis: usize| if side[axis] == 0 { pad } else { -pad };
        let inverse = direction.map(|d| {
            if d == 0.0 {
                STEEP
            } else {
                (1.0 / d).clamp(-STEEP, STEEP)
            }
        });
        Slabs {
            inverse,
            enter: [0, 1, 2].map(|axis| local[axis] + signed(axis)),
            leave: [0, 1, 2].map(|axis| local[axis] - signed(axis)),
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
        let tree = clustered(boxes);
        let mut all = RayTree {
            origin,
            reach: f64::from(Aabb::union_of(boxes).reach().max_element()),
            pairs: Vec::with_capacity(tree.nodes.len() / 2 + 1),
            ids: tree.primitive_indices.clone(),
        };
        let Some(root) = tree.nodes.first() else {
            return all;
        };
        let bounds = |node: usize| {
            [
                tree.nodes[node].min.to_array(),
                tree.nodes[node].max.to_array(),
            ]
        };
        // A tree of one leaf gets a pair whose other half is empty.
        let nothing = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        if root.is_leaf() {
            all.pairs.push(Pair {
                bounds: [bounds(0), nothing],
                first: [root.first_index, 0],
                count: [root.prim_count, 0],
            });
            return all;
        }
        // The children of node k, which are nodes c and c + 1, become pair (c - 1) / 2.
        for c in (1..tree.nodes.len()).step_by(2) {
            let both = [&tree.nodes[c], &tree.nodes[c + 1]];
            let first = both.map(|node| match node.is_leaf() {
                true => node.first_index,
                false => (node.first_index - 1) / 2,
            });
            let count = both.map(|node| node.prim_count);
            let bounds = [bounds(c), bounds(c + 1)];
            all.pairs.push(Pair {
                bounds,
                first,
                count,
            });
        }
        all
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
            let mut open = [0, 1].map(|side| slabs.entry(&pair.bounds[side], limit));
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

/// The tree of crate obvhs over the boxes.
fn clustered(boxes: &[Aabb]) -> Bvh2 {
    if boxes.is_empty() {
        return Bvh2::default();
    }
    let params = BvhBuildParams::medium_build();
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        params.ploc_search_distance,
        boxes,
        (0..boxes.len() as u32).collect(),
        params.sort_precision,
        params.search_depth_threshold,
    );
    ReinsertionOptimizer::default().run(&mut tree, params.reinsertion_batch_ratio, None);
    tree.reorder_in_stack_traversal_order();
    tree
}
