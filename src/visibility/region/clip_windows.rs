//! The windows of a search by clipped openings: half-spaces through which each region
//! is seen.

use super::number::{Marks, RegionId};
use super::view::{HalfSpace, Polygon, View};
use super::windows::Windows;

/// Memory of a search. The shape of a window is the range of its half-spaces.
#[derive(Clone, Default, Debug)]
pub struct ClipWindows {
    pub entered: Windows<[u32; 2]>,
    planes: Vec<HalfSpace>,
    pub polygon: Polygon,
    pub kept: Vec<HalfSpace>,
}

impl ClipWindows {
    pub fn clear(&mut self, regions: usize) {
        self.entered.clear(regions);
        self.planes.clear();
    }

    pub fn range(&self, [first, end]: [u32; 2]) -> &[HalfSpace] {
        &self.planes[first as usize..end as usize]
    }

    /// Enters a region through the window of `kept`, unless an earlier one holds it.
    pub fn enter(&mut self, seen: &mut Marks, region: RegionId, view: &View) {
        let ClipWindows {
            entered,
            planes,
            polygon,
            kept,
        } = self;
        // Each half-space of the earlier one is one of this or holds its polygon.
        let implied = |old: &HalfSpace| {
            let shared = kept.iter().any(|plane| plane.number == old.number);
            shared || polygon.is_within(old)
        };
        let holds = |[first, end]: &[u32; 2]| {
            let earlier = &planes[*first as usize..*end as usize];
            earlier.iter().all(implied)
        };
        if entered.is_entered(seen, region, holds) {
            return;
        }
        let first = planes.len() as u32;
        planes.extend_from_slice(match entered.is_crowded(region) {
            true => &view.sides,
            false => &kept[..],
        });
        entered.push(region, [first, planes.len() as u32]);
    }
}
