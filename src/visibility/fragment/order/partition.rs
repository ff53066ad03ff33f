//! Draw order by a partition that the scene has, such as the BSP of a Doom map.
//!
//! Leaves are drawn from front to back, and in each leaf the parts of its items.
//!
//! A ray from the eye meets all of a leaf before all of a leaf behind it, so the order
//! between leaves is exact, except for rounding within [`SLACK`] of a plane. In a leaf,
//! items that are behind all the others come last, in any order: the walls around a room
//! hide neither its content nor each other. The rest is sorted by distance. (Fuchs, Kedem
//! and Naylor 1980; linuxdoom 1.10, r_bsp.c, draws the walls of a leaf the same way, and
//! then its things by distance.)

use glam::DVec3;

use super::{DepthOrder, Part, Piece, ToOrder, nearest};
use crate::camera::Camera;
use crate::geometry::PlaneTree;
use crate::query::ItemId;
use crate::scene::{Surfaces, WorldBox, clipped};

/// Distance within which points lie in a plane, per unit of the largest coordinate.
///
/// A multiple of the error of a plane that is rounded to f32.
const SLACK: f64 = 1.0 / (1u64 << 21) as f64;
/// Most triangles of a leaf that are compared, each with each.
const MOST_COMPARED: usize = 1000;

/// A plane: unit normal towards the front, offset, and what is in front and behind.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub normal: DVec3,
    pub d: f64,
    pub children: [Option<u32>; 2],
}

impl Node {
    pub fn height(&self, at: DVec3) -> f64 {
        self.normal.dot(at) + self.d
    }

    /// The side that a surface in the plane is seen from.
    fn faced(&self, normal: DVec3) -> usize {
        usize::from(self.normal.dot(normal) < 0.0)
    }
}

/// Part of an item in a leaf.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    pub item: ItemId,
    pub bounds: WorldBox,
    pub part: Option<Part>,
    /// `true` if all the rest of the leaf is before it, and it is seen from there only.
    pub is_behind_all: bool,
}

/// A partition with the items in its leaves, which are drawn from front to back.
#[derive(Default)]
pub struct Partition {
    pub(super) nodes: Vec<Node>,
    pub(super) root: Option<u32>,
    /// World position of the zero of the planes.
    origin: DVec3,
    /// Index: twice the node above, plus its side. An undivided space is leaf 0.
    pub(super) leaves: Vec<Vec<Held>>,
    /// Distance within which points lie in a plane.
    slack: f64,
    /// If the order is declared exact: `true` if cutting ended early.
    pub(super) is_cut_short: Option<bool>,
}

impl DepthOrder for Partition {
    fn order(&self, camera: &Camera, pieces: &mut Vec<Piece>) {
        pieces.clear();
        let eye = camera.frame.eye - self.origin;
        let parallel = camera.lens.is_orthographic();
        let mut sorted = Vec::new();
        let mut open = vec![(self.root, 0)];
        while let Some((node, leaf)) = open.pop() {
            if let Some(at) = node {
                let node = &self.nodes[at as usize];
                let is_before = match parallel {
                    true => node.normal.dot(camera.frame.forward()) <= 0.0,
                    false => node.height(eye) >= 0.0,
                };
                let near = usize::from(!is_before);
                for side in [1 - near, near] {
                    open.push((node.children[side], 2 * at as usize + side));
                }
                continue;
            }
            sorted.clear();
            let held = self.leaves[leaf].iter();
            sorted.extend(held.map(|held| (nearest(camera, &held.bounds), held)));
            sorted.sort_by(|(near_a, a): &(f64, &Held), (near_b, b)| {
                let by_depth = near_a.total_cmp(near_b).then(a.item.cmp(&b.item));
                a.is_behind_all.cmp(&b.is_behind_all).then(by_depth)
            });
            pieces.extend(sorted.iter().map(|(_, held)| Piece {
                item: held.item,
                part: held.part,
            }));
        }
    }

    fn leaf(&self, at: DVec3, normal: DVec3) -> Option<u32> {
        let (mut node, mut leaf) = (self.root, 0);
        let normal = normal.normalize_or_zero();
        while let Some(place) = node {
            let plane = &self.nodes[place as usize];
            let height = plane.height(at);
            let along = plane.normal.dot(normal).abs();
            let side = match height.abs() <= self.slack && along > 1.0 - 1e-6 {
                true => plane.faced(normal),
                false => usize::from(height < 0.0),
            };
            (node, leaf) = (plane.children[side], 2 * place + side as u32);
        }
        Some(leaf)
    }

    fn exception(&self, camera: &Camera) -> Option<&'static str> {
        if self.is_cut_short? {
            return Some("the limit on cuts was reached before all items were separated");
        }
        let Camera { frame, lens } = camera;
        let is_within = |node: &Node| match lens.is_orthographic() {
            true => node.normal.dot(frame.forward()) == 0.0,
            false => node.height(frame.eye) == 0.0,
        };
        let within = self.nodes.iter().any(is_within);
        within.then_some("rays may run within the plane of a face")
    }
}

/// Part of a triangle in a leaf.
struct Fallen {
    item: ItemId,
    polygon: Vec<DVec3>,
    /// Unit normal.
    normal: DVec3,
    two_sided: bool,
}

/// Sorts the items of surfaces in a scene with a partition of its own.
pub fn order(of: &ToOrder) -> Option<Box<dyn DepthOrder>> {
    Some(Box::new(Partition::of(of.surfaces?, of.planes?)))
}

