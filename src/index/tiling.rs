//! Region search where planes part the items cleanly, as the regions of a map
//! that tile it: one plane where [`Treelets`] need two, down to single items.
//! It owns these planes and the descents of one point and of many; points on a
//! plane, which have more than one way down, are left to the treelets.

use std::ops::ControlFlow;

use glam::Vec3;

use super::tree::PackedTree;
use super::treelets::{
    AXES, Branch, CHILDREN, DESCENT_LEAF, LEVELS, TOP_PLANES, Treelets, grow, parting_axis,
};
use crate::geometry::Aabb;
use crate::kernel::{Isa, Piece, prefetch};
use crate::query::{ManySink, NoRecorder, Recorder, Sink};

/// Four levels of planes and what is below them, lanes as in a treelet: two
/// cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(128))]
struct Node {
    /// Lower is what is at most this. The last lane holds the axes.
    planes: [f32; CHILDREN],
    /// The number of a node, or [`ITEM`] and more.
    below: [u32; CHILDREN],
}

/// Says that the rest of the word is an item's id.
const ITEM: u32 = 1 << 31;
/// Says, along with [`ITEM`], that the rest is the place of an item that may not
/// hold the point, or one of the two below.
const UNSURE: u32 = 1 << 30;
const REST: u32 = UNSURE - 1;
/// The point is outside of the hull, or on a plane of its way.
const OUTSIDE: u32 = u32::MAX;
const ON_PLANE: u32 = u32::MAX - 1;

/// An exact partition of the items by planes parallel to the axes.
///
/// A plane has nothing of its lower side above it and nothing of its upper side
/// below it, so a point on neither side's face takes one way, and ends at one
/// item. If the planes on the way are that item's faces there is nothing left
/// to test.
#[derive(Debug)]
pub struct Tiling {
    nodes: Vec<Node>,
    /// The bounds of all items.
    hull: Aabb,
    /// Most nodes on a way from the root to an item.
    height: usize,
}

/// Points that go down together: enough to hide the waits, few enough for what
/// they ask for to stay in the nearest cache.
const GROUP: usize = 64;

/// For the planes above the last level that a point is above: which of the
/// planes of the last level it comes to.
static LAST_PLANE: [u8; 1 << TOP_PLANES] = {
    let mut table = [0; 1 << TOP_PLANES];
    let mut above = 0;
    while above < table.len() {
        let (mut plane, mut depth) = (0, 0);
        while depth < LEVELS - 1 {
            plane = 2 * plane + 1 + (above >> plane & 1);
            depth += 1;
        }
        table[above] = (plane - TOP_PLANES) as u8;
        above += 1;
    }
    table
};

/// The planes on the way to each child.
static WAY: [u16; CHILDREN] = {
    let mut table = [0; CHILDREN];
    let mut child = 0;
    while child < CHILDREN {
        let mut lane = child + AXES;
        while lane > 0 {
            lane = (lane - 1) / 2;
            table[child] |= 1 << lane;
        }
        child += 1;
    }
    table
};

impl Node {
    /// One step down, for a point within the hull.
    #[inline(always)]
    fn step<I: Isa>(&self, isa: I, p: &[f32; 4]) -> u32 {
        let value = isa.permute(p, self.planes[AXES].to_bits());
        let planes = isa.load(&self.planes);
        let (lower, upper) = (isa.at_most(value, planes), isa.at_most(planes, value));
        // A point within the hull is a number.
        let above = u32::from(!lower);
        let last = u32::from(LAST_PLANE[above as usize % LAST_PLANE.len()]);
        let child = 2 * last + (above >> (TOP_PLANES as u32 + last) & 1);
        let child = child as usize % CHILDREN;
        match lower & upper & WAY[child] {
            0 => self.below[child],
            _ => ON_PLANE,
        }
    }

    #[inline(always)]
    fn prefetch(&self) {
        prefetch(&self.planes);
        prefetch(&self.below);
    }
}

