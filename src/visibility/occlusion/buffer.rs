//! Interface of depth buffers.
//!
//! Occluders are drawn and rectangles are tested, alternately.

use super::outline::Outline;
use super::rect::{Candidate, Rect, Rects};
use super::scene::OccluderTree;
use super::view::View;
use crate::kernel::{Isa, LaneMask};
use crate::visibility::SampleGrid;

/// A depth buffer of occluders.
pub trait OcclusionBuffer {
    /// True if an occluder covers only whole pixels; else it covers pixel centres.
    const COVERS_WHOLE: bool;

    /// Creates an empty buffer.
    fn new(grid: SampleGrid) -> Self;

    /// Empties the buffer.
    fn clear(&mut self);

    /// Draws an occluder.
    fn draw<I: Isa>(&mut self, isa: I, outline: &Outline);

    /// Returns `true` if the buffer is nearer than the rectangle in all its pixels.
    ///
    /// Equal depth does not count as nearer.
    fn hides<I: Isa>(&self, isa: I, rect: &Rect) -> bool;

    /// Tests some boxes of a block; returns the lanes of the hidden ones.
    fn hides_lanes<I: Isa>(&self, isa: I, rects: &Rects, lanes: LaneMask) -> LaneMask;
}

/// Draws the occluders of a candidate; returns the number that cover any pixel.
///
/// Draws none if a ray may enter the candidate's box before the near plane.
#[inline(always)]
pub fn draw<I: Isa, B: OcclusionBuffer>(
    isa: I,
    buffer: &mut B,
    scene: &OccluderTree,
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
        let Some(mut outline) = Outline::of(&occluder.inner, open, view, B::COVERS_WHOLE) else {
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
    /// Projected boxes of nodes and items.
    pub boxes: usize,
    /// Occluders drawn.
    pub drawn: usize,
}
