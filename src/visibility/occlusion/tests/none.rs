//! No occlusion: the baseline that removes nothing hidden.

use super::super::buffer::OcclusionBuffer;
use super::super::outline::Outline;
use super::super::rect::{Rect, Rects};
use crate::kernel::{Isa, LaneMask};
use crate::visibility::SampleGrid;

/// A buffer that hides nothing.
///
/// The couplings still remove boxes that no ray of the image can meet.
#[derive(Clone, Copy, Default, Debug)]
pub struct NoOcclusion;

impl OcclusionBuffer for NoOcclusion {
    const COVERS_WHOLE: bool = true;

    fn new(_: SampleGrid) -> Self {
        NoOcclusion
    }

    fn clear(&mut self) {}

    #[inline(always)]
    fn draw<I: Isa>(&mut self, _: I, _: &Outline) {}

    #[inline(always)]
    fn hides<I: Isa>(&self, _: I, _: &Rect) -> bool {
        false
    }

    #[inline(always)]
    fn hides_lanes<I: Isa>(&self, _: I, _: &Rects, _: LaneMask) -> LaneMask {
        0
    }
}