impl Tiling {
    /// The partition over a binary tree, continued below its leaves down to
    /// single items: `parts` as for [`Treelets::over`], `fine` for the divisions
    /// of fewer items. `None` if the items are not parted cleanly. O(n).
    pub fn over(tree: &PackedTree, parts: &[u32], fine: &[u32]) -> Option<Tiling> {
        if tree.nodes().is_empty() || tree.ids().iter().any(|&id| id >= ON_PLANE & REST) {
            return None;
        }
        let (mut parts, mut fine) = (parts.iter().copied(), fine.iter().copied());
        let mut branches = Vec::with_capacity(2 * tree.ids().len());
        grow(tree, 0, &mut branches, &mut |items| match items {
            0 | 1 => None,
            2..=DESCENT_LEAF => fine.next(),
            _ => parts.next(),
        });
        let mut bounds = vec![Aabb::EMPTY; branches.len()];
        for (at, branch) in branches.iter().enumerate().rev() {
            bounds[at] = if branch.upper != 0 {
                bounds[at + 1].union(&bounds[branch.upper])
            } else if branch.items.len() == 1 {
                tree.boxes().get(branch.items.start as usize)
            } else {
                return None;
            };
        }
        let mut tiling = Tiling {
            nodes: Vec::new(),
            hull: bounds[0],
            height: 0,
        };
        // Level by level: what every search reads lies together.
        let mut open = vec![(0, bounds[0], 1)];
        while let Some(&(branch, cell, depth)) = open.get(tiling.nodes.len()) {
            tiling.height = depth;
            let mut cut = Cut {
                branches: &branches,
                bounds: &bounds,
                planes: [f32::INFINITY; CHILDREN],
                axes: 0,
                ends: Vec::with_capacity(CHILDREN),
            };
            cut.fill(branch, cell, 0)?;
            cut.planes[AXES] = f32::from_bits(cut.axes);
            let mut below = [OUTSIDE; CHILDREN];
            for end in cut.ends {
                let branch = &branches[end.branch];
                below[end.child] = if branch.upper != 0 {
                    open.push((end.branch, end.cell, depth + 1));
                    open.len() as u32 - 1
                } else if bounds[end.branch].contains(&end.cell) {
                    ITEM | tree.ids()[branch.items.start as usize]
                } else {
                    ITEM | UNSURE | branch.items.start
                };
            }
            tiling.nodes.push(Node {
                planes: cut.planes,
                below,
            });
        }
        tiling.nodes.shrink_to_fit();
        Some(tiling)
    }

    /// Heap bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..])
    }

    /// Hands every item whose closed box holds `p` to the sink, in tree order.
    #[inline(always)]
    pub fn locate<I: Isa, S: Sink, R: Recorder>(
        &self,
        isa: I,
        tree: &PackedTree,
        treelets: &Treelets,
        p: Vec3,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        recorder.node_tested();
        if !self.hull.contains_point(p) {
            return ControlFlow::Continue(());
        }
        let (at, steps) = isa.apart(SinglePoint {
            nodes: &self.nodes,
            row: p.extend(0.0).to_array(),
        });
        recorder.nodes_tested(AXES as u32 * steps);
        match at {
            ON_PLANE => treelets.locate(isa, tree, p, sink, recorder),
            _ if at & UNSURE == 0 => {
                recorder.subtree_accepted(1);
                sink.accept(&[at & REST])
            }
            _ => {
                recorder.items_tested(1);
                let place = (at & REST) as usize;
                match tree.boxes().get(place).contains_point(p) {
                    true => sink.accept(&tree.ids()[place..place + 1]),
                    false => ControlFlow::Continue(()),
                }
            }
        }
    }

    /// Searches for many points, a group of them step by step: the loads of a
    /// step do not wait for each other.
    #[inline(always)]
    pub fn query_many<I: Isa, S: ManySink>(
        &self,
        isa: I,
        tree: &PackedTree,
        treelets: &Treelets,
        points: &[Vec3],
        sink: &mut S,
    ) -> ControlFlow<()> {
        let mut found = Vec::with_capacity(GROUP);
        let mut rows = [[0.0; 4]; GROUP];
        for (group, first) in points.chunks(GROUP).zip((0..).step_by(GROUP)) {
            for (&p, row) in group.iter().zip(&mut rows) {
                *row = p.extend(0.0).to_array();
            }
            let mut at = [OUTSIDE; GROUP];
            isa.apart(Descent {
                tiling: self,
                rows: &rows,
                at: &mut at[..group.len()],
            });
            let at = &at[..group.len()];
            found.clear();
            if at.iter().fold(0, |any, at| any | at) & UNSURE == 0 {
                found.extend(at.iter().map(|at| at & REST));
                sink.accept_rows(first, &found, &ONE_EACH[..group.len()])?;
                continue;
            }
            let mut ends = [0; GROUP];
            for ((&p, &at), end) in group.iter().zip(at).zip(&mut ends) {
                match at {
                    OUTSIDE => {}
                    ON_PLANE => {
                        // A Vec never breaks off.
                        let _ = treelets.locate(isa, tree, p, &mut found, &mut NoRecorder);
                    }
                    _ if at & UNSURE == 0 => found.push(at & REST),
                    _ => {
                        let place = (at & REST) as usize;
                        if tree.boxes().get(place).contains_point(p) {
                            found.push(tree.ids()[place]);
                        }
                    }
                }
                *end = found.len() as u32;
            }
            sink.accept_rows(first, &found, &ends[..group.len()])?;
        }
        ControlFlow::Continue(())
    }
}

