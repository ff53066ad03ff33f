//! The interleaved coupling: a front-to-back traversal that tests and draws.
//!
//! Blocks are tested before they are opened. Large visible items are drawn at once; items
//! that were found visible early are tested again at the end.
//!
//! The nearest open block of the whole tree comes next. Compared with a depth-first order,
//! fewer items are drawn that a nearer one hides, and a masked buffer loses less
//! (docs/adr/0021-nearest-block-first.md).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::buffer::{CullStats, OcclusionBuffer, draw};
use super::rect::{Candidate, Rect, Rects};
use super::scene::OccluderScene;
use super::view::View;
use crate::geometry::PlaneMask;
use crate::kernel::{Isa, Kernel, LANES, LaneMask, Work};
use crate::query::{Bits, ItemId};

/// Survivors are drawn that may cover at least this part of the image: a pixel of
/// 320 x 180.
const DEFAULT_DRAWN_PART: u32 = 65_536;

/// The interleaved coupling, with memory that is kept from view to view.
#[derive(Clone, Debug)]
pub struct Interleaved<B> {
    /// The buffer as the last view left it.
    pub buffer: B,
    kernel: Kernel,
    /// Survivors are drawn that may cover at least the image's pixels divided by this.
    pub(super) drawn_part: u32,
    /// The [`key`]s of blocks and their places among the entries.
    queue: BinaryHeap<Reverse<(u64, u32)>>,
    entries: Vec<Entry>,
    survivors: Vec<Candidate>,
}

/// A block that is still to be opened.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// Its box; its number is the position.
    block: Candidate,
    level: u16,
    open: PlaneMask,
    /// How many occluders had been drawn when the rectangle was looked at.
    drawn: u32,
}

/// The nearest block comes first; of as near ones the first of the lowest level.
///
/// Upper bits a depth that is not above the block's ([`depth_bits`]), lower ones its level
/// and its number.
#[inline(always)]
fn key(depth: u32, level: u16, block: u32) -> u64 {
    debug_assert!(level < 16 && block >> 28 == 0);
    u64::from(depth) << 32 | u64::from(level) << 28 | u64::from(block)
}

impl<B: OcclusionBuffer> Interleaved<B> {
    /// With a buffer, on an instruction set.
    pub fn new(buffer: B, kernel: Kernel) -> Interleaved<B> {
        Interleaved {
            buffer,
            kernel,
            drawn_part: DEFAULT_DRAWN_PART,
            queue: BinaryHeap::new(),
            entries: Vec::new(),
            survivors: Vec::new(),
        }
    }

    /// Appends the items that no plane of the view's volume excludes, that some ray
    /// of the image may meet and that are not hidden; the nearest come first,
    /// roughly.
    pub fn cull(&mut self, scene: &OccluderScene, view: &View, out: &mut Vec<ItemId>) -> CullStats {
        self.kernel.run(Walk(self, scene, view, out))
    }
}

struct Walk<'a, B>(
    &'a mut Interleaved<B>,
    &'a OccluderScene,
    &'a View<'a>,
    &'a mut Vec<ItemId>,
);

