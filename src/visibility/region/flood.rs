//! Flood: every region that is reached through openings which meet the view volume,
//! each taken by itself.

use std::sync::Arc;

use super::answer::{About, Scratch};
use super::graph::RegionGraph;
use super::searched::Searched;
use super::view::{Polygon, View};
use crate::visibility::Guarantee;

/// What it declares of itself.
pub const ABOUT: About = About {
    name: "flood",
    summary: "regions reached through openings that meet the view volume",
    guarantee: Guarantee::Conservative,
};

impl Searched {
    /// Floods the graph through what meets the view volume.
    pub fn flood(graph: Arc<RegionGraph>) -> Searched {
        let about = ABOUT;
        Searched {
            about,
            graph,
            search,
        }
    }
}

fn search(graph: &RegionGraph, view: &View, scratch: &mut Scratch) {
    let (seen, queue) = (&mut scratch.seen, &mut scratch.queue);
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
                && polygon.begin(view, opening, &corners, reach)
                && view.sides.iter().all(|side| polygon.cut(side));
            let other = opening.other(at);
            if meets && seen.insert(other) {
                queue.push(other);
            }
        }
    }
}