/// The way down of one point within the hull: where it ends, and how many nodes
/// it passes.
struct SinglePoint<'a> {
    nodes: &'a [Node],
    row: [f32; 4],
}

impl<I: Isa> Piece<I> for SinglePoint<'_> {
    type Output = (u32, u32);

    #[inline(always)]
    fn run(self, isa: I) -> (u32, u32) {
        let (mut at, mut steps) = (0, 0);
        while let Some(node) = self.nodes.get(at as usize) {
            at = node.step(isa, &self.row);
            steps += 1;
        }
        (at, steps)
    }
}

/// The way down of a group of points.
struct Descent<'a> {
    tiling: &'a Tiling,
    rows: &'a [[f32; 4]; GROUP],
    /// As many as there are points.
    at: &'a mut [u32],
}

impl<I: Isa> Piece<I> for Descent<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, isa: I) {
        let Descent { tiling, rows, at } = self;
        let nodes = &tiling.nodes[..];
        // Four points a vector.
        let [min, max] = [tiling.hull.min, tiling.hull.max].map(|corner| {
            let four = [corner.extend(0.0).to_array(); 4];
            std::array::from_fn(|lane| four[lane / 4][lane % 4])
        });
        let (min, max) = (isa.load(&min), isa.load(&max));
        let (vectors, _) = rows.as_flattened().as_chunks();
        for (four, at) in vectors.iter().zip(at.chunks_mut(4)) {
            let four = isa.load(four);
            let held = isa.at_most(min, four) & isa.at_most(four, max);
            for (i, at) in at.iter_mut().enumerate() {
                let within = held >> (4 * i) & 0b1111 == 0b1111;
                *at = if within { 0 } else { OUTSIDE };
            }
        }
        for _ in 0..tiling.height {
            for i in 0..at.len() {
                // An item's word is the number of no node.
                let Some(node) = nodes.get(at[i] as usize) else {
                    continue;
                };
                at[i] = node.step(isa, &rows[i]);
                if let Some(next) = nodes.get(at[i] as usize) {
                    next.prefetch();
                }
            }
        }
    }
}

/// Where rows of one id each end.
const ONE_EACH: [u32; GROUP] = {
    let mut ends = [0; GROUP];
    let mut row = 0;
    while row < GROUP {
        ends[row] = row as u32 + 1;
        row += 1;
    }
    ends
};

/// The branches of one line of planes.
struct Cut<'a> {
    branches: &'a [Branch],
    bounds: &'a [Aabb],
    planes: [f32; CHILDREN],
    axes: u32,
    /// Lowest child first.
    ends: Vec<End>,
}

/// A child of the line.
struct End {
    child: usize,
    branch: usize,
    /// What the planes leave of the hull.
    cell: Aabb,
}

