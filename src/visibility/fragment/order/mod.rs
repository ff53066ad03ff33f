//! Depth orders: in which order items are drawn. One file an order; each gives a
//! list from front to back as well as it can.

mod box_distance;
mod bsp;
mod centre_distance;
mod contract;
mod none;
mod partition;
mod tree;

pub use box_distance::front_to_back;
pub use bsp::BspOrder;
pub use contract::{DepthOrder, Part, Piece, ToOrder};

use crate::visibility::Guarantee;

/// A row of the table of orders.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct OrderRow {
    /// As typed on the command line.
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
pub const ORDERS: &[OrderRow] = &[
    OrderRow {
        name: "none",
        summary: "items in the order of their ids",
        guarantee: Guarantee::Unproven,
        build: |_| Some(Box::new(none::order)),
    },
    OrderRow {
        name: "tree",
        summary: "items as they lie in the tree 'wide', the same for all views",
        guarantee: Guarantee::Unproven,
        build: |of| Some(Box::new(tree::TreeOrder::of(of.boxes))),
    },
    OrderRow {
        name: "centre-distance",
        summary: "sorted by the distance of the centre of each box",
        guarantee: Guarantee::Unproven,
        build: |_| Some(Box::new(centre_distance::order)),
    },
    OrderRow {
        name: "box-distance",
        summary: "sorted by the distance of the nearest point of each box",
        guarantee: Guarantee::Unproven,
        build: |_| Some(Box::new(box_distance::order)),
    },
    OrderRow {
        name: "bsp",
        summary: "planes through faces of boxes, which are cut where they cross: exact",
        guarantee: Guarantee::Exact,
        build: |of| match of.surfaces {
            None => Some(Box::new(BspOrder::of(of.boxes))),
            Some(_) => None,
        },
    },
    OrderRow {
        name: "map-bsp",
        summary: "the map's own BSP leaf by leaf, what is in one leaf by distance",
        // In a leaf of walls that surround it nothing hides a wall but what is no wall.
        guarantee: Guarantee::Unproven,
        build: |of| {
            let order = partition::PartitionOrder::of(of.surfaces?, of.planes?);
            Some(Box::new(order))
        },
    },
];
