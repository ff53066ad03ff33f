//! A search of the graph from the regions of the eye, through windows: the parts of
//! the image in which each region is seen.

use super::graph::RegionGraph;
use super::id_set::{IdSet, RegionId};
use super::opening::Opening;
use super::view::View;
use crate::visibility::Rays;

/// Most different windows of a region; further ones are the whole image.
///
/// Bounds the time where many ways lead to one region.
const MOST_WINDOWS: u32 = 32;

/// A form of windows, and how an opening narrows them.
pub trait Windows {
    /// A part of the image.
    type Window: Copy;

    /// Forgets the last search; returns the window of the whole image.
    fn begin(&mut self, view: &View) -> Self::Window;

    /// The region that lines of sight enter out of `region` through an opening.
    fn entered(opening: &Opening, region: RegionId, view: &View) -> Option<RegionId> {
        opening.entered(region, view.eye)
    }

    /// Narrows a window to the part through which an opening (of this index) is seen;
    /// `false` if there is none. The result is the current window.
    fn narrow(&mut self, view: &View, opening: (u32, &Opening), window: Self::Window) -> bool;

    /// Tests whether an earlier window surely holds the current one.
    fn is_within(&self, earlier: Self::Window) -> bool;

    /// Stores the current window.
    fn keep(&mut self) -> Self::Window;
}

/// Memory of a search.
#[derive(Clone, Default, Debug)]
pub struct Search<W, S> {
    windows: W,
    /// All entries of regions, in the order of the search.
    entries: Vec<Entry<S>>,
    /// Last entry plus one, and number of entries, of each region that is seen.
    last: Vec<(u32, u32)>,
}

/// A region seen through a window.
#[derive(Clone, Copy, Debug)]
struct Entry<S> {
    region: RegionId,
    window: S,
    /// The entry before it of the same region, plus one.
    before: u32,
}

impl<S: Copy, W: Windows<Window = S>> Search<W, S> {
    /// Adds the regions that are seen from those of the eye, these among them.
    pub fn run(&mut self, graph: &RegionGraph, rays: &Rays, homes: &[RegionId], seen: &mut IdSet) {
        let view = &View::of(rays);
        let whole = self.windows.begin(view);
        self.entries.clear();
        self.last.resize(graph.len().max(self.last.len()), (0, 0));
        for &home in homes {
            if !self.is_entered(seen, home) {
                self.enter(home, whole);
            }
        }
        let mut next = 0;
        while let Some(&Entry { region, window, .. }) = self.entries.get(next) {
            next += 1;
            for &exit in graph.exits(region) {
                let opening = &graph.openings()[exit as usize];
                let Some(entered) = W::entered(opening, region, view) else {
                    continue;
                };
                if self.windows.narrow(view, (exit, opening), window)
                    && !self.is_entered(seen, entered)
                {
                    let window = match self.last[entered as usize].1 < MOST_WINDOWS {
                        true => self.windows.keep(),
                        false => whole,
                    };
                    self.enter(entered, window);
                }
            }
        }
    }

    /// Tests whether an earlier window of a region holds the current one.
    fn is_entered(&mut self, seen: &mut IdSet, region: RegionId) -> bool {
        if seen.insert(region) {
            self.last[region as usize] = (0, 0);
            return false;
        }
        let mut earlier = self.last[region as usize].0;
        while earlier > 0 {
            let entry = &self.entries[earlier as usize - 1];
            if self.windows.is_within(entry.window) {
                return true;
            }
            earlier = entry.before;
        }
        false
    }

    fn enter(&mut self, region: RegionId, window: S) {
        let (before, count) = self.last[region as usize];
        self.entries.push(Entry {
            region,
            window,
            before,
        });
        self.last[region as usize] = (self.entries.len() as u32, count + 1);
    }
}