impl<B: OcclusionBuffer> Work for Walk<'_, B> {
    type Output = CullStats;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> CullStats {
        let Walk(state, scene, view, out) = self;
        let mut stats = CullStats::default();
        if scene.len() == 0 {
            return stats;
        }
        let pixels = view.grid.width * view.grid.height;
        let least_area = (pixels / state.drawn_part).max(1);
        let (buffer, queue) = (&mut state.buffer, &mut state.queue);
        let (entries, survivors) = (&mut state.entries, &mut state.survivors);
        buffer.clear();
        survivors.clear();
        queue.clear();
        queue.push(Reverse((0, 0)));
        entries.clear();
        entries.push(Entry {
            block: Candidate {
                rect: Rect::default(),
                position: 0,
                near: true,
            },
            level: (scene.levels.len() - 1) as u16,
            open: view.volume.mask(),
            drawn: 0,
        });
        let mut rects = Rects::default();
        let mut open = [0; LANES];
        // Survivors that something was drawn after; the others were tested against all of it.
        let mut early = 0;
        while let Some(Reverse((_, place))) = queue.pop() {
            let entry = entries[place as usize];
            // Much may have been drawn since it was put there.
            let again = !entry.block.near && entry.drawn < stats.drawn as u32;
            if again && buffer.hides(isa, &entry.block.rect) {
                continue;
            }
            let (level, index) = (usize::from(entry.level), entry.block.position as usize);
            let block = &scene.levels[level].blocks()[index];
            let mut lanes = scene.lanes(level, index);
            if level > 0 {
                let (kept, words) = block.sorted_by(isa, view.volume, entry.open);
                lanes &= kept;
                // The words leave the vector by a row that adds nothing to them.
                isa.compress(&mut open, words, LaneMask::MAX);
            } else {
                lanes &= block.admitted_by(isa, view.volume, entry.open);
            }
            if lanes == 0 {
                continue;
            }
            rects.project(isa, block, view);
            stats.boxes += lanes.count_ones() as usize;
            let (seen, flat) = (rects.seen, rects.flat);
            lanes &= seen;
            lanes &= !buffer.hides_lanes(isa, &rects, lanes & flat);
            let below = |lane: usize| rects.candidate(lane, index * LANES + lane);
            if level > 0 {
                for lane in Bits(lanes.into()) {
                    let lane = lane as usize;
                    let (level, block) = (entry.level - 1, below(lane));
                    let key = key(depth_bits(rects.depth[lane]), level, block.position);
                    queue.push(Reverse((key, entries.len() as u32)));
                    entries.push(Entry {
                        block,
                        level,
                        open: open[lane],
                        drawn: stats.drawn as u32,
                    });
                }
                continue;
            }
            // Occluders come first, the nearest before the others: they may hide them.
            let large = lanes & (!flat | coverable_from(isa, &rects, B::COVERS_WHOLE, least_area));
            let mut order = [0; LANES];
            let count = by_depth(&rects.depth, large, &mut order);
            let mut drawn = 0;
            for &key in &order[..count] {
                let item = below((key & 15) as usize);
                if drawn > 0 && !item.near && buffer.hides(isa, &item.rect) {
                    continue;
                }
                survivors.push(item);
                let own = draw(isa, buffer, scene, view, &item);
                if own > 0 {
                    // No item hides itself.
                    early = survivors.len() - 1;
                }
                drawn += own;
            }
            let mut left = lanes & !large;
            if drawn > 0 {
                left &= !buffer.hides_lanes(isa, &rects, left);
            }
            for lane in Bits(left.into()) {
                survivors.push(below(lane as usize));
            }
            stats.drawn += drawn;
        }
        let (early, late) = survivors.split_at(early);
        for sixteen in early.chunks(LANES) {
            let mut asked: LaneMask = 0;
            for (lane, survivor) in sixteen.iter().enumerate() {
                rects.set(lane, &survivor.rect);
                asked |= LaneMask::from(!survivor.near) << lane;
            }
            let hidden = buffer.hides_lanes(isa, &rects, asked);
            for (lane, survivor) in sixteen.iter().enumerate() {
                if hidden >> lane & 1 == 0 {
                    out.extend(scene.item(survivor.position as usize));
                }
            }
        }
        for survivor in late {
            out.extend(scene.item(survivor.position as usize));
        }
        stats
    }
}

/// Sorts lanes by depth; returns their number.
///
/// Each entry is the upper bits of the depth, then the lane.
#[inline(always)]
fn by_depth(depth: &[f32; LANES], lanes: LaneMask, order: &mut [u32; LANES]) -> usize {
    let mut count = 0;
    for lane in Bits(lanes.into()) {
        let key = depth_bits(depth[lane as usize]) & !15 | lane;
        let mut at = count;
        while at > 0 && order[at - 1] > key {
            order[at] = order[at - 1];
            at -= 1;
        }
        order[at] = key;
        count += 1;
    }
    count
}

/// The lanes whose boxes may cover at least `pixels` pixels, about.
///
/// A rectangle is rounded outward, so the pixels at its rim are covered in part.
#[inline(always)]
fn coverable_from<I: Isa>(isa: I, rects: &Rects, whole: bool, pixels: u32) -> LaneMask {
    let rim = i32::from(whole);
    let mut enough = [0; LANES];
    for (lane, enough) in enough.iter_mut().enumerate() {
        let across = (rects.x1[lane] - rects.x0[lane] - rim).max(0) as u32;
        let down = (rects.y1[lane] - rects.y0[lane] - rim).max(0) as u32;
        *enough = u32::from(across * down >= pixels);
    }
    !isa.equal(isa.words(&enough), 0)
}

/// Bits of a float grow with it from zero on; what is before the eye comes first.
#[inline(always)]
fn depth_bits(depth: f32) -> u32 {
    if depth > 0.0 { depth.to_bits() } else { 0 }
}
