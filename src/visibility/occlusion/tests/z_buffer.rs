//! Plain depth buffer, the reference for the masked buffers.
//!
//! One depth per pixel, at its centre; every pixel of a box is tested.

use super::super::buffer::OcclusionBuffer;
use super::super::outline::Outline;
use super::super::rect::{Rect, Rects};
use crate::kernel::{Isa, LANES, LaneMask, first_lanes};
use crate::query::Bits;
use crate::visibility::SampleGrid;

/// Nearness at the centre of each pixel; 0 if nothing is drawn there.
#[derive(Clone, Debug)]
pub struct ZBuffer {
    grid: SampleGrid,
    nearness: Vec<f32>,
}

impl OcclusionBuffer for ZBuffer {
    const COVERS_WHOLE: bool = false;

    fn new(grid: SampleGrid) -> Self {
        ZBuffer {
            grid,
            nearness: vec![0.0; grid.samples() + LANES],
        }
    }

    fn clear(&mut self) {
        self.nearness.fill(0.0);
    }

    #[inline(always)]
    fn draw<I: Isa>(&mut self, _: I, outline: &Outline) {
        let (width, height) = (self.grid.width as usize, self.grid.height as usize);
        let nearness = outline.per_tile();
        let (first, end) = outline.rows();
        for row in first..end.min(height) {
            let ([start], [end]) = outline.spans::<1>(row);
            let (start, end) = (start as usize, (end as usize).min(width));
            if start >= end {
                continue;
            }
            let pixels = &mut self.nearness[row * width + start..row * width + end];
            for (i, pixel) in pixels.iter_mut().enumerate() {
                let [x, y] = [start + i, row].map(|at| at as f32 + 0.5);
                let near = nearness.within([x, x], [y, y]);
                *pixel = if near > *pixel { near } else { *pixel };
            }
        }
    }

    #[inline(always)]
    fn hides<I: Isa>(&self, isa: I, rect: &Rect) -> bool {
        let width = self.grid.width as usize;
        let nearness = isa.splat(rect.nearness);
        let (first, end) = (usize::from(rect.x0), usize::from(rect.x1) + 1);
        for row in usize::from(rect.y0)..usize::from(rect.y1) + 1 {
            for column in (first..end).step_by(LANES) {
                let at = row * width + column;
                let Some(pixels) = self.nearness[at..].first_chunk() else {
                    return false;
                };
                let passed = isa.at_most(isa.load(pixels), nearness);
                if passed & first_lanes(end - column) != 0 {
                    return false;
                }
            }
        }
        true
    }

    #[inline(always)]
    fn hides_lanes<I: Isa>(&self, isa: I, rects: &Rects, lanes: LaneMask) -> LaneMask {
        Bits(lanes.into()).fold(0, |hidden, lane| {
            hidden | LaneMask::from(self.hides(isa, &rects.get(lane as usize))) << lane
        })
    }
}
