//! Flood: every region that is reached through openings which meet the view volume,
//! each taken by itself.

use super::id_set::RegionId;
use super::opening::Opening;
use super::search::Windows;
use super::view::{Polygon, View};

/// No windows: a region is seen or not.
#[derive(Clone, Default, Debug)]
pub struct Flood {
    polygon: Polygon,
}

impl Windows for Flood {
    type Window = ();

    fn begin(&mut self, _: &View) {}

    fn entered(opening: &Opening, region: RegionId, _: &View) -> Option<RegionId> {
        Some(opening.other(region))
    }

    fn narrow(&mut self, view: &View, (_, opening): (u32, &Opening), (): ()) -> bool {
        self.polygon.see(view, opening, &view.sides).is_some()
    }

    fn is_within(&self, (): ()) -> bool {
        true
    }

    fn keep(&mut self) {}
}
