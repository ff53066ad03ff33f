//! The sixteen-wide tree: sixteen slab tests at once, nearest children first.
//! What the tests in f32 leave open is decided exactly, among the few items
//! whose depths are within their slack of the first. This file owns the
//! traversal.

mod build;
mod slabs;

use glam::{DVec3, Vec3};

use self::build::{Built, Child, Node};
use self::slabs::Slabs;
use super::contract::{BackEnd, Hit, NotBuilt, Pick};
use super::exactly;
use crate::geometry::Aabb;
use crate::kernel::{Isa, Kernel, LANES, Work};
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::{Guarantee, Ray, Solids};

/// The row of this file.
pub const ROW: BackEnd = BackEnd {
    name: "wide-ray",
    summary: "16-wide tree, sixteen slab tests at once, the last step exact",
    guarantee: Guarantee::Exact,
    build: |solids| Ok(Box::new(WideRay::of(solids)?)),
};

/// Most items: a node holds one at least.
const MOST: usize = Child::MOST;

/// An item in one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Item {
    /// As it was written.
    b: WorldBox,
    id: ItemId,
}

/// Boxes under a tree of nodes of sixteen. Some 45 bytes of nodes and 64 of the
/// box as it was written per item.
#[derive(Clone, Debug)]
pub struct WideRay {
    nodes: Vec<Node>,
    root: Child,
    /// In tree order.
    items: Vec<Item>,
    /// Where the zero of the nodes is.
    zero: DVec3,
    /// Largest absolute local coordinate on each axis.
    reach: Vec3,
    /// The best of the machine that it was built on.
    kernel: Kernel,
}

impl WideRay {
    /// Builds the tree. O(n log n).
    ///
    /// # Errors
    /// More than 2^27 items.
    pub fn of(solids: &Solids) -> Result<WideRay, NotBuilt> {
        let count = solids.outer.len();
        if count > MOST {
            return Err(NotBuilt::TooMany { count, most: MOST });
        }
        let Built { nodes, root, ids } = build::build(&solids.outer);
        let item = |&id: &ItemId| Item {
            b: solids.boxes[id as usize],
            id,
        };
        Ok(WideRay {
            nodes,
            root,
            items: ids.iter().map(item).collect(),
            zero: solids.origin,
            reach: Aabb::union_of(&solids.outer).reach(),
            kernel: Kernel::best(),
        })
    }

    /// [`Pick::first`] by an instruction set of one's choice.
    #[inline]
    pub fn first_by(&self, kernel: Kernel, ray: &Ray) -> Option<Hit> {
        kernel.run(First { tree: self, ray })
    }

    /// [`Pick::nearest`] by an instruction set of one's choice.
    pub fn nearest_by(&self, kernel: Kernel, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        kernel.run(Nearest {
            tree: self,
            ray,
            count,
            hits,
        });
    }

    fn place(&self, place: u32) -> (ItemId, &WorldBox) {
        let item = &self.items[place as usize];
        (item.id, &item.b)
    }

    fn all(&self) -> impl Iterator<Item = (ItemId, &WorldBox)> {
        self.items.iter().map(|item| (item.id, &item.b))
    }

    /// Offers every item that the ray can meet no deeper than the candidates'
    /// bound, near ones first as far as the tree tells.
    #[inline(always)]
    fn search<I: Isa, C: Candidates>(&self, isa: I, slabs: &Slabs, found: &mut C) {
        let mut open = Open::new();
        if self.nodes.is_empty() {
            return;
        }
        let mut at = self.root;
        loop {
            let node = &self.nodes[at.node()];
            let tested = slabs.test(isa, &node.rows, found.bound());
            let items = at.items();
            let mut left = tested.lanes;
            if left != 0 {
                let less_entry = isa.to_array(tested.less_entry);
                let mut here = left & items;
                while here != 0 {
                    let lane = here.trailing_zeros() as usize % LANES;
                    here &= here - 1;
                    let low = -less_entry[lane];
                    if low <= found.bound()
                        && let Some(bounds) = slabs.bounds(&node.rows, lane, low)
                    {
                        found.offer(bounds.low, bounds.high, node.children[lane]);
                    }
                }
                left &= !items;
                if left != 0 {
                    let first = open.len();
                    // The nearest so far is kept out of the stack.
                    let lane = left.trailing_zeros() as usize % LANES;
                    left &= left - 1;
                    let mut next = (-less_entry[lane], node.children[lane]);
                    while left != 0 {
                        let lane = left.trailing_zeros() as usize % LANES;
                        left &= left - 1;
                        let other = (-less_entry[lane], node.children[lane]);
                        let (low, high) = if other.0 < next.0 {
                            (other, next)
                        } else {
                            (next, other)
                        };
                        next = low;
                        open.push_sorted(first, high);
                    }
                    if next.0 <= found.bound() {
                        at = Child(next.1);
                        continue;
                    }
                }
            }
            loop {
                match open.pop() {
                    None => return,
                    Some((low, next)) if low <= found.bound() => {
                        at = Child(next);
                        break;
                    }
                    Some(_) => {}
                }
            }
        }
    }
}

