//! The 2-D BSP tree of a Doom map.
//!
//! The bounds of its leaves, and the leaf that contains a point, exactly.

use std::ops::{Add, Mul, Sub};

use glam::{DVec2, DVec3, Vec3};

use super::WorldBox;
use crate::arithmetic::Expansion;
use crate::geometry::{Aabb, Plane, PlaneTree, PlaneTreeNode};
use crate::query::ItemId;

/// A node of the tree with its partition line, map units.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct BspNode {
    /// A point of the line.
    pub start: DVec2,
    /// Direction of the line, not of unit length.
    pub direction: DVec2,
    /// Front (right of the direction) first, then back.
    pub children: [BspChild; 2],
}

/// Child of a node: another node, or the end of the branch.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum BspChild {
    /// Index of a node.
    Node(u32),
    /// Index of a leaf; in a Quake III map only open leaves are counted.
    Leaf(ItemId),
    /// A leaf within the solid.
    Solid,
}

/// The leaf that a descent ends in.
///
/// `below` returns the child of a node on the side of the point.
pub fn descend(mut at: BspChild, below: impl Fn(u32) -> BspChild) -> Option<ItemId> {
    loop {
        match at {
            BspChild::Node(node) => at = below(node),
            BspChild::Leaf(leaf) => return Some(leaf),
            BspChild::Solid => return None,
        }
    }
}

/// Most planes of a map on one path that structures divide by.
///
/// Real maps have 13 to 61. A chain of planes would make building quadratic.
const DEPTH: usize = 256;

/// The planes of a map's nodes, for structures that can use them.
///
/// The nodes must form a tree, as the readers of maps check; cut off below [`DEPTH`].
pub fn plane_tree(
    root: BspChild,
    nodes: impl Iterator<Item = (Plane, [BspChild; 2])>,
) -> PlaneTree {
    let below = |child| match child {
        BspChild::Node(node) => Some(node),
        _ => None,
    };
    let nodes = nodes.map(|(plane, children)| PlaneTreeNode {
        plane,
        children: children.map(below),
    });
    let mut nodes: Vec<PlaneTreeNode> = nodes.collect();
    let root = below(root);
    let mut level = Vec::from_iter(root);
    for _ in 1..DEPTH {
        let children = |node: u32| nodes[node as usize].children.into_iter().flatten();
        level = level.into_iter().flat_map(children).collect();
    }
    for node in level {
        nodes[node as usize].children = [None; 2];
    }
    PlaneTree { nodes, root }
}

/// The sign of `normal . p - distance`, exactly.
pub fn side_of(normal: DVec3, distance: f64, p: DVec3) -> i32 {
    let value = normal.dot(p) - distance;
    // Twice the rounding error of three products and three sums.
    let doubt = (normal.abs().dot(p.abs()) + distance.abs()) * 8.0 * f64::EPSILON;
    if value.abs() > doubt {
        return if value < 0.0 { -1 } else { 1 };
    }
    let products = (0..3).map(|k| Expansion::product(normal[k], p[k]));
    let start = Expansion::from(-distance);
    products.fold(start, |sum, product| &sum + &product).sign()
}

impl BspNode {
    /// 0 for the front (right) side, 1 for the back.
    ///
    /// Ties follow the Doom engine's `R_PointOnSide` (linuxdoom 1.10, r_main.c), which treats
    /// points on axis-parallel lines differently from those on other lines. Exact; the engine's
    /// 16.16 truncation is not imitated.
    pub fn side(&self, p: DVec2) -> usize {
        let (DVec2 { x, y }, DVec2 { x: dx, y: dy }) = (self.start, self.direction);
        if dx == 0.0 {
            let along = if p.x <= x { dy } else { -dy };
            return usize::from(along > 0.0);
        }
        if dy == 0.0 {
            let along = if p.y <= y { -dx } else { dx };
            return usize::from(along > 0.0);
        }
        let to = p - self.start;
        // The engine's short cut by sign bits; differs from the products below only for a point
        // exactly at the line's start.
        let parts = [dy, dx, to.x, to.y].into_iter();
        if parts.filter(|v| *v < 0.0).count() % 2 == 1 {
            return usize::from((dy < 0.0) != (to.x < 0.0));
        }
        // Coordinates of a map are 16-bit integers, so this distance is exact.
        let normal = DVec3::new(-dy, dx, 0.0);
        usize::from(side_of(normal, dx * y - dy * x, p.extend(0.0)) >= 0)
    }
}

/// A BSP tree with the bounds of its leaves.
#[derive(Clone, Debug)]
pub struct BspTree {
    nodes: Vec<BspNode>,
    root: BspChild,
    /// Bounds of each leaf, at height zero.
    pub boxes: Vec<Aabb>,
    /// Least and greatest coordinate of the square that the leaves divide.
    extent: [f64; 2],
}

