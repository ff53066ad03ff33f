//! Octree and quadtree: regular subdivision into cells.
//!
//! An item descends by its centre, and nodes are fitted to their items: items across a split plane
//! cost some overlap, and the tree never collapses.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::geometry::Aabb;
use crate::index::items::Record;
use crate::index::tree::{Built, Part, Splitter, Tree, TreeBuilder, build_top_down};
use crate::index::{Info, Input, Kind, check_range};

/// An octree with fitted nodes.
///
/// Meagher 1982, "Geometric modeling using octree encoding"; loose variant Ulrich 2000.
///
/// A textbook octree keeps an item that crosses a split plane at the inner node. In a flat city, or
/// among needles, nearly every item crosses one and the tree collapses into a list. Here every item
/// descends by its centre and each node's bounds are the exact union of its items: crossing items
/// only make neighbours overlap. Levels in which all items take the same child are skipped, and
/// coincident items are halved by size below the depth limit, so a leaf never exceeds its limit and
/// the build terminates.
pub type Octree = Tree<CellBuilder<3>>;

/// A quadtree over the two axes in which the scene is widest.
///
/// Finkel and Bentley 1974. Node bounds are fitted and three-dimensional, so that the height still
/// culls.
///
/// For terrain, cities and maps, which are flat. Cells much higher than wide are columns, divided
/// into slabs with equal numbers of items (docs/adr/0012); a flat scene has none. Crossing and
/// coincident items are treated as in [`Octree`].
pub type Quadtree = Tree<CellBuilder<2>>;

/// Builder of [`Octree`] (three axes) and [`Quadtree`] (two).
pub struct CellBuilder<const AXES: usize>;

impl<const AXES: usize> TreeBuilder for CellBuilder<AXES> {
    const INFO: Info = match AXES {
        3 => Info::ours(
            "octree",
            "octree with fitted nodes; loose=2 for the loose variant",
            Kind::Tree,
        ),
        _ => Info::ours(
            "quadtree",
            "quadtree over the two widest axes, high cells in slabs; loose=2 for the loose variant",
            Kind::Tree,
        ),
    };
    type Params = CellParams;

    fn build(input: &Input<'_>, params: &CellParams) -> Built {
        let (name, leaf) = (Self::INFO.name, params.leaf as usize);
        check_range(name, "leaf", params.leaf.into(), 1.0, 4096.0)?;
        check_range(name, "depth", params.depth.into(), 0.0, 64.0)?;
        check_range(name, "loose", params.loose.into(), 1.0, 16.0)?;
        let bounds = Aabb::union_of(input.items);
        let axes = widest_axes::<AXES>(&bounds);
        // The remaining axis.
        let axis = 3 - axes.iter().sum::<usize>();
        let mut splitter = CellSplitter {
            axes: &axes,
            columns: (AXES == 2).then_some(Columns { axis, leaf }),
            depth: params.depth,
            reach: match params.loose > 1.0 {
                true => params.loose - 1.0,
                false => f32::INFINITY,
            },
            sorted: Vec::new(),
        };
        let root = Cell {
            centre: bounds.centre(),
            // Halved before subtracting: bounds may span the range of f32.
            half: bounds.half_extent().max_element(),
            level: 0,
        };
        let records = Record::all(input.items)?;
        let tree = build_top_down(records, leaf, root, &mut splitter);
        Ok((tree, Vec::new()))
    }
}

/// Axes in which the bounds are widest, ascending: all, or all but the narrowest.
pub fn widest_axes<const AXES: usize>(bounds: &Aabb) -> [usize; AXES] {
    let width = bounds.half_extent();
    let narrowest = (0..3).rev().min_by(|&a, &b| width[a].total_cmp(&width[b]));
    let left_out = narrowest.filter(|_| AXES < 3).unwrap_or(3);
    std::array::from_fn(|i| i + usize::from(i >= left_out))
}

