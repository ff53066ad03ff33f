//! Exact clipped portals: an opening is cut, as a convex polygon, by the half-spaces
//! through the eye and the edges of all openings before it. Exact up to a slack of
//! some 1e-11 of the distance, which is given away so that rounding loses nothing.
//!
//! A window keeps half-spaces of the openings' own edges only; none is ever made from
//! a corner that was computed by cutting, so errors do not build up from opening to
//! opening (the proof is at the slack, in `view`).

use std::sync::Arc;

use super::answer::{EyePlace, Marks, RegionId, RegionRow, Scratch};
use super::graph::RegionGraph;
use super::view::{HalfSpace, MOST_PLANES, Polygon, View, through_edge};
use crate::visibility::{Guarantee, Rays};

/// As it is typed.
pub const NAME: &str = "portal-clip";
/// One line of what it does.
pub const SUMMARY: &str = "openings clipped as convex polygons by those before them";
/// What it promises.
pub const GUARANTEE: Guarantee = Guarantee::Conservative;

/// After this many different windows a region is taken to be seen through the whole
/// image: bounds the time where many ways lead to one region.
const MOST_WINDOWS: u32 = 32;

/// The row.
#[derive(Clone, Debug)]
pub struct PortalClip(pub Arc<RegionGraph>);

/// A region seen through the common part of half-spaces.
#[derive(Clone, Copy, Debug)]
struct Window {
    region: RegionId,
    /// Its half-spaces, a range of `Search::planes`.
    planes: [u32; 2],
    /// The window before it in the same region, plus one.
    before: u32,
}

/// Memory of a search.
#[derive(Clone, Default, Debug)]
pub struct Search {
    windows: Vec<Window>,
    planes: Vec<HalfSpace>,
    last: Vec<u32>,
    count: Vec<u32>,
    polygon: Polygon,
    kept: Vec<HalfSpace>,
}

impl Search {
    fn clear(&mut self, regions: usize) {
        self.windows.clear();
        self.planes.clear();
        self.last.resize(regions.max(self.last.len()), 0);
        self.count.resize(regions.max(self.count.len()), 0);
    }

    fn range(&self, window: &Window) -> &[HalfSpace] {
        &self.planes[window.planes[0] as usize..window.planes[1] as usize]
    }

    /// Enters a region through the window of `kept`, unless an earlier one holds it.
    fn enter(&mut self, seen: &mut Marks, region: RegionId, view: &View) {
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

impl RegionRow for PortalClip {
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
        let (seen, search) = (&mut scratch.seen, &mut scratch.windows);
        seen.clear(graph.len());
        search.clear(graph.len());
        search.polygon.corners.clear();
        for &home in &scratch.homes {
            search.kept.clear();
            search.kept.extend_from_slice(&view.sides);
            search.enter(seen, home, &view);
        }
        let mut next = 0;
        while let Some(&window) = search.windows.get(next) {
            next += 1;
            for &exit in graph.exits(window.region) {
                let opening = &graph.openings()[exit as usize];
                let Some(entered) = opening.entered(window.region, view.eye) else {
                    continue;
                };
                let (corners, reach) = view.corners(opening);
                if view.is_beyond(&corners, reach) {
                    continue;
                }
                let mut polygon = std::mem::take(&mut search.polygon);
                let passes = polygon.begin(&view, opening, &corners, reach)
                    && search.range(&window).iter().all(|plane| polygon.cut(plane));
                search.polygon = polygon;
                if !passes {
                    continue;
                }
                let range = window.planes[0] as usize..window.planes[1] as usize;
                let mut kept = std::mem::take(&mut search.kept);
                kept.clear();
                let edges = (0u32..4).filter_map(|edge| {
                    through_edge(&corners, edge as usize, reach, 4 + 4 * exit + edge)
                });
                let all = search.planes[range].iter().copied().chain(edges);
                // A half-space that holds all of the polygon follows from the others.
                kept.extend(
                    all.filter(|plane| !search.polygon.is_within(plane))
                        .take(MOST_PLANES),
                );
                search.kept = kept;
                search.enter(seen, entered, &view);
            }
        }
        seen.list(out);
        EyePlace::Inside
    }
}
