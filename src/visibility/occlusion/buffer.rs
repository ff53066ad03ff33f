//! Depth buffers as a contract, and the plain one.
//!
//! Occluders are drawn into them and rectangles are tested, in turn.

use super::outline::{Coverage, Outline};
use super::rect::{Candidate, Rect, Rects};
use super::scene::OccluderScene;
use super::view::View;
use crate::kernel::{Isa, LANES, LaneMask, first_lanes};
use crate::visibility::{Guarantee, SampleGrid};

/// A depth buffer of occluders.
pub trait OcclusionBuffer {
    /// One line for tables; names the source of code written after a description.
    const SUMMARY: &'static str;
    /// Guarantee of the items that it does not hide.
    const GUARANTEE: Guarantee;
    /// The pixels of an occluder that are drawn.
    const COVERAGE: Coverage;

    /// An empty buffer.
    fn new(grid: SampleGrid) -> Self;

    /// Empties the buffer.
    fn clear(&mut self);

    /// Draws an occluder.
    fn draw<I: Isa>(&mut self, isa: I, outline: &Outline);

    /// Returns `true` if what was drawn is nearer than the rectangle in all its pixels.
    ///
    /// Equal depth does not count as nearer.
    fn hides<I: Isa>(&self, isa: I, rect: &Rect) -> bool;

    /// Tests some boxes of a block; returns the lanes of the hidden ones.
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

/// Draws the occluders of a candidate; returns the number that cover any pixel.
///
/// Draws none if a ray may enter the candidate's box before the near plane.
#[inline(always)]
pub fn draw<I: Isa, B: OcclusionBuffer>(
    isa: I,
    buffer: &mut B,
    scene: &OccluderScene,
    view: &View,
    candidate: &Candidate,
) -> usize {
    let position = candidate.position as usize;
    if view.entered_before_near(&scene.outer(position)) {
        return 0;
    }
    let mut drawn = 0;
    for occluder in scene.occluders(position) {
        let open = view.open & occluder.faces;
        let Some(mut outline) = Outline::of(&occluder.inner, open, view, B::COVERAGE) else {
            continue;
        };
        if !candidate.near {
            outline.within(&candidate.rect);
        }
        buffer.draw(isa, &outline);
        drawn += 1;
    }
    drawn
}

/// Counts of one view.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct CullStats {
    /// Boxes of nodes and items that were projected.
    pub boxes: usize,
    /// Occluders drawn.
    pub drawn: usize,
    /// Items that were not removed.
    pub kept: usize,
}

/// Nearness at the centre of each pixel; 0 where nothing was drawn.
#[derive(Clone, Debug)]
pub struct ZBuffer {
    grid: SampleGrid,
    nearness: Vec<f32>,
}

impl OcclusionBuffer for ZBuffer {
    const SUMMARY: &'static str =
        "one depth per pixel, at its centre; every pixel of a box is tested";
    const GUARANTEE: Guarantee = Guarantee::Unproven;
    const COVERAGE: Coverage = Coverage::Centre;

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
        let nearness = outline.per_pixel();
        let (first, end) = outline.rows();
        for row in first..end.min(height) {
            let ([start], [end]) = outline.spans::<1>(row);
            let (start, end) = (start as usize, (end as usize).min(width));
            if start >= end {
                continue;
            }
            let pixels = &mut self.nearness[row * width + start..row * width + end];
            for (i, pixel) in pixels.iter_mut().enumerate() {
                let near = nearness.of((start + i) as u32 as f32, row as f32);
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
}
