//! A binary space partition of the items (Fuchs, Kedem, Naylor 1980): planes
//! through faces of boxes, each across an axis; boxes that a plane passes through
//! are cut in two.
//!
//! A ray enters boxes on the eye's side of a plane before those on the other side, so the
//! order of boxes that a plane separates is exact. Boxes that no plane separates or cuts
//! have the same bounds, and a ray enters them at the same depth; or they are flat and lie
//! in a face of another box. The order is therefore exact even for overlapping boxes.
//!
//! Two exceptions remain, which [`DepthOrder::exception`] returns: cutting ends if there
//! are too many parts or planes, and for a ray within a plane both sides are on the eye's
//! side.

use super::{DepthOrder, Piece, nearest};
use crate::camera::Camera;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::Solids;

/// Parts that there may be for each item before cutting ends.
const MOST_PARTS: usize = 16;
/// Least bound of the number of parts.
///
/// Few boxes, each within the next, are cut into hundreds.
const ROOM: usize = 1 << 14;
/// Cuts per part, on average, before cutting ends.
// Boxes nested within each other are split off one at a time.
const MOST_PLANES: usize = 64;
/// Cost of a cut, in boxes of imbalance.
const COST_OF_CUT: usize = 8;

/// A plane across an axis, and the nodes above and below it.
#[derive(Clone, Copy, Debug)]
struct Node {
    axis: usize,
    at: f64,
    children: [Option<u32>; 2],
}

/// An item in a leaf, or a part of it.
#[derive(Clone, Copy, Debug)]
struct Held {
    item: ItemId,
    bounds: WorldBox,
    is_cut: bool,
}

/// A partition with the items in its leaves, which are drawn from front to back.
#[derive(Default)]
pub struct Partition {
    nodes: Vec<Node>,
    root: Option<u32>,
    /// Index: twice the node above, plus its side. An undivided space is leaf 0.
    leaves: Vec<Vec<Held>>,
    /// `true` if cutting ended early.
    is_cut_short: bool,
}

impl DepthOrder for Partition {
    fn order(&self, camera: &Camera, pieces: &mut Vec<Piece>) {
        pieces.clear();
        let parallel = camera.lens.is_orthographic();
        let (eye, forward) = (camera.frame.eye, camera.frame.forward());
        let mut sorted = Vec::new();
        let mut open = vec![(self.root, 0)];
        while let Some((node, leaf)) = open.pop() {
            if let Some(place) = node {
                let Node { axis, at, children } = self.nodes[place as usize];
                let is_above = match parallel {
                    true => forward[axis] <= 0.0,
                    false => eye[axis] >= at,
                };
                let near = usize::from(!is_above);
                for side in [1 - near, near] {
                    open.push((children[side], 2 * place as usize + side));
                }
                continue;
            }
            sorted.clear();
            let held = self.leaves[leaf].iter();
            sorted.extend(held.map(|held| (nearest(camera, &held.bounds), held)));
            sorted.sort_by(|(near_a, a): &(f64, &Held), (near_b, b)| {
                near_a.total_cmp(near_b).then(a.item.cmp(&b.item))
            });
            pieces.extend(sorted.iter().map(|(_, held)| Piece {
                item: held.item,
                part: held.is_cut.then_some(held.bounds),
            }));
        }
    }

    fn exception(&self, camera: &Camera) -> Option<&'static str> {
        if self.is_cut_short {
            return Some("the limit on cuts was reached before all items were separated");
        }
        let Camera { frame, lens } = camera;
        let is_within = |node: &Node| match lens.is_orthographic() {
            true => frame.forward()[node.axis] == 0.0,
            false => frame.eye[node.axis] == node.at,
        };
        let within = self.nodes.iter().any(is_within);
        within.then_some("rays may run within the plane of a face")
    }
}

/// Builds the tree. O(n log^2 n) where few boxes are cut.
pub fn parted(solids: &Solids) -> Partition {
    parted_within(solids, (solids.boxes.len() * MOST_PARTS).max(ROOM))
}

