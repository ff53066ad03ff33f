//! Region stage: the rooms or sectors of a scene that may be visible.
//!
//! Their items remain.
//!
//! A back end ([`BackEnd`]) searches a [`RegionGraph`]: regions and the openings between them,
//! built from a tiling of rooms or a Doom map.
//!
//! Visibility is defined by regions and openings alone: a line of sight leaves a region through an
//! opening, and the rest of a region's border is opaque. Doors are open. Lines that only touch an
//! edge of an opening see nothing, but all back ends also list the regions that such lines reach.

mod boxes;
pub mod doom;
mod graph;
mod locate;
mod quake;
mod row;
mod search;

pub use crate::index::IdSet;
pub use graph::{Opening, OpeningPlane, RegionGraph, RegionId, RegionLocator, rectangle};
pub use locate::{RegionItems, without};
pub use row::{BACK_ENDS, BackEnd, Pvs, Scratch};

#[cfg(test)]
pub use tests::leads_through;

#[cfg(test)]
mod tests;
