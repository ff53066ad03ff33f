//! The linear scans: no structure at all, every box against every plane, O(n).
//! `linear-scalar` is the textbook loop and the yardstick of every ratio;
//! `linear` is the same answer from blocks of sixteen boxes.

use std::ops::ControlFlow;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::tree::{scan_blocks, visible_on_baseline};
use super::{BuildError, FrustumQuery, MemoryUsage, RegionIndex, indexable};
use crate::geometry::{Aabb, BoxBlocks, LANES, PlaneTree, lanes_of};
use crate::kernel::{BASELINE, Isa};
use crate::query::{ItemId, Recorder, Region, Sink, View};

/// A scan has nothing to choose.
#[derive(Clone, Copy, Default, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearParams {}

/// The plain loop over an array of boxes, leaving each box at the first plane
/// that excludes it. O(n) per query.
pub struct LinearScalar {
    boxes: Vec<Aabb>,
    ids: Vec<ItemId>,
}

impl LinearScalar {
    #[inline(always)]
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

impl RegionIndex for LinearScalar {
    const NAME: &'static str = "linear-scalar";
    const SUMMARY: &'static str = "the textbook loop over all boxes, O(n): the yardstick";
    type Params = LinearParams;

    fn build(items: &[Aabb], _: Option<&PlaneTree>, _: &LinearParams) -> Result<Self, BuildError> {
        let ids = indexable(items)?;
        let boxes = ids.iter().map(|&id| items[id as usize]).collect();
        Ok(LinearScalar { boxes, ids })
    }

    fn memory(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: 0,
            item_bytes: size_of_val(&self.boxes[..]) + size_of_val(&self.ids[..]),
        }
    }

    #[inline(always)]
    fn locate<S: Sink, R: Recorder>(
        &self,
        p: Vec3,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        self.scan(&p, sink, recorder)
    }
}

impl FrustumQuery for LinearScalar {
    #[inline(always)]
    fn visible<V: View, S: Sink, R: Recorder>(
        &self,
        view: &V,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        self.scan(view, sink, recorder)
    }
}

/// The scan over blocks: all planes against sixteen boxes at once, no early
/// way out. O(n) per query, with a constant several times smaller.
pub struct Linear {
    boxes: BoxBlocks,
    ids: Vec<ItemId>,
}

impl Linear {
    #[inline(always)]
    fn scan<I: Isa, G: Region, S: Sink, R: Recorder>(
        &self,
        isa: I,
        region: &G,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let blocks = self.boxes.range(0, self.ids.len());
        scan_blocks(
            isa,
            blocks,
            &self.ids,
            region,
            region.start(),
            sink,
            recorder,
        )
    }
}

impl RegionIndex for Linear {
    const NAME: &'static str = "linear";
    const SUMMARY: &'static str = "scan over blocks of sixteen boxes, O(n)";
    type Params = LinearParams;

    fn build(items: &[Aabb], _: Option<&PlaneTree>, _: &LinearParams) -> Result<Self, BuildError> {
        let ids = indexable(items)?;
        let mut boxes = BoxBlocks::with_capacity(ids.len());
        ids.iter().for_each(|&id| boxes.push(&items[id as usize]));
        Ok(Linear { boxes, ids })
    }

    fn memory(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: 0,
            item_bytes: self.boxes.bytes() + size_of_val(&self.ids[..]),
        }
    }

    #[inline(always)]
    fn locate<S: Sink, R: Recorder>(
        &self,
        p: Vec3,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        self.scan(BASELINE, &p, sink, recorder)
    }
}

impl FrustumQuery for Linear {
    visible_on_baseline!();

    #[inline(always)]
    fn visible_by<I: Isa, V: View, S: Sink, R: Recorder>(
        &self,
        isa: I,
        view: &V,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        // Four blocks at a time: with all planes open it is the making ready of
        // the planes' numbers that costs, not the boxes.
        let (fours, rest) = self.boxes.blocks().as_chunks();
        let (mask, count) = (view.mask(), self.ids.len());
        let planes = mask.count_ones();
        for (four, blocks) in fours.iter().enumerate() {
            let first = 4 * four;
            let kept = view.kept_of_four(isa, blocks, mask);
            for (i, kept) in kept.into_iter().enumerate() {
                let lanes = lanes_of(first + i, 0, count);
                recorder.items_tested(lanes.count_ones());
                recorder.planes_tested(lanes.count_ones() * planes);
                if kept & lanes != 0 {
                    sink.accept_lanes(isa, &self.ids, (first + i) * LANES, kept & lanes)?;
                }
            }
        }
        let first = self.boxes.len().div_ceil(LANES) - rest.len();
        let rest = self.boxes.range(first * LANES, count);
        scan_blocks(isa, rest, &self.ids, view, mask, sink, recorder)
    }
}
