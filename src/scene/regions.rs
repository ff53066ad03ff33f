//! What region search looks for. The indexes hold bounding boxes; where a
//! region is not just its box (a cell of a BSP tree), this file owns the exact
//! membership test that follows.

use std::sync::OnceLock;

use glam::{DVec2, DVec3, Vec3};

use super::{Dispute, Linedef, Originals, disputes};

use crate::geometry::{Aabb, Plane, PlaneTree, PlaneTreeNode};
use crate::query::ItemId;

/// The regions of a scene, numbered from zero.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Regions {
    /// The items themselves, closed boxes that may overlap: a point belongs
    /// to every one that holds it.
    Items,
    /// Boxes that tile a volume, joined by portals. Closed as well: a point
    /// on a shared wall belongs to both sides.
    Tiling(Tiling),
    /// The leaves of a map's own 2-D BSP tree: every point of the map belongs
    /// to exactly one, whatever its height.
    Bsp(BspRegions),
}

/// Boxes that tile a volume.
#[derive(Clone, Default, Debug)]
pub struct Tiling {
    /// In scene coordinates; the id is the index.
    pub boxes: Vec<Aabb>,
    /// The boxes as they were made, where f32 holds any of them otherwise.
    pub originals: Originals,
    /// Openings between neighbours.
    pub portals: Vec<Portal>,
}

/// An opening between two regions of a tiling.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Portal {
    /// Ids of the two regions.
    pub between: [ItemId; 2],
    /// Box through which one sees from one into the other, in scene coordinates.
    pub opening: Aabb,
}

impl Regions {
    /// The boxes to build an index over. Every point of region i lies in
    /// box i.
    pub fn boxes<'a>(&'a self, items: &'a [Aabb]) -> &'a [Aabb] {
        match self {
            Regions::Items => items,
            Regions::Tiling(tiling) => &tiling.boxes,
            Regions::Bsp(bsp) => &bsp.boxes,
        }
    }

    /// The boxes that hold a local point, by a look at each of them: what an
    /// index must find. Ascending ids.
    pub fn holding(&self, p: Vec3, items: &[Aabb]) -> Vec<ItemId> {
        let boxes = self.boxes(items).iter().zip(0..);
        let holding = boxes.filter(|(b, _)| b.contains_point(p));
        holding.map(|(_, id)| id).collect()
    }

    /// In words, for `scene info`.
    pub fn kind(&self) -> &'static str {
        match self {
            Regions::Items => "the items' boxes",
            Regions::Tiling(_) => "a tiling of boxes",
            Regions::Bsp(_) => "the leaves of the map's BSP tree",
        }
    }
}

/// A partition line of a Doom node: through `(x, y)` along `(dx, dy)`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct BspNode {
    /// A point of the line, map units.
    pub x: f64,
    /// A point of the line, map units.
    pub y: f64,
    /// Direction of the line, not of unit length.
    pub dx: f64,
    /// Direction of the line, not of unit length.
    pub dy: f64,
    /// Front (right of the direction) first, then back.
    pub children: [BspChild; 2],
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum BspChild {
    Node(u32),
    Leaf(u32),
}

impl BspNode {
    /// 0 for the front (right) side, 1 for the back, ties decided as the
    /// Doom engine's `R_PointOnSide` does (linuxdoom 1.10, r_main.c): an
    /// axis-parallel line and a line through other points treat a point
    /// exactly on them differently. The comparison itself is exact for map
    /// coordinates (integers) and correctly signed up to f64 rounding for
    /// others; the engine's 16.16 truncation is not imitated.
    pub fn side(&self, p: DVec2) -> usize {
        if self.dx == 0.0 {
            let along = if p.x <= self.x { self.dy } else { -self.dy };
            return usize::from(along > 0.0);
        }
        if self.dy == 0.0 {
            let along = if p.y <= self.y { -self.dx } else { self.dx };
            return usize::from(along > 0.0);
        }
        let (dx, dy) = (p.x - self.x, p.y - self.y);
        // The engine's short cut by sign bits; it differs from the products
        // below only for a point exactly at the line's start.
        let parts = [self.dy, self.dx, dx, dy].into_iter();
        if parts.filter(|v| *v < 0.0).count() % 2 == 1 {
            return usize::from((self.dy < 0.0) != (dx < 0.0));
        }
        let (left, right) = (self.dy * dx, dy * self.dx);
        usize::from(right >= left)
    }
}

