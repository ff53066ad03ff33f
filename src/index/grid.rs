//! A uniform grid as engines have it: equal cells over the scene.
//!
//! Each item is in the cell of its centre, and cells have the exact bounds of their items. A query
//! visits the cells within the bounds of the centres of its answers. (Grids on crates.io are hash
//! maps for moving bodies.)

use std::hint::black_box;
use std::ops::{ControlFlow, Range};

use glam::{UVec3, Vec3};

use super::box_test::{BoxQuery, BoxTest, BoxTested};
use super::items::Record;
use super::{BuildError, Info, Kind, MemoryUsage, NoParams};
use crate::geometry::Aabb;
use crate::query::{Bits, Context, ItemId, Recorder};

/// Average number of items per cell.
const ITEMS_PER_CELL: f64 = 8.0;
/// Most cells along an axis.
const MOST_CELLS: f64 = 1024.0;
/// Most cells that are all tested: bounding the centres of answers takes longer.
const FEW_CELLS: usize = 32;

/// A uniform grid: cells in rows along x, items in the order of their cells.
///
/// Bentley and Friedman 1979, "Data structures for range searching".
pub struct UniformGrid {
    /// Bounds of the centres, divided into cells.
    centres: Aabb,
    counts: UVec3,
    /// Exact union of each cell's items.
    bounds: Vec<Aabb>,
    /// First item of each cell, and the end of the last one.
    starts: Vec<u32>,
    boxes: Vec<Aabb>,
    ids: Vec<ItemId>,
    scene: Aabb,
    /// Half the size of the largest item, axis by axis.
    half: Vec3,
}

/// Number of cells along each axis: nearly cubic cells, flat axes undivided.
fn cells_for(extent: Vec3, items: usize) -> UVec3 {
    let extent = extent.as_dvec3();
    let wanted = (items as f64 / ITEMS_PER_CELL).max(1.0);
    let mut open: Vec<usize> = (0..3).filter(|&axis| extent[axis] > 0.0).collect();
    loop {
        let volume: f64 = open.iter().map(|&axis| extent[axis]).product();
        let edge = (volume / wanted).powf(1.0 / open.len().max(1) as f64);
        // An axis shorter than a cell is left undivided, and the others are cut finer.
        let short = |axis: usize| extent[axis] < edge;
        if open.iter().any(|&axis| short(axis)) {
            open.retain(|&axis| !short(axis));
            continue;
        }
        let mut counts = UVec3::ONE;
        for axis in open {
            // The quotient of infinite numbers is a NaN, which becomes 0 and then 1.
            let count = (extent[axis] / edge).round().clamp(1.0, MOST_CELLS);
            counts[axis] = (count as u32).max(1);
        }
        return counts;
    }
}

impl UniformGrid {
    /// The cell of a coordinate on an axis.
    ///
    /// Monotone: a larger coordinate never lies in a lower cell.
    #[inline(always)]
    fn cell_on(&self, axis: usize, coordinate: f32) -> u32 {
        let (low, high) = (self.centres.min[axis], self.centres.max[axis]);
        let count = self.counts[axis];
        if count == 1 {
            return 0;
        }
        let share = (f64::from(coordinate) - f64::from(low)) / (f64::from(high) - f64::from(low));
        ((share * f64::from(count)) as u32).min(count - 1)
    }

    fn cell_of(&self, centre: Vec3) -> usize {
        let at = [0, 1, 2].map(|axis| self.cell_on(axis, centre[axis]) as usize);
        self.row(at[1], at[2]).start + at[0]
    }

    /// The cells of a row along x.
    #[inline(always)]
    fn row(&self, y: usize, z: usize) -> Range<usize> {
        let counts = self.counts.as_usizevec3();
        let start = (z * counts.y + y) * counts.x;
        start..start + counts.x
    }

