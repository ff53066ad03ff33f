//! The windows of a search by clipped openings: half-spaces through which each region
//! is seen.

use super::number::{Marks, RegionId};
use super::view::{HalfSpace, Polygon, View};

/// After this many different windows a region is taken to be seen through the whole
/// image: bounds the time where many ways lead to one region.
const MOST_WINDOWS: u32 = 32;

/// A region seen through the common part of half-spaces.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    pub region: RegionId,
    /// Its half-spaces, a range of `ClipWindows::planes`.
    pub planes: [u32; 2],
    /// The window before it in the same region, plus one.
    pub before: u32,
}

/// Memory of a search.
#[derive(Clone, Default, Debug)]
pub struct ClipWindows {
    pub windows: Vec<Window>,
    pub planes: Vec<HalfSpace>,
    pub last: Vec<u32>,
    pub count: Vec<u32>,
    pub polygon: Polygon,
    pub kept: Vec<HalfSpace>,
}

impl ClipWindows {
    pub fn clear(&mut self, regions: usize) {
        self.windows.clear();
        self.planes.clear();
        self.last.resize(regions.max(self.last.len()), 0);
        self.count.resize(regions.max(self.count.len()), 0);
    }

    pub fn range(&self, window: &Window) -> &[HalfSpace] {
        &self.planes[window.planes[0] as usize..window.planes[1] as usize]
    }

    /// Enters a region through the window of `kept`, unless an earlier one holds it.
    pub fn enter(&mut self, seen: &mut Marks, region: RegionId, view: &View) {
        let at = region as usize;
        if seen.insert(region) {
            (self.last[at], self.count[at]) = (0, 0);
        }
        let mut earlier = self.last[at];
        while earlier > 0 {
            let window = self.windows[earlier as usize - 1];
            // Each half-space of the earlier one is one of this or holds its polygon.
            let implied = |old: &HalfSpace| {
                let shared = self.kept.iter().any(|plane| plane.number == old.number);
                shared || self.polygon.is_within(old)
            };
            if self.range(&window).iter().all(implied) {
                return;
            }
            earlier = window.before;
        }
        self.count[at] += 1;
        let first = self.planes.len() as u32;
        if self.count[at] > MOST_WINDOWS {
            self.planes.extend_from_slice(&view.sides);
        } else {
            self.planes.extend_from_slice(&self.kept);
        }
        self.windows.push(Window {
            region,
            planes: [first, self.planes.len() as u32],
            before: self.last[at],
        });
        self.last[at] = self.windows.len() as u32;
    }
}
