//! Flood over the cells of a grid: what the faces between free cells let through, with
//! no portals given.

use std::sync::Arc;

use super::answer::{About, EyePlace, RegionId, RegionRow, Scratch};
use super::flood::Flood;
use super::graph::RegionGraph;
use crate::visibility::{Guarantee, Rays, Solids};

/// What it declares of itself.
pub const ABOUT: About = About {
    name: "grid-flood",
    summary: "cells of a grid reached through faces that no one solid closes",
    guarantee: Guarantee::Conservative,
};

/// Cells of the grid at least and at most; between them one for each solid.
const CELLS: [usize; 2] = [64, 1 << 15];

/// The row.
#[derive(Clone, Debug)]
pub struct GridFlood(Flood);

impl GridFlood {
    /// Of solid boxes, whose regions it makes itself.
    pub fn of(solids: &Solids) -> GridFlood {
        let [least, most] = CELLS;
        let cells = solids.boxes.len().clamp(least, most);
        GridFlood(Flood(Arc::new(RegionGraph::of_free_space(solids, cells))))
    }
}

impl RegionRow for GridFlood {
    fn about(&self) -> About {
        ABOUT
    }

    fn graph(&self) -> &Arc<RegionGraph> {
        self.0.graph()
    }

    fn from_eye(&self, rays: &Rays, scratch: &mut Scratch, out: &mut Vec<RegionId>) -> EyePlace {
        self.0.from_eye(rays, scratch, out)
    }
}
