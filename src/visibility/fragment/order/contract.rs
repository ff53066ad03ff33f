//! The contract of a depth order: a list of pieces from front to back.

use glam::DVec3;

use crate::camera::Camera;
use crate::geometry::PlaneTree;
use crate::query::ItemId;
use crate::scene::{Surfaces, WorldBox};
use crate::visibility::Solids;

/// Input of an order.
#[derive(Clone, Copy, Debug)]
pub struct ToOrder<'a> {
    /// The items as solid boxes, or the boxes about them.
    pub boxes: &'a Solids,
    /// Their triangles, if they are no solid boxes.
    pub surfaces: Option<&'a Surfaces>,
    /// Planes of the scene's own partition.
    pub planes: Option<&'a PlaneTree>,
}

/// A part of an item.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Part {
    /// The part that is entered through this box.
    Within(WorldBox),
    /// The part in a leaf ([`DepthOrder::leaf`]).
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
    /// Replaces `pieces` by all items, from front to back as well as it can.
    /// Deterministic.
    fn order(&self, solids: &Solids, camera: &Camera, pieces: &mut Vec<Piece>);

    /// Leaf of a point of a triangle; `None` if parts are no leaves.
    ///
    /// The point is relative to the zero of the surfaces.
    fn leaf(&self, _at: DVec3, _normal: DVec3) -> Option<u32> {
        None
    }

    /// Reason why an order that is declared exact may be wrong for a camera.
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
