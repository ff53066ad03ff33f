//! The binary tree that crate obvhs builds.
//!
//! The steps of its helper `build_bvh2`, without the validation that the helper runs in debug
//! builds. The validation recurses once per level and compares with a depth noted before
//! reinsertion, which may have deepened the tree: deep trees panic or overflow the stack. No walk
//! here relies on either.
//!
//! The crate takes quadratic time if few neighbours agree in a round of clustering, as in a row of
//! posts or of growing boxes, and if boxes lie in one another. Here both are bounded, and a single
//! far item does not spoil the order of the others; the trees of other scenes are the crate's own.

use glam::DVec3;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::morton::{morton_encode_u64_unorm, morton_encode_u128_unorm};
use obvhs::ploc::{PlocSearchDistance, SortPrecision};
use obvhs::{Boundable, BvhBuildParams};
use rdst::{RadixKey, RadixSort};

use crate::geometry::Aabb;

impl Boundable for Aabb {
    fn aabb(&self) -> obvhs::aabb::Aabb {
        obvhs::aabb::Aabb::new(self.min.into(), self.max.into())
    }
}

/// Clusters boxes bottom-up (PLOC), reinserts, and merges leaves.
///
/// The steps of obvhs 0.4.0 with the same parameters; `pre_split` is for triangles only. O(n log
/// n): clustering is bounded, and reinsertion is skipped where it would take quadratic time.
pub fn build(boxes: &[Aabb], params: BvhBuildParams) -> Bvh2 {
    let mut tree = clustered(boxes, &params);
    let share = params.reinsertion_batch_ratio;
    reinsert(&mut tree, share);
    let leaf = params.max_prims_per_leaf.clamp(1, 255);
    collapse(&mut tree, leaf, params.collapse_traversal_cost);
    let after = params.post_collapse_reinsertion_batch_ratio_multiplier;
    reinsert(&mut tree, share * after);
    tree
}

/// Reinserts a share of the nodes, unless too many others contain them.
fn reinsert(tree: &mut Bvh2, share: f32) {
    if !is_nested(tree, share) {
        ReinsertionOptimizer::default().run(tree, share, None);
    }
}

/// Number of nodes sampled to count the others that contain them.
const SAMPLE: usize = 1024;
/// Most nodes that contain a node, on average. Ten to forty are usual.
const MOST_AROUND: usize = 150;

/// Decides whether reinsertion would take quadratic time.
///
/// The search for a better position visits all nodes that contain the reinserted one.
fn is_nested(tree: &Bvh2, share: f32) -> bool {
    let nodes = &tree.nodes;
    // As obvhs rounds it: above 2^24 nodes possibly up.
    let candidates = (nodes.len() as f32 * (2.0 * share).min(1.0)) as usize;
    let candidates = candidates.min(nodes.len());
    let step = candidates.div_ceil(SAMPLE).max(16);
    let mut left = candidates.div_ceil(step) * MOST_AROUND;
    let mut open = Vec::new();
    for inner in nodes[..candidates].iter().step_by(step) {
        open.push(0);
        while let Some(at) = open.pop() {
            let outer = nodes[at as usize];
            if inner.min.cmpge(outer.min).all() && inner.max.cmple(outer.max).all() {
                if left == 0 {
                    return true;
                }
                left -= 1;
                if !outer.is_leaf() {
                    open.extend([outer.first_index, outer.first_index + 1]);
                }
            }
        }
    }
    false
}

/// Clusters that all rounds together may visit, as a multiple of the boxes.
///
/// Three to six are usual.
const CREDIT: usize = 10;

