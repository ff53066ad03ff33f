//! Region search by axis-parallel planes alone: [`Treelets`], a descent of `bsp`.
//!
//! A k-d tree with four levels per treelet of three cache lines. It has the shape of a
//! packed binary tree, continued below its leaves to a few items per leaf; the items
//! stay in the packed tree. Order of the file: one treelet with its tables, construction,
//! refit, and the descents of one point and of many.

use std::ops::{ControlFlow, Range};

use glam::Vec3;

use super::packed::PackedTree;
use super::search::{Cursor, GROUP};
use crate::geometry::{Aabb, LANES};
use crate::kernel::{Isa, prefetch};
use crate::query::{ManySink, Predicate, Recorder, Sink};

/// Most items of a leaf of the descent: one or two blocks.
pub const DESCENT_LEAF: usize = LANES;

/// Levels of the binary tree in a treelet.
const LEVELS: usize = 4;
/// Subtrees below a treelet.
const CHILDREN: usize = 1 << LEVELS;
/// Number of planes of a treelet, and the lane after them, which holds their axes.
const AXES: usize = CHILDREN - 1;

/// Most treelets on a way from the root to a leaf.
///
/// A division leaves at least a quarter of the items on either side, so 2^32 items have
/// at most 77 levels of planes. Two successive treelets take at least four of them.
const MOST_HEIGHT: usize = 48;

/// Four levels of planes (a treelet: Aila and Karras 2010, "Architecture
/// considerations for tracing incoherent rays"). Lane 0 is the root, lanes 1
/// and 2 its children, and so on.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Treelet {
    /// Nothing on the lower side reaches above this. The last lane holds the
    /// axes instead, two bits for each plane.
    high: [f32; CHILDREN],
    /// Nothing on the upper side reaches below this.
    low: [f32; CHILDREN],
    /// Children of the last planes: a treelet, or [`LEAF`] and the number of a leaf.
    children: [u32; CHILDREN],
}

/// Bit that distinguishes the number of a leaf from that of a treelet.
const LEAF: u32 = 1 << 31;

impl Treelet {
    /// A treelet whose planes send every point to the lower side.
    ///
    /// Lanes stay so where a branch ends before the last level. NaN compares false,
    /// so the upper side is never entered.
    const UNUSED: Treelet = {
        let mut high = [f32::INFINITY; CHILDREN];
        high[AXES] = 0.0;
        Treelet {
            high,
            low: [f32::NAN; CHILDREN],
            children: [LEAF; CHILDREN],
        }
    };

    fn is_unused(&self, lane: usize) -> bool {
        self.low[lane].is_nan()
    }

    fn set(&mut self, lane: usize, axis: usize, high: f32, low: f32) {
        let others = self.high[AXES].to_bits() & !(3 << (2 * lane));
        self.high[AXES] = f32::from_bits(others | (axis as u32) << (2 * lane));
        self.high[lane] = high;
        self.low[lane] = low;
    }

    /// The children that may hold the point, one bit each. Both sides of a
    /// plane are closed. None for a NaN.
    #[inline(always)]
    fn sides(&self, p: Vec3) -> u32 {
        let axes = self.high[AXES].to_bits();
        let mut sides = [0; CHILDREN];
        // One loop of selects, so that it becomes one vector of sixteen lanes.
        for lane in 0..CHILDREN {
            let value = if axes & Y[lane] != 0 { p.y } else { p.x };
            let value = if axes & Z[lane] != 0 { p.z } else { value };
            let below = value <= self.high[lane];
            let above = value >= self.low[lane];
            let lower = if below { BITS[lane] } else { 0 };
            let upper = if above { BITS[lane] << 16 } else { 0 };
            sides[lane] = lower | upper;
        }
        let sides = sides.iter().fold(0, |all, side| all | side);
        let (lower, upper) = (sides as usize, (sides >> 16) as usize);
        let first = LOWER[lower & TOP] & UPPER[upper & TOP];
        let last = SPREAD[lower >> TOP_PLANES & LAST] | SPREAD[upper >> TOP_PLANES & LAST] << 1;
        u32::from(first & last)
    }

    #[inline(always)]
    fn prefetch(&self) {
        prefetch(&self.high);
        prefetch(&self.low);
        prefetch(&self.children);
    }
}

/// Bit of each lane's plane in a set of planes.
const BITS: [u32; CHILDREN] = powers_of_two(1, 1);
/// Bit of the axes that is set for each lane if its plane is across y.
const Y: [u32; CHILDREN] = powers_of_two(1, 2);
/// Bit of the axes that is set for each lane if its plane is across z.
const Z: [u32; CHILDREN] = powers_of_two(2, 2);