defaults! {
    /// Parameters of octree and quadtree: `octree:leaf=32,depth=20,loose=2`.
    #[derive(Clone, Copy, Debug, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct CellParams {
        /// Most items of a leaf (1 to 4096).
        pub leaf: u32 = 32,
        /// Most levels of cells (0 to 64).
        pub depth: u32 = 24,
        /// Looseness (1 to 16) of the cells.
        ///
        /// 1 lets every item descend by its centre; k > 1 keeps items larger than k - 1 edges of
        /// the child cell at the parent.
        pub loose: f32 = 1.0,
    }
}

/// A cell, a cube in the axes that are split.
#[derive(Clone, Copy)]
struct Cell {
    centre: Vec3,
    /// Half an edge.
    half: f32,
    level: u32,
}

/// Splits cells in the middle of each of `axes`.
struct CellSplitter<'a> {
    axes: &'a [usize],
    /// Treatment of cells that are too high for their width; `None` for an octree.
    columns: Option<Columns>,
    /// Most splits along a path from the root.
    depth: u32,
    /// Edges of the child cell that an item must exceed to stay at the parent.
    ///
    /// With looseness (Ulrich, "Loose octrees", Game Programming Gems 1, p. 444) cells count as
    /// grown by that factor, so this is `loose - 1`; infinite for items that always descend.
    reach: f32,
    sorted: Vec<Record>,
}

impl CellSplitter<'_> {
    /// The child cell of an item; the number of cells if the item stays.
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
            centre[axis] += match child >> bit & 1 {
                1 => quarter,
                _ => -quarter,
            };
        }
        Cell {
            centre,
            half: quarter,
            level: cell.level + 1,
        }
    }
}

/// Division of columns into slabs; a column has many items above each other.
///
/// Splitting two axes only makes cells ever narrower columns over the full height of the world. In
/// a high world a leaf becomes a thin needle, and even a small view grazes many. So a cell is split
/// only while a cube of its width would hold more than [`LEAVES_OF_A_CUBE`] leaves; then its items
/// are sorted by height and divided into slabs of equal numbers.
struct Columns {
    axis: usize,
    leaf: usize,
}

/// Leaves in a cube of a cell's width below which the cell is a column.
///
/// A split divides that number by eight, so the height of slabs is between 1/3 and 3 times their
/// width.
const LEAVES_OF_A_CUBE: f32 = 3.0;

/// Most slabs per node: one test of sixteen.
const SLABS: usize = 16;