/// A map's BSP tree with its leaves as regions.
#[derive(Clone, Debug)]
pub struct BspRegions {
    nodes: Vec<BspNode>,
    root: BspChild,
    /// About each leaf.
    pub(super) boxes: Vec<Aabb>,
    /// For each node and leaf the node above it and the side taken there.
    node_parent: Vec<Option<(u32, usize)>>,
    leaf_parent: Vec<Option<(u32, usize)>>,
    extent: Aabb,
    /// The map's linedefs, and what they disagree about once that was asked.
    pub(super) lines: Vec<Linedef>,
    disputes: OnceLock<Vec<Dispute>>,
}

impl BspRegions {
    /// Links the tree and bounds its leaves within the square
    /// `[low, high]^2`, outside of which no point has a region.
    ///
    /// `Err` names a node that is reached twice or not there, or a leaf that
    /// is: the nodes then form no tree. O(nodes * depth).
    pub fn new(
        nodes: Vec<BspNode>,
        root: BspChild,
        leaf_count: usize,
        low: f64,
        high: f64,
    ) -> Result<BspRegions, String> {
        let mut node_parent = vec![None; nodes.len()];
        let mut leaf_parent = vec![None; leaf_count];
        // A leaf that no node has is nowhere.
        let mut boxes = vec![planar_bounds(&[]); leaf_count];
        let (mut node_seen, mut leaf_seen) = (vec![false; nodes.len()], vec![false; leaf_count]);
        let square = [(low, low), (high, low), (high, high), (low, high)];
        let square: Vec<DVec2> = square.iter().map(|&(x, y)| DVec2::new(x, y)).collect();
        let mut open = vec![(root, None, square)];
        while let Some((child, parent, polygon)) = open.pop() {
            let (seen, parents, index) = match child {
                BspChild::Node(n) => (&mut node_seen, &mut node_parent, n),
                BspChild::Leaf(l) => (&mut leaf_seen, &mut leaf_parent, l),
            };
            match seen.get_mut(index as usize) {
                None => return Err(format!("{child:?} does not exist")),
                Some(true) => return Err(format!("{child:?} is reached twice")),
                Some(fresh) => *fresh = true,
            }
            parents[index as usize] = parent;
            match child {
                BspChild::Leaf(leaf) => boxes[leaf as usize] = planar_bounds(&polygon),
                BspChild::Node(n) => {
                    let node = nodes[n as usize];
                    for side in [1, 0] {
                        let part = clip(&polygon, &node, side);
                        open.push((node.children[side], Some((n, side)), part));
                    }
                }
            }
        }
        let corner = |v: f64| Vec3::new(v as f32, v as f32, 0.0);
        Ok(BspRegions {
            nodes,
            root,
            boxes,
            node_parent,
            leaf_parent,
            extent: Aabb::new(corner(low), corner(high)),
            lines: Vec::new(),
            disputes: OnceLock::new(),
        })
    }

    /// The tree's lines as upright planes, for structures that can use them.
    /// Ties do not matter to those: they keep their own bounds.
    pub fn plane_tree(&self) -> PlaneTree {
        let below = |child: BspChild| match child {
            BspChild::Node(node) => Some(node),
            BspChild::Leaf(_) => None,
        };
        let node = |node: &BspNode| {
            // Right of the direction is the front.
            let normal = Vec3::new(node.dy as f32, -node.dx as f32, 0.0);
            PlaneTreeNode {
                plane: Plane::through(Vec3::new(node.x as f32, node.y as f32, 0.0), normal),
                children: node.children.map(below),
            }
        };
        PlaneTree {
            nodes: self.nodes.iter().map(node).collect(),
            root: below(self.root),
        }
    }

    /// A place about which the map's linedefs disagree, if there is any: its sectors are
    /// then no regions.
    pub fn dispute(&self) -> Option<Dispute> {
        let lines = self.lines.iter().map(|line| (line.ends, line.sectors));
        let all = self.disputes.get_or_init(|| disputes(lines));
        all.first().copied()
    }

    /// Number of leaves.
    pub fn len(&self) -> usize {
        self.boxes.len()
    }

    /// Whether there are no leaves.
    pub fn is_empty(&self) -> bool {
        self.boxes.is_empty()
    }

    /// The leaf that holds the point, by the map's own descent from the root;
    /// `None` outside the map's coordinate space. O(depth).
    pub fn descend(&self, p: DVec2) -> Option<ItemId> {
        if !self.covers(p) {
            return None;
        }
        let mut at = self.root;
        loop {
            match at {
                BspChild::Leaf(leaf) => return Some(leaf),
                BspChild::Node(n) => {
                    let node = &self.nodes[n as usize];
                    at = node.children[node.side(p)];
                }
            }
        }
    }

