//! A search of the graph from the regions of the eye, through windows.
//!
//! A window is the rectangle of the image that an opening covers, intersected with the
//! window before it (Luebke and Georges 1995, "Portals and mirrors: simple, fast evaluation
//! of potentially visible sets").

use super::graph::{RegionGraph, RegionId};
use super::view::{Window, window_of};
use crate::index::IdSet;
use crate::visibility::Rays;

/// Most different windows of a region; further ones are the whole image.
///
/// Bounds the time where many ways lead to one region.
const MOST_WINDOWS: usize = 32;

/// Memory of a search.
#[derive(Clone, Default, Debug)]
pub struct Search {
    /// All entries of regions through windows, in the order of the search.
    entries: Vec<(RegionId, Window)>,
    /// The windows of each region that is seen.
    windows: Vec<Vec<Window>>,
}

impl Search {
    /// Adds the regions that are seen from those of the eye, these among them.
    pub fn run(&mut self, graph: &RegionGraph, rays: &Rays, homes: &[RegionId], seen: &mut IdSet) {
        self.entries.clear();
        let regions = graph.len().max(self.windows.len());
        self.windows.resize_with(regions, Vec::new);
        for &home in homes {
            if !self.is_entered(seen, home, rays.window) {
                self.enter(home, rays.window);
            }
        }
        let mut next = 0;
        while let Some(&(region, window)) = self.entries.get(next) {
            next += 1;
            for &exit in &graph.exits[region as usize] {
                let opening = &graph.openings[exit as usize];
                let Some(entered) = opening.entered(region, rays.camera.frame.eye) else {
                    continue;
                };
                let covered = window_of(rays, opening);
                let Some(narrowed) = covered.and_then(|covered| common(window, covered)) else {
                    continue;
                };
                if !self.is_entered(seen, entered, narrowed) {
                    let window = match self.windows[entered as usize].len() < MOST_WINDOWS {
                        true => narrowed,
                        false => rays.window,
                    };
                    self.enter(entered, window);
                }
            }
        }
    }

    /// Tests whether an earlier window of a region holds a window.
    fn is_entered(&mut self, seen: &mut IdSet, region: RegionId, window: Window) -> bool {
        let earlier = &mut self.windows[region as usize];
        if seen.insert(region) {
            earlier.clear();
        }
        earlier.iter().any(|earlier| is_within(window, *earlier))
    }

    fn enter(&mut self, region: RegionId, window: Window) {
        self.entries.push((region, window));
        self.windows[region as usize].push(window);
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