/// PLOC: repeatedly merges clusters that are mutual nearest neighbours.
///
/// The nearest neighbour in Morton order is the one with the least surface of common bounds. Once
/// the credit is spent, adjacent clusters merge in pairs.
fn clustered(boxes: &[Aabb], params: &BvhBuildParams) -> Bvh2 {
    let mut tree = Bvh2::zeroed(boxes.len());
    tree.primitive_indices = (0..boxes.len() as u32).collect();
    tree.children_are_ordered_after_parents = true;
    let (mut clusters, ties) = match params.sort_precision {
        SortPrecision::U64 => in_morton_order(boxes, morton_encode_u64_unorm),
        SortPrecision::U128 => in_morton_order(boxes, morton_encode_u128_unorm),
    };
    // One item far away or around all others, such as a sky box, leaves them few distinct codes.
    if ties > boxes.len() / 2 {
        clusters = in_morton_order(boxes, morton_encode_u128_unorm).0;
    }
    let (mut next, mut found) = (Vec::with_capacity(clusters.len()), Vec::new());
    let (mut free, mut rounds) = (tree.nodes.len(), 0);
    let mut credit = CREDIT * boxes.len();
    while clusters.len() > 1 {
        let reach = match rounds < params.search_depth_threshold {
            true => 1,
            false => reach(params.ploc_search_distance),
        };
        credit = credit.saturating_sub(clusters.len());
        match credit {
            0 => pair(clusters.len(), &mut found),
            _ => find_nearest(&clusters, reach, &mut found),
        }
        for (i, &(_, other)) in found.iter().enumerate() {
            let other = other as usize;
            if other == i || found[other].1 as usize != i {
                next.push(clusters[i]);
            } else if other < i {
                free -= 2;
                let children = [clusters[i], clusters[other]];
                tree.nodes[free..free + 2].copy_from_slice(&children);
                let [left, right] = children.map(|node| *node.aabb());
                next.push(Bvh2Node::new(left.union(&right), 0, free as u32));
            }
        }
        std::mem::swap(&mut clusters, &mut next);
        next.clear();
        rounds += 1;
    }
    if let Some(root) = clusters.first() {
        tree.nodes[0] = *root;
    }
    tree.max_depth = tree.max_depth.max(rounds + 1);
    tree
}

fn reach(distance: PlocSearchDistance) -> usize {
    match distance {
        PlocSearchDistance::Minimum => 1,
        PlocSearchDistance::VeryLow => 2,
        PlocSearchDistance::Low => 6,
        PlocSearchDistance::Medium => 14,
        PlocSearchDistance::High => 24,
        PlocSearchDistance::VeryHigh => 32,
    }
}

/// The least area of bounds shared with a neighbour so far, and that neighbour.
type Nearest = (f32, u32);

/// Finds each cluster's nearest neighbour at most `reach` away, the last of ties.
fn find_nearest(clusters: &[Bvh2Node], reach: usize, found: &mut Vec<Nearest>) {
    found.clear();
    found.extend((0..clusters.len() as u32).map(|i| (f32::INFINITY, i)));
    for (i, cluster) in clusters.iter().enumerate() {
        let mut own = found[i];
        for other in i + 1..clusters.len().min(i + reach + 1) {
            let cost = cluster.aabb().union(clusters[other].aabb()).half_area();
            if cost <= own.0 {
                own = (cost, other as u32);
            }
            if cost <= found[other].0 {
                found[other] = (cost, i as u32);
            }
        }
        found[i] = own;
    }
}

/// Pairs adjacent clusters.
fn pair(clusters: usize, found: &mut Vec<Nearest>) {
    found.clear();
    let last = clusters as u32 - 1;
    found.extend((0..=last).map(|i| (0.0, (i ^ 1).min(last))));
}

/// A box's index with the code of its centre.
#[derive(Clone, Copy)]
struct Coded<C> {
    code: C,
    place: u64,
}

impl<C: RadixKey> RadixKey for Coded<C> {
    const LEVELS: usize = C::LEVELS;

    #[inline(always)]
    fn get_level(&self, level: usize) -> u8 {
        self.code.get_level(level)
    }
}

