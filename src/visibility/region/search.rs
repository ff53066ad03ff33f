//! A search of the graph from the regions of the eye, through windows.
//!
//! Windows are the parts of the image in which each region is seen; each back end has its own
//! form of them.

use super::graph::{Opening, RegionGraph, RegionId};
use super::view::{HalfSpace, MOST_PLANES, Polygon, View, through_edge};
use crate::index::IdSet;
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
            for &exit in &graph.exits[region as usize] {
                let opening = &graph.openings[exit as usize];
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

/// Flood, without windows: a region is seen or not.
///
/// Regions are reached through openings that meet the view volume, each by itself.
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

/// Portal rectangles: left, right, bottom, top, slopes per unit of depth.
///
/// A window is the rectangle of the image that an opening covers, intersected with the
/// window before it (Luebke and Georges 1995, "Portals and mirrors: simple, fast evaluation
/// of potentially visible sets").
#[derive(Clone, Default, Debug)]
pub struct PortalRect {
    current: [f64; 4],
}

impl Windows for PortalRect {
    type Window = [f64; 4];

    fn begin(&mut self, view: &View) -> [f64; 4] {
        view.window
    }

    fn narrow(&mut self, view: &View, (_, opening): (u32, &Opening), window: [f64; 4]) -> bool {
        let Some(seen) = view.rectangle(opening) else {
            return false;
        };
        let ([x0, x1, y0, y1], [left, right, bottom, top]) = (window, seen);
        self.current = [x0.max(left), x1.min(right), y0.max(bottom), y1.min(top)];
        self.current[0] <= self.current[1] && self.current[2] <= self.current[3]
    }

    fn is_within(&self, outer: [f64; 4]) -> bool {
        let inner = &self.current;
        outer[0] <= inner[0] && inner[1] <= outer[1] && outer[2] <= inner[2] && inner[3] <= outer[3]
    }

    fn keep(&mut self) -> [f64; 4] {
        self.current
    }
}

/// Exact clipped portals. A window is the range of its half-spaces in `planes`.
///
/// An opening is cut, as a convex polygon, by the half-spaces through the eye and the edges
/// of all openings before it. Exact up to a slack of some 1e-11 of the distance, which is
/// given away so that rounding loses nothing.
///
/// A window keeps half-spaces of the openings' own edges only; none is ever made from
/// a corner that was computed by cutting, so errors do not build up from opening to
/// opening (the proof is at the slack, in `view`).
#[derive(Clone, Default, Debug)]
pub struct PortalClip {
    /// The half-spaces of all windows, the sides of the image first.
    planes: Vec<HalfSpace>,
    /// The current window: the opening as it is seen, and the half-spaces about it.
    polygon: Polygon,
    current: Vec<HalfSpace>,
}

impl Windows for PortalClip {
    type Window = [u32; 2];

    fn begin(&mut self, view: &View) -> [u32; 2] {
        self.planes.clear();
        self.planes.extend_from_slice(&view.sides);
        [0, view.sides.len() as u32]
    }

    fn narrow(&mut self, view: &View, (exit, opening): (u32, &Opening), window: [u32; 2]) -> bool {
        let before = &self.planes[window[0] as usize..window[1] as usize];
        let Some((corners, reach)) = self.polygon.see(view, opening, before) else {
            return false;
        };
        let edges = (0u32..4)
            .filter_map(|edge| through_edge(&corners, edge as usize, reach, 4 + 4 * exit + edge));
        // A half-space that holds all of the polygon follows from the others.
        let needed = |plane: &HalfSpace| !self.polygon.is_within(plane);
        let all = before.iter().copied().chain(edges);
        self.current.clear();
        self.current.extend(all.filter(needed).take(MOST_PLANES));
        true
    }

    /// Each half-space of an earlier window is one of the current or holds its polygon.
    fn is_within(&self, [first, end]: [u32; 2]) -> bool {
        let implied = |old: &HalfSpace| {
            let shared = self.current.iter().any(|plane| plane.number == old.number);
            shared || self.polygon.is_within(old)
        };
        let mut earlier = self.planes[first as usize..end as usize].iter();
        earlier.all(implied)
    }

    fn keep(&mut self) -> [u32; 2] {
        let first = self.planes.len() as u32;
        self.planes.extend_from_slice(&self.current);
        [first, self.planes.len() as u32]
    }
}
