//! Masked depth buffers: per tile of 8 x 4 pixels two depths and one bit a pixel
//! (Hasselgren, Andersson, Akenine-Moeller 2016, "Masked software occlusion
//! culling", High Performance Graphics), 12 bytes a tile.
//!
//! The layout and the rule of merging are the paper's; outlines instead of
//! triangles and everything else is not. Two coverage rules, and nothing else,
//! tell the two back ends apart.

use super::buffer::{OcclusionBuffer, Origin};
use super::outline::{Coverage, Outline, TileNearness};
use super::rect::Rect;
use super::view::{TILE_HEIGHT, TILE_WIDTH};
use crate::visibility::{Guarantee, SampleGrid};

/// Pixels of a tile: bit `8 * row + column`.
type Mask = u32;

/// A masked buffer; `WHOLE` pixels only, or those whose centre is covered.
///
/// Nearness grows towards the eye; 0 is infinitely far. Per tile, all pixels are
/// covered at least at `reference`, and those of `mask` at least at `working`.
#[derive(Clone, Debug)]
pub struct Masked<const WHOLE: bool> {
    columns: usize,
    rows: usize,
    reference: Vec<f32>,
    working: Vec<f32>,
    mask: Vec<Mask>,
}

/// Pixels that an occluder covers wholly hide what is behind: nothing visible is
/// ever lost.
pub type MaskedInner = Masked<true>;

/// Pixels whose centre is covered hide: what shows between centres is lost.
pub type MaskedCentre = Masked<false>;

impl<const WHOLE: bool> OcclusionBuffer for Masked<WHOLE> {
    const NAME: &'static str = if WHOLE { "masked-inner" } else { "masked" };
    const SUMMARY: &'static str = if WHOLE {
        "masked tiles of 8 x 4 pixels; only wholly covered pixels hide"
    } else {
        "masked tiles of 8 x 4 pixels; pixels hide whose centre is covered"
    };
    const GUARANTEE: Guarantee = if WHOLE {
        Guarantee::Conservative
    } else {
        Guarantee::Unproven
    };
    const ORIGIN: Origin = if WHOLE {
        Origin::Own
    } else {
        Origin::StandIn("Hasselgren, Andersson, Akenine-Moeller 2016")
    };
    const COVERAGE: Coverage = if WHOLE {
        Coverage::Whole
    } else {
        Coverage::Centre
    };
    const ALTERNATES: bool = true;

    fn new(grid: SampleGrid) -> Self {
        let columns = (grid.width as usize).div_ceil(TILE_WIDTH);
        let rows = (grid.height as usize).div_ceil(TILE_HEIGHT);
        let tiles = columns * rows;
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
    fn draw(&mut self, outline: &Outline) {
        let nearness = outline.per_tile([self.columns, self.rows]);
        let (first, end) = outline.rows();
        let mut row = first / TILE_HEIGHT;
        let last = end.div_ceil(TILE_HEIGHT).min(self.rows);
        while row < last {
            let (starts, ends) = outline.spans::<16>(row * TILE_HEIGHT);
            for (part, (start, end)) in starts.chunks(4).zip(ends.chunks(4)).enumerate() {
                if row + part < last {
                    self.draw_row(row + part, start, end, &nearness);
                }
            }
            row += 4;
        }
    }

    #[inline(always)]
    fn hides(&self, rect: &Rect) -> bool {
        let [x0, x1, y0, y1] = [rect.x0, rect.x1, rect.y0, rect.y1].map(usize::from);
        let columns = x0 / TILE_WIDTH..x1 / TILE_WIDTH + 1;
        for row in y0 / TILE_HEIGHT..y1 / TILE_HEIGHT + 1 {
            let at = row * self.columns;
            let place = at + columns.start..at + columns.end;
            let reference = &self.reference[place.clone()];
            // All of the row by its reference, as it mostly is.
            let open = reference
                .iter()
                .fold(false, |any, &near| any | !(near > rect.nearness));
            if !open {
                continue;
            }
            let tiles = self.working[place.clone()].iter().zip(&self.mask[place]);
            let tiles = reference.iter().zip(tiles).zip(columns.clone());
            for ((&near, (&working, &mask)), column) in tiles {
                if near > rect.nearness {
                    continue;
                }
                let left = x0.saturating_sub(column * TILE_WIDTH);
                let right = (x1 - column * TILE_WIDTH).min(TILE_WIDTH - 1);
                let top = y0.saturating_sub(row * TILE_HEIGHT);
                let bottom = (y1 - row * TILE_HEIGHT).min(TILE_HEIGHT - 1);
                let pixels = columns_from_to(left, right + 1) & rows_from_to(top, bottom + 1);
                if !(working > rect.nearness) || pixels & !mask != 0 {
                    return false;
                }
            }
        }
        true
    }
}