/// What a search collects.
trait Candidates {
    /// Nothing deeper than this is wanted.
    fn bound(&self) -> f32;
    /// An item that can be met from `low` on, and is met at `high` or before if
    /// that is finite.
    fn offer(&mut self, low: f32, high: f32, place: u32);
}

/// Nodes kept without the heap.
const NEAR: usize = 48;

/// Nodes still to be visited, the nearest of each node's children last.
struct Open {
    near: [(f32, u32); NEAR],
    used: usize,
    /// What does not fit.
    far: Vec<(f32, u32)>,
}

impl Open {
    #[inline(always)]
    fn new() -> Open {
        Open {
            near: [(0.0, 0); NEAR],
            used: 0,
            far: Vec::new(),
        }
    }

    #[inline(always)]
    fn len(&self) -> usize {
        self.used
    }

    /// Adds a node to those from `first` on, which are sorted.
    #[inline(always)]
    fn push_sorted(&mut self, first: usize, node: (f32, u32)) {
        if self.used == NEAR {
            // Out of order, which costs time only.
            self.far.push(node);
            return;
        }
        let mut at = self.used;
        self.used += 1;
        while at > first && self.near[at - 1].0 < node.0 {
            self.near[at] = self.near[at - 1];
            at -= 1;
        }
        self.near[at] = node;
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<(f32, u32)> {
        if let Some(last) = self.far.pop() {
            return Some(last);
        }
        self.used = self.used.checked_sub(1)?;
        Some(self.near[self.used % NEAR])
    }
}

/// Candidates kept without the heap.
const FEW: usize = 8;

/// The candidates for the first hit.
struct Foremost {
    bound: f32,
    few: [(f32, u32); FEW],
    used: usize,
    more: Vec<(f32, u32)>,
}

impl Foremost {
    #[inline(always)]
    fn within(&self) -> impl Iterator<Item = u32> {
        let all = self.few[..self.used].iter().chain(&self.more);
        all.filter(|(low, _)| *low <= self.bound)
            .map(|&(_, place)| place)
    }

    #[cold]
    fn make_room(&mut self) {
        let mut kept = 0;
        for i in 0..self.used {
            if self.few[i].0 <= self.bound {
                self.few[kept] = self.few[i];
                kept += 1;
            }
        }
        self.used = kept;
        if kept == FEW {
            self.more.extend(self.few);
            self.used = 0;
        }
    }
}

impl Candidates for Foremost {
    #[inline(always)]
    fn bound(&self) -> f32 {
        self.bound
    }

    #[inline(always)]
    fn offer(&mut self, low: f32, high: f32, place: u32) {
        if high < self.bound {
            self.bound = high;
        }
        if self.used == FEW {
            self.make_room();
        }
        self.few[self.used % FEW] = (low, place);
        self.used += 1;
    }
}

struct First<'a> {
    tree: &'a WideRay,
    ray: &'a Ray,
}

impl Work for First<'_> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Option<Hit> {
        let First { tree, ray } = self;
        let Some(slabs) = Slabs::of(ray, tree.zero, tree.reach) else {
            return exactly::first(ray, tree.all());
        };
        let mut found = Foremost {
            bound: slabs.far(),
            few: [(0.0, 0); FEW],
            used: 0,
            more: Vec::new(),
        };
        tree.search(isa, &slabs, &mut found);
        exactly::first(ray, found.within().map(|place| tree.place(place)))
    }
}

/// The candidates for the first `count` hits.
struct Several {
    count: usize,
    far: f32,
    /// The lowest upper bounds of depths, sorted, at most `count`.
    highs: Vec<f32>,
    all: Vec<(f32, u32)>,
}

impl Candidates for Several {
    #[inline(always)]
    fn bound(&self) -> f32 {
        match self.highs.len() == self.count {
            true => self.highs[self.count - 1].min(self.far),
            false => self.far,
        }
    }

    #[inline(always)]
    fn offer(&mut self, low: f32, high: f32, place: u32) {
        self.all.push((low, place));
        if high < self.bound() {
            self.highs.truncate(self.count - 1);
            let at = self.highs.partition_point(|&other| other <= high);
            self.highs.insert(at, high);
        }
    }
}

struct Nearest<'a> {
    tree: &'a WideRay,
    ray: &'a Ray,
    count: usize,
    hits: &'a mut Vec<Hit>,
}

impl Work for Nearest<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Nearest {
            tree,
            ray,
            count,
            hits,
        } = self;
        let Some(slabs) = Slabs::of(ray, tree.zero, tree.reach) else {
            return exactly::nearest(ray, count, tree.all(), hits);
        };
        if count == 0 {
            return hits.clear();
        }
        let mut found = Several {
            count,
            far: slabs.far(),
            highs: Vec::new(),
            all: Vec::new(),
        };
        tree.search(isa, &slabs, &mut found);
        let bound = found.bound();
        let within = found.all.iter().filter(|(low, _)| *low <= bound);
        let places = within.map(|&(_, place)| tree.place(place));
        exactly::nearest(ray, count, places, hits);
    }
}

impl Pick for WideRay {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        self.first_by(self.kernel, ray)
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        self.nearest_by(self.kernel, ray, count, hits);
    }
}