impl BspTree {
    /// Bounds the leaves of a tree within the closed square `[low, high]^2`.
    ///
    /// Points outside it have no leaf. O(nodes * depth).
    ///
    /// # Errors
    /// A node or leaf that is reached twice or does not exist: the nodes do not form a tree.
    pub fn new(
        nodes: Vec<BspNode>,
        root: BspChild,
        leaf_count: usize,
        [low, high]: [f64; 2],
    ) -> Result<BspTree, String> {
        let mut reached = [vec![false; nodes.len()], vec![false; leaf_count]];
        // A leaf without a node has no place.
        let mut boxes = vec![planar_bounds(&[]); leaf_count];
        let corners = [(low, low), (high, low), (high, high), (low, high)];
        let square = corners.map(DVec2::from).to_vec();
        let mut open = vec![(root, square)];
        while let Some((child, polygon)) = open.pop() {
            let (of, index) = match child {
                BspChild::Node(node) => (0, node as usize),
                BspChild::Leaf(leaf) => (1, leaf as usize),
                BspChild::Solid => continue,
            };
            match reached[of].get_mut(index) {
                None => return Err(format!("{child:?} does not exist")),
                Some(true) => return Err(format!("{child:?} is reached twice")),
                Some(fresh) => *fresh = true,
            }
            if let BspChild::Leaf(_) = child {
                boxes[index] = planar_bounds(&polygon);
                continue;
            }
            let node = &nodes[index];
            open.extend([1, 0].map(|side| (node.children[side], clip(&polygon, node, side))));
        }
        Ok(BspTree {
            nodes,
            root,
            boxes,
            extent: [low, high],
        })
    }

    /// The partition lines as upright planes, for structures that can use them.
    ///
    /// Structures keep their own bounds, so ties do not matter to them.
    pub fn plane_tree(&self) -> PlaneTree {
        let nodes = self.nodes.iter().map(|node| {
            // Right of the direction is the front.
            let normal = -node.direction.perp().as_vec2().extend(0.0);
            let start = node.start.as_vec2().extend(0.0);
            (Plane::through(start, normal), node.children)
        });
        plane_tree(self.root, nodes)
    }

    /// The leaf that contains the point, by descent from the root.
    ///
    /// `None` outside the closed square. O(depth).
    pub fn descend(&self, p: DVec2) -> Option<ItemId> {
        let [low, high] = self.extent.map(DVec2::splat);
        let is_within = p.cmpge(low).all() && p.cmple(high).all();
        let below = |node: u32| {
            let node = &self.nodes[node as usize];
            node.children[node.side(p)]
        };
        is_within.then(|| descend(self.root, below)).flatten()
    }
}

/// Margin by which a cell is grown on every side before its box is taken.
///
/// In map units. Far above the rounding of the clipping below (under 2^-20 for coordinates of
/// 2^16), far below any detail of a map.
const CELL_MARGIN: f64 = 1.0 / 1024.0;

/// The part of a convex polygon on one side of a node's line.
///
/// The line is moved outward by [`CELL_MARGIN`], so rounding and ties can only enlarge the cell.
fn clip(polygon: &[DVec2], node: &BspNode, side: usize) -> Vec<DVec2> {
    let length = node.direction.length();
    if length == 0.0 {
        return polygon.to_vec();
    }
    let sign = if side == 0 { 1.0 } else { -1.0 };
    let front = -node.direction.perp() / length * sign;
    clipped(polygon, |p| front.dot(p - node.start) + CELL_MARGIN)
}

/// The part of a convex polygon where a depth is not negative.
///
/// The depth is linear in the point (Sutherland and Hodgman 1974).
pub fn clipped<P: Point>(polygon: &[P], depth: impl Fn(P) -> f64) -> Vec<P> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    let mut last = polygon.last().map(|&last| (last, depth(last)));
    for &p in polygon {
        let b = depth(p);
        if let Some((previous, a)) = last.replace((p, b))
            && (a < 0.0) != (b < 0.0)
        {
            kept.push(previous + (p - previous) * (a / (a - b)));
        }
        if b >= 0.0 {
            kept.push(p);
        }
    }
    kept
}

/// A point in the plane or in space.
pub trait Point: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<f64, Output = Self> {}

impl Point for DVec2 {}
impl Point for DVec3 {}

