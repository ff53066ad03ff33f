//! Regular subdivision into cells: what octree and quadtree share. An item
//! goes down with its centre, and nodes are fitted to what they hold, so that
//! items across a split plane cost a little overlap and never a collapse.

use glam::Vec3;

use super::partition::{Part, Record, Splitter};
use crate::geometry::Aabb;

/// A cell, a cube in the axes that are split.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
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
    /// What becomes of cells that are too high for their width.
    columns: Option<Columns>,
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
            columns: None,
            depth,
            reach,
            sorted: Vec::new(),
        }
    }

    /// With cells that are high and narrow cut across `axis`, which is none
    /// of those split, in parts of no more than `leaf` items.
    pub fn with_columns(mut self, axis: usize, leaf: usize) -> Self {
        self.columns = Some(Columns { axis, leaf });
        self
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

/// How a column, a cell with much above each other, is cut into slabs.
///
/// Cells that leave one axis alone become ever narrower columns over the full
/// height of the world. Where that is high, a leaf is a thin needle, and even a
/// small view grazes many. So a cell is split on only while a cube of its width
/// would hold more than some leaves; then its items are sorted by height and
/// stacked, the same number in each slab.
struct Columns {
    axis: usize,
    leaf: usize,
}

/// A cell is a column once a cube of its width would hold fewer than this
/// many leaves. A split makes that number eight times less, so slabs come
/// out between a third as high as they are wide and three times as high.
const LEAVES_OF_A_CUBE: f32 = 3.0;

/// Most slabs of one node: one test of sixteen.
const SLABS: usize = 16;

impl Columns {
    /// Whether the items of the cell are to be stacked. O(items).
    fn is_column(&self, cell: &Cell, records: &[Record]) -> bool {
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for record in records {
            let at = record.bounds.centre()[self.axis];
            (low, high) = (low.min(at), high.max(at));
        }
        // Divided first: the product with the number of items may overflow.
        let most = LEAVES_OF_A_CUBE * self.leaf as f32 / records.len() as f32;
        cell.half <= (high * 0.5 - low * 0.5) * most
    }

    /// Sorts the items by height and divides them evenly.
    fn stack(&self, records: &mut [Record], cell: Cell, parts: &mut Vec<Part<Cell>>) {
        let height = |record: &Record| record.bounds.centre()[self.axis];
        records.sort_unstable_by(|a, b| height(a).total_cmp(&height(b)).then(a.id.cmp(&b.id)));
        let slabs = records.len().div_ceil(self.leaf).min(SLABS);
        let place = |slab| records.len() * slab / slabs;
        for slab in 0..slabs {
            parts.push(Part {
                items: place(slab + 1) - place(slab),
                cell: Some(cell),
            });
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
            if let Some(columns) = &self.columns
                && columns.is_column(&cell, records)
            {
                return columns.stack(records, cell, parts);
            }
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
