//! The depth buffer with a pyramid above it (Greene, Kass, Miller 1993,
//! "Hierarchical z-buffer visibility", SIGGRAPH): each texel of a level is the
//! farthest of four below, and a rectangle is tested at the level where it covers
//! at most two by two of them.

use super::buffer::OcclusionBuffer;
use super::outline::{Coverage, Outline};
use super::rect::Rect;
use super::zbuffer::ZBuffer;
use crate::kernel::Isa;
use crate::visibility::{Guarantee, SampleGrid};

/// A depth buffer and its pyramid, which is built when all has been drawn.
#[derive(Clone, Debug)]
pub struct HierarchicalZ {
    /// The pixels, then a level of texels after the other up to one texel.
    levels: Vec<ZBuffer>,
}

impl OcclusionBuffer for HierarchicalZ {
    const SUMMARY: &'static str = "a depth buffer at pixel centres with a pyramid of the farthest \
                                   (stand-in for Greene, Kass, Miller 1993)";
    const GUARANTEE: Guarantee = Guarantee::Unproven;
    const COVERAGE: Coverage = Coverage::Centre;
    const ALTERNATES: bool = false;

    fn new(mut grid: SampleGrid) -> Self {
        let mut levels = vec![ZBuffer::new(grid)];
        while grid.samples() > 1 {
            grid = SampleGrid::new(grid.width.div_ceil(2), grid.height.div_ceil(2));
            levels.push(ZBuffer::new(grid));
        }
        HierarchicalZ { levels }
    }

    fn clear(&mut self) {
        self.levels[0].clear();
    }

    #[inline(always)]
    fn draw<I: Isa>(&mut self, isa: I, outline: &Outline) {
        self.levels[0].draw(isa, outline);
    }

    fn finish(&mut self) {
        for upper in 1..self.levels.len() {
            let (below, above) = self.levels.split_at_mut(upper);
            above[0].reduce(&below[upper - 1]);
        }
    }

    #[inline(always)]
    fn hides<I: Isa>(&self, _: I, rect: &Rect) -> bool {
        let widest = (rect.x1 - rect.x0).max(rect.y1 - rect.y0);
        // 2^level is above the width less one: at most two texels along it.
        let index = ((16 - widest.leading_zeros()) as usize).min(self.levels.len() - 1);
        let level = &self.levels[index];
        let [x0, x1, y0, y1] =
            [rect.x0, rect.x1, rect.y0, rect.y1].map(|at| usize::from(at) >> index);
        let nearer = |x: usize, y: usize| level.at(x, y) > rect.nearness;
        nearer(x0, y0) && nearer(x1, y0) && nearer(x0, y1) && nearer(x1, y1)
    }
}