/// The same, of at most `most` parts.
pub fn parted_within(solids: &Solids, most: usize) -> Partition {
    let part = |(b, item): (&WorldBox, u32)| Held {
        item,
        bounds: *b,
        is_cut: false,
    };
    let all: Vec<Held> = solids.boxes.iter().zip(0..).map(part).collect();
    let (mut tree, mut count) = (Partition::default(), all.len());
    tree.leaves.push(Vec::new());
    // Parts, and the leaf that they are if no plane divides them.
    let mut open = vec![(0, all)];
    let mut left = most.saturating_mul(MOST_PLANES);
    while let Some((leaf, parts)) = open.pop() {
        left = left.saturating_sub(parts.len());
        let room = most.saturating_sub(count);
        let found = (left > 0).then(|| plane(&parts, room)).flatten();
        let Some((axis, at)) = found else {
            tree.is_cut_short |= plane(&parts, usize::MAX).is_some();
            tree.leaves[leaf] = parts;
            continue;
        };
        count -= parts.len();
        let node = tree.nodes.len() as u32;
        match tree.nodes.get_mut(leaf / 2) {
            None => tree.root = Some(node),
            Some(above) => above.children[leaf % 2] = Some(node),
        }
        tree.nodes.push(Node {
            axis,
            at,
            children: [None; 2],
        });
        tree.leaves.resize_with(2 * tree.nodes.len(), Vec::new);
        for (side, parts) in sides(parts, axis, at).into_iter().enumerate().rev() {
            let parts = entered(parts, &solids.boxes);
            count += parts.len();
            open.push((2 * node as usize + side, parts));
        }
    }
    tree
}

/// Parts above and below a plane; parts within the plane count as below.
fn sides(parts: Vec<Held>, axis: usize, at: f64) -> [Vec<Held>; 2] {
    let (mut below, mut above) = (Vec::new(), Vec::new());
    for part in parts {
        let [mut low, mut high] = [Held {
            is_cut: true,
            ..part
        }; 2];
        (low.bounds.max[axis], high.bounds.min[axis]) = (at, at);
        match (part.bounds.max[axis] <= at, part.bounds.min[axis] >= at) {
            (true, _) => below.push(part),
            (_, true) => above.push(part),
            _ => {
                below.push(low);
                above.push(high);
            }
        }
    }
    [above, below]
}

/// The parts through which a ray can enter their items; others are never drawn.
fn entered(mut parts: Vec<Held>, boxes: &[WorldBox]) -> Vec<Held> {
    parts.retain(|held| {
        let (b, whole) = (&held.bounds, &boxes[held.item as usize]);
        let ends = b.min.cmpeq(whole.min) | b.max.cmpeq(whole.max);
        !held.is_cut || ends.any()
    });
    parts
}

/// The plane through a face that balances its sides best and cuts least; `None` if
/// there is none that parts or cuts anything, or only such as cut more than `room`
/// parts.
fn plane(parts: &[Held], room: usize) -> Option<(usize, f64)> {
    let count = parts.len();
    if count < 2 {
        return None;
    }
    let mut best: Option<(usize, usize, f64)> = None;
    for axis in 0..3 {
        let sorted = |bound: &dyn Fn(&WorldBox) -> Option<f64>| {
            let bounds = parts.iter().filter_map(|part| bound(&part.bounds));
            let mut bounds: Vec<f64> = bounds.collect();
            bounds.sort_unstable_by(f64::total_cmp);
            bounds
        };
        let low = sorted(&|b| Some(b.min[axis]));
        let high = sorted(&|b| Some(b.max[axis]));
        let flat = sorted(&|b| (b.min[axis] == b.max[axis]).then_some(b.min[axis]));
        let equal = |list: &[f64], at: f64| {
            list.partition_point(|&x| x <= at) - list.partition_point(|&x| x < at)
        };
        for &at in low.iter().chain(&high) {
            let below = high.partition_point(|&x| x <= at);
            // Parts within the plane count as below.
            let above = count - low.partition_point(|&x| x < at) - equal(&flat, at);
            let cut = count - below - above;
            // A part is never cut twice at the same plane, so the recursion ends.
            let parts_them = cut > 0 || (below < count && above < count);
            if !parts_them || cut > room {
                continue;
            }
            let cost = below.abs_diff(above) + COST_OF_CUT * cut;
            if best.is_none_or(|best| cost < best.0) {
                best = Some((cost, axis, at));
            }
        }
    }
    best.map(|(_, axis, at)| (axis, at))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::visibility::truth::judge;

    /// A limit of parts alone does not end the cutting of nested boxes.
    #[test]
    fn parting_nested_boxes_ends_before_it_is_quadratic() {
        for (count, is_whole) in [(60, true), (200, false)] {
            let half = |i: usize| DVec3::splat(i as f64 + 1.0);
            let boxes: Vec<_> = (0..count)
                .map(|i| WorldBox::new(-half(i), half(i)))
                .collect();
            let tree = parted_within(&judge::solids(&boxes), 8 * count);
            let parts: usize = tree.leaves.iter().map(Vec::len).sum();
            assert!(parts < 8 * count);
            assert_eq!(tree.is_cut_short, !is_whole, "{count}");
        }
    }
}