const fn powers_of_two(first: u32, step: usize) -> [u32; CHILDREN] {
    let mut bits = [0; CHILDREN];
    let mut lane = 0;
    while lane < AXES {
        bits[lane] = first << (step * lane);
        lane += 1;
    }
    bits
}

/// Number of planes above the last level of a treelet.
const TOP_PLANES: usize = CHILDREN / 2 - 1;
/// Bits of those planes.
const TOP: usize = (1 << TOP_PLANES) - 1;
/// Bits of the planes of the last level, from bit 0 on.
const LAST: usize = (1 << (CHILDREN / 2)) - 1;

/// Children that are open, by the set of planes whose lower side holds the point.
///
/// The index is a set of planes above the last level. A child is open if all planes whose
/// lower side contains the child are in the set.
static LOWER: [u16; TOP + 1] = reachable(0);
/// Children that are open, by the set of planes whose upper side holds the point.
static UPPER: [u16; TOP + 1] = reachable(1);

/// Table of open children for the lower (0) or the upper (1) side.
const fn reachable(side: usize) -> [u16; TOP + 1] {
    let mut table = [0; TOP + 1];
    let mut planes = 0;
    while planes < table.len() {
        let mut child = 0;
        while child < CHILDREN {
            let mut open = true;
            let mut depth = 0;
            while depth < LEVELS - 1 {
                // The plane at this depth on the way to the child, and the
                // side that the way takes there.
                let plane = (1 << depth) - 1 + (child >> (LEVELS - depth));
                let turn = child >> (LEVELS - 1 - depth) & 1;
                open &= turn != side || planes >> plane & 1 == 1;
                depth += 1;
            }
            if open {
                table[planes] |= 1 << child;
            }
            child += 1;
        }
        planes += 1;
    }
    table
}

/// The bits of a byte, moved to the even positions of a word.
///
/// These are the lower children of the planes of the last level.
static SPREAD: [u16; LAST + 1] = {
    let mut table = [0; LAST + 1];
    let mut planes = 0;
    while planes < table.len() {
        let mut plane = 0;
        while plane < CHILDREN / 2 {
            table[planes] |= (planes as u16 >> plane & 1) << (2 * plane);
            plane += 1;
        }
        planes += 1;
    }
    table
};

/// A k-d tree over the items of a packed binary tree, cut into treelets.
#[derive(Clone, Default, Debug)]
pub struct Treelets {
    treelets: Vec<Treelet>,
    /// The first item of each leaf, and the end of the last one.
    starts: Vec<u32>,
    /// The plane or leaf of each node of the packed tree.
    refs: Vec<PlaneOrLeaf>,
    /// Most treelets on a way from the root to a leaf.
    height: usize,
}

/// A plane (16 * treelet + lane) or a leaf ([`LEAF`] | number).
type PlaneOrLeaf = u32;

/// A node of the k-d tree before it is cut into treelets, in depth-first order.
struct Branch {
    /// The branch of the upper side; 0 for a leaf.
    upper: usize,
    /// Levels of planes from here down to the deepest leaf.
    height: u32,
    /// First of its items.
    start: u32,
    /// Its node of the packed tree, if it has one.
    node: Option<usize>,
}

impl Branch {
    /// Returns whether the branch begins a treelet of its own at this lane.
    ///
    /// True where four levels or a multiple of four are left, so that the treelets
    /// above the leaves are full.
    fn begins_treelet(&self, lane: usize) -> bool {
        lane >= AXES || (lane > 0 && (self.height as usize).is_multiple_of(LEVELS))
    }
}

/// Lists the branches of a node, or of items within a leaf; returns their height.
///
/// Branches are in depth-first order. `cuts` has the number of items before the plane for each
/// division of more than [`DESCENT_LEAF`] items within a leaf, in the same order.
fn list_branches(
    tree: &PackedTree,
    node: Option<usize>,
    items: Range<u32>,
    cuts: &mut impl Iterator<Item = u32>,
    branches: &mut Vec<Branch>,
) -> u32 {
    let at = branches.len();
    branches.push(Branch {
        upper: 0,
        height: 0,
        start: items.start,
        node,
    });
    let (lower, upper, middle) = match node.filter(|&node| !tree.is_leaf(node)) {
        Some(node) => {
            let upper = tree.nodes()[node + 1].after();
            (Some(node + 1), Some(upper), tree.nodes()[upper].first)
        }
        None if items.len() > DESCENT_LEAF => match cuts.next() {
            Some(cut) => (None, None, items.start + cut),
            None => return 0,
        },
        None => return 0,
    };
    let below = list_branches(tree, lower, items.start..middle, cuts, branches);
    branches[at].upper = branches.len();
    let above = list_branches(tree, upper, middle..items.end, cuts, branches);
    branches[at].height = 1 + below.max(above);
    branches[at].height
}

