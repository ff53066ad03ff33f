//! A back end that searches the graph from the regions of the eye on: what all such
//! searches have in common.

use std::sync::Arc;

use super::answer::{About, EyePlace, RegionId, RegionRow, Scratch};
use super::graph::RegionGraph;
use super::view::View;
use crate::visibility::Rays;

/// The row of a search.
#[derive(Clone, Debug)]
pub struct Searched {
    pub(super) about: About,
    pub(super) graph: Arc<RegionGraph>,
    /// Marks the regions that are seen from those of the eye, these among them.
    pub(super) search: fn(&RegionGraph, &View, &mut Scratch),
}

impl RegionRow for Searched {
    fn about(&self) -> About {
        self.about
    }

    fn graph(&self) -> &Arc<RegionGraph> {
        &self.graph
    }

    fn from_eye(&self, rays: &Rays, scratch: &mut Scratch, out: &mut Vec<RegionId>) -> EyePlace {
        let graph = &*self.graph;
        let inside = graph.homes(rays, &mut scratch.homes);
        let (true, Some(view)) = (inside, View::of(rays)) else {
            out.clear();
            out.extend(0..graph.len() as u32);
            return EyePlace::Outside;
        };
        scratch.seen.clear(graph.len());
        (self.search)(graph, &view, scratch);
        scratch.seen.list(out);
        EyePlace::Inside
    }
}