    /// Whether the point lies in the map's coordinate space.
    pub fn covers(&self, p: DVec2) -> bool {
        let (low, high) = (self.extent.min.as_dvec3(), self.extent.max.as_dvec3());
        p.cmpge(low.truncate()).all() && p.cmple(high.truncate()).all()
    }

    /// Whether the leaf holds the point: the same side tests, walked from the
    /// leaf up to the root. O(depth).
    pub fn holds(&self, leaf: ItemId, p: DVec2) -> bool {
        let mut above = self.leaf_parent[leaf as usize];
        while let Some((node, side)) = above {
            if self.nodes[node as usize].side(p) != side {
                return false;
            }
            above = self.node_parent[node as usize];
        }
        true
    }
}

/// How far a cell is grown on every side before its box is taken, in map
/// units: far above the rounding of the clipping below (under 2^-20 for
/// coordinates of 2^16), far below anything a map shows.
const CELL_MARGIN: f64 = 1.0 / 1024.0;

/// The part of a convex polygon on one side of a node's line (Sutherland and
/// Hodgman 1974), the line moved outward by [`CELL_MARGIN`] so that rounding
/// and ties can only make the cell larger.
fn clip(polygon: &[DVec2], node: &BspNode, side: usize) -> Vec<DVec2> {
    let direction = DVec2::new(node.dx, node.dy);
    let length = direction.length();
    if length == 0.0 {
        return polygon.to_vec();
    }
    let sign = if side == 0 { 1.0 } else { -1.0 };
    let front = DVec2::new(node.dy, -node.dx) / length * sign;
    let start = DVec2::new(node.x, node.y);
    let depth = |p: DVec2| front.dot(p - start) + CELL_MARGIN;
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &p) in polygon.iter().enumerate() {
        let previous = polygon[(i + polygon.len() - 1) % polygon.len()];
        let (a, b) = (depth(previous), depth(p));
        if (a < 0.0) != (b < 0.0) {
            kept.push(previous + (p - previous) * (a / (a - b)));
        }
        if b >= 0.0 {
            kept.push(p);
        }
    }
    kept
}

/// The polygon's box at height zero, grown by [`CELL_MARGIN`]. A cell that no
/// point of the square belongs to keeps an empty polygon; it gets a point box
/// outside the square, which region search never enters.
fn planar_bounds(polygon: &[DVec2]) -> Aabb {
    if polygon.is_empty() {
        let beyond = Vec3::splat(f32::from(i16::MAX) * 2.0);
        return Aabb::new(beyond, beyond);
    }
    let low = polygon.iter().fold(DVec2::INFINITY, |low, p| low.min(*p));
    let high = polygon.iter();
    let high = high.fold(DVec2::NEG_INFINITY, |high, p| high.max(*p));
    Aabb::rounded_outward(
        (low - CELL_MARGIN).extend(0.0),
        (high + CELL_MARGIN).extend(0.0),
        DVec3::ZERO,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(x: f64, y: f64, dx: f64, dy: f64) -> BspNode {
        let children = [BspChild::Leaf(0), BspChild::Leaf(1)];
        BspNode {
            x,
            y,
            dx,
            dy,
            children,
        }
    }

    #[test]
    fn sides_follow_the_engine_on_and_off_the_line() {
        let at = DVec2::new;
        // Upward vertical line: the right is the front, a tie the back.
        let up = line(0.0, 0.0, 0.0, 4.0);
        assert_eq!(
            [
                up.side(at(1.0, 0.0)),
                up.side(at(-1.0, 0.0)),
                up.side(at(0.0, 9.0))
            ],
            [0, 1, 1]
        );
        // Downward: front and back swap, and so does the tie.
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
    fn cells_tile_the_square_and_ties_have_one_owner() {
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
        let bsp = BspRegions::new(nodes, BspChild::Node(0), 3, -16.0, 16.0).unwrap();
        for x in -16..=16 {
            for y in -16..=16 {
                let p = DVec2::new(x.into(), y.into());
                let owners: Vec<u32> = (0..3).filter(|&leaf| bsp.holds(leaf, p)).collect();
                assert_eq!(owners, [bsp.descend(p).unwrap()], "{p}");
                let bounds = bsp.boxes[owners[0] as usize];
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
        let error = BspRegions::new(vec![looped], BspChild::Node(0), 1, -1.0, 1.0).unwrap_err();
        assert!(error.contains("twice"), "{error}");
        let missing = BspNode {
            children: [BspChild::Leaf(0), BspChild::Leaf(7)],
            ..line(0.0, 0.0, 1.0, 1.0)
        };
        let error = BspRegions::new(vec![missing], BspChild::Node(0), 1, -1.0, 1.0).unwrap_err();
        assert!(error.contains("does not exist"), "{error}");
    }
}
