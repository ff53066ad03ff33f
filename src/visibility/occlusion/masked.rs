//! Masked depth buffers: two depths and one bit per pixel in tiles of 8 x 4.
//!
//! Hasselgren, Andersson, Akenine-Moeller 2016, "Masked software occlusion culling", High
//! Performance Graphics. 12 bytes per tile.
//!
//! The layout and the merge rule are the paper's; everything else differs (outlines instead of
//! triangles, for one). The two back ends differ only in their coverage rule.

use super::buffer::OcclusionBuffer;
use super::outline::{Nearness, Outline};
use super::rect::{Rect, Rects};
use super::view::{TILE_HEIGHT, TILE_WIDTH};
use crate::kernel::{Isa, LANES, LaneMask, each, first_lanes, pairs};
use crate::query::Bits;
use crate::visibility::SampleGrid;

/// Pixel mask of a tile: bit `8 * row + column`.
type Mask = u32;

/// Masked buffer that covers whole pixels only (`WHOLE`) or pixel centres.
///
/// Nearness grows towards the eye; 0 is infinitely far. Per tile, occluders cover all pixels at
/// nearness `reference` or more, and the pixels of `mask` at `working` or more.
#[derive(Clone, Debug)]
pub struct Masked<const WHOLE: bool> {
    columns: usize,
    rows: usize,
    reference: Vec<f32>,
    working: Vec<f32>,
    mask: Vec<Mask>,
}

/// Covers only whole pixels: no visible item is ever lost.
///
/// A pixel hides what is behind it only if an occluder covers it wholly.
pub type MaskedInner = Masked<true>;

/// Covers pixel centres: items visible between centres are lost.
pub type MaskedCentre = Masked<false>;

impl<const WHOLE: bool> OcclusionBuffer for Masked<WHOLE> {
    const COVERS_WHOLE: bool = WHOLE;

    fn new(grid: SampleGrid) -> Self {
        let columns = (grid.width as usize).div_ceil(TILE_WIDTH);
        let rows = (grid.height as usize).div_ceil(TILE_HEIGHT);
        // Padding, so that a chunk that starts at the last tile is complete.
        let tiles = columns * rows + LANES;
        Masked {
            columns,
            rows,
            reference: vec![0.0; tiles],
            working: vec![0.0; tiles],
            mask: vec![0; tiles],
        }
    }

    fn clear(&mut self) {
        self.reference.fill(0.0);
        self.working.fill(0.0);
        self.mask.fill(0);
    }

    #[inline(always)]
    fn draw<I: Isa>(&mut self, isa: I, outline: &Outline) {
        let nearness = outline.per_tile();
        let (first, end) = outline.rows();
        let mut row = first / TILE_HEIGHT;
        let last = end.div_ceil(TILE_HEIGHT).min(self.rows);
        while row < last {
            let (starts, ends) = outline.spans::<16>(row * TILE_HEIGHT);
            let tiles = pairs(starts.as_chunks().0, ends.as_chunks().0).enumerate();
            for (i, (start, end)) in tiles.take(last - row) {
                self.draw_row(isa, row + i, start, end, &nearness);
            }
            row += 4;
        }
    }

    #[inline(always)]
    fn hides<I: Isa>(&self, isa: I, rect: &Rect) -> bool {
        let nearness = isa.splat(rect.nearness);
        let first = usize::from(rect.x0) / TILE_WIDTH;
        let last = usize::from(rect.x1) / TILE_WIDTH;
        for row in usize::from(rect.y0) / TILE_HEIGHT..usize::from(rect.y1) / TILE_HEIGHT + 1 {
            for column in (first..last + 1).step_by(LANES) {
                let at = row * self.columns + column;
                let Some(reference) = self.reference[at..].first_chunk::<LANES>() else {
                    return false;
                };
                // The reference depth of the tile usually decides.
                let passed = isa.at_most(isa.load(reference), nearness);
                for i in Bits((passed & first_lanes(last + 1 - column)).into()) {
                    let i = i as usize;
                    let pixels = pixels_of(rect, column + i, row);
                    let shown = pixels & !self.mask[at + i] != 0;
                    let behind = self.working[at + i] > rect.nearness;
                    if shown | !behind {
                        return false;
                    }
                }
            }
        }
        true
    }

