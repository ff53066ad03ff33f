//! Portal rectangles: an opening is narrowed to the rectangle of the image that it
//! covers, and what is behind it is seen through that rectangle's part in common
//! with the one before (Luebke and Georges 1995, "Portals and mirrors: simple, fast
//! evaluation of potentially visible sets").

use std::sync::Arc;

use super::answer::{EyePlace, Marks, RegionId, RegionRow, Scratch};
use super::graph::RegionGraph;
use super::view::View;
use crate::visibility::{Guarantee, Rays};

/// As it is typed.
pub const NAME: &str = "portal-rect";
/// One line of what it does.
pub const SUMMARY: &str = "rectangles of the image, intersected from opening to opening";
/// What it promises.
pub const GUARANTEE: Guarantee = Guarantee::Conservative;

/// After this many different rectangles a region is taken to be seen through the
/// whole image: bounds the time where many ways lead to one region.
const MOST_WINDOWS: u32 = 32;

/// The row.
#[derive(Clone, Debug)]
pub struct PortalRect(pub Arc<RegionGraph>);

/// A region seen through a rectangle.
#[derive(Clone, Copy, Debug)]
struct Window {
    region: RegionId,
    rectangle: [f64; 4],
    /// The window before it in the same region, plus one.
    before: u32,
}

/// Memory of a search.
#[derive(Clone, Default, Debug)]
pub struct Search {
    windows: Vec<Window>,
    /// For each region its last window plus one, valid where `seen`.
    last: Vec<u32>,
    count: Vec<u32>,
}

impl Search {
    fn clear(&mut self, regions: usize) {
        self.windows.clear();
        self.last.resize(regions.max(self.last.len()), 0);
        self.count.resize(regions.max(self.count.len()), 0);
    }

    /// Enters a region unless an earlier window of it holds this one.
    fn enter(
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

impl RegionRow for PortalRect {
    fn name(&self) -> &'static str {
        NAME
    }

    fn summary(&self) -> &'static str {
        SUMMARY
    }

    fn guarantee(&self) -> Guarantee {
        GUARANTEE
    }

    fn graph(&self) -> &Arc<RegionGraph> {
        &self.0
    }

    fn from_eye(&self, rays: &Rays, scratch: &mut Scratch, out: &mut Vec<RegionId>) -> EyePlace {
        let graph = &*self.0;
        let inside = graph.homes(rays, &mut scratch.homes);
        let (true, Some(view)) = (inside, View::of(rays)) else {
            out.clear();
            out.extend(0..graph.len() as u32);
            return EyePlace::Outside;
        };
        let (seen, search) = (&mut scratch.seen, &mut scratch.rectangles);
        seen.clear(graph.len());
        search.clear(graph.len());
        let all = view.window();
        for &home in &scratch.homes {
            search.enter(seen, home, all, all);
        }
        let mut next = 0;
        while let Some(&Window {
            region, rectangle, ..
        }) = search.windows.get(next)
        {
            next += 1;
            for &exit in graph.exits(region) {
                let opening = &graph.openings()[exit as usize];
                let Some(entered) = opening.entered(region, view.eye) else {
                    continue;
                };
                let Some(through) = view.rectangle(opening) else {
                    continue;
                };
                let common = [
                    rectangle[0].max(through[0]),
                    rectangle[1].min(through[1]),
                    rectangle[2].max(through[2]),
                    rectangle[3].min(through[3]),
                ];
                if common[0] <= common[1] && common[2] <= common[3] {
                    search.enter(seen, entered, common, all);
                }
            }
        }
        seen.list(out);
        EyePlace::Inside
    }
}
