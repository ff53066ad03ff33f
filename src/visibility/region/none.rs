//! No region stage: every region, always.

use std::sync::Arc;

use super::answer::{EyePlace, RegionId, RegionRow, Scratch};
use super::graph::RegionGraph;
use crate::visibility::{Guarantee, Rays};

/// As it is typed.
pub const NAME: &str = "none";
/// One line of what it does.
pub const SUMMARY: &str = "every region, whatever the camera";
/// What it promises.
pub const GUARANTEE: Guarantee = Guarantee::Conservative;

/// The row.
#[derive(Clone, Debug)]
pub struct EveryRegion(pub Arc<RegionGraph>);

impl RegionRow for EveryRegion {
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
        let inside = self.0.homes(rays, &mut scratch.homes);
        out.clear();
        out.extend(0..self.0.len() as u32);
        if inside {
            EyePlace::Inside
        } else {
            EyePlace::Outside
        }
    }

    fn from_region(&self, _: RegionId, out: &mut Vec<RegionId>) {
        out.clear();
        out.extend(0..self.0.len() as u32);
    }
}
