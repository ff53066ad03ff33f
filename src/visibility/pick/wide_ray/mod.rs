//! The sixteen-wide tree: sixteen slab tests at once, nearest children first.
//!
//! It holds the bounds of bodies. The exact tests of the bodies (`bodies`) decide what the slab
//! tests in f32 leave open.

mod bodies;
mod build;
mod slabs;

use std::hint::black_box;

use glam::DVec3;

pub use self::bodies::WideRay;
use self::build::{Child, Node};
use self::slabs::Slabs;
use super::contract::{BackEnd, NotBuilt};
use crate::geometry::Aabb;
use crate::kernel::{Isa, Kernel, LANES};
use crate::query::ItemId;
use crate::visibility::{Guarantee, Ray};

/// The row of this folder.
pub const ROW: BackEnd = BackEnd {
    name: "wide-ray",
    summary: "16-wide tree, sixteen slab tests at once, the last step exact",
    guarantee: Guarantee::Exact,
    boxes: |boxes, kernel| Ok(Box::new(WideRay::of(boxes, kernel)?)),
    facets: |facets, kernel| Ok(Box::new(WideRay::of(facets, kernel)?)),
};

/// The nodes, some 45 bytes of them a box.
#[derive(Clone, Debug)]
struct Tree {
    nodes: Vec<Node>,
    root: Child,
    /// World position of the zero of the nodes.
    zero: DVec3,
    /// Bounds of all boxes.
    bounds: Aabb,
    /// Instruction set of the queries.
    kernel: Kernel,
}

impl Tree {
    /// Builds it over boxes relative to a zero. O(n log n).
    ///
    /// Returns their ids in tree order; [`Candidates`] get positions in these.
    fn of(boxes: &[Aabb], zero: DVec3, kernel: Kernel) -> Result<(Tree, Vec<ItemId>), NotBuilt> {
        // Each node holds at least one box.
        let (count, most) = (boxes.len(), Child::MOST);
        if count > most {
            return Err(NotBuilt::TooMany { count, most });
        }
        let (nodes, root, ids) = build::build(boxes);
        let tree = Tree {
            nodes,
            root,
            zero,
            bounds: Aabb::union_of(boxes),
            kernel,
        };
        Ok((tree, ids))
    }

    /// The ray for the tests of the nodes; `None` if they do not cover it.
    #[inline(always)]
    fn slabs(&self, ray: &Ray) -> Option<Slabs> {
        Slabs::of(ray, self.zero, self.bounds.reach())
    }

    /// Returns `true` if the ray certainly misses all boxes.
    ///
    /// Called first, since it costs less than preparing the ray for the nodes.
    ///
    /// It begins outside and comes no nearer along an axis, or the shadows of its line and of
    /// the bounds on the plane of two axes are apart (Gottschalk, Lin and Manocha 1996,
    /// "OBBTree", the separating axes that are products of two directions). What is rounded
    /// is below 2^-50 of the largest number here times the direction; 2^-48 of it is added.
    #[inline(always)]
    fn is_passed_by(&self, ray: &Ray) -> bool {
        let start = ray.origin - self.zero;
        let (min, max) = (self.bounds.min.as_dvec3(), self.bounds.max.as_dvec3());
        let (above, below) = (start.cmpgt(max), start.cmplt(min));
        if !(above | below).any() {
            return false;
        }
        let d = ray.direction;
        let away = (above & d.cmpge(DVec3::ZERO)) | (below & d.cmple(DVec3::ZERO));
        if away.any() && ray.near >= 0.0 {
            return true;
        }
        let (half, from) = ((max - min) * 0.5, start - (min + max) * 0.5);
        let most = start.abs().max(min.abs()).max(max.abs()).max_element();
        let half = half + most * (1.0 / (1u64 << 48) as f64);
        let (turned, d) = (from.cross(d).abs(), d.abs());
        let reach = DVec3::new(
            half.y * d.z + half.z * d.y,
            half.z * d.x + half.x * d.z,
            half.x * d.y + half.y * d.x,
        );
        turned.cmpgt(reach).any()
    }

    /// Offers every item that the ray can meet no deeper than the candidates'
    /// bound, near ones first as far as the tree tells.
    #[inline(always)]
    fn search<I: Isa, C: Candidates>(&self, isa: I, slabs: &Slabs, found: &mut C) {
        // Behind an opaque pointer, so that each node reads the ray's numbers again, which
        // AVX-512 does within the instruction that needs them.
        // Spread over whole vectors ahead of the loop, they are read back from the stack.
        let slabs = match I::MANY_REGISTERS {
            true => black_box(slabs),
            false => slabs,
        };
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
                    if low <= found.bound() {
                        let latest = || slabs.latest(&node.rows, lane, low);
                        found.offer(low, node.children[lane], latest);
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

/// Candidates that a search collects.
trait Candidates {
    /// Nothing deeper than this is wanted.
    fn bound(&self) -> f32;
    /// A box that can be entered from `low` on, and up to what [`Slabs::latest`] says.
    fn offer(&mut self, low: f32, place: u32, latest: impl FnOnce() -> Option<f32>);
}

/// Nodes kept without the heap.
const NEAR: usize = 48;

/// Nodes still to be visited, the nearest of each node's children last.
struct Open {
    near: [(f32, u32); NEAR],
    used: usize,
    /// Nodes that do not fit.
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
