//! No region stage: every region, always.

use std::sync::Arc;

use super::answer::{About, EyePlace, RegionId, RegionRow, Scratch};
use super::graph::RegionGraph;
use crate::visibility::{Guarantee, Rays};

/// What it declares of itself.
pub const ABOUT: About = About {
    name: "none",
    summary: "every region, whatever the camera",
    guarantee: Guarantee::Conservative,
};

/// The row.
#[derive(Clone, Debug)]
pub struct EveryRegion(pub Arc<RegionGraph>);

impl RegionRow for EveryRegion {
    fn about(&self) -> About {
        ABOUT
    }

    fn graph(&self) -> &Arc<RegionGraph> {
        &self.0
    }

    fn from_eye(&self, rays: &Rays, scratch: &mut Scratch, out: &mut Vec<RegionId>) -> EyePlace {
        let inside = self.0.homes(rays, &mut scratch.homes);
        out.clear();
        out.extend(0..self.0.len() as u32);
        if inside {
            EyePlace::Inside
        } else {
            EyePlace::Outside
        }
    }

    fn from_region<'a>(&'a self, _: RegionId, memory: &'a mut Vec<RegionId>) -> &'a [RegionId] {
        memory.clear();
        memory.extend(0..self.0.len() as u32);
        memory
    }
}
