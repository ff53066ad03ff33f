//! Flood: every region that is reached through openings which meet the view volume,
//! each taken by itself.

use std::sync::Arc;

use super::answer::{About, EyePlace, RegionId, RegionRow, Scratch};
use super::graph::RegionGraph;
use super::view::{Polygon, View};
use crate::visibility::{Guarantee, Rays};

/// What it declares of itself.
pub const ABOUT: About = About {
    name: "flood",
    summary: "regions reached through openings that meet the view volume",
    guarantee: Guarantee::Conservative,
};

/// The row.
#[derive(Clone, Debug)]
pub struct Flood(pub Arc<RegionGraph>);

impl RegionRow for Flood {
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
        let (seen, queue) = (&mut scratch.seen, &mut scratch.queue);
        seen.clear(graph.len());
        queue.clear();
        for &home in &scratch.homes {
            seen.insert(home);
            queue.push(home);
        }
        let mut polygon = Polygon::default();
        while let Some(at) = queue.pop() {
            for &exit in graph.exits(at) {
                let opening = &graph.openings()[exit as usize];
                let (corners, reach) = view.corners(opening);
                let meets = !view.is_beyond(&corners, reach)
                    && polygon.begin(&view, opening, &corners, reach)
                    && view.sides.iter().all(|side| polygon.cut(side));
                let other = opening.other(at);
                if meets && seen.insert(other) {
                    queue.push(other);
                }
            }
        }
        seen.list(out);
        EyePlace::Inside
    }
}
