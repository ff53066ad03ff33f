//! The quadtree: splits the two axes in which the scene is widest. For terrain,
//! cities and maps, which are flat; where a scene is not, the cells' items are
//! stacked along the third axis.

use super::by_tree::answered_by_tree;
use super::octree::CellParams;
use super::tree::PackedTree;
use super::{BuildError, Info, Input, Kind, Origin, RegionIndex, indexable};
use crate::geometry::Aabb;

/// A quadtree (Finkel and Bentley 1974) with fitted three-dimensional node
/// bounds, so that the height still culls. Cells that are much higher than wide
/// are columns of slabs with as many items each (docs/adr/0012); in a flat
/// scene there are none. Crossing and coincident items are treated as in
/// [`super::Octree`].
pub struct Quadtree {
    tree: PackedTree,
}

/// The two axes in which the bounds are widest, ascending.
pub(super) fn widest_axes(bounds: &Aabb) -> [usize; 2] {
    let width = bounds.max * 0.5 - bounds.min * 0.5;
    let narrowest = (0..3).rev().min_by(|&a, &b| width[a].total_cmp(&width[b]));
    match narrowest {
        Some(0) => [1, 2],
        Some(1) => [0, 2],
        _ => [0, 1],
    }
}

impl RegionIndex for Quadtree {
    const INFO: Info = Info::new(
        "quadtree",
        "quadtree over the two widest axes, high cells in slabs; loose=2 for the loose variant",
        Kind::Tree,
        Origin::Ours,
    )
    .refits()
    .ranges();
    type Params = CellParams;

    fn build(input: &Input<'_>, params: &CellParams) -> Result<Self, BuildError> {
        let items = input.items;
        let ids = indexable(items)?;
        let axes = widest_axes(&Aabb::union_of(items));
        let height = 3 - axes[0] - axes[1];
        let tree = params.build(Self::INFO.name, items, &ids, &axes, Some(height))?;
        Ok(Quadtree { tree })
    }

    answered_by_tree!();
}

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

    /// Small cubes on a grid of so many by so many by so many.
    fn grid(counts: [u32; 3]) -> Vec<Aabb> {
        let corner = |i: u32| {
            let (x, yz) = (i % counts[0], i / counts[0]);
            Vec3::new(x as f32, (yz % counts[1]) as f32, (yz / counts[1]) as f32)
        };
        let corners = (0..counts.iter().product()).map(corner);
        corners.map(|at| Aabb::new(at, at + 0.5)).collect()
    }

    fn built(items: &[Aabb]) -> PackedTree {
        let quadtree = Quadtree::build(&Input::new(items), &CellParams::default());
        quadtree.expect("boxes on a grid").tree
    }

    #[test]
    fn leaves_of_a_high_world_are_no_needles() {
        // About 3 times as high as wide at most, but a grid has no fractions.
        for (counts, height) in [([32; 3], 2), ([40, 64, 48], 0), ([64, 16, 64], 1)] {
            let tree = built(&grid(counts));
            let nodes = 0..tree.nodes().len();
            let leaves: Vec<usize> = nodes.filter(|&node| tree.is_leaf(node)).collect();
            assert!(leaves.len() > 1000, "{}", leaves.len());
            for leaf in leaves {
                let size = tree.nodes()[leaf].bounds.extent();
                let width = (0..3).filter(|&axis| axis != height).map(|axis| size[axis]);
                let width = width.fold(0.0, f32::max);
                assert!(size[height] <= 4.0 * width, "{size} of {counts:?}");
            }
        }
    }

    #[test]
    fn a_flat_world_has_no_slabs() {
        let items = grid([64, 64, 2]);
        let (tree, params) = (built(&items), CellParams::default());
        let ids = indexable(&items).expect("boxes on a grid");
        let plain = params.build("plain", &items, &ids, &[0, 1], None);
        let plain = plain.expect("boxes on a grid");
        assert_eq!(tree.ids(), plain.ids());
        assert_eq!(tree.nodes().len(), plain.nodes().len());
    }

    #[test]
    fn towers_are_cut_in_slabs() {
        // Items above each other, which no split of the two axes parts.
        let ground = |i: u32| [(i & 1) as f32 * 4000.0, (i >> 1 & 1) as f32 * 4000.0];
        let items: Vec<Aabb> = (0..4000)
            .map(|i| (ground(i), (i / 4) as f32))
            .map(|([x, y], z)| Aabb::new(Vec3::new(x, y, z), Vec3::new(x, y, z + 1.0)))
            .collect();
        let tree = built(&items);
        // The world, a tower, sixteen slabs of 62 or 63, two of those each.
        assert_eq!(tree.depth(), 4);
        let leaves = (0..tree.nodes().len()).filter(|&node| tree.is_leaf(node));
        let highest = leaves.map(|leaf| tree.nodes()[leaf].bounds.extent().z);
        assert_eq!(highest.fold(0.0, f32::max), 32.0);
    }
}
