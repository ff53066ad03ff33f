//! What a masked buffer is asked to do in one view, written down: the tiles that are
//! drawn into and those that decide. Doing that again, and nothing else, is the least
//! that the stage can take with such a buffer.

use std::cell::RefCell;

use super::buffer::{OcclusionBuffer, Origin};
use super::interleaved::Interleaved;
use super::masked::{MaskedInner, Tile};
use super::outline::{Coverage, Outline};
use super::rect::Rect;
use super::scene::OccluderScene;
use super::stats::CullStats;
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
    /// Of the interleaved coupling with [`MaskedInner`].
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

    /// Reads the boxes of the occluders that were drawn, 24 bytes each: as many, side by
    /// side.
    pub fn read_occluders(&self, scene: &OccluderScene) -> u32 {
        let drawn = (0..self.stats.drawn).map(|position| scene.inner(position));
        drawn.fold(0, |all, b| {
            let [low, high] = [b.min, b.max].map(|corner| corner.to_array().map(f32::to_bits));
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
    const NAME: &'static str = MaskedInner::NAME;
    const SUMMARY: &'static str = MaskedInner::SUMMARY;
    const GUARANTEE: Guarantee = MaskedInner::GUARANTEE;
    const ORIGIN: Origin = MaskedInner::ORIGIN;
    const COVERAGE: Coverage = MaskedInner::COVERAGE;
    const ALTERNATES: bool = MaskedInner::ALTERNATES;

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
        let parts = self.buffer.tiles_of(rect);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::PlaneOptions;
    use crate::path::{self, LensDefaults};
    use crate::scene::load;
    use crate::visibility::{Rays, Solids};

    #[test]
    fn a_view_done_again_leaves_the_same_buffer() {
        let scene = load("city:n=3000", &Default::default()).unwrap();
        let solids = Solids::of(&scene);
        let occluders = OccluderScene::of(&solids);
        let path = path::load("street:frames=3", &scene, &LensDefaults::default()).unwrap();
        let grid = SampleGrid::new(96, 54);
        let mut drawn_in_all = 0;
        for camera in &path.cameras {
            let rays = Rays::of(camera).unwrap();
            let volume = camera.volume(&PlaneOptions::default(), &scene.surroundings());
            let volume = volume.unwrap();
            let view = View::new(&rays, &volume, &occluders, grid);
            let trace = FrameTrace::of(&occluders, &view, Kernel::best());
            let mut culling = Interleaved::new(MaskedInner::new(grid), Kernel::best());
            assert_eq!(
                culling.cull(&occluders, &view, &mut Vec::new()),
                trace.stats
            );
            drawn_in_all += trace.stats.drawn;
            let drawn = culling.buffer();
            let mut again = MaskedInner::new(grid);
            trace.replay(&mut again);
            let tiles = |b: &MaskedInner| (0..b.tiles()).map(|at| b.tile(at)).collect::<Vec<_>>();
            assert_eq!(tiles(&again), tiles(drawn));
            // No tile changes that no occluder has, and one that is full is never reset.
            assert!(
                trace
                    .writes
                    .iter()
                    .all(|(_, tile)| tile.reference > 0.0 || tile.mask != 0)
            );
            assert!(trace.reads.iter().all(|&at| (at as usize) < again.tiles()));
            // Kept from being thrown away, and of what was there.
            assert_eq!(
                trace.read_tested(&occluders, &again) != 0,
                trace.stats.boxes > 0
            );
            assert_eq!(trace.read_occluders(&occluders) != 0, trace.stats.drawn > 0);
        }
        assert!(drawn_in_all > 10, "{drawn_in_all}");
    }

    #[test]
    fn a_rectangle_is_cut_into_the_tiles_that_it_meets() {
        let buffer = MaskedInner::new(SampleGrid::new(64, 36));
        let nearness = 0.5;
        let rect = Rect {
            x0: 7,
            x1: 17,
            y0: 3,
            y1: 4,
            nearness,
        };
        let parts: Vec<_> = buffer.tiles_of(&rect).collect();
        assert_eq!(
            parts.iter().map(|(at, _)| *at).collect::<Vec<_>>(),
            [0, 1, 2, 8, 9, 10]
        );
        assert_eq!(
            parts.iter().map(|(_, part)| part.area()).sum::<u32>(),
            rect.area()
        );
        assert_eq!(
            parts[4].1,
            Rect {
                x0: 8,
                x1: 15,
                y0: 4,
                y1: 4,
                nearness
            }
        );
    }
}
