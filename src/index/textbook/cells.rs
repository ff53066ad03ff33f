//! The textbook octree and quadtree.
//!
//! A cube is cut in the middle of all three axes, or a square column in the middle of
//! two, recursively; every item is at the smallest cell that contains it.

use glam::Vec3;

use super::{Division, Node, Textbook, TextbookParams};
use crate::geometry::Aabb;
use crate::index::Input;
use crate::index::build::cells::widest_axes;
use crate::index::items::Record;

/// An octree (Meagher 1982, "Geometric modeling using octree encoding") as the
/// lecture on visibility means it (slides "Visibility", "Region search"). O(log n
/// + answers) per query where items are small against their cells.
///
/// An item that crosses the middle of a cell stays with the cell, however small it is,
/// and every query that reaches the cell tests it: not so in [`Octree`](crate::index::Octree),
/// whose items all descend with their centres, nor in loose octrees (Ulrich 2000).
pub type OctreeTextbook = Textbook<OctreeCells>;

/// A quadtree (Finkel and Bentley 1974, "Quad trees: a data structure for
/// retrieval on composite keys") as the lecture on visibility means it (slides
/// "Visibility", "Region search"), over boxes.
///
/// As in [`OctreeTextbook`], an item lies with the smallest cell that contains it. Cells
/// are columns through the whole scene, over the two axes in which it is widest. Takes
/// O(log n + answers) per query where the scene is flat and items are small against their
/// cells; nothing is culled by height.
pub type QuadtreeTextbook = Textbook<QuadtreeCells>;

/// Division of [`OctreeTextbook`].
pub struct OctreeCells;

/// Division of [`QuadtreeTextbook`].
pub struct QuadtreeCells;

impl Division for OctreeCells {
    const NAME: &str = "octree-textbook";
    const SUMMARY: &str = "lecture form: items at the smallest cell that holds them";

    fn root(input: &Input<'_>, records: Vec<Record>, params: &TextbookParams) -> Node {
        let axes = [0, 1, 2];
        let cell = root_cell(&Aabb::union_of(input.items), &axes);
        divided(cell, &axes, records, params, 0)
    }
}

impl Division for QuadtreeCells {
    const NAME: &str = "quadtree-textbook";
    const SUMMARY: &str = "lecture form: items at the smallest column that holds them";

    fn root(input: &Input<'_>, records: Vec<Record>, params: &TextbookParams) -> Node {
        let scene = Aabb::union_of(input.items);
        let axes = widest_axes(&scene);
        divided(root_cell(&scene, &axes), &axes, records, params, 0)
    }
}

/// The cell of a whole scene: as wide on each of the axes that are cut.
fn root_cell(scene: &Aabb, axes: &[usize]) -> Aabb {
    // Halved before subtracting and clamped: bounds may span the range of f32.
    let half = scene.max * 0.5 - scene.min * 0.5;
    let widest = axes.iter().map(|&axis| half[axis]).fold(0.0, f32::max);
    let cube = Aabb::around(scene.centre(), Vec3::splat(widest));
    let mut cell = *scene;
    for &axis in axes {
        // Rounding may have put a face of the cube within the scene.
        cell.min[axis] = cube.min[axis].min(scene.min[axis]).max(f32::MIN);
        cell.max[axis] = cube.max[axis].max(scene.max[axis]).min(f32::MAX);
    }
    cell
}

/// A cell with its items and subtrees; children without items are left out.
///
/// Bit `k` of a child's number is its side of the middle of `axes[k]`.
fn divided(
    bounds: Aabb,
    axes: &[usize],
    records: Vec<Record>,
    params: &TextbookParams,
    level: u32,
) -> Node {
    if params.ends_at(records.len(), level) {
        return Node::with(bounds, &records);
    }
    let cells = (0..1 << axes.len()).map(|child| part(&bounds, axes, child));
    let mut below: Vec<(Aabb, Vec<Record>)> = cells.map(|cell| (cell, Vec::new())).collect();
    let mut own = Vec::new();
    for record in records {
        // Closed bounds: on a face, the first of the cells that share it.
        match below
            .iter_mut()
            .find(|(cell, _)| cell.contains(&record.bounds))
        {
            Some((_, items)) => items.push(record),
            None => own.push(record),
        }
    }
    let mut node = Node::with(bounds, &own);
    let some = below.into_iter().filter(|(_, items)| !items.is_empty());
    node.children = some
        .map(|(cell, items)| divided(cell, axes, items, params, level + 1))
        .collect();
    node
}

/// A part of a cell. Its faces are the cell's or the middle, so parts meet exactly.
fn part(cell: &Aabb, axes: &[usize], child: usize) -> Aabb {
    let (mut part, middle) = (*cell, cell.centre());
    for (bit, &axis) in axes.iter().enumerate() {
        match child >> bit & 1 {
            0 => part.max[axis] = middle[axis],
            _ => part.min[axis] = middle[axis],
        }
    }
    part
}
