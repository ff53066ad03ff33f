//! Sixteen-wide bounding volume hierarchy: 16 slab tests at once, nearest first.
//!
//! It holds the bounds of bodies. The exact tests of the bodies decide what the slab tests in f32
//! leave open. Built top-down: the set of each node is split by the surface area heuristic (16 bins
//! per axis; Wald 2007, "On fast construction of SAH-based bounding volume hierarchies") until it
//! has sixteen parts.

use std::hint::black_box;
use std::mem::swap;
use std::ops::Range;

use glam::DVec3;

use super::slabs::RaySlabTest;
use crate::arithmetic::cross_sizes;
use crate::geometry::{Aabb, BoxBlock};
use crate::index::{NEAR, Record, Stack, by_surface_area};
use crate::kernel::{Isa, LANES, LaneMask};
use crate::query::{Bits, ItemId};
use crate::visibility::Ray;

/// Tree over boxes; its nodes take some 45 bytes per box.
#[derive(Clone, Debug)]
pub struct RayTree {
    nodes: Vec<Node>,
    root: Child,
    /// World position of the nodes' origin.
    pub zero: DVec3,
    /// Bounds of all boxes.
    pub bounds: Aabb,
}

impl RayTree {
    /// Builds the tree over boxes relative to `zero`. O(n log n).
    ///
    /// Returns their ids in tree order too; searches report positions in this order.
    pub fn of(boxes: &[Aabb], zero: DVec3) -> (RayTree, Vec<ItemId>) {
        let mut items = Record::numbered(boxes);
        let mut nodes: Vec<Node> = Vec::with_capacity(boxes.len() / 8 + 1);
        let mut root = Child::new(0, 0);
        // Parts to split, each with the node and lane that refers to it.
        let mut open: Vec<(ItemRange, Option<(usize, usize)>)> = Vec::new();
        if !items.is_empty() {
            open.push((ItemRange::of(&items, 0..items.len()), None));
        }
        while let Some((part, round_up)) = open.pop() {
            let at = nodes.len();
            let mut parts = split(&mut items, part);
            parts.sort_by_key(|part| part.len() > 1);
            let single = parts.iter().filter(|part| part.len() == 1).count();
            let child = Child::new(at, single);
            match round_up {
                None => root = child,
                Some((node, lane)) => nodes[node].children[lane] = child.0,
            }
            let mut node = Node {
                boxes: BoxBlock::EMPTY,
                children: [0; LANES],
            };
            for (lane, part) in parts.iter().enumerate() {
                node.boxes.set(lane, &part.bounds);
                node.children[lane] = part.range.start as u32;
            }
            nodes.push(node);
            for (lane, part) in parts.into_iter().enumerate().skip(single).rev() {
                open.push((part, Some((at, lane))));
            }
        }
        let tree = RayTree {
            nodes,
            root,
            zero,
            bounds: Aabb::union_of(boxes),
        };
        (tree, items.iter().map(|item| item.id).collect())
    }

    /// Calls `offer` for every item that the ray may meet, tested in f64.
    ///
    /// For rays outside the analysis of the slab tests: ignores depths, so all bodies along the ray
    /// are reported.
    pub fn search_in_f64(&self, ray: &Ray, mut offer: impl FnMut(u32)) {
        let mut open = Vec::from_iter((!self.nodes.is_empty()).then_some(self.root));
        while let Some(at) = open.pop() {
            let node = &self.nodes[at.node()];
            for (lane, &child) in node.children.iter().enumerate() {
                let bounds = node.boxes.get(lane);
                if bounds.is_empty() || misses(ray, self.zero, &bounds) {
                    continue;
                }
                match at.items() >> lane & 1 {
                    0 => open.push(Child(child)),
                    _ => offer(child),
                }
            }
        }
    }

