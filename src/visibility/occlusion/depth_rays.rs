//! One depth ray for each block of pixels, as the Godot engine's raycast occlusion
//! has it: what lies behind the depths of all rays in its rectangle is hidden.
//!
//! A ray's depth is what drawing its one sample gives, so occluders are drawn here,
//! at one pixel a block; only the speed of casting rays is not that of the engine.

use super::buffer::OcclusionBuffer;
use super::outline::{Coverage, Outline};
use super::rect::Rect;
use crate::kernel::Isa;
use crate::visibility::{Guarantee, SampleGrid};

/// One ray through the middle of each block of `SIZE` x `SIZE` pixels.
#[derive(Clone, Debug)]
pub struct DepthRays<const SIZE: usize> {
    columns: usize,
    rows: usize,
    nearness: Vec<f32>,
}

impl<const SIZE: usize> OcclusionBuffer for DepthRays<SIZE> {
    const NAME: &'static str = "rays";
    const SUMMARY: &'static str =
        "one depth ray a block of pixels (stand-in for the occlusion culling of Godot Engine 4)";
    const GUARANTEE: Guarantee = Guarantee::Unproven;
    const COVERAGE: Coverage = Coverage::Centre;
    const ALTERNATES: bool = true;

    fn new(grid: SampleGrid) -> Self {
        let columns = (grid.width as usize).div_ceil(SIZE);
        let rows = (grid.height as usize).div_ceil(SIZE);
        DepthRays {
            columns,
            rows,
            nearness: vec![0.0; columns * rows],
        }
    }

    fn clear(&mut self) {
        self.nearness.fill(0.0);
    }

    #[inline(always)]
    fn draw<I: Isa>(&mut self, _: I, outline: &Outline) {
        let nearness = outline.per_pixel();
        let (first, end) = outline.rows();
        for row in 0..self.rows {
            let y = row * SIZE + SIZE / 2;
            if y < first || y >= end {
                continue;
            }
            let ([start], [end]) = outline.spans::<1>(y);
            for column in 0..self.columns {
                let x = column * SIZE + SIZE / 2;
                if (start as usize..end as usize).contains(&x) {
                    let near = nearness.of(x as f32, y as f32);
                    let depth = &mut self.nearness[row * self.columns + column];
                    *depth = depth.max(near);
                }
            }
        }
    }

    #[inline(always)]
    fn hides<I: Isa>(&self, _: I, rect: &Rect) -> bool {
        let block = |at: u16| usize::from(at) / SIZE;
        let mut blocks = (block(rect.y0)..block(rect.y1) + 1).flat_map(|row| {
            let at = row * self.columns;
            at + block(rect.x0)..at + block(rect.x1) + 1
        });
        blocks.all(|at| self.nearness[at] > rect.nearness)
    }
}
