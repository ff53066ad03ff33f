//! The binary tree that crate obvhs builds: the steps of its helper `build_bvh2`
//! without the validation that ends it in debug builds. That one recurses once a
//! level and compares with a depth noted before reinsertion, which may have made the
//! tree deeper: deep trees panic or overflow the stack. No walk here relies on either.

use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;
use obvhs::{Boundable, BvhBuildParams};

use crate::geometry::Aabb;

impl Boundable for Aabb {
    fn aabb(&self) -> obvhs::aabb::Aabb {
        obvhs::aabb::Aabb::new(self.min.into(), self.max.into())
    }
}

/// Clusters boxes bottom-up (PLOC), reinserts, and puts leaves together, as
/// obvhs 0.4.0 does with the same parameters; `pre_split` is for triangles only.
pub(crate) fn build(boxes: &[Aabb], params: BvhBuildParams) -> Bvh2 {
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        params.ploc_search_distance,
        boxes,
        (0..boxes.len() as u32).collect(),
        params.sort_precision,
        params.search_depth_threshold,
    );
    let mut reinsertion = ReinsertionOptimizer::default();
    let share = params.reinsertion_batch_ratio;
    reinsertion.run(&mut tree, share, None);
    let leaf = params.max_prims_per_leaf.clamp(1, 255);
    collapse(&mut tree, leaf, params.collapse_traversal_cost);
    let after = params.post_collapse_reinsertion_batch_ratio_multiplier;
    reinsertion.run(&mut tree, share * after, None);
    tree
}

/// The preset that was fastest for views and for rays: one item a leaf.
pub(crate) const ONE_A_LEAF: BvhBuildParams = BvhBuildParams {
    max_prims_per_leaf: 1,
    pre_split: false,
    ..BvhBuildParams::very_slow_build()
};

/// Most items with the very same bounds that a builder gets which needs
/// quadratic time for them.
pub(crate) const MOST_ALIKE: usize = 50_000;

/// How many items have the same bounds, if more than [`MOST_ALIKE`] have.
/// O(n log n) if there are that many items at all.
pub(crate) fn too_many_alike<'a>(items: impl ExactSizeIterator<Item = &'a Aabb>) -> Option<usize> {
    if items.len() <= MOST_ALIKE {
        return None;
    }
    let mut keys: Vec<_> = items.map(Aabb::bits).collect();
    keys.sort_unstable();
    let alike = keys.chunk_by(|a, b| a == b).map(<[_]>::len).max();
    alike.filter(|&alike| alike > MOST_ALIKE)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use glam::Vec3;
    use obvhs::bvh2::builder::build_bvh2;

    use super::*;

    /// Boxes one behind the other, each larger than all before.
    fn growing(n: i32) -> Vec<Aabb> {
        let corner = |i| Vec3::splat(1.3_f32.powi(i));
        (0..n).map(|i| Aabb::new(Vec3::ZERO, corner(i))).collect()
    }

    #[test]
    fn the_tree_is_that_of_the_crates_own_helper() {
        let boxes = growing(60);
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

    /// One that is validated overflows the stack of a test's thread here.
    #[test]
    fn deep_trees_are_built_in_debug_builds_too() {
        let tree = build(
            &[Aabb::new(Vec3::ZERO, Vec3::ONE); 2000],
            BvhBuildParams::medium_build(),
        );
        let (mut deepest, mut open) = (0, vec![(0, 0)]);
        while let Some((at, depth)) = open.pop() {
            deepest = deepest.max(depth);
            let node = &tree.nodes[at as usize];
            if !node.is_leaf() {
                open.extend([0, 1].map(|child| (node.first_index + child, depth + 1)));
            }
        }
        assert!(deepest > 1000, "{deepest}");
    }
}
