//! The textbook octree: a cube cut in the middle of all three axes, again and
//! again, and every item at the smallest cell that wholly holds it.

use glam::Vec3;

use super::{Items, Node, Slice, TextbookParams, answered_by_walk, memory_of};
use crate::geometry::Aabb;
use crate::index::partition::Record;
use crate::index::{BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex};

/// An octree (Meagher 1982, "Geometric modeling using octree encoding") as the
/// lecture on visibility means it (slides "Visibility", "Region search"). O(log n
/// + answers) per query where items are small against their cells.
///
/// What crosses the middle of a cell stays with the cell, however small it is, and
/// is tested by every query that comes so far: `octree`, whose items all go down
/// with their centres, does not have that, and loose octrees (Ulrich 2000) neither.
pub struct OctreeTextbook {
    root: Option<Box<Cell<8>>>,
}

/// A cell with what it keeps and its children, as many as have any item.
pub(super) struct Cell<const CHILDREN: usize> {
    bounds: Aabb,
    items: Items,
    children: [Option<Box<Cell<CHILDREN>>>; CHILDREN],
}

/// The cell that all of a scene lies in: as wide on each of the axes that are cut.
pub(super) fn root_cell(scene: &Aabb, axes: &[usize]) -> Aabb {
    // Halved before subtracting and held: bounds may span the range of f32.
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

impl<const CHILDREN: usize> Cell<CHILDREN> {
    /// The cell with everything below it. Bit `k` of a child's number says which
    /// side of the middle of `axes[k]` it is.
    pub(super) fn divided(
        bounds: Aabb,
        axes: &[usize],
        records: Vec<Record>,
        params: &TextbookParams,
        level: u32,
    ) -> Box<Self> {
        let mut cell = Cell {
            bounds,
            items: Items::default(),
            children: [const { None }; CHILDREN],
        };
        if params.ends_at(records.len(), level) {
            cell.items = Items::of(&records);
            return Box::new(cell);
        }
        let cells: [Aabb; CHILDREN] = std::array::from_fn(|child| part(&bounds, axes, child));
        let mut below = [const { Vec::new() }; CHILDREN];
        let mut own = Vec::new();
        for record in records {
            // Closed bounds: on a face, the first of the cells that share it.
            match cells.iter().position(|c| c.contains(&record.bounds)) {
                Some(child) => below[child].push(record),
                None => own.push(record),
            }
        }
        cell.items = Items::of(&own);
        for (child, records) in below.into_iter().enumerate() {
            cell.children[child] = (!records.is_empty())
                .then(|| Cell::divided(cells[child], axes, records, params, level + 1));
        }
        Box::new(cell)
    }
}

/// A part of a cell. Its faces are the cell's and the middle, nothing is computed
/// but that, and so parts meet exactly.
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

impl<const CHILDREN: usize> Node for &Cell<CHILDREN> {
    /// The cell itself: it was asked whether it holds each item below.
    #[inline]
    fn bounds(&self) -> Aabb {
        self.bounds
    }
    #[inline]
    fn items(&self) -> Slice<'_> {
        self.items.all()
    }
    #[inline]
    fn children(self) -> impl Iterator<Item = Self> {
        self.children.iter().flatten().map(|child| &**child)
    }
}

impl OctreeTextbook {
    fn root(&self) -> Option<&Cell<8>> {
        self.root.as_deref()
    }
}

impl RegionIndex for OctreeTextbook {
    const INFO: Info = Info::new(
        "octree-textbook",
        "lecture form: items at the smallest cell that holds them",
        Kind::Tree,
        Origin::Ours,
    )
    .textbook();
    type Params = TextbookParams;

    fn build(input: &Input<'_>, params: &TextbookParams) -> Result<Self, BuildError> {
        let items = input.items;
        params.check(Self::INFO.name)?;
        let records = Record::all(items)?;
        let axes = [0, 1, 2];
        let cell = root_cell(&Aabb::union_of(items), &axes);
        let root = (!records.is_empty()).then(|| Cell::divided(cell, &axes, records, params, 0));
        Ok(OctreeTextbook { root })
    }

    fn memory(&self) -> MemoryUsage {
        memory_of(self.root(), size_of::<Cell<8>>())
    }

    answered_by_walk!();
}
