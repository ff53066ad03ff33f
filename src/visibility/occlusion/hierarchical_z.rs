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
    pixels: ZBuffer,
    levels: Vec<Level>,
}

#[derive(Clone, Debug)]
struct Level {
    width: usize,
    height: usize,
    nearness: Vec<f32>,
}

impl OcclusionBuffer for HierarchicalZ {
    const NAME: &'static str = "hierarchical-z";
    const SUMMARY: &'static str = "a depth buffer at pixel centres with a pyramid of the farthest \
                                   (stand-in for Greene, Kass, Miller 1993)";
    const GUARANTEE: Guarantee = Guarantee::Unproven;
    const COVERAGE: Coverage = Coverage::Centre;
    const ALTERNATES: bool = false;

    fn new(grid: SampleGrid) -> Self {
        let mut size = (grid.width as usize, grid.height as usize);
        let mut levels = Vec::new();
        loop {
            levels.push(Level {
                width: size.0,
                height: size.1,
                nearness: vec![0.0; size.0 * size.1],
            });
            if size.0 * size.1 <= 1 {
                break;
            }
            size = (size.0.div_ceil(2), size.1.div_ceil(2));
        }
        HierarchicalZ {
            pixels: ZBuffer::new(grid),
            levels,
        }
    }

    fn clear(&mut self) {
        self.pixels.clear();
    }

    #[inline(always)]
    fn draw<I: Isa>(&mut self, isa: I, outline: &Outline) {
        self.pixels.draw(isa, outline);
    }

    fn finish(&mut self) {
        let Some((pixels, _)) = self.levels.split_first_mut() else {
            return;
        };
        let count = pixels.nearness.len();
        pixels
            .nearness
            .copy_from_slice(&self.pixels.nearness()[..count]);
        for upper in 1..self.levels.len() {
            let (below, above) = self.levels.split_at_mut(upper);
            if let (Some(below), Some(above)) = (below.last(), above.first_mut()) {
                above.reduce(below);
            }
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
        let nearer = |x: usize, y: usize| level.nearness[y * level.width + x] > rect.nearness;
        nearer(x0, y0) && nearer(x1, y0) && nearer(x0, y1) && nearer(x1, y1)
    }
}

impl Level {
    /// Each texel from the four below it, or as many as there are.
    fn reduce(&mut self, below: &Level) {
        for y in 0..self.height {
            let rows = [2 * y, (2 * y + 1).min(below.height - 1)].map(|row| row * below.width);
            for x in 0..self.width {
                let columns = [2 * x, (2 * x + 1).min(below.width - 1)];
                let at = |row: usize, column: usize| below.nearness[row + column];
                let upper = at(rows[0], columns[0]).min(at(rows[0], columns[1]));
                let lower = at(rows[1], columns[0]).min(at(rows[1], columns[1]));
                self.nearness[y * self.width + x] = upper.min(lower);
            }
        }
    }
}