impl<const WHOLE: bool> Masked<WHOLE> {
    /// Draws four rows of pixels, given by their first columns and the ones behind
    /// the last.
    #[inline(always)]
    fn draw_row(&mut self, row: usize, start: &[i32], end: &[i32], nearness: &TileNearness) {
        let (mut least, mut greatest) = (i32::MAX, 0);
        let (mut full_from, mut full_to) = (0, i32::MAX);
        for (&start, &end) in start.iter().zip(end) {
            if start < end {
                least = least.min(start);
                greatest = greatest.max(end);
            }
            full_from = full_from.max(start);
            full_to = full_to.min(end);
        }
        if least >= greatest {
            return;
        }
        let tile = TILE_WIDTH as i32;
        let first = (least / tile) as usize;
        let last = ((greatest + tile - 1) / tile) as usize;
        // Tiles that all four rows fill.
        let full_from = ((full_from + tile - 1) / tile) as usize;
        let full_to = (full_to.max(0) / tile) as usize;
        let (full_from, full_to) = match full_from < full_to {
            true => (full_from, full_to),
            false => (last, last),
        };
        let at = row * self.columns;
        let of_row = row as f32;
        for column in (first..full_from).chain(full_to..last) {
            let mut mask = 0;
            for (line, (&start, &end)) in start.iter().zip(end).enumerate() {
                let left = (start - column as i32 * tile).clamp(0, tile) as usize;
                let right = (end - column as i32 * tile).clamp(0, tile) as usize;
                if left < right {
                    mask |= columns_from_to(left, right) & rows_from_to(line, line + 1);
                }
            }
            self.merge(at + column, mask, nearness.of(column as f32, of_row));
        }
        if full_from >= full_to {
            return;
        }
        let place = at + full_from..at + full_to;
        let reference = &mut self.reference[place.clone()];
        let working = &self.working[place.clone()];
        let masks = &mut self.mask[place];
        for i in 0..reference.len().min(working.len()).min(masks.len()) {
            let near = nearness.of((full_from + i) as f32, of_row);
            let kept = reference[i];
            let near = if near > kept { near } else { kept };
            reference[i] = near;
            // A working layer that is no nearer than all of the tile is done with.
            masks[i] = if working[i] > near { masks[i] } else { 0 };
        }
    }

    /// Adds a layer that covers some pixels of a tile.
    #[inline(always)]
    fn merge(&mut self, tile: usize, mask: Mask, near: f32) {
        let reference = self.reference[tile];
        if mask == 0 || !(near > reference) {
            return;
        }
        let (old, working) = (self.mask[tile], self.working[tile]);
        let (mut mask, mut near) = (mask, near);
        // A layer that another one covers, no farther, adds nothing.
        if mask & !old == 0 && near <= working {
            return;
        }
        let replaces = old & !mask == 0 && near >= working;
        // Two layers are kept of three. The paper's rule: give up the working one
        // if it lies nearer to the reference than to the new one.
        if !replaces && near - working <= working - reference {
            mask |= old;
            near = if near < working { near } else { working };
        }
        if mask == Mask::MAX {
            self.reference[tile] = near;
            mask = 0;
        }
        self.mask[tile] = mask;
        self.working[tile] = near;
    }
}

/// The pixels of a tile in some columns, from `left` to before `right`.
#[inline(always)]
fn columns_from_to(left: usize, right: usize) -> Mask {
    let byte = (0xff >> (TILE_WIDTH - right)) & (0xff << left) & 0xff;
    byte * 0x0101_0101
}

/// The pixels of a tile in some rows, from `top` to before `bottom`.
#[inline(always)]
fn rows_from_to(top: usize, bottom: usize) -> Mask {
    (Mask::MAX >> (8 * (TILE_HEIGHT - bottom))) & (Mask::MAX << (8 * top))
}