impl Treelets {
    /// Builds the k-d tree over a packed binary tree. O(n).
    ///
    /// `cuts` continue it below the leaves, as [`list_branches`] reads them.
    pub fn over(tree: &PackedTree, cuts: Vec<u32>) -> Treelets {
        let mut treelets = Treelets {
            refs: vec![LEAF; tree.nodes().len()],
            ..Treelets::default()
        };
        if tree.nodes().is_empty() {
            return treelets;
        }
        let count = tree.ids().len() as u32;
        let mut branches = Vec::new();
        list_branches(
            tree,
            Some(0),
            0..count,
            &mut cuts.into_iter(),
            &mut branches,
        );
        treelets.treelets.push(Treelet::UNUSED);
        treelets.assign(&branches, 0, (0, 0), 1);
        treelets.starts.push(count);
        treelets.treelets.shrink_to_fit();
        treelets.starts.shrink_to_fit();
        for node in (0..tree.nodes().len()).rev() {
            treelets.fit(tree, node);
        }
        treelets
    }

    /// Assigns a branch to a lane of a treelet, and its descendants to those below.
    fn assign(
        &mut self,
        branches: &[Branch],
        at: usize,
        (treelet, mut lane): (usize, usize),
        depth: usize,
    ) {
        self.height = self.height.max(depth);
        let branch = &branches[at];
        let is_leaf = branch.upper == 0;
        let mut place = (treelet * CHILDREN + lane) as PlaneOrLeaf;
        if !is_leaf && !branch.begins_treelet(lane) {
            // In use from here on; `fit` computes the plane.
            self.treelets[treelet].low[lane] = f32::INFINITY;
            self.assign(branches, at + 1, (treelet, 2 * lane + 1), depth);
            self.assign(branches, branch.upper, (treelet, 2 * lane + 2), depth);
        } else {
            while lane < AXES {
                lane = 2 * lane + 1;
            }
            let child = lane - AXES;
            if !is_leaf {
                let below = self.treelets.len();
                self.treelets[treelet].children[child] = below as u32;
                self.treelets.push(Treelet::UNUSED);
                return self.assign(branches, at, (below, 0), depth + 1);
            }
            place = LEAF | self.starts.len() as u32;
            self.treelets[treelet].children[child] = place;
            self.starts.push(branch.start);
        }
        if let Some(node) = branch.node {
            self.refs[node] = place;
        }
    }

    /// Computes the plane of a node from the bounds of its children.
    ///
    /// For a leaf of the packed tree, all planes below it, from the bounds of items.
    pub fn fit(&mut self, tree: &PackedTree, node: usize) {
        let place = self.refs[node];
        if tree.is_leaf(node) {
            self.fit_below(tree, place);
        } else {
            let lower = &tree.nodes()[node + 1];
            let upper = &tree.nodes()[lower.after()];
            self.set_plane(place, &lower.bounds, &upper.bounds);
        }
    }

    /// Computes a plane and all planes below it; returns the bounds of their items.
    fn fit_below(&mut self, tree: &PackedTree, place: PlaneOrLeaf) -> Aabb {
        if place & LEAF != 0 {
            let bounds = self.items(place).map(|place| tree.boxes().get(place));
            return bounds.fold(Aabb::EMPTY, |all, b| all.union(&b));
        }
        let lower = self.fit_below(tree, self.side(place, 0));
        if self.treelets[place as usize / CHILDREN].is_unused(place as usize % CHILDREN) {
            return lower;
        }
        let upper = self.fit_below(tree, self.side(place, 1));
        self.set_plane(place, &lower, &upper);
        lower.union(&upper)
    }

    /// The plane or leaf on the lower (0) or the upper (1) side of a plane.
    fn side(&self, place: PlaneOrLeaf, side: usize) -> PlaneOrLeaf {
        let (treelet, lane) = (place as usize / CHILDREN, place as usize % CHILDREN);
        let lane = 2 * lane + 1 + side;
        match lane.checked_sub(AXES) {
            None => (treelet * CHILDREN + lane) as PlaneOrLeaf,
            Some(child) => match self.treelets[treelet].children[child] {
                leaf if leaf & LEAF != 0 => leaf,
                below => below * CHILDREN as u32,
            },
        }
    }

