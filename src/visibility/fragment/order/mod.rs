//! Depth orders: lists of items from front to back, as well as each can.

mod bsp;
mod contract;
mod partition;
mod whole;

pub use bsp::BspOrder;
pub use contract::{DepthOrder, Part, Piece, ToOrder};
pub use whole::front_to_back;

use crate::visibility::Guarantee;

/// A row of the table of orders.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct OrderRow {
    /// Name as typed.
    pub name: &'static str,
    /// One line for tables and help.
    pub summary: &'static str,
    /// [`Guarantee::Exact`]: no pair that overlaps in the image is the wrong way
    /// round, but where it says so ([`DepthOrder::exception`]).
    pub guarantee: Guarantee,
    /// Prepares it for the items of a scene, if it can order them.
    pub build: fn(&ToOrder) -> Option<Box<dyn DepthOrder>>,
}

/// All orders.
pub const ORDERS: &[OrderRow] = rows! { OrderRow { name, summary, guarantee, build }
    "none", "items in the order of their ids", Guarantee::Unproven, whole::by_id;
    "tree", "items in the order of the tree 'wide', the same for all views",
        Guarantee::Unproven, whole::by_tree;
    "centre-distance", "sorted by the distance of the centre of each box",
        Guarantee::Unproven, whole::by_centre;
    "box-distance", "sorted by the distance of the nearest point of each box",
        Guarantee::Unproven, whole::by_box;
    "bsp", "planes through faces of boxes, which are cut where they cross: exact",
        Guarantee::Exact, bsp::order;
    // In a leaf of walls that surround it nothing hides a wall but what is no wall.
    "map-bsp", "the map's own BSP leaf by leaf, items of one leaf by distance",
        Guarantee::Unproven, partition::order;
};
