//! How the sixteen-wide tree is made: from the root down, each node's set is cut by
//! the surface area heuristic until it has sixteen parts.

use super::slabs::Rows;
use crate::geometry::Aabb;
use crate::index::Record;
use crate::kernel::{LANES, LaneMask};
use crate::query::ItemId;
use crate::visibility::sah::{Part, halve};

/// Sixteen boxes: items in the first lanes, nodes in those behind. 448 bytes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Node {
    pub rows: Rows,
    /// Places of items in tree order, nodes as [`Child`]; of unused lanes any.
    pub children: [u32; LANES],
}

/// A node's number and how many of its first lanes hold items, in 27 and 5 bits:
/// known before the node is read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Child(pub u32);

impl Child {
    /// Most nodes there can be.
    pub const MOST: usize = 1 << 27;

    fn new(node: usize, items: usize) -> Child {
        Child((node as u32) << 5 | items as u32)
    }

    #[inline(always)]
    pub fn node(self) -> usize {
        (self.0 >> 5) as usize
    }

    /// The lanes of items.
    #[inline(always)]
    pub fn items(self) -> LaneMask {
        ((1u32 << (self.0 & 31)) - 1) as LaneMask
    }
}

const EMPTY: Node = Node {
    rows: {
        let (low, high) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
        [low, low, low, high, high, high]
    },
    children: [0; LANES],
};

impl Node {
    fn set(&mut self, lane: usize, b: &Aabb, child: u32) {
        for axis in 0..3 {
            self.rows[axis][lane] = b.min[axis];
            self.rows[axis + 3][lane] = b.max[axis];
        }
        self.children[lane] = child;
    }
}

/// Builds the tree. O(n log n).
///
/// Returns its nodes, the root first, the root, and the ids of the items in tree order.
pub(super) fn build(boxes: &[Aabb]) -> (Vec<Node>, Child, Vec<ItemId>) {
    let mut items = Record::numbered(boxes);
    let mut nodes: Vec<Node> = Vec::with_capacity(boxes.len() / 8 + 1);
    let mut root = Child::new(0, 0);
    // Where the number of the node is to be written.
    let mut open: Vec<(Part, Option<(usize, usize)>)> = Vec::new();
    if !items.is_empty() {
        open.push((Part::of(&items, 0..items.len()), None));
    }
    while let Some((part, above)) = open.pop() {
        let at = nodes.len();
        let mut parts = cut(&mut items, part);
        parts.sort_by_key(|part| part.len() > 1);
        let single = parts.iter().filter(|part| part.len() == 1).count();
        let child = Child::new(at, single);
        match above {
            None => root = child,
            Some((node, lane)) => nodes[node].children[lane] = child.0,
        }
        let mut node = EMPTY;
        for (lane, part) in parts.iter().enumerate() {
            node.set(lane, &part.bounds, part.range.start as u32);
        }
        nodes.push(node);
        for (lane, part) in parts.into_iter().enumerate().skip(single).rev() {
            open.push((part, Some((at, lane))));
        }
    }
    (nodes, root, items.iter().map(|item| item.id).collect())
}

/// Cuts a set into at most sixteen parts: the one with the largest surface
/// first, as long as there is one that does not fit a node; then small ones into
/// single items, as many as there are lanes left for.
fn cut(items: &mut [Record], part: Part) -> Vec<Part> {
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
        let middle = part.range.start + halve(&mut items[part.range.clone()]);
        parts.push(Part::of(items, part.range.start..middle));
        parts.push(Part::of(items, middle..part.range.end));
    }
    loop {
        let left = LANES - parts.len();
        let fits = (0..parts.len()).filter(|&i| (2..=left + 1).contains(&parts[i].len()));
        let Some(smallest) = fits.min_by_key(|&i| parts[i].len()) else {
            break;
        };
        let part = parts.swap_remove(smallest);
        parts.extend(part.range.map(|i| Part::of(items, i..i + 1)));
    }
    parts
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::scene::SeededRng;

    fn check(boxes: &[Aabb]) -> usize {
        let (nodes, root, ids) = build(boxes);
        let mut sorted = ids.clone();
        sorted.sort_unstable();
        assert!(sorted.iter().copied().eq(0..boxes.len() as u32));
        let mut found = vec![0; boxes.len()];
        let mut reached = vec![0; nodes.len()];
        let mut children = vec![root; nodes.len()];
        for (at, node) in nodes.iter().enumerate() {
            let items = children[at].items();
            for lane in 0..LANES {
                let bound = |row: usize| node.rows[row][lane];
                let b = Aabb::new(
                    Vec3::new(bound(0), bound(1), bound(2)),
                    Vec3::new(bound(3), bound(4), bound(5)),
                );
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
                    let below = &nodes[child.node()].rows;
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
