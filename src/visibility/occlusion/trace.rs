//! A trace of a masked buffer in a view: tiles drawn into and tiles that decide.
//!
//! Replaying it, and nothing else, is the least that the stage can take with such a buffer.

use std::cell::RefCell;

use super::buffer::{CullStats, OcclusionBuffer};
use super::interleaved::Interleaved;
use super::masked::{MaskedInner, Tile};
use super::outline::{Coverage, Outline};
use super::rect::Rect;
use super::scene::OccluderScene;
use super::view::View;
use crate::geometry::xor_of_bits;
use crate::kernel::{Isa, Kernel, LANES};
use crate::visibility::{Guarantee, SampleGrid};

/// The work of one view.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct FrameTrace {
    /// Counts of the view.
    pub stats: CullStats,
    /// Every change of a tile, in its order: which one, and what it became.
    writes: Vec<(u32, Tile)>,
    /// The tiles that answers rest on, in their order: of what is hidden all, of what
    /// is not the first that shows it.
    reads: Vec<u32>,
}

impl FrameTrace {
    /// Traces the interleaved coupling with [`MaskedInner`].
    pub fn of(scene: &OccluderScene, view: &View, kernel: Kernel) -> FrameTrace {
        let traced = Traced::new(view.grid);
        let mut culling = Interleaved::new(traced, kernel);
        let stats = culling.cull(scene, view, &mut Vec::new());
        let buffer = culling.buffer();
        FrameTrace {
            stats,
            writes: buffer.writes.clone(),
            reads: buffer.reads.borrow().clone(),
        }
    }

    /// Reads as many boxes of occluders as were drawn, side by side, 24 bytes each.
    pub fn read_occluders(&self, scene: &OccluderScene) -> u32 {
        let drawn = &scene.all_occluders()[..self.stats.drawn];
        drawn.iter().fold(0, |all, occluder| {
            let [low, high] = occluder.inner.bits();
            all ^ low[0] ^ low[1] ^ low[2] ^ high[0] ^ high[1] ^ high[2]
        })
    }

    /// Clears the buffer and changes its tiles as in this view.
    pub fn replay(&self, buffer: &mut MaskedInner) {
        buffer.clear();
        for (at, tile) in &self.writes {
            buffer.set_tile(*at as usize, tile);
        }
    }

    /// Reads as many boxes of the tree as were tested, side by side, and the tiles that
    /// decided.
    pub fn read_tested(&self, scene: &OccluderScene, buffer: &MaskedInner) -> u32 {
        let boxes = scene.len().min(self.stats.boxes);
        let blocks = &scene.level(0)[..boxes.div_ceil(LANES)];
        self.reads.iter().fold(xor_of_bits(blocks), |all, &at| {
            let tile = buffer.tile(at as usize);
            all ^ tile.reference.to_bits() ^ tile.working.to_bits() ^ tile.mask
        })
    }
}

/// A masked buffer that writes down what happens to it. Slow.
struct Traced {
    buffer: MaskedInner,
    writes: Vec<(u32, Tile)>,
    reads: RefCell<Vec<u32>>,
}

impl OcclusionBuffer for Traced {
    const SUMMARY: &'static str = MaskedInner::SUMMARY;
    const GUARANTEE: Guarantee = MaskedInner::GUARANTEE;
    const COVERAGE: Coverage = MaskedInner::COVERAGE;

    fn new(grid: SampleGrid) -> Traced {
        Traced {
            buffer: MaskedInner::new(grid),
            writes: Vec::new(),
            reads: RefCell::default(),
        }
    }

    fn clear(&mut self) {
        self.buffer.clear();
        self.writes.clear();
        self.reads.borrow_mut().clear();
    }

    fn draw<I: Isa>(&mut self, isa: I, outline: &Outline) {
        let before = self.buffer.clone();
        self.buffer.draw(isa, outline);
        let tiles = (0..before.tiles()).map(|at| (at as u32, self.buffer.tile(at)));
        let changed = tiles.filter(|(at, tile)| before.tile(*at as usize) != *tile);
        self.writes.extend(changed);
    }

    fn hides<I: Isa>(&self, isa: I, rect: &Rect) -> bool {
        let hidden = self.buffer.hides(isa, rect);
        let parts = self.buffer.tiles_of(rect).into_iter();
        let reads = &mut self.reads.borrow_mut();
        match hidden {
            true => reads.extend(parts.map(|(at, _)| at as u32)),
            false => {
                let mut parts = parts.filter(|(_, part)| !self.buffer.hides(isa, part));
                reads.extend(parts.next().map(|(at, _)| at as u32));
            }
        }
        hidden
    }
}
