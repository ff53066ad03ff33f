//! The windows of a search by rectangles: parts of the image in which each region is
//! seen.

use super::number::{Marks, RegionId};

/// After this many different rectangles a region is taken to be seen through the
/// whole image: bounds the time where many ways lead to one region.
const MOST_WINDOWS: u32 = 32;

/// A region seen through a rectangle.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    pub region: RegionId,
    pub rectangle: [f64; 4],
    /// The window before it in the same region, plus one.
    pub before: u32,
}

/// Memory of a search.
#[derive(Clone, Default, Debug)]
pub struct RectangleWindows {
    pub windows: Vec<Window>,
    /// For each region its last window plus one, valid where `seen`.
    pub last: Vec<u32>,
    pub count: Vec<u32>,
}

impl RectangleWindows {
    pub fn clear(&mut self, regions: usize) {
        self.windows.clear();
        self.last.resize(regions.max(self.last.len()), 0);
        self.count.resize(regions.max(self.count.len()), 0);
    }

    /// Enters a region unless an earlier window of it holds this one.
    pub fn enter(
        &mut self,
        seen: &mut Marks,
        region: RegionId,
        mut rectangle: [f64; 4],
        all: [f64; 4],
    ) {
        let at = region as usize;
        if seen.insert(region) {
            (self.last[at], self.count[at]) = (0, 0);
        }
        let mut earlier = self.last[at];
        while earlier > 0 {
            let window = &self.windows[earlier as usize - 1];
            if holds(&window.rectangle, &rectangle) {
                return;
            }
            earlier = window.before;
        }
        self.count[at] += 1;
        if self.count[at] > MOST_WINDOWS {
            rectangle = all;
        }
        let before = self.last[at];
        self.windows.push(Window {
            region,
            rectangle,
            before,
        });
        self.last[at] = self.windows.len() as u32;
    }
}

fn holds(outer: &[f64; 4], inner: &[f64; 4]) -> bool {
    outer[0] <= inner[0] && inner[1] <= outer[1] && outer[2] <= inner[2] && inner[3] <= outer[3]
}