impl Cut<'_> {
    /// Puts a branch in a lane and what is below it in the lanes below, as
    /// [`Treelets`] do. `None` if its plane cuts an item.
    fn fill(&mut self, at: usize, cell: Aabb, lane: usize) -> Option<()> {
        let branch = &self.branches[at];
        if branch.upper == 0 || branch.ends(lane) {
            let mut lane = lane;
            while lane < AXES {
                lane = 2 * lane + 1;
            }
            self.ends.push(End {
                child: lane - AXES,
                branch: at,
                cell,
            });
            return Some(());
        }
        let [lower, upper] = [&self.bounds[at + 1], &self.bounds[branch.upper]];
        let axis = parting_axis(lower, upper);
        let plane = lower.max[axis];
        // Not so for a NaN either.
        let beside = plane <= upper.min[axis];
        if !beside {
            return None;
        }
        self.planes[lane] = plane;
        self.axes |= (axis as u32) << (2 * lane);
        let (mut low_cell, mut high_cell) = (cell, cell);
        low_cell.max[axis] = plane;
        high_cell.min[axis] = plane;
        self.fill(at + 1, low_cell, 2 * lane + 1)?;
        self.fill(branch.upper, high_cell, 2 * lane + 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::erased::query_many;
    use crate::index::{Bsp, BspParams, Input, Query, RegionIndex};
    use crate::kernel::{BASELINE, Kernel};
    use crate::query::{ItemId, Located, QueryContext, QueryCost};

    /// Cells between uneven walls, without those that `gone` says.
    fn cells(gone: impl Fn(usize) -> bool) -> Vec<Aabb> {
        let wall = |axis: usize, i: usize| (i * (i + 3 + axis)) as f32 * 0.25 - 20.0;
        let corner = |x, y, z| Vec3::new(wall(0, x), wall(1, y), wall(2, z));
        let numbers = (0..11 * 9 * 7).filter(|&i| !gone(i));
        numbers
            .map(|i| (i % 11, i / 11 % 9, i / 99))
            .map(|(x, y, z)| Aabb::new(corner(x, y, z), corner(x + 1, y + 1, z + 1)))
            .collect()
    }

    /// Centres, corners, middles of faces, and places outside of each box; and
    /// what is no number.
    fn points(items: &[Aabb]) -> Vec<Vec3> {
        let of_box = |b: &Aabb| {
            let far = b.max + b.extent() * 0.25;
            let [face, opposite] = [b.min.x, b.max.x].map(|x| b.centre().with_x(x));
            [b.centre(), b.min, b.max, face, opposite, far, far * 100.0]
        };
        let mut points: Vec<Vec3> = items.iter().flat_map(of_box).collect();
        for strange in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            points.insert(7, items[0].centre().with_y(strange));
        }
        points
    }

    fn answers_are_right(bsp: &Bsp, items: &[Aabb]) {
        let points = points(items);
        for kernel in Kernel::available() {
            let (mut many, mut alone) = (Located::default(), Vec::new());
            query_many(kernel, bsp, &points, &mut many);
            for (&p, found) in points.iter().zip(many.iter()) {
                alone.clear();
                let (sink, recorder) = (&mut alone, &mut NoRecorder);
                let _ = kernel.run(Query {
                    index: bsp,
                    volume: &p,
                    sink,
                    recorder,
                });
                assert_eq!(found, alone, "{p} {kernel}");
                alone.sort();
                let holding = items.iter().zip(0..).filter(|(b, _)| b.contains_point(p));
                let holding: Vec<ItemId> = holding.map(|(_, id)| id).collect();
                assert_eq!(alone, holding, "{p} {kernel}");
            }
        }
    }

    #[test]
    fn a_point_in_a_cell_is_found_by_planes_alone() {
        let items = cells(|_| false);
        let bsp = Bsp::build(&Input::new(&items), &BspParams::default()).unwrap();
        assert!(bsp.tiling().is_some());
        let mut cost = QueryCost::default();
        for (b, id) in items.iter().zip(0..) {
            let mut found = Vec::new();
            let _ = bsp.query(
                &b.centre(),
                &mut QueryContext::new(BASELINE, &mut found, &mut cost),
            );
            assert_eq!(found, [id]);
        }
        assert_eq!(cost.items_tested, 0);
        // Groups in which every point has its one item, the last one not full.
        let centres: Vec<Vec3> = items.iter().map(Aabb::centre).collect();
        assert!(centres.len() > 2 * GROUP && !centres.len().is_multiple_of(GROUP));
        let mut many = Located::default();
        query_many(Kernel::best(), &bsp, &centres, &mut many);
        assert!(many.len() == items.len() && many.iter().zip(0..).all(|(found, id)| found == [id]));
        answers_are_right(&bsp, &items);
    }

    #[test]
    fn cells_beside_gaps_are_tested() {
        let items = cells(|i| i % 5 == 0 || i % 7 == 3);
        let bsp = Bsp::build(&Input::new(&items), &BspParams::default()).unwrap();
        assert!(bsp.tiling().is_some());
        answers_are_right(&bsp, &items);
    }

    #[test]
    fn a_cell_that_reaches_into_another_ends_it() {
        // Each in its turn: some reach over a plane far up only.
        for i in (0..11 * 9 * 7).step_by(3).filter(|i| i % 11 != 10) {
            let mut items = cells(|_| false);
            items[i].max.x += 0.125;
            let bsp = Bsp::build(&Input::new(&items), &BspParams::default()).unwrap();
            assert!(bsp.tiling().is_none(), "{i}");
            if i == 300 {
                answers_are_right(&bsp, &items);
            }
        }
    }

    #[test]
    fn moved_items_end_it() {
        let mut items = cells(|_| false);
        let mut bsp = Bsp::build(&Input::new(&items), &BspParams::default()).unwrap();
        items[300].max.x += 0.125;
        assert!(RegionIndex::refit(&mut bsp, &items, &[300]));
        answers_are_right(&bsp, &items);
    }
}
