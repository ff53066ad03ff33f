//! The region stage: which rooms, sectors or cells of a scene can be seen at all,
//! and so which items.
//!
//! A [`RegionGraph`] is what is searched: regions and the openings between them, made
//! from a tiling of rooms or a Doom map. The back ends are one file each.
//!
//! What is seen is defined by regions and openings alone: a line of sight leaves a
//! region through an opening, and everything else on a region's border is opaque.
//! Doors are open. Lines that only touch an edge of an opening see nothing; all back
//! ends but the exact ones list what they touch too.

mod answer;
mod boxes;
mod clip_windows;
pub mod doom;
mod flood;
mod graph;
mod items;
mod lists;
mod locate;
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

pub use answer::{About, EyePlace, RegionRow, Scratch};
pub use boxes::NoRegions;
pub use graph::{Ground, RegionGraph};
pub use items::RegionItems;
pub use number::{Marks, RegionId, decode};
pub use opening::{Opening, OpeningPlane, rectangle};
pub use pvs::{Pvs, PvsError};
pub use rooms::NotFlat;
pub use searched::Searched;
pub use stored::{ABOUT as STORED, EXACT, REJECT, StoredPvs};
#[cfg(test)]
pub use tests::leads_through;
pub use walk::seen_by_samples;

/// The back ends of the region stage.
pub const ROWS: [About; 6] = [
    flood::ABOUT,
    portal_rect::ABOUT,
    portal_clip::ABOUT,
    stored::ABOUT,
    stored::REJECT,
    stored::EXACT,
];

#[cfg(test)]
mod tests;