    /// Calls `offer` for every item that the ray may meet up to a bound.
    ///
    /// The bound is the depth that the last `offer` returned. Near items come first as far as the
    /// tree order permits.
    #[inline(always)]
    pub fn search<I: Isa>(&self, isa: I, slabs: &RaySlabTest, mut offer: impl FnMut(u32) -> f32) {
        // The opaque pointer makes each node read the ray's numbers again, which AVX-512 does
        // within the instruction that needs them. If they were broadcast to vectors ahead of the
        // loop, they would be read back from the stack.
        let slabs = match I::MANY_REGISTERS {
            true => black_box(slabs),
            false => slabs,
        };
        let mut open = Stack::new((0.0, 0));
        open.used = 0;
        if self.nodes.is_empty() {
            return;
        }
        let mut bound = slabs.far;
        let mut at = self.root;
        loop {
            let node = &self.nodes[at.node()];
            let tested = slabs.test(isa, node.boxes.rows(), bound);
            let items = at.items();
            let left = tested.lanes;
            if left != 0 {
                let neg_entry = isa.to_array(tested.neg_entry);
                for lane in Bits((left & items).into()) {
                    let lane = lane as usize % LANES;
                    if -neg_entry[lane] <= bound {
                        bound = offer(node.children[lane]);
                    }
                }
                let mut nodes = Bits((left & !items).into()).map(|lane| {
                    let lane = lane as usize % LANES;
                    (-neg_entry[lane], node.children[lane])
                });
                // The nearest so far stays off the stack.
                if let Some(mut next) = nodes.next() {
                    let first = open.used;
                    for mut other in nodes {
                        if other.0 < next.0 {
                            swap(&mut other, &mut next);
                        }
                        open.push_sorted(first, other);
                    }
                    if next.0 <= bound {
                        at = Child(next.1);
                        continue;
                    }
                }
            }
            loop {
                match open.pop() {
                    None => return,
                    Some((low, next)) if low <= bound => {
                        at = Child(next);
                        break;
                    }
                    Some(_) => {}
                }
            }
        }
    }
}

/// Returns `true` if a ray certainly misses a box relative to `zero`.
///
/// Either the ray starts outside and does not approach the box along some axis, or the projections
/// of its line and of the box along some axis are disjoint (Gottschalk, Lin and Manocha 1996,
/// "OBBTree": the separating axes that are cross products of two directions). Rounding errors are
/// below 2^-50 of the largest number here times the direction; 2^-48 of it is added. No product
/// overflows or underflows for numbers that a [`Probe`](super::Probe) accepts.
#[inline(always)]
pub fn misses(ray: &Ray, zero: DVec3, bounds: &Aabb) -> bool {
    let start = ray.origin - zero;
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let most = start.abs().max(min.abs()).max(max.abs()).max_element();
    let slack = DVec3::splat(most * (1.0 / (1u64 << 48) as f64));
    let (round_up, below) = (start.cmpgt(max + slack), start.cmplt(min - slack));
    if !(round_up | below).any() {
        return false;
    }
    let d = ray.direction;
    let away = (round_up & d.cmpge(DVec3::ZERO)) | (below & d.cmple(DVec3::ZERO));
    if away.any() && ray.near >= 0.0 {
        return true;
    }
    let (half, from) = ((max - min) * 0.5 + slack, start - (min + max) * 0.5);
    let turned = from.cross(d).abs();
    turned.cmpgt(cross_sizes(half, d.abs())).any()
}

/// Nodes still to be visited, the nearest child of each node on top.
impl Stack<(f32, u32)> {
    /// Inserts a node among those from `first` on, which are sorted.
    #[inline(always)]
    fn push_sorted(&mut self, first: usize, node: (f32, u32)) {
        if self.used == NEAR {
            // Out of order, which only costs time.
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
}

/// Sixteen boxes: items in the first lanes, nodes in the others. 448 bytes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Node {
    boxes: BoxBlock,
    /// Tree positions of items; nodes as [`Child`]; arbitrary in unused lanes.
    children: [u32; LANES],
}

/// Node number (27 bits) and number of its item lanes (5 bits).
///
/// The number of item lanes is thus available before the node is read.
#[derive(Clone, Copy, Debug)]
struct Child(u32);

impl Child {
    /// Packs a node number and a number of item lanes.
    ///
    /// # Panics
    /// With 2^27 nodes, i.e. for a billion boxes.
    fn new(node: usize, items: usize) -> Child {
        assert!(node < 1 << 27, "too many nodes");
        Child((node as u32) << 5 | items as u32)
    }

    #[inline(always)]
    fn node(self) -> usize {
        (self.0 >> 5) as usize
    }