    /// Sets a plane from the bounds of its two sides.
    fn set_plane(&mut self, place: PlaneOrLeaf, lower: &Aabb, upper: &Aabb) {
        let axis = split_axis(lower, upper);
        let (treelet, lane) = (place as usize / CHILDREN, place as usize % CHILDREN);
        self.treelets[treelet].set(lane, axis, lower.max[axis], upper.min[axis]);
    }

    /// Heap bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.treelets[..])
            + size_of_val(&self.starts[..])
            + size_of_val(&self.refs[..])
    }

    /// The items of a leaf.
    #[inline(always)]
    fn items(&self, leaf: u32) -> Range<usize> {
        let leaf = (leaf & !LEAF) as usize;
        self.starts[leaf] as usize..self.starts[leaf + 1] as usize
    }

    /// Passes every item whose closed box holds `p` to the sink, in tree order.
    #[inline(always)]
    pub fn locate<I: Isa, S: Sink, R: Recorder>(
        &self,
        isa: I,
        tree: &PackedTree,
        p: Vec3,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        if self.treelets.is_empty() {
            return ControlFlow::Continue(());
        }
        // Treelets above the present one, with the children still to be entered.
        let mut above = [(0, 0); MOST_HEIGHT];
        let mut level = 0;
        let (mut at, mut open) = (0, self.open(0, p, recorder));
        loop {
            if open == 0 {
                if level == 0 {
                    return ControlFlow::Continue(());
                }
                level -= 1;
                (at, open) = above[level];
                continue;
            }
            let child = self.treelets[at].children[open.trailing_zeros() as usize];
            open &= open - 1;
            if child & LEAF != 0 {
                let items = self.items(child);
                tree.prefetch_items(items.clone());
                tree.test_items(isa, items, (&p, p.mask()), sink, recorder)?;
            } else {
                if open != 0 {
                    above[level] = (at, open);
                    level += 1;
                }
                at = child as usize;
                open = self.open(at, p, recorder);
            }
        }
    }

    /// Children of a treelet that may hold the point, counted by the recorder.
    #[inline(always)]
    fn open<R: Recorder>(&self, at: usize, p: Vec3, recorder: &mut R) -> u32 {
        recorder.nodes_tested(AXES as u32);
        self.treelets[at].sides(p)
    }

    /// Region search for groups of points, each level by level.
    ///
    /// The loads of a level do not wait for each other.
    #[inline(always)]
    pub fn query_many<S: ManySink>(
        &self,
        tree: &PackedTree,
        points: &[Vec3],
        sink: &mut S,
    ) -> ControlFlow<()> {
        let (mut now, mut next, mut ids) = (Vec::new(), Vec::new(), Vec::new());
        for (group, first) in points.chunks(GROUP).zip((0..).step_by(GROUP)) {
            now.clear();
            if !self.treelets.is_empty() {
                now.extend((0..group.len() as u32).map(|point| Cursor { point, at: 0 }));
            }
            // Cursors stay in the order of their points, those at leaves included.
            for _ in 0..self.height {
                next.clear();
                for &Cursor { point, at } in &now {
                    if at & LEAF != 0 {
                        next.push(Cursor { point, at });
                        continue;
                    }
                    let treelet = &self.treelets[at as usize];
                    let mut open = treelet.sides(group[point as usize]);
                    while open != 0 {
                        let at = treelet.children[open.trailing_zeros() as usize];
                        open &= open - 1;
                        match at & LEAF {
                            0 => self.treelets[at as usize].prefetch(),
                            _ => prefetch(&self.starts[(at & !LEAF) as usize]),
                        }
                        next.push(Cursor { point, at });
                    }
                }
                std::mem::swap(&mut now, &mut next);
            }
            let items_of = |leaf| self.items(leaf);
            tree.answer_group(group, first, &now, items_of, &mut ids, sink)?;
        }
        ControlFlow::Continue(())
    }
}

/// Axis of the plane between two boxes: the one on which they overlap least,
/// relative to the extent of both.
fn split_axis(lower: &Aabb, upper: &Aabb) -> usize {
    let shared = (lower.max - upper.min) / lower.union(upper).extent();
    // A NaN (no extent, or one beyond f32) is as bad as all of it.
    let shared = |axis: usize| match shared[axis] {
        share if share < 1.0 => share,
        _ => 1.0,
    };
    let best = (0..3).min_by(|&a, &b| shared(a).total_cmp(&shared(b)));
    best.unwrap_or(0)
}