    /// Tests boxes of up to 2 x 2 tiles all together, larger ones one by one.
    ///
    /// Most boxes are small.
    #[inline(always)]
    fn hides_lanes<I: Isa>(&self, isa: I, rects: &Rects, lanes: LaneMask) -> LaneMask {
        if lanes == 0 {
            return 0;
        }
        let (mut across, mut down) = ([0; LANES], [0; LANES]);
        for lane in 0..LANES {
            across[lane] = ((rects.x1[lane] >> 3) - (rects.x0[lane] >> 3)) as u32;
            down[lane] = ((rects.y1[lane] >> 2) - (rects.y0[lane] >> 2)) as u32;
        }
        let mut large = [0; LANES];
        for lane in 0..LANES {
            large[lane] = (across[lane] | down[lane]) & !1;
        }
        let small = lanes & isa.equal(isa.words(&large), 0);
        let wide = !isa.equal(isa.words(&across), 0);
        let high = !isa.equal(isa.words(&down), 0);
        let mut hidden = small;
        // The lower row of tiles is tested if it differs from the upper one.
        for (y, other) in [(&rects.y0, LaneMask::MAX), (&rects.y1, high)] {
            let asked = hidden & other;
            if asked != 0 {
                hidden &= !asked | self.hidden_in_row(isa, rects, asked, wide, y);
            }
        }
        for lane in Bits((lanes & !small).into()) {
            hidden |= LaneMask::from(self.hides(isa, &rects.get(lane as usize))) << lane;
        }
        hidden
    }
}

impl<const WHOLE: bool> Masked<WHOLE> {
    /// Lanes that are hidden in the row of tiles that contains the pixel rows `y`.
    ///
    /// Tests two tiles of the row for `wide` lanes, else one.
    #[inline(always)]
    fn hidden_in_row<I: Isa>(
        &self,
        isa: I,
        rects: &Rects,
        lanes: LaneMask,
        wide: LaneMask,
        y: &[i32; LANES],
    ) -> LaneMask {
        let columns = self.columns as i32;
        let mut at = [0; LANES];
        for lane in 0..LANES {
            at[lane] = ((y[lane] >> 2) * columns + (rects.x0[lane] >> 3)) as u32;
        }
        let nearness = isa.load(&rects.nearness);
        let [left, right] = isa.pairs(&self.reference, &at);
        let (left, right) = (isa.at_most(left, nearness), isa.at_most(right, nearness));
        let open = [left & lanes, right & (lanes & wide)];
        if open == [0; 2] {
            return lanes;
        }
        // The reference did not decide: test the working layer and its pixels.
        let working = isa.pairs(&self.working, &at);
        let mut hidden = lanes;
        for side in 0..2 {
            let behind = open[side] & !isa.at_most(working[side], nearness);
            hidden &= !open[side] | behind;
            if behind == 0 {
                continue;
            }
            let mut masks = [0; LANES];
            for lane in Bits(behind.into()) {
                let lane = lane as usize;
                masks[lane] = self.mask[at[lane] as usize + side];
            }
            // The results of the other lanes are unspecified.
            let mut shown = [0; LANES];
            for lane in 0..LANES {
                let first_column = (rects.x0[lane] & !7) + (side * TILE_WIDTH) as i32;
                let first_row = y[lane] & !3;
                let left = (rects.x0[lane] - first_column).max(0) as u32;
                let right = (rects.x1[lane] - first_column).min(7) as u32;
                let top = (rects.y0[lane] - first_row).max(0) as u32;
                let bottom = (rects.y1[lane] - first_row).min(3) as u32;
                let row =
                    0xffu32.wrapping_shl(left) & 0xffu32.wrapping_shr(7u32.wrapping_sub(right));
                let above = Mask::MAX.wrapping_shl(top.wrapping_mul(8));
                let below = Mask::MAX.wrapping_shr(3u32.wrapping_sub(bottom).wrapping_mul(8));
                shown[lane] = (row * 0x0101_0101) & above & below & !masks[lane];
            }
            hidden &= !behind | isa.equal(isa.words(&shown), 0);
        }
        hidden
    }

    /// Draws one row of tiles.
    ///
    /// `start` and `end` are the first column and the one past the last of each of its four pixel
    /// rows.
    #[inline(always)]
    fn draw_row<I: Isa>(
        &mut self,
        isa: I,
        row: usize,
        start: &[i32; TILE_HEIGHT],
        end: &[i32; TILE_HEIGHT],
        nearness: &Nearness,
    ) {
        let (mut least, mut greatest) = (i32::MAX, 0);
        let (mut top, mut bottom) = (TILE_HEIGHT, 0);
        for line in 0..TILE_HEIGHT {
            let (start, end) = (start[line], end[line]);
            if start < end {
                least = least.min(start);
                greatest = greatest.max(end);
                top = top.min(line);
                bottom = line + 1;
            }
        }
        if least >= greatest {
            return;
        }
        let lines = each([top, bottom], |line| (row * TILE_HEIGHT + line) as f32);
        let (lowest, highest) = (least as f32, greatest as f32);
        let first = least as usize / TILE_WIDTH;
        let last = (greatest as usize).div_ceil(TILE_WIDTH);
        for column in (first..last).step_by(LANES) {
            let at = row * self.columns + column;
            let Some(reference) = self.reference[at..].first_chunk::<LANES>() else {
                return;
            };
            let mut near = [0.0; LANES];
            for i in 0..LANES {
                let left = (column * TILE_WIDTH) as f32 + TILE_COLUMNS[i];
                let right = left + TILE_WIDTH as f32;
                let left = if left > lowest { left } else { lowest };
                let right = if right < highest { right } else { highest };
                near[i] = nearness.within([left, right], lines);
            }
            // Fully covered by something nearer, the usual case front to back.
            let below = isa.at_most(isa.load(&near), isa.load(reference));
            let adds = !below & first_lanes(last - column);
            for half in 0..2 {
                if adds >> (CHUNK * half) & 0xff == 0 {
                    continue;
                }
                let at = at + CHUNK * half;
                let left = ((column + CHUNK * half) * TILE_WIDTH) as i32;
                let mut layer = Layer {
                    mask: [0; CHUNK],
                    near: [0.0; CHUNK],
                };
                for i in 0..CHUNK {
                    layer.mask[i] = pixels_between(start, end, left + (i * TILE_WIDTH) as i32);
                    layer.near[i] = near[CHUNK * half + i];
                }
                let reference = self.reference[at..].first_chunk_mut();
                let working = self.working[at..].first_chunk_mut();
                let mask = self.mask[at..].first_chunk_mut();
                if let (Some(reference), Some(working), Some(mask)) = (reference, working, mask) {
                    layer.merge(reference, working, mask);
                }
            }
        }
    }
}

