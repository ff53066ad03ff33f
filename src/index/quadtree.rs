//! The quadtree: splits the two axes in which the scene is widest and leaves
//! the third alone. For terrain, cities and maps, which are flat.

use super::octree::CellParams;
use super::tree::{PackedTree, searched_by_tree, seen_by_tree};
use super::{BuildError, RegionIndex, indexable};
use crate::geometry::{Aabb, PlaneTree};

/// A quadtree (Finkel and Bentley 1974) with fitted three-dimensional node
/// bounds, so that the height still culls. Crossing and coincident items are
/// treated as in [`super::Octree`].
pub struct Quadtree {
    tree: PackedTree,
}

/// The two axes in which the bounds are widest, ascending.
fn widest_axes(bounds: &Aabb) -> [usize; 2] {
    let width = bounds.max * 0.5 - bounds.min * 0.5;
    let narrowest = (0..3).rev().min_by(|&a, &b| width[a].total_cmp(&width[b]));
    match narrowest {
        Some(0) => [1, 2],
        Some(1) => [0, 2],
        _ => [0, 1],
    }
}

impl RegionIndex for Quadtree {
    const NAME: &'static str = "quadtree";
    const SUMMARY: &'static str =
        "quadtree over the two widest axes, 3-D bounds; loose=2 for the loose variant";
    type Params = CellParams;

    fn build(
        items: &[Aabb],
        _: Option<&PlaneTree>,
        params: &CellParams,
    ) -> Result<Self, BuildError> {
        let ids = indexable(items)?;
        let axes = widest_axes(&Aabb::union_of(items));
        let tree = params.build(Self::NAME, items, &ids, &axes)?;
        Ok(Quadtree { tree })
    }

    searched_by_tree!();
}

seen_by_tree!(Quadtree);

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn the_narrowest_axis_is_left_alone() {
        let of = |x, y, z| widest_axes(&Aabb::new(Vec3::ZERO, Vec3::new(x, y, z)));
        assert_eq!(of(9.0, 5.0, 1.0), [0, 1]);
        assert_eq!(of(1.0, 5.0, 9.0), [1, 2]);
        assert_eq!(of(9.0, 1.0, 5.0), [0, 2]);
        assert_eq!(of(1.0, 1.0, 1.0), [0, 1]);
        assert_eq!(widest_axes(&Aabb::EMPTY).len(), 2);
    }
}
