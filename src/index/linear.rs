//! The linear scan: no structure at all, every box against every plane. The
//! yardstick of every ratio and the textbook's O(n).

use std::ops::ControlFlow;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::{BuildError, FrustumQuery, MemoryUsage, RegionIndex, indexable};
use crate::geometry::{Aabb, ConvexVolume};
use crate::query::{ItemId, Recorder, Region, Sink};

/// The plain loop over an array of boxes, leaving each box at the first plane
/// that excludes it. O(n) per query.
pub struct Linear {
    boxes: Vec<Aabb>,
    ids: Vec<ItemId>,
}

/// The scan has nothing to choose.
#[derive(Clone, Copy, Default, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearParams {}

impl Linear {
    fn scan<G: Region, S: Sink, R: Recorder>(
        &self,
        region: &G,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let memo = region.start();
        for (b, id) in self.boxes.iter().zip(&self.ids) {
            recorder.items_tested(1);
            if region.admits(b, memo, recorder) {
                sink.accept(std::slice::from_ref(id))?;
            }
        }
        ControlFlow::Continue(())
    }
}

impl RegionIndex for Linear {
    const NAME: &'static str = "linear";
    const SUMMARY: &'static str = "plain scan over all boxes, O(n): the yardstick";
    type Params = LinearParams;

    fn build(items: &[Aabb], _: &LinearParams) -> Result<Self, BuildError> {
        let ids = indexable(items)?;
        let boxes = ids.iter().map(|&id| items[id as usize]).collect();
        Ok(Linear { boxes, ids })
    }

    fn memory(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: 0,
            item_bytes: size_of_val(&self.boxes[..]) + size_of_val(&self.ids[..]),
        }
    }

    fn locate<S: Sink, R: Recorder>(
        &self,
        p: Vec3,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        self.scan(&p, sink, recorder)
    }
}

impl FrustumQuery for Linear {
    fn visible<S: Sink, R: Recorder>(
        &self,
        volume: &ConvexVolume,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        self.scan(volume, sink, recorder)
    }
}
