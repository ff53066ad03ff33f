//! The region stage: which rooms, sectors or cells of a scene can be seen at all,
//! and so which items.
//!
//! A [`RegionGraph`] is what is searched: regions and the openings between them, made
//! from a tiling of rooms, a Doom map, or a grid over the free space of any box scene.
//! The back ends are one file each; all answer "from this camera", some also "from
//! anywhere in this region".
//!
//! What is seen is defined by regions and openings alone: a line of sight leaves a
//! region through an opening, and everything else on a region's border is opaque.
//! Doors are open. Lines that only touch an edge of an opening see nothing; all back
//! ends but the exact ones list what they touch too.

mod answer;
mod audit;
mod boxes;
mod check_boxes;
mod clip_windows;
pub mod doom;
mod flood;
mod free_space;
mod from_region;
mod graph;
mod grid_flood;
mod items;
mod lists;
mod locate;
mod none;
mod number;
mod opening;
mod portal_clip;
mod portal_rect;
mod pvs;
mod rooms;
mod searched;
mod stab;
mod stored;
mod view;
mod walk;
mod windows;
mod witness;

pub use answer::{About, EyePlace, RegionRow, Scratch};
pub use audit::{Audit, OtherRegions, audit};
pub use boxes::NoRegions;
pub use check_boxes::check_boxes;
pub use from_region::{FromRegion, pairs_of};
pub use graph::{Ground, RegionGraph};
pub use grid_flood::ABOUT as GRID_FLOOD;
pub use items::RegionItems;
pub use locate::{BoxGrid, covers};
pub use none::EveryRegion;
pub use number::{Marks, RegionId, decode};
pub use opening::{Opening, OpeningPlane, rectangle};
pub use pvs::{Pvs, PvsError};
pub use rooms::{NotFlat, RoomsPvs};
pub use searched::Searched;
pub use stab::{Stabbing, turn};
pub use stored::{ABOUT as STORED, EXACT, REJECT, StoredPvs};
pub use walk::{follow_boxes, seen_by_samples};
pub use witness::{ProvenPvs, Rejected, Witness};

/// The back ends of the region stage.
pub const ROWS: [About; 8] = [
    none::ABOUT,
    flood::ABOUT,
    portal_rect::ABOUT,
    portal_clip::ABOUT,
    grid_flood::ABOUT,
    stored::ABOUT,
    stored::REJECT,
    stored::EXACT,
];

#[cfg(test)]
mod tests;