    /// Lanes of items.
    #[inline(always)]
    fn items(self) -> LaneMask {
        ((1u32 << (self.0 & 31)) - 1) as LaneMask
    }
}

/// Splits a set into at most sixteen parts.
///
/// Splits the part with the largest surface first, as long as some part does not fit a node; then
/// splits the smallest parts into single items, as many as there are lanes left for.
fn split(items: &mut [Record], part: ItemRange) -> Vec<ItemRange> {
    let mut parts = vec![part];
    while parts.len() < LANES {
        let wide = (0..parts.len()).filter(|&i| parts[i].len() > LANES);
        let largest = wide.max_by(|&a, &b| {
            let area = |i: usize| parts[i].bounds.half_area();
            area(a).total_cmp(&area(b))
        });
        let Some(largest) = largest else {
            break;
        };
        let part = parts.swap_remove(largest);
        // Split in the middle if no plane separates the centres.
        let cut = by_surface_area(&mut items[part.range.clone()]);
        let middle = part.range.start + cut.map_or(part.len() / 2, |(_, below)| below);
        parts.push(ItemRange::of(items, part.range.start..middle));
        parts.push(ItemRange::of(items, middle..part.range.end));
    }
    loop {
        let left = LANES - parts.len();
        let fits = (0..parts.len()).filter(|&i| (2..=left + 1).contains(&parts[i].len()));
        let Some(smallest) = fits.min_by_key(|&i| parts[i].len()) else {
            break;
        };
        let part = parts.swap_remove(smallest);
        parts.extend(part.range.map(|i| ItemRange::of(items, i..i + 1)));
    }
    parts
}

/// Range of the items with its bounds.
struct ItemRange {
    range: Range<usize>,
    bounds: Aabb,
}

impl ItemRange {
    fn of(items: &[Record], range: Range<usize>) -> ItemRange {
        ItemRange {
            bounds: Aabb::union_of(items[range.clone()].iter().map(|item| &item.bounds)),
            range,
        }
    }

    fn len(&self) -> usize {
        self.range.len()
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::scene::SeededRng;

    fn check(boxes: &[Aabb]) -> usize {
        let (RayTree { nodes, root, .. }, ids) = RayTree::of(boxes, DVec3::ZERO);
        let mut sorted = ids.clone();
        sorted.sort_unstable();
        assert!(sorted.iter().copied().eq(0..boxes.len() as u32));
        let mut found = vec![0; boxes.len()];
        let mut reached = vec![0; nodes.len()];
        let mut children = vec![root; nodes.len()];
        for (at, node) in nodes.iter().enumerate() {
            let items = children[at].items();
            for lane in 0..LANES {
                let b = node.boxes.get(lane);
                let child = node.children[lane];
                if b.is_empty() {
                    continue;
                }
                if items >> lane & 1 == 1 {
                    assert_eq!(b, boxes[ids[child as usize] as usize]);
                    found[child as usize] += 1;
                } else {
                    let child = Child(child);
                    children[child.node()] = child;
                    reached[child.node()] += 1;
                    let below = nodes[child.node()].boxes.rows();
                    for axis in 0..3 {
                        let low = below[axis].iter().fold(f32::INFINITY, |a, &b| a.min(b));
                        let high = below[axis + 3].iter();
                        let high = high.fold(f32::NEG_INFINITY, |a, &b| a.max(b));
                        assert_eq!((low, high), (b.min[axis], b.max[axis]));
                    }
                }
            }
        }
        assert!(found.iter().all(|&n| n == 1));
        assert!(reached.iter().skip(1).all(|&n| n == 1), "each node once");
        nodes.len()
    }

    #[test]
    fn every_item_is_in_one_lane_within_the_bounds_above_it() {
        let mut rng = SeededRng::new(3);
        for n in [0, 1, 2, 15, 16, 17, 40, 300, 5000] {
            let mut random = |_| {
                let at = (rng.point() * 100.0).as_vec3();
                Aabb::new(at, at + rng.point().as_vec3() * 3.0)
            };
            let boxes: Vec<Aabb> = (0..n).map(&mut random).collect();
            let nodes = check(&boxes);
            assert!(nodes <= 1 + n / 6, "{nodes} nodes for {n} items");
        }
    }

    #[test]
    fn stacks_and_rows_that_grow_are_built_too() {
        check(&[Aabb::new(Vec3::ZERO, Vec3::ONE); 3000]);
        let corner = |i: i32| Vec3::splat(1.05_f32.powi(i));
        let growing: Vec<Aabb> = (-500..1700)
            .map(|i| Aabb::new(Vec3::ZERO, corner(i)))
            .collect();
        check(&growing);
    }
}