    #[inline(always)]
    fn cell<T: BoxTest + ?Sized, C: Context>(
        &self,
        cell: usize,
        ask: &mut BoxQuery<T, C>,
    ) -> ControlFlow<()> {
        let items = self.starts[cell] as usize..self.starts[cell + 1] as usize;
        if items.is_empty() {
            return ControlFlow::Continue(());
        }
        // Opaque, so that each cell loads the planes again: planes kept in registers from cell to
        // cell would be saved and restored around each call of the sink.
        let (test, cx) = (black_box(ask.test), &mut *ask.cx);
        let mut ask = BoxQuery { test, cx };
        let (rejected, accepted) = ask.rejects_accepts(&self.bounds[cell]);
        if rejected {
            ask.cx.recorder().subtrees_rejected(1);
            return ControlFlow::Continue(());
        }
        if accepted {
            ask.cx.recorder().subtree_accepted(items.len());
            return ask.cx.accept(&self.ids[items]);
        }
        // All tests before the first answer: a call between two tests would evict the planes from
        // their registers.
        for (start, boxes) in items.clone().step_by(64).zip(self.boxes[items].chunks(64)) {
            let mut admitted = 0_u64;
            for (i, b) in boxes.iter().enumerate() {
                admitted |= u64::from(ask.admits(b)) << i;
            }
            for bit in Bits(admitted) {
                let place = start + bit as usize;
                ask.cx.accept(&self.ids[place..=place])?;
            }
        }
        ControlFlow::Continue(())
    }
}

impl BoxTested for UniformGrid {
    const ABOUT: Info = Info::ours(
        "uniform-grid",
        "uniform grid: items in the cell of their centre, exact cell bounds",
        Kind::Grid,
    );
    type Params = NoParams;

    fn of(items: Vec<Record>, _: &NoParams) -> Result<Self, BuildError> {
        let centres = Aabb::of_points(items.iter().map(|item| item.bounds.centre()));
        let counts = match items.is_empty() {
            true => UVec3::ONE,
            false => cells_for(centres.extent(), items.len()),
        };
        let cells = counts.as_usizevec3().element_product();
        let halves = items.iter().map(|item| item.bounds.half_extent());
        let mut grid = UniformGrid {
            centres,
            counts,
            bounds: vec![Aabb::EMPTY; cells],
            starts: vec![0; cells + 1],
            boxes: vec![Aabb::EMPTY; items.len()],
            ids: vec![0; items.len()],
            scene: Aabb::union_of(items.iter().map(|item| &item.bounds)),
            half: halves.fold(Vec3::ZERO, Vec3::max),
        };
        // A counting sort by cell.
        let cell_of = |item: &Record| grid.cell_of(item.bounds.centre());
        let places: Vec<usize> = items.iter().map(cell_of).collect();
        for &cell in &places {
            grid.starts[cell + 1] += 1;
        }
        for cell in 0..cells {
            grid.starts[cell + 1] += grid.starts[cell];
        }
        let mut next = grid.starts.clone();
        for (item, &cell) in items.iter().zip(&places) {
            let place = next[cell] as usize;
            next[cell] += 1;
            grid.boxes[place] = item.bounds;
            grid.ids[place] = item.id;
            grid.bounds[cell] = grid.bounds[cell].union(&item.bounds);
        }
        Ok(grid)
    }

    fn used(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: size_of_val(&self.bounds[..]) + size_of_val(&self.starts[..]),
            item_bytes: size_of_val(&self.boxes[..]) + size_of_val(&self.ids[..]),
        }
    }

    #[inline(always)]
    fn search<T: BoxTest + ?Sized, C: Context>(&self, ask: &mut BoxQuery<T, C>) -> ControlFlow<()> {
        if ask.rejects(&self.scene) || self.ids.is_empty() {
            return ControlFlow::Continue(());
        }
        // Testing few cells is faster than bounding the centres of the answers.
        let asked = match self.bounds.len() {
            0..=FEW_CELLS => self.centres,
            _ => ask.test.centres(self.half, &self.scene),
        };
        if asked.is_empty() {
            return ControlFlow::Continue(());
        }
        let range = |axis: usize| {
            let first = self.cell_on(axis, asked.min[axis]) as usize;
            first..self.cell_on(axis, asked.max[axis]) as usize + 1
        };
        let (xs, ys, zs) = (range(0), range(1), range(2));
        for z in zs {
            for y in ys.clone() {
                let row = self.row(y, z).start;
                for cell in row + xs.start..row + xs.end {
                    self.cell(cell, ask)?;
                }
            }
        }
        ControlFlow::Continue(())
    }
}
