//! Regular subdivision into cells: what octree and quadtree share. An item
//! goes down with its centre, and nodes are fitted to what they hold, so that
//! items across a split plane cost a little overlap and never a collapse.

use glam::Vec3;

use super::partition::{Part, Record, Splitter};
use crate::geometry::Aabb;

/// A cell, a cube in the axes that are split.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    centre: Vec3,
    /// Half an edge.
    half: f32,
    level: u32,
}

impl Cell {
    /// The cubic root cell about the centre of all items.
    pub fn root(bounds: &Aabb) -> Cell {
        Cell {
            centre: bounds.centre(),
            // Halved before subtracting: bounds may span the range of f32.
            half: (bounds.max * 0.5 - bounds.min * 0.5).max_element(),
            level: 0,
        }
    }
}

/// Splits cells in the middle of each of `axes`.
pub struct CellSplitter<'a> {
    axes: &'a [usize],
    /// Cells are split at most this often on the way from the root.
    depth: u32,
    /// An item stays where it is once it is larger than this many edges of
    /// the next smaller cell; infinite for items that always go down.
    reach: f32,
    sorted: Vec<Record>,
}

impl<'a> CellSplitter<'a> {
    /// `loose` is the looseness of Ulrich's loose octree ("Loose octrees",
    /// Game Programming Gems 1, p. 444): cells count as grown by that factor,
    /// so an item may be as large as `loose - 1` cell edges. 1 means that
    /// size does not matter.
    pub fn new(axes: &'a [usize], depth: u32, loose: f32) -> Self {
        let reach = if loose > 1.0 {
            loose - 1.0
        } else {
            f32::INFINITY
        };
        CellSplitter {
            axes,
            depth,
            reach,
            sorted: Vec::new(),
        }
    }

    /// Which child cell an item goes to; the number of cells for an item that
    /// stays.
    fn child(&self, cell: &Cell, b: &Aabb) -> usize {
        if b.extent().max_element() > self.reach * cell.half {
            return 1 << self.axes.len();
        }
        let centre = b.centre();
        let bits = self.axes.iter().enumerate();
        bits.fold(0, |child, (bit, &axis)| {
            child | usize::from(centre[axis] >= cell.centre[axis]) << bit
        })
    }

    fn child_cell(&self, cell: &Cell, child: usize) -> Cell {
        let quarter = cell.half * 0.5;
        let mut centre = cell.centre;
        for (bit, &axis) in self.axes.iter().enumerate() {
            centre[axis] += if child >> bit & 1 == 1 {
                quarter
            } else {
                -quarter
            };
        }
        Cell {
            centre,
            half: quarter,
            level: cell.level + 1,
        }
    }
}

impl Splitter for CellSplitter<'_> {
    type Cell = Cell;

    fn split(
        &mut self,
        records: &mut [Record],
        mut cell: Cell,
        _: usize,
        parts: &mut Vec<Part<Cell>>,
    ) {
        let cells = 1 << self.axes.len();
        while cell.level < self.depth {
            // At most eight cells, and one place for items that stay.
            let mut counts = [0; 9];
            for record in records.iter() {
                counts[self.child(&cell, &record.bounds)] += 1;
            }
            if let Some(only) = counts.iter().position(|&count| count == records.len()) {
                if only == cells {
                    return;
                }
                // A level without a choice is no level: on to the one child.
                cell = self.child_cell(&cell, only);
                continue;
            }
            let mut next = [0; 9];
            for k in 1..9 {
                next[k] = next[k - 1] + counts[k - 1];
            }
            self.sorted.clear();
            self.sorted.extend_from_slice(records);
            for record in &self.sorted {
                let k = self.child(&cell, &record.bounds);
                records[next[k]] = *record;
                next[k] += 1;
            }
            for (k, &items) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
                let cell = (k < cells).then(|| self.child_cell(&cell, k));
                parts.push(Part { items, cell });
            }
            return;
        }
    }
}