/// The boxes as leaves in the order of their codes; the number of equal codes.
///
/// Boxes with one code are in the crate's order.
fn in_morton_order<C>(boxes: &[Aabb], code: impl Fn(DVec3) -> C) -> (Vec<Bvh2Node>, usize)
where
    C: RadixKey + Copy + Ord + Send + Sync,
{
    let all = Aabb::union_of(boxes).aabb();
    let scale = 1.0 / all.diagonal().as_dvec3();
    let offset = -all.min.as_dvec3() * scale;
    let coded = |(place, b): (usize, &Aabb)| Coded {
        code: code(b.aabb().center().as_dvec3() * scale + offset),
        place: place as u64,
    };
    let mut order: Vec<_> = boxes.iter().enumerate().map(coded).collect();
    match order.len() {
        0..=250_000 => order.sort_unstable_by_key(|coded| coded.code),
        _ => order.radix_sort_unstable(),
    }
    let leaf = |at: &Coded<C>| Bvh2Node::new(boxes[at.place as usize].aabb(), 1, at.place as u32);
    let ties = order.windows(2).filter(|two| two[0].code == two[1].code);
    (order.iter().map(leaf).collect(), ties.count())
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use glam::Vec3;
    use obvhs::bvh2::builder::build_bvh2;

    use super::*;

    /// The slowest preset, one item per leaf.
    const ONE_A_LEAF: BvhBuildParams = BvhBuildParams {
        max_prims_per_leaf: 1,
        pre_split: false,
        ..BvhBuildParams::very_slow_build()
    };

    /// Boxes in random order, some with a common centre or common bounds.
    fn scattered(n: usize) -> Vec<Aabb> {
        let mut state = 5_u64;
        let mut unit = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f32 / (1 << 24) as f32
        };
        let mut point = || Vec3::new(unit(), unit(), unit());
        let mut some = || {
            let at = (point() * 20.0).floor();
            Aabb::around(at, point() * 3.0)
        };
        (0..n).map(|_| some()).collect()
    }

    #[test]
    fn the_tree_is_that_of_the_crates_own_helper() {
        let boxes = scattered(3000);
        for params in [
            BvhBuildParams::fastest_build(),
            BvhBuildParams::very_fast_build(),
            BvhBuildParams::medium_build(),
            BvhBuildParams::very_slow_build(),
        ] {
            let ours = build(&boxes, params);
            let theirs = build_bvh2(&boxes, params, &mut Duration::default());
            assert_eq!(ours.primitive_indices, theirs.primitive_indices);
            let rows = |tree: &Bvh2| -> Vec<_> {
                let row =
                    |n: &obvhs::bvh2::node::Bvh2Node| (n.min, n.max, n.first_index, n.prim_count);
                tree.nodes.iter().map(row).collect()
            };
            assert_eq!(rows(&ours), rows(&theirs));
        }
    }

    /// Clustering by mutual neighbours alone takes as many rounds as there are boxes.
    #[test]
    fn rounds_are_few_where_few_neighbours_agree() {
        let rows: [fn(f32) -> Aabb; 5] = [
            |_| Aabb::new(Vec3::ZERO, Vec3::ONE),
            |i| Aabb::new(Vec3::X * 2.0 * i, Vec3::X * (2.0 * i + 1.0) + Vec3::ONE),
            |i| Aabb::new(Vec3::splat(-1.0 - i), Vec3::splat(1.0 + i)),
            |i| Aabb::new(Vec3::ZERO, Vec3::splat(1.0 + i)),
            |i| Aabb::new(Vec3::ZERO, Vec3::splat((i / 50.0).exp2())),
        ];
        for (row, at) in rows.iter().enumerate() {
            let boxes: Vec<Aabb> = (0..3000).map(|i| at(i as f32)).collect();
            for params in [BvhBuildParams::very_fast_build(), ONE_A_LEAF] {
                let tree = clustered(&boxes, &params);
                assert!(tree.max_depth <= 100, "row {row}: {}", tree.max_depth);
                assert_eq!(is_nested(&tree, 1.0), row != 1, "row {row}");
            }
        }
        let tree = clustered(&scattered(3000), &ONE_A_LEAF);
        assert!(!is_nested(&tree, 1.0));
    }
}