/// The polygon's box at height zero, grown by [`CELL_MARGIN`].
///
/// An empty polygon, whose cell contains no point of the square, gets a point box outside the
/// square, which region search never enters.
fn planar_bounds(polygon: &[DVec2]) -> Aabb {
    if polygon.is_empty() {
        let beyond = Vec3::splat(f32::from(i16::MAX) * 2.0);
        return Aabb::new(beyond, beyond);
    }
    let corners = polygon.iter().map(|p| WorldBox::at(p.extend(0.0)));
    let WorldBox { min, max } = WorldBox::union_of(corners);
    let margin = DVec3::new(CELL_MARGIN, CELL_MARGIN, 0.0);
    Aabb::rounded_outward(min - margin, max + margin, DVec3::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn line(x: f64, y: f64, dx: f64, dy: f64) -> BspNode {
        BspNode {
            start: DVec2::new(x, y),
            direction: DVec2::new(dx, dy),
            children: [BspChild::Leaf(0), BspChild::Leaf(1)],
        }
    }

    #[test]
    fn structures_divide_by_no_long_chain_of_planes() {
        let deep = |below: u32| BspChild::Node(below);
        let nodes = (1..=1000).map(|next| {
            let child = if next < 1000 {
                deep(next)
            } else {
                BspChild::Solid
            };
            (Plane::new(Vec3::X, 0.0), [BspChild::Leaf(next), child])
        });
        let tree = plane_tree(deep(0), nodes);
        let mut at = tree.root;
        let depth = std::iter::from_fn(|| {
            at = tree.nodes[at? as usize].children[1];
            Some(())
        });
        assert_eq!(depth.count(), DEPTH);
    }

    #[test]
    fn sides_follow_the_engine_on_and_off_the_line() {
        let at = DVec2::new;
        // Upward vertical line: front on the right, ties to the back.
        let up = line(0.0, 0.0, 0.0, 4.0);
        assert_eq!(
            [
                up.side(at(1.0, 0.0)),
                up.side(at(-1.0, 0.0)),
                up.side(at(0.0, 9.0))
            ],
            [0, 1, 1]
        );
        // Downward: front and back swap, and so do ties.
        let down = line(0.0, 0.0, 0.0, -4.0);
        assert_eq!(
            [
                down.side(at(1.0, 0.0)),
                down.side(at(-1.0, 0.0)),
                down.side(at(0.0, 9.0))
            ],
            [1, 0, 0]
        );
        let east = line(0.0, 0.0, 4.0, 0.0);
        assert_eq!(
            [
                east.side(at(0.0, -1.0)),
                east.side(at(0.0, 1.0)),
                east.side(at(3.0, 0.0))
            ],
            [0, 1, 0]
        );
        let west = line(0.0, 0.0, -4.0, 0.0);
        assert_eq!(
            [
                west.side(at(0.0, -1.0)),
                west.side(at(0.0, 1.0)),
                west.side(at(3.0, 0.0))
            ],
            [1, 0, 1]
        );
        // -5.7e-14 in rational arithmetic; the rounded products lose it.
        let near = line(-149.0, -505.0, 30.0, -19.0);
        assert_eq!(near.side(at(-317.7181021391705, -398.14520197852534)), 0);
        let slope = line(0.0, 0.0, 2.0, 2.0);
        assert_eq!(
            [
                slope.side(at(2.0, 0.0)),
                slope.side(at(0.0, 2.0)),
                slope.side(at(5.0, 5.0))
            ],
            [0, 1, 1]
        );
    }

    #[test]
    fn cells_tile_the_square() {
        let nodes = vec![
            BspNode {
                children: [BspChild::Leaf(0), BspChild::Node(1)],
                ..line(0.0, 0.0, 0.0, 8.0)
            },
            BspNode {
                children: [BspChild::Leaf(1), BspChild::Leaf(2)],
                ..line(-4.0, 0.0, 3.0, 1.0)
            },
        ];
        let bsp = BspTree::new(nodes, BspChild::Node(0), 3, [-16.0, 16.0]).unwrap();
        for x in -16..=16 {
            for y in -16..=16 {
                let p = DVec2::new(x.into(), y.into());
                let bounds = bsp.boxes[bsp.descend(p).unwrap() as usize];
                assert!(
                    bounds.contains_point(p.as_vec2().extend(0.0)),
                    "{p} {bounds:?}"
                );
            }
        }
        assert_eq!(bsp.descend(DVec2::new(17.0, 0.0)), None);
    }

    #[test]
    fn loops_and_missing_nodes_are_no_tree() {
        let looped = BspNode {
            children: [BspChild::Node(0), BspChild::Leaf(0)],
            ..line(0.0, 0.0, 1.0, 1.0)
        };
        let error = BspTree::new(vec![looped], BspChild::Node(0), 1, [-1.0, 1.0]).unwrap_err();
        assert!(error.contains("twice"), "{error}");
        let missing = BspNode {
            children: [BspChild::Leaf(0), BspChild::Leaf(7)],
            ..line(0.0, 0.0, 1.0, 1.0)
        };
        let error = BspTree::new(vec![missing], BspChild::Node(0), 1, [-1.0, 1.0]).unwrap_err();
        assert!(error.contains("does not exist"), "{error}");
    }
}