/// Tiles merged together.
const CHUNK: usize = 8;
/// First pixel columns of sixteen tiles, relative to the first tile.
const TILE_COLUMNS: [f32; LANES] = [
    0.0, 8.0, 16.0, 24.0, 32.0, 40.0, 48.0, 56.0, 64.0, 72.0, 80.0, 88.0, 96.0, 104.0, 112.0, 120.0,
];

/// Coverage and nearness of an occluder in adjacent tiles.
struct Layer {
    mask: [Mask; CHUNK],
    near: [f32; CHUNK],
}

impl Layer {
    /// Merges a new layer into reference and working layer (the paper's rule).
    ///
    /// Drops the working layer if it lies nearer to the reference than to the new layer. A new
    /// layer adds nothing if it is no nearer than the reference, or if the working layer covers its
    /// pixels at least as near; in the opposite case it replaces the working layer. A full layer
    /// behind the working one becomes the reference.
    #[inline(always)]
    fn merge(
        &self,
        reference: &mut [f32; CHUNK],
        working: &mut [f32; CHUNK],
        mask: &mut [Mask; CHUNK],
    ) {
        for i in 0..CHUNK {
            let (new, near) = (self.mask[i], self.near[i]);
            let (least, old) = (reference[i], mask[i]);
            let layer = if old == 0 { least } else { working[i] };
            let adds = (new != 0) & (near > least) & ((new & !old != 0) | (near > layer));
            let behind = (new == Mask::MAX) & (near < layer);
            let replaces = (old & !new == 0) & (near >= layer);
            let joins = !replaces & (near - layer <= layer - least);
            let lower = if near < layer { near } else { layer };
            let new = if joins { new | old } else { new };
            let near_or_lower = if joins { lower } else { near };
            let full = new == Mask::MAX;
            let to_reference = if full { near_or_lower } else { least };
            let to_mask = if full { 0 } else { new };
            let to_reference = if behind { near } else { to_reference };
            let to_mask = if behind { old } else { to_mask };
            let to_working = if behind { layer } else { near_or_lower };
            reference[i] = if adds { to_reference } else { least };
            mask[i] = if adds { to_mask } else { old };
            working[i] = if adds { to_working } else { working[i] };
        }
    }
}

/// Pixels of the tile at column `left` that lie in the spans of its rows.
#[inline(always)]
fn pixels_between(start: &[i32; 4], end: &[i32; 4], left: i32) -> Mask {
    let mut mask = 0;
    for line in 0..TILE_HEIGHT {
        let from = (start[line] - left).clamp(0, 8) as u32;
        let to = (end[line] - left).clamp(0, 8) as u32;
        let row = 0xffu32.wrapping_shl(from) & !0xffu32.wrapping_shl(to) & 0xff;
        mask |= row << (8 * line);
    }
    mask
}

/// Pixels of a tile inside a rectangle that overlaps the tile.
#[inline(always)]
fn pixels_of(rect: &Rect, column: usize, row: usize) -> Mask {
    let [x0, x1, y0, y1] = each([rect.x0, rect.x1, rect.y0, rect.y1], usize::from);
    let left = x0.saturating_sub(column * TILE_WIDTH);
    let right = (x1 - column * TILE_WIDTH).min(TILE_WIDTH - 1);
    let top = y0.saturating_sub(row * TILE_HEIGHT);
    let bottom = (y1 - row * TILE_HEIGHT).min(TILE_HEIGHT - 1);
    let columns = (0xff >> (TILE_WIDTH - 1 - right)) & (0xff << left) & 0xff;
    let below = Mask::MAX >> (8 * (TILE_HEIGHT - 1 - bottom));
    (columns * 0x0101_0101) & below & (Mask::MAX << (8 * top))
}
