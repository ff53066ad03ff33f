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

use super::{DepthOrder, Piece, ToOrder, nearest};
use crate::camera::Camera;
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

/// A node, or the parts of a leaf.
#[derive(Clone, Debug)]
enum Node {
    /// A plane, with the nodes not above it and above it.
    Plane {
        axis: usize,
        at: f64,
        sides: [usize; 2],
    },
    /// Parts between which there is no plane.
    Leaf(Vec<Part>),
}

/// A part of an item while the tree is built, and in its leaves.
#[derive(Clone, Copy, Debug)]
struct Part {
    item: u32,
    b: WorldBox,
    cut: bool,
}

/// The tree.
#[derive(Clone, Debug)]
pub struct BspOrder {
    nodes: Vec<Node>,
    parts: usize,
    /// `true` if cutting ended early.
    is_cut_short: bool,
}

/// Cuts boxes by planes; no order of triangles.
pub fn order(of: &ToOrder) -> Option<Box<dyn DepthOrder>> {
    let order = || Box::new(BspOrder::of(of.boxes)) as Box<dyn DepthOrder>;
    of.surfaces.is_none().then(order)
}

impl BspOrder {
    /// Builds the tree. O(n log^2 n) where few boxes are cut.
    pub fn of(solids: &Solids) -> BspOrder {
        BspOrder::within(solids, (solids.boxes.len() * MOST_PARTS).max(ROOM))
    }

    /// The same, of at most `most` parts.
    pub fn within(solids: &Solids, most: usize) -> BspOrder {
        let part = |(b, item): (&WorldBox, u32)| Part {
            item,
            b: *b,
            cut: false,
        };
        let all: Vec<Part> = solids.boxes.iter().zip(0..).map(part).collect();
        let mut tree = BspOrder {
            parts: all.len(),
            is_cut_short: false,
            nodes: vec![Node::Leaf(Vec::new())],
        };
        let mut open = vec![(0, all)];
        let mut left = most.saturating_mul(MOST_PLANES);
        while let Some((node, parts)) = open.pop() {
            left = left.saturating_sub(parts.len());
            let room = most.saturating_sub(tree.parts);
            let found = (left > 0).then(|| plane(&parts, room)).flatten();
            let Some((axis, at)) = found else {
                tree.is_cut_short |= plane(&parts, usize::MAX).is_some();
                tree.nodes[node] = Node::Leaf(parts);
                continue;
            };
            let count = parts.len();
            let sides = sides(parts, axis, at).map(|side| entered(side, &solids.boxes));
            tree.parts = tree.parts + sides[0].len() + sides[1].len() - count;
            let first = tree.nodes.len();
            for (side, parts) in sides.into_iter().enumerate() {
                tree.nodes.push(Node::Leaf(Vec::new()));
                open.push((first + side, parts));
            }
            tree.nodes[node] = Node::Plane {
                axis,
                at,
                sides: [first, first + 1],
            };
        }
        tree
    }

    /// How many parts the items were cut into.
    pub fn parts(&self) -> usize {
        self.parts
    }
}

/// Parts below and above a plane; parts within the plane count as below.
fn sides(parts: Vec<Part>, axis: usize, at: f64) -> [Vec<Part>; 2] {
    let (mut below, mut above) = (Vec::new(), Vec::new());
    for part in parts {
        let [mut low, mut high] = [Part { cut: true, ..part }; 2];
        (low.b.max[axis], high.b.min[axis]) = (at, at);
        match (part.b.max[axis] <= at, part.b.min[axis] >= at) {
            (true, _) => below.push(part),
            (_, true) => above.push(part),
            _ => {
                below.push(low);
                above.push(high);
            }
        }
    }
    [below, above]
}

/// The parts through which a ray can enter their items; others are never drawn.
fn entered(mut parts: Vec<Part>, boxes: &[WorldBox]) -> Vec<Part> {
    parts.retain(|Part { item, b, cut }| {
        let whole = &boxes[*item as usize];
        let ends = b.min.cmpeq(whole.min) | b.max.cmpeq(whole.max);
        !cut || ends.any()
    });
    parts
}

/// The plane through a face that balances its sides best and cuts least; `None` if
/// there is none that parts or cuts anything, or only such as cut more than `room`
/// parts.
fn plane(parts: &[Part], room: usize) -> Option<(usize, f64)> {
    let count = parts.len();
    if count < 2 {
        return None;
    }
    let mut best: Option<(usize, usize, f64)> = None;
    for axis in 0..3 {
        let sorted = |bound: &dyn Fn(&WorldBox) -> Option<f64>| {
            let bounds = parts.iter().filter_map(|part| bound(&part.b));
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

impl DepthOrder for BspOrder {
    fn order(&self, _: &Solids, camera: &Camera, pieces: &mut Vec<Piece>) {
        pieces.clear();
        let parallel = camera.lens.is_orthographic();
        let mut open = vec![0];
        while let Some(node) = open.pop() {
            match &self.nodes[node] {
                &Node::Plane { axis, at, sides } => {
                    let below_first = match parallel {
                        true => camera.frame.forward()[axis] > 0.0,
                        false => camera.frame.eye[axis] < at,
                    };
                    let [below, above] = sides;
                    open.extend(match below_first {
                        true => [above, below],
                        false => [below, above],
                    });
                }
                Node::Leaf(parts) => {
                    let far = |part: &Part| nearest(camera, &part.b);
                    let mut parts: Vec<&Part> = parts.iter().collect();
                    parts.sort_by(|a, b| far(a).total_cmp(&far(b)).then(a.item.cmp(&b.item)));
                    pieces.extend(parts.iter().map(|part| Piece {
                        item: part.item,
                        part: part.cut.then_some(super::Part::Within(part.b)),
                    }));
                }
            }
        }
    }

    fn exception(&self, camera: &Camera) -> Option<&'static str> {
        if self.is_cut_short {
            return Some("the limit on cuts was reached before all items were separated");
        }
        let Camera { frame, lens } = camera;
        let parallel = lens.is_orthographic();
        let is_within = |node: &Node| match node {
            Node::Plane { axis, .. } if parallel => frame.forward()[*axis] == 0.0,
            Node::Plane { axis, at, .. } => frame.eye[*axis] == *at,
            Node::Leaf(_) => false,
        };
        let within = self.nodes.iter().any(is_within);
        within.then_some("rays may run within the plane of a face")
    }
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
            let tree = BspOrder::within(&judge::solids(&boxes), 8 * count);
            assert!(tree.parts() < 8 * count);
            assert_eq!(!tree.is_cut_short, is_whole, "{count}");
        }
    }
}
