//! Depth orders: lists of items from front to back, as well as each can.

mod bsp;

use glam::DVec3;

use crate::camera::Camera;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::{Guarantee, Row, Solids};

pub use bsp::{Partition, parted, parted_within};

/// A row of the table of orders: prepares one for items, if it can order them.
///
/// `true` for solid boxes, which can be cut; else the boxes are about the items.
pub type OrderRow = Row<fn(&Solids, bool) -> Option<Box<dyn DepthOrder>>>;

/// All orders.
///
/// An [exact](Guarantee::Exact) one has no pair that overlaps in the image the wrong way
/// round, but where it says so ([`DepthOrder::exception`]).
pub const ORDERS: &[OrderRow] = rows! { OrderRow { name, summary, guarantee, build }
    "none", "items in the order of their ids", Guarantee::Unproven,
        |items, _| Some(by_id(items));
    "box-distance", "sorted by the distance of the nearest point of each box",
        Guarantee::Unproven, |items, _| Some(by_distance(items));
    "bsp", "planes through faces of boxes, which are cut where they cross: exact",
        Guarantee::Exact,
        |items, are_solid| are_solid.then(|| Box::new(parted(items)) as _);
};

/// An item to be drawn, or a part of it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Piece {
    /// The item.
    pub item: ItemId,
    /// The box that the part is entered through; `None` is all of the item.
    pub part: Option<WorldBox>,
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
    fn order(&self, camera: &Camera, pieces: &mut Vec<Piece>);

    /// Reason why an order that is declared exact may be wrong for a camera.
    fn exception(&self, _: &Camera) -> Option<&'static str> {
        None
    }
}

impl<F> DepthOrder for F
where
    F: Fn(&Camera, &mut Vec<Piece>) + Send + Sync,
{
    fn order(&self, camera: &Camera, pieces: &mut Vec<Piece>) {
        self(camera, pieces);
    }
}

/// Items in the order of their ids.
fn by_id(items: &Solids) -> Box<dyn DepthOrder> {
    let all: Vec<Piece> = (0..items.boxes.len() as ItemId).map(Piece::whole).collect();
    Box::new(move |_: &Camera, pieces: &mut Vec<Piece>| pieces.clone_from(&all))
}

/// Items sorted by [`nearest`], then by id. O(n log n) per view.
fn by_distance(items: &Solids) -> Box<dyn DepthOrder> {
    let boxes = items.boxes.clone();
    let order = move |camera: &Camera, pieces: &mut Vec<Piece>| {
        let boxes = boxes.iter().zip(0..);
        let mut keyed: Vec<_> = boxes.map(|(b, item)| (nearest(camera, b), item)).collect();
        keyed.sort_unstable_by(|a: &(f64, ItemId), b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        pieces.clear();
        pieces.extend(keyed.into_iter().map(|(_, item)| Piece::whole(item)));
    };
    Box::new(order)
}

/// Distance of the nearest point of a box.
///
/// Squared from the eye; the depth for an orthographic lens.
fn nearest(camera: &Camera, b: &WorldBox) -> f64 {
    let (eye, forward) = (camera.frame.eye, camera.frame.forward());
    match camera.lens.is_orthographic() {
        true => {
            let point = DVec3::select(forward.cmpgt(DVec3::ZERO), b.min, b.max);
            (point - eye).dot(forward)
        }
        false => (eye.max(b.min).min(b.max) - eye).length_squared(),
    }
}
