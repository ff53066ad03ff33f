//! Portal rectangles: an opening is narrowed to the rectangle of the image that it
//! covers, and what is behind it is seen through that rectangle's part in common
//! with the one before (Luebke and Georges 1995, "Portals and mirrors: simple, fast
//! evaluation of potentially visible sets").

use std::sync::Arc;

use super::answer::{About, Scratch};
use super::graph::RegionGraph;
use super::searched::Searched;
use super::view::View;
use super::windows::{Window, Windows};
use crate::visibility::Guarantee;

/// What it declares of itself.
pub const ABOUT: About = About {
    name: "portal-rect",
    summary: "rectangles of the image, intersected from opening to opening",
    guarantee: Guarantee::Conservative,
};

impl Searched {
    /// Searches with rectangles of the image.
    pub fn portal_rect(graph: Arc<RegionGraph>) -> Searched {
        let about = ABOUT;
        Searched {
            about,
            graph,
            search,
        }
    }
}

fn search(graph: &RegionGraph, view: &View, scratch: &mut Scratch) {
    let (seen, search) = (&mut scratch.seen, &mut scratch.rectangles);
    search.clear(graph.len());
    let all = view.window();
    let mut enter = |search: &mut Windows<[f64; 4]>, region, rectangle: [f64; 4]| {
        if !search.is_entered(seen, region, |outer| holds(outer, &rectangle)) {
            let is_crowded = search.is_crowded(region);
            search.push(region, if is_crowded { all } else { rectangle });
        }
    };
    for &home in &scratch.homes {
        enter(search, home, all);
    }
    let mut next = 0;
    while let Some(&Window {
        region,
        shape: rectangle,
        ..
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
                enter(search, entered, common);
            }
        }
    }
}

fn holds(outer: &[f64; 4], inner: &[f64; 4]) -> bool {
    outer[0] <= inner[0] && inner[1] <= outer[1] && outer[2] <= inner[2] && inner[3] <= outer[3]
}
