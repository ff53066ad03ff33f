//! The windows through which a search sees each region.

use super::number::{Marks, RegionId};

/// After this many different windows a region is taken to be seen through the whole
/// image: bounds the time where many ways lead to one region.
const MOST_WINDOWS: u32 = 32;

/// A region seen through a part of the image.
#[derive(Clone, Copy, Debug)]
pub struct Window<S> {
    pub region: RegionId,
    pub shape: S,
    /// The window before it in the same region, plus one.
    before: u32,
}

/// The windows of a search, in the order in which they were entered.
#[derive(Clone, Debug)]
pub struct Windows<S> {
    pub windows: Vec<Window<S>>,
    /// For each region its last window plus one, valid where `seen`.
    last: Vec<u32>,
    count: Vec<u32>,
}

impl<S> Default for Windows<S> {
    fn default() -> Self {
        Windows {
            windows: Vec::new(),
            last: Vec::new(),
            count: Vec::new(),
        }
    }
}

impl<S> Windows<S> {
    pub fn clear(&mut self, regions: usize) {
        self.windows.clear();
        self.last.resize(regions.max(self.last.len()), 0);
        self.count.resize(regions.max(self.count.len()), 0);
    }

    /// Whether some window of a region holds what it is to be entered through now.
    pub fn is_entered(
        &mut self,
        seen: &mut Marks,
        region: RegionId,
        mut holds: impl FnMut(&S) -> bool,
    ) -> bool {
        let at = region as usize;
        if seen.insert(region) {
            (self.last[at], self.count[at]) = (0, 0);
        }
        let mut earlier = self.last[at];
        while earlier > 0 {
            let window = &self.windows[earlier as usize - 1];
            if holds(&window.shape) {
                return true;
            }
            earlier = window.before;
        }
        false
    }

    /// Whether the next window of a region is to be the whole image.
    pub fn is_crowded(&self, region: RegionId) -> bool {
        self.count[region as usize] >= MOST_WINDOWS
    }

    /// Enters a region through a window.
    pub fn push(&mut self, region: RegionId, shape: S) {
        let at = region as usize;
        self.count[at] += 1;
        let before = self.last[at];
        self.windows.push(Window {
            region,
            shape,
            before,
        });
        self.last[at] = self.windows.len() as u32;
    }
}
