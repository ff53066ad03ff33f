//! Interleaved coupling: a front-to-back traversal that tests and draws.
//!
//! Tests each block before opening it. Draws large visible items at once; tests items that were
//! found visible early again at the end.
//!
//! Opens the nearest pending block of the whole tree next. Compared with a depth-first order, it
//! draws fewer items that a nearer one hides, and a masked buffer loses less
//! (docs/adr/0021-nearest-block-first.md).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::buffer::{CullStats, OcclusionBuffer, draw};
use super::rect::{Candidate, Rect, Rects};
use super::scene::OccluderTree;
use super::view::View;
use crate::geometry::PlaneMask;
use crate::kernel::{Isa, Kernel, LANES, LaneMask, Work};
use crate::query::{Bits, ItemId};

/// Default of [`Interleaved::drawn_part`]: about one pixel of 320 x 180.
const DEFAULT_DRAWN_PART: u32 = 65_536;

/// Interleaved coupling; reuses its memory from view to view.
#[derive(Clone, Debug)]
pub struct Interleaved<B> {
    /// Depth buffer, as the last view left it.
    pub buffer: B,
    kernel: Kernel,
    /// Survivors are drawn if they may cover 1 / `drawn_part` of the image or more.
    pub(super) drawn_part: u32,
    /// [`key`]s of pending blocks, with their indices among the entries.
    queue: BinaryHeap<Reverse<(u64, u32)>>,
    entries: Vec<Entry>,
    survivors: Vec<Candidate>,
}

/// A block that is not opened yet.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// Box of the block; `position` is the block's number.
    block: Candidate,
    level: u16,
    open: PlaneMask,
    /// Number of occluders drawn before the block's box was tested.
    drawn: u32,
}

/// Sort key of a block: nearest first, at equal depth the lowest level.
///
/// The upper bits hold a lower bound of the block's depth ([`depth_bits`]), the lower bits its
/// level and its number.
#[inline(always)]
fn key(depth: u32, level: u16, block: u32) -> u64 {
    debug_assert!(level < 16 && block >> 28 == 0);
    u64::from(depth) << 32 | u64::from(level) << 28 | u64::from(block)
}

impl<B: OcclusionBuffer> Interleaved<B> {
    /// Couples a buffer with an instruction set.
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

    /// Appends the visible items, roughly nearest first.
    ///
    /// These are the items that no plane of the view's volume excludes, that some ray of the image
    /// may meet, and that are not hidden.
    pub fn cull(&mut self, scene: &OccluderTree, view: &View, out: &mut Vec<ItemId>) -> CullStats {
        self.kernel.run(Cull(self, scene, view, out))
    }
}

struct Cull<'a, B>(
    &'a mut Interleaved<B>,
    &'a OccluderTree,
    &'a View<'a>,
    &'a mut Vec<ItemId>,
);

impl<B: OcclusionBuffer> Work for Cull<'_, B> {
    type Output = CullStats;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> CullStats {
        let Cull(state, scene, view, out) = self;
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
        // Number of survivors after which something was drawn; later ones need no second test.
        let mut early = 0;
        while let Some(Reverse((_, next))) = queue.pop() {
            let entry = entries[next as usize];
            // Occluders may have been drawn since the block was queued.
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
                // Compressing with a full mask stores all words.
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
            // Possible occluders come first, nearest first: they may hide the others.
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
                    // An item is not retested for its own occluders: they cannot hide it.
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

/// Lanes whose boxes may cover at least about `pixels` pixels.
///
/// Rectangles are rounded outward, so their rim pixels are covered in part.
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

/// Sortable bits of a depth; a depth not above 0 maps to 0, the nearest.
#[inline(always)]
fn depth_bits(depth: f32) -> u32 {
    if depth > 0.0 { depth.to_bits() } else { 0 }
}
