//! A back end asked for more than the camera sees: what may be seen from anywhere in the
//! regions that the eye is in. The answer holds for every camera there, so it can be kept
//! until the eye leaves them.

use std::sync::Arc;

use super::answer::{About, EyePlace, RegionId, RegionRow, Scratch};
use super::graph::RegionGraph;
use super::pvs::Pvs;
use crate::visibility::Rays;

/// The row.
pub struct FromRegion(pub Box<dyn RegionRow>);

impl RegionRow for FromRegion {
    fn about(&self) -> About {
        self.0.about()
    }

    fn graph(&self) -> &Arc<RegionGraph> {
        self.0.graph()
    }

    fn from_eye(&self, rays: &Rays, scratch: &mut Scratch, out: &mut Vec<RegionId>) -> EyePlace {
        let graph = self.graph();
        out.clear();
        if !graph.homes(rays, &mut scratch.homes) {
            out.extend(0..graph.len() as RegionId);
            return EyePlace::Outside;
        }
        if let [home] = scratch.homes[..] {
            let seen = self.from_region(home, &mut scratch.queue);
            out.extend_from_slice(seen);
            return EyePlace::Inside;
        }
        scratch.seen.clear(graph.len());
        for &home in &scratch.homes {
            let seen = self.0.from_region(home, &mut scratch.queue);
            seen.iter().for_each(|&region| {
                scratch.seen.insert(region);
            });
        }
        scratch.seen.list(out);
        EyePlace::Inside
    }

    fn from_region<'a>(
        &'a self,
        region: RegionId,
        memory: &'a mut Vec<RegionId>,
    ) -> &'a [RegionId] {
        self.0.from_region(region, memory)
    }
}

/// What a back end says is seen from each region, as a set of pairs that can be audited.
pub fn pairs_of(row: &dyn RegionRow) -> Pvs {
    let regions = row.graph().len();
    let (mut pvs, mut memory) = (Pvs::alone(regions), Vec::new());
    for from in 0..regions as RegionId {
        let seen = row.from_region(from, &mut memory);
        seen.iter().for_each(|&to| pvs.insert(from, to));
    }
    pvs
}