impl Columns {
    /// Decides whether a cell is divided into slabs. O(items).
    fn is_column(&self, cell: &Cell, records: &[Record]) -> bool {
        let centres = Aabb::of_points(records.iter().map(|record| record.bounds.centre()));
        // Divided first: the product with the number of items may overflow.
        let most = LEAVES_OF_A_CUBE * self.leaf as f32 / records.len() as f32;
        cell.half <= centres.half_extent()[self.axis] * most
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
            // At most eight cells, and one slot for items that stay.
            let mut counts = [0; 9];
            for record in records.iter() {
                counts[self.child(&cell, &record.bounds)] += 1;
            }
            if let Some(only) = counts.iter().position(|&count| count == records.len()) {
                let centre = |record: &Record| record.bounds.centre();
                let is_point = records.iter().all(|r| centre(r) == centre(&records[0]));
                if only == cells || is_point || cell.half == 0.0 {
                    return;
                }
                // A level without a choice is skipped: continue with the only child.
                cell = Cell {
                    level: cell.level,
                    ..self.child_cell(&cell, only)
                };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ConvexVolume;
    use crate::index::tree::PackedTree;
    use crate::index::tree::node::is_leaf;
    use crate::index::{RegionIndex, StructureSpec};
    use crate::query::QueryCost;

    #[test]
    fn the_narrowest_axis_is_left_alone() {
        let of = |x, y, z| widest_axes::<2>(&Aabb::new(Vec3::ZERO, Vec3::new(x, y, z)));
        assert_eq!(of(9.0, 5.0, 1.0), [0, 1]);
        assert_eq!(of(1.0, 5.0, 9.0), [1, 2]);
        assert_eq!(of(9.0, 1.0, 5.0), [0, 2]);
        assert_eq!(of(1.0, 1.0, 1.0), [0, 1]);
        assert!(widest_axes::<2>(&Aabb::EMPTY) < [1, 3]);
        assert_eq!(widest_axes(&Aabb::EMPTY), [0, 1, 2]);
    }

    /// Small cubes on a grid, `counts` along each axis.
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

    /// A sky box, a lost projectile: levels without a choice do not consume depth.
    #[test]
    fn an_item_far_away_or_around_all_does_not_spoil_the_tree() {
        // Shuffled: ids do not follow positions.
        let grid = grid([24; 3]);
        let items: Vec<Aabb> = (0..grid.len())
            .map(|i| grid[i * 5003 % grid.len()])
            .collect();
        let view = ConvexVolume::of_box(&Aabb::new(Vec3::splat(5.0), Vec3::splat(9.0)));
        // Codes of 42 bits resolve less than halving.
        let names = [
            ("octree", 3),
            ("quadtree", 3),
            ("bsp:builder=sah", 3),
            ("bvh", 2),
        ];
        for (name, cases) in names {
            let spec = StructureSpec::parse(name).unwrap();
            let tested = |items: &[Aabb]| {
                let (mut ids, mut cost) = (Vec::new(), QueryCost::default());
                let index = spec.build(Input::new(items)).unwrap();
                index.query_counted((&view).into(), &mut ids, &mut cost);
                cost.items_tested
            };
            let alone = tested(&items);
            for (at, size) in [(0.0, 1e12), (1e10, 1.0), (1e25, 1e25)]
                .into_iter()
                .take(cases)
            {
                let far = Aabb::new(Vec3::splat(at - size), Vec3::splat(at + size));
                let with = tested(&[&items[..], &[far]].concat());
                assert!(with <= 3 * alone, "{name}, {far:?}: {alone} to {with}");
            }
        }
    }

    #[test]
    fn leaves_of_a_high_world_are_no_needles() {
        // At most about 3 times as high as wide, but a grid has whole layers only.
        for (counts, height) in [([32; 3], 2), ([40, 64, 48], 0), ([64, 16, 64], 1)] {
            let tree = built(&grid(counts));
            let nodes = 0..tree.nodes().len();
            let leaves: Vec<usize> = nodes.filter(|&node| is_leaf(tree.nodes(), node)).collect();
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
        let (tree, bounds) = (built(&items), Aabb::union_of(&items));
        let root = Cell {
            centre: bounds.centre(),
            half: bounds.half_extent().max_element(),
            level: 0,
        };
        let mut without = CellSplitter {
            axes: &[0, 1],
            columns: None,
            depth: CellParams::default().depth,
            reach: f32::INFINITY,
            sorted: Vec::new(),
        };
        let records = Record::all(&items).expect("boxes on a grid");
        let plain = build_top_down(
            records,
            CellParams::default().leaf as usize,
            root,
            &mut without,
        );
        assert_eq!(tree.ids(), plain.ids());
        assert_eq!(tree.nodes().len(), plain.nodes().len());
    }

    #[test]
    fn towers_are_cut_in_slabs() {
        // Items above each other, which splits of the two axes cannot separate.
        let ground = |i: u32| [(i & 1) as f32 * 4000.0, (i >> 1 & 1) as f32 * 4000.0];
        let items: Vec<Aabb> = (0..4000)
            .map(|i| (ground(i), (i / 4) as f32))
            .map(|([x, y], z)| Aabb::new(Vec3::new(x, y, z), Vec3::new(x, y, z + 1.0)))
            .collect();
        let tree = built(&items);
        // The root, four towers, sixteen slabs of 62 or 63 each, two leaves each.
        assert_eq!(tree.nodes().len(), 1 + 4 + 64 + 128);
        let leaves = (0..tree.nodes().len()).filter(|&node| is_leaf(tree.nodes(), node));
        let highest = leaves.map(|leaf| tree.nodes()[leaf].bounds.extent().z);
        assert_eq!(highest.fold(0.0, f32::max), 32.0);
    }
}
