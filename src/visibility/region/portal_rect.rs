//! Portal rectangles: an opening is narrowed to the rectangle of the image that it
//! covers, and what is behind it is seen through that rectangle's part in common
//! with the one before (Luebke and Georges 1995, "Portals and mirrors: simple, fast
//! evaluation of potentially visible sets").

use std::sync::Arc;

use super::answer::{About, EyePlace, RegionId, RegionRow, Scratch};
use super::graph::RegionGraph;
use super::rectangle_windows::Window;
use super::view::View;
use crate::visibility::{Guarantee, Rays};

/// What it declares of itself.
pub const ABOUT: About = About {
    name: "portal-rect",
    summary: "rectangles of the image, intersected from opening to opening",
    guarantee: Guarantee::Conservative,
};

/// The row.
#[derive(Clone, Debug)]
pub struct PortalRect(pub Arc<RegionGraph>);

impl RegionRow for PortalRect {
    fn about(&self) -> About {
        ABOUT
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
