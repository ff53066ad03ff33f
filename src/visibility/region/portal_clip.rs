//! Exact clipped portals: an opening is cut, as a convex polygon, by the half-spaces
//! through the eye and the edges of all openings before it. Exact up to a slack of
//! some 1e-11 of the distance, which is given away so that rounding loses nothing.
//!
//! A window keeps half-spaces of the openings' own edges only; none is ever made from
//! a corner that was computed by cutting, so errors do not build up from opening to
//! opening (the proof is at the slack, in `view`).

use std::sync::Arc;

use super::answer::{About, Scratch};
use super::graph::RegionGraph;
use super::searched::Searched;
use super::view::{MOST_PLANES, View, through_edge};
use super::windows::Window;
use crate::visibility::Guarantee;

/// What it declares of itself.
pub const ABOUT: About = About {
    name: "portal-clip",
    summary: "openings clipped as convex polygons by those before them",
    guarantee: Guarantee::Conservative,
};

impl Searched {
    /// Searches with clipped openings.
    pub fn portal_clip(graph: Arc<RegionGraph>) -> Searched {
        let about = ABOUT;
        Searched {
            about,
            graph,
            search,
        }
    }
}

fn search(graph: &RegionGraph, view: &View, scratch: &mut Scratch) {
    let (seen, search) = (&mut scratch.seen, &mut scratch.windows);
    search.clear(graph.len());
    search.polygon.corners.clear();
    for &home in &scratch.homes {
        search.kept.clear();
        search.kept.extend_from_slice(&view.sides);
        search.enter(seen, home, view);
    }
    let mut next = 0;
    while let Some(&Window { region, shape, .. }) = search.entered.windows.get(next) {
        next += 1;
        for &exit in graph.exits(region) {
            let opening = &graph.openings()[exit as usize];
            let Some(entered) = opening.entered(region, view.eye) else {
                continue;
            };
            let (corners, reach) = view.corners(opening);
            if view.is_beyond(&corners, reach) {
                continue;
            }
            let mut polygon = std::mem::take(&mut search.polygon);
            let passes = polygon.begin(view, opening, &corners, reach)
                && search.range(shape).iter().all(|plane| polygon.cut(plane));
            search.polygon = polygon;
            if !passes {
                continue;
            }
            let mut kept = std::mem::take(&mut search.kept);
            kept.clear();
            let edges = (0u32..4).filter_map(|edge| {
                through_edge(&corners, edge as usize, reach, 4 + 4 * exit + edge)
            });
            let all = search.range(shape).iter().copied().chain(edges);
            // A half-space that holds all of the polygon follows from the others.
            kept.extend(
                all.filter(|plane| !search.polygon.is_within(plane))
                    .take(MOST_PLANES),
            );
            search.kept = kept;
            search.enter(seen, entered, view);
        }
    }
}