impl Partition {
    /// The scene's own partition: cuts every triangle by the planes that it meets.
    ///
    /// O(triangles * depth) where few are cut.
    pub fn of(surfaces: &Surfaces, planes: &PlaneTree) -> Partition {
        let nodes = planes.nodes.iter().map(|node| {
            let normal = node.plane.normal.as_dvec3();
            let unit = 1.0 / normal.length();
            Node {
                normal: normal * unit,
                d: f64::from(node.plane.d) * unit,
                children: node.children,
            }
        });
        let corners = surfaces.points.iter().map(|p| p.abs().max_element());
        let reach = f64::from(corners.fold(0.0, f32::max));
        let mut order = Partition {
            nodes: nodes.collect(),
            root: planes.root,
            origin: surfaces.origin,
            slack: reach * SLACK,
            ..Partition::default()
        };
        let mut fallen: Vec<Vec<Fallen>> = Vec::new();
        fallen.resize_with(2 * planes.nodes.len().max(1), Vec::new);
        for item in 0..surfaces.items() {
            for triangle in surfaces.range(item) {
                let [a, b, c] = surfaces.corners(triangle as u32).map(|p| p.as_dvec3());
                let normal = (b - a).cross(c - a).normalize_or_zero();
                order.drop_in([a, b, c], normal, |leaf, polygon| {
                    fallen[leaf].push(Fallen {
                        item: item as ItemId,
                        polygon,
                        normal,
                        two_sided: surfaces.two_sided[triangle],
                    });
                });
            }
        }
        let leaves = fallen.iter().zip(0..);
        let held = leaves.map(|(all, leaf)| order.held(all, leaf));
        order.leaves = held.collect();
        order
    }

    fn drop_in(
        &self,
        corners: [DVec3; 3],
        normal: DVec3,
        mut fallen: impl FnMut(usize, Vec<DVec3>),
    ) {
        // Parts of the triangle, each with the node that it is at and the leaf if that is none.
        let mut open = vec![(corners.to_vec(), self.root, 0)];
        while let Some((polygon, node, leaf)) = open.pop() {
            let Some(at) = node else {
                fallen(leaf, polygon);
                continue;
            };
            let node = &self.nodes[at as usize];
            let heights: Vec<f64> = polygon.iter().map(|&p| node.height(p)).collect();
            let sides = match [1.0, -1.0].map(|sign| heights.iter().any(|h| sign * h > self.slack))
            {
                [false, false] => [0, 1].map(|side| node.faced(normal) == side),
                sides => sides,
            };
            for side in (0..2).filter(|&side| sides[side]) {
                let polygon = match sides[1 - side] {
                    true => clipped(&polygon, |p| [1.0, -1.0][side] * node.height(p)),
                    false => polygon.clone(),
                };
                open.push((polygon, node.children[side], 2 * at as usize + side));
            }
        }
    }

    /// The parts of a leaf, from all triangles in it, item by item.
    fn held(&self, all: &[Fallen], leaf: u32) -> Vec<Held> {
        let is_before = |own: &Fallen| {
            let mut corners = all.iter().flat_map(|other| &other.polygon);
            let height = |p: &DVec3| own.normal.dot(*p - own.polygon[0]);
            !own.two_sided && corners.all(|p| height(p) >= -self.slack)
        };
        let parts = all.chunk_by(|a, b| a.item == b.item).map(|parts| {
            let corners = parts.iter().flat_map(|part| &part.polygon);
            let corners = corners.map(|&p| WorldBox::at(p + self.origin));
            Held {
                item: parts[0].item,
                bounds: WorldBox::union_of(corners),
                part: Some(Part::InLeaf(leaf)),
                is_behind_all: all.len() <= MOST_COMPARED && parts.iter().all(is_before),
            }
        });
        parts.collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::camera::{Frame, Lens};
    use crate::geometry::Aabb;
    use crate::scene::SurfaceKind;

    /// A wall hides nothing of a thing before it, however near the wall is to the eye.
    #[test]
    fn what_stands_before_a_wall_comes_first_however_near_the_wall_is() {
        let wall = [(-100.0, -9.0), (100.0, -9.0), (100.0, 9.0), (-100.0, 9.0)];
        let wall = wall.map(|(y, z)| Vec3::new(0.0, y, z));
        let thing = Aabb::new(Vec3::new(1.0, 50.0, -1.0), Vec3::new(2.0, 52.0, 1.0));
        let order = |two_sided| {
            let mut surfaces = Surfaces::about(DVec3::ZERO);
            let triangles = [[0, 1, 2], [0, 2, 3]];
            surfaces.push(SurfaceKind::Opaque, two_sided, &wall, &triangles);
            surfaces.push_box(SurfaceKind::Opaque, false, &thing);
            let order = Partition::of(&surfaces, &PlaneTree::default());
            let frame = Frame::looking_along(DVec3::new(5.0, -60.0, 0.0), DVec3::Y, DVec3::Z);
            let camera = Camera {
                frame: frame.unwrap(),
                lens: Lens::perspective(90.0, 1.0, 0.1, None).unwrap(),
            };
            let mut pieces = Vec::new();
            order.order(&camera, &mut pieces);
            pieces.iter().map(|piece| piece.item).collect::<Vec<_>>()
        };
        assert_eq!(order(false), [1, 0]);
        // Something may stand behind one of two sides.
        assert_eq!(order(true), [0, 1]);
    }
}
