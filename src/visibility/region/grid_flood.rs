//! Flood over the cells of a grid: what the faces between free cells let through, with
//! no portals given.

use std::sync::Arc;

use super::answer::About;
use super::graph::RegionGraph;
use super::searched::Searched;
use crate::visibility::{Guarantee, Solids};

/// What it declares of itself.
pub const ABOUT: About = About {
    name: "grid-flood",
    summary: "cells of a grid reached through faces that no one solid closes",
    guarantee: Guarantee::Conservative,
};

/// Cells of the grid at least and at most; between them one for each solid.
const CELLS: [usize; 2] = [64, 1 << 15];

impl Searched {
    /// Floods the free space of solid boxes, whose regions it makes itself.
    pub fn grid_flood(solids: &Solids) -> Searched {
        let [least, most] = CELLS;
        let cells = solids.boxes.len().clamp(least, most);
        Searched {
            about: ABOUT,
            ..Searched::flood(Arc::new(RegionGraph::of_free_space(solids, cells)))
        }
    }
}
