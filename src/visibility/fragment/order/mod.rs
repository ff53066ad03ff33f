//! Depth orders: in which order items are drawn. One file an order; each gives a
//! list from front to back as well as it can.

mod box_distance;
mod bsp;
mod centre_distance;
mod contract;
mod none;
mod tree;

pub use box_distance::front_to_back;
pub use bsp::BspOrder;
pub use contract::{DepthOrder, Piece};

use crate::visibility::{Guarantee, Solids};

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
    /// Prepares it for the items of a scene.
    pub build: fn(&Solids) -> Box<dyn DepthOrder>,
}

/// All orders.
pub const ORDERS: &[OrderRow] = &[
    OrderRow {
        name: "none",
        summary: "items in the order of their ids",
        guarantee: Guarantee::Unproven,
        build: |_| Box::new(none::order),
    },
    OrderRow {
        name: "tree",
        summary: "items as they lie in the tree 'wide', the same for all views",
        guarantee: Guarantee::Unproven,
        build: |solids| Box::new(tree::TreeOrder::of(solids)),
    },
    OrderRow {
        name: "centre-distance",
        summary: "sorted by the distance of the centre of each box",
        guarantee: Guarantee::Unproven,
        build: |_| Box::new(centre_distance::order),
    },
    OrderRow {
        name: "box-distance",
        summary: "sorted by the distance of the nearest point of each box",
        guarantee: Guarantee::Unproven,
        build: |_| Box::new(box_distance::order),
    },
    OrderRow {
        name: "bsp",
        summary: "planes through faces of boxes, which are cut where they cross: exact",
        guarantee: Guarantee::Exact,
        build: |solids| Box::new(BspOrder::of(solids)),
    },
];
