//! What a depth order is: a list of pieces from front to back.

use std::cmp::Ordering;

use glam::DVec3;

use crate::camera::Camera;
use crate::geometry::PlaneTree;
use crate::query::ItemId;
use crate::scene::{Surfaces, WorldBox};
use crate::visibility::Solids;

/// What an order is of.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct ToOrder<'a> {
    /// The items as solid boxes, or the boxes about them.
    pub boxes: &'a Solids,
    /// Their triangles, if they are no solid boxes.
    pub surfaces: Option<&'a Surfaces>,
    /// Planes that the scene brings with it.
    pub planes: Option<&'a PlaneTree>,
}

impl<'a> ToOrder<'a> {
    /// Items that are solid boxes.
    pub fn boxes(boxes: &'a Solids) -> ToOrder<'a> {
        ToOrder {
            boxes,
            surfaces: None,
            planes: None,
        }
    }

    /// Items of triangles with the boxes about them, and the planes of their scene.
    pub fn surfaces(
        boxes: &'a Solids,
        surfaces: &'a Surfaces,
        planes: Option<&'a PlaneTree>,
    ) -> ToOrder<'a> {
        ToOrder {
            boxes,
            surfaces: Some(surfaces),
            planes,
        }
    }
}

/// A part of an item.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Part {
    /// Where it is entered through this box.
    Within(WorldBox),
    /// What of it is in a leaf ([`DepthOrder::leaf`]).
    InLeaf(u32),
}

/// An item to be drawn, or a part of it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Piece {
    /// The item.
    pub item: ItemId,
    /// `None` is all of it.
    pub part: Option<Part>,
}

impl Piece {
    /// All of an item.
    pub fn whole(item: ItemId) -> Piece {
        Piece { item, part: None }
    }
}

/// A way to order items for a camera.
pub trait DepthOrder: Send + Sync {
    /// Puts all items, from front to back as well as it can, into `pieces` in place
    /// of what it held. Deterministic.
    fn order(&self, solids: &Solids, camera: &Camera, pieces: &mut Vec<Piece>);

    /// Where a point of a triangle is, about the zero of the surfaces, if parts are told by
    /// leaves.
    fn leaf(&self, _at: DVec3, _normal: DVec3) -> Option<u32> {
        None
    }

    /// Why an order that is declared exact may be wrong for a camera all the same.
    fn exception(&self, _: &Camera) -> Option<&'static str> {
        None
    }
}

impl<F> DepthOrder for F
where
    F: Fn(&Solids, &Camera, &mut Vec<Piece>) + Send + Sync,
{
    fn order(&self, solids: &Solids, camera: &Camera, pieces: &mut Vec<Piece>) {
        self(solids, camera, pieces);
    }
}

/// All items, least key first; of the same key the lowest id.
pub(super) fn by_key(solids: &Solids, pieces: &mut Vec<Piece>, key: impl Fn(&WorldBox) -> f64) {
    let keyed = solids.boxes.iter().zip(0..).map(|(b, item)| (key(b), item));
    pieces.clear();
    let items = sorted(keyed).into_iter().map(|(_, item)| item);
    pieces.extend(items.map(Piece::whole));
}

/// Items with their keys, least first; of the same key the lowest id.
pub(super) fn sorted(keyed: impl Iterator<Item = (f64, ItemId)>) -> Vec<(f64, ItemId)> {
    let mut keyed: Vec<(f64, ItemId)> = keyed.collect();
    keyed.sort_unstable_by(order_of_keyed);
    keyed
}

fn order_of_keyed(a: &(f64, ItemId), b: &(f64, ItemId)) -> Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}

/// How far a point is: squared distance from the eye, or the depth for an
/// orthographic lens.
pub(super) fn distance(camera: &Camera, point: DVec3) -> f64 {
    let away = point - camera.frame.eye;
    match camera.lens.is_orthographic() {
        true => away.dot(camera.frame.forward()),
        false => away.length_squared(),
    }
}

/// The point of a box that is nearest to the eye, or of least depth for an
/// orthographic lens.
pub(super) fn nearest_point(camera: &Camera, b: &WorldBox) -> DVec3 {
    match camera.lens.is_orthographic() {
        true => {
            let forward = camera.frame.forward();
            let pick = |k: usize| if forward[k] > 0.0 { b.min[k] } else { b.max[k] };
            DVec3::new(pick(0), pick(1), pick(2))
        }
        false => camera.frame.eye.max(b.min).min(b.max),
    }
}
