//! A search of the graph from the regions of the eye, through windows.
//!
//! A window is the rectangle of the image that an opening covers, intersected with the
//! window before it (Luebke and Georges 1995, "Portals and mirrors: simple, fast evaluation
//! of potentially visible sets").

use super::graph::{RegionGraph, RegionId};
use super::view::{View, Window};
use crate::index::IdSet;
use crate::visibility::Rays;

/// Most different windows of a region; further ones are the whole image.
///
/// Bounds the time where many ways lead to one region.
const MOST_WINDOWS: u32 = 32;

/// Memory of a search.
#[derive(Clone, Default, Debug)]
pub struct Search {
    /// All entries of regions, in the order of the search.
    entries: Vec<Entry>,
    /// Last entry plus one, and number of entries, of each region that is seen.
    last: Vec<(u32, u32)>,
}

/// A region seen through a window.
#[derive(Clone, Copy, Debug)]
struct Entry {
    region: RegionId,
    window: Window,
    /// The entry before it of the same region, plus one.
    before: u32,
}

impl Search {
    /// Adds the regions that are seen from those of the eye, these among them.
    pub fn run(&mut self, graph: &RegionGraph, rays: &Rays, homes: &[RegionId], seen: &mut IdSet) {
        let view = &View::of(rays);
        self.entries.clear();
        self.last.resize(graph.len().max(self.last.len()), (0, 0));
        for &home in homes {
            if !self.is_entered(seen, home, view.window) {
                self.enter(home, view.window);
            }
        }
        let mut next = 0;
        while let Some(&Entry { region, window, .. }) = self.entries.get(next) {
            next += 1;
            for &exit in &graph.exits[region as usize] {
                let opening = &graph.openings[exit as usize];
                let Some(entered) = opening.entered(region, view.eye) else {
                    continue;
                };
                let covered = view.rectangle(opening);
                let Some(narrowed) = covered.and_then(|covered| common(window, covered)) else {
                    continue;
                };
                if !self.is_entered(seen, entered, narrowed) {
                    let window = match self.last[entered as usize].1 < MOST_WINDOWS {
                        true => narrowed,
                        false => view.window,
                    };
                    self.enter(entered, window);
                }
            }
        }
    }

    /// Tests whether an earlier window of a region holds a window.
    fn is_entered(&mut self, seen: &mut IdSet, region: RegionId, window: Window) -> bool {
        if seen.insert(region) {
            self.last[region as usize] = (0, 0);
            return false;
        }
        let mut earlier = self.last[region as usize].0;
        while earlier > 0 {
            let entry = &self.entries[earlier as usize - 1];
            if is_within(window, entry.window) {
                return true;
            }
            earlier = entry.before;
        }
        false
    }

    fn enter(&mut self, region: RegionId, window: Window) {
        let (before, count) = self.last[region as usize];
        self.entries.push(Entry {
            region,
            window,
            before,
        });
        self.last[region as usize] = (self.entries.len() as u32, count + 1);
    }
}

/// The common part of two windows; `None` if they do not meet.
fn common([x0, x1, y0, y1]: Window, [left, right, bottom, top]: Window) -> Option<Window> {
    let both = [x0.max(left), x1.min(right), y0.max(bottom), y1.min(top)];
    (both[0] <= both[1] && both[2] <= both[3]).then_some(both)
}

fn is_within(inner: Window, outer: Window) -> bool {
    outer[0] <= inner[0] && inner[1] <= outer[1] && outer[2] <= inner[2] && inner[3] <= outer[3]
}
