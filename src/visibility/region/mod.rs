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

mod back_ends;
mod box_grid;
mod boxes;
pub mod doom;
mod graph;
mod quake;
mod search;

pub use crate::index::IdSet;
pub use back_ends::{BACK_ENDS, BackEnd, Pvs, Scratch};
pub use box_grid::{RegionItems, without};
pub use graph::{Opening, OpeningPlane, RegionGraph, RegionId, RegionLocator, rectangle};

#[cfg(test)]
pub use tests::leads_through;

#[cfg(test)]
mod tests;
