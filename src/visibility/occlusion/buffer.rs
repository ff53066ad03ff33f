//! What all depth buffers of this stage have in common: occluders are drawn into
//! them, and rectangles are asked whether they are hidden.

use super::outline::{Coverage, Outline};
use super::rect::{Rect, Rects};
use crate::kernel::{Isa, LaneMask};
use crate::visibility::{Guarantee, SampleGrid};

/// A buffer that says what lies behind what was drawn.
pub trait OcclusionBuffer {
    /// Its name in tables.
    const NAME: &'static str;
    /// What it is, one line; of code written after a description, which one.
    const SUMMARY: &'static str;
    /// What it promises of the items that it does not hide.
    const GUARANTEE: Guarantee;
    /// Which pixels of an occluder are drawn.
    const COVERAGE: Coverage;
    /// Whether drawing and asking may alternate. If not, [`OcclusionBuffer::finish`]
    /// has to be called in between.
    const ALTERNATES: bool;

    /// A buffer of so many pixels, nothing drawn.
    fn new(grid: SampleGrid) -> Self;

    /// Forgets what was drawn.
    fn clear(&mut self);

    /// Draws an occluder.
    fn draw<I: Isa>(&mut self, isa: I, outline: &Outline);

    /// Everything has been drawn.
    fn finish(&mut self) {}

    /// Whether something that was drawn is nearer than the rectangle in all its
    /// pixels. As near is not nearer.
    fn hides<I: Isa>(&self, isa: I, rect: &Rect) -> bool;

    /// The same for some boxes of a block at once.
    #[inline(always)]
    fn hides_lanes<I: Isa>(&self, isa: I, rects: &Rects, lanes: LaneMask) -> LaneMask {
        let mut hidden = 0;
        let mut left = lanes;
        while left != 0 {
            let lane = left.trailing_zeros();
            left &= left - 1;
            hidden |= LaneMask::from(self.hides(isa, &rects.get(lane as usize))) << lane;
        }
        hidden
    }
}
