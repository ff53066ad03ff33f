//! Where sixteen boxes are in the image, and how near: rectangles of pixels,
//! rounded outward, and depths, rounded towards the eye.
//!
//! # Error analysis
//!
//! u = 2^-24. A bound of a box becomes a coordinate c about the eye by two
//! subtractions: of the eye rounded to f32, and of what that left (at most u of the
//! eye's coordinate e). The first one is exact if the bound is within a factor of
//! two of e; otherwise its result is more than e / 2, and what the second one takes
//! off is nothing against it. So `|error of c| <= 2.01 u |c| + 1.01 u^2 |e|`.
//!
//! A sum of three products with a row m of the projection adds u for the row's own
//! rounding, u for the product and 2 u for the sums: with r >= |c| + u |e|, where
//! |c| is the length of the longest corner, `|error| <= 6.2 u |m| r` by Cauchy and
//! Schwarz. The row of depths has length 1.
//!
//! Perspective: let w be the least depth of a corner. Boxes with `w <= r / 4096`
//! are *near*: they have no rectangle and are never hidden. For the others the
//! computed w is true to 1 part in 600, and X / w is wrong by at most
//! `(r / w) u (6.3 |m| + 6.3 |x|)` by the sums and 2.1 u |x| by reciprocal and
//! product, together `(r / w) u (6.3 |m| + 8.4 |x|)`, as r / w >= 0.99. For corners
//! in the image and as far again beside it, |x| <= 2 size, so
//! `10 u (|m| + 2 size) r / w` is enough and leaves more than 3 u size for the
//! subtraction of the slack itself. A corner farther away than that may be wrong by
//! more, but by less than its distance from the image (the factor is below 1 / 400),
//! and is clamped to the image anyway.
//!
//! Parallel rays: as above without the division, `6.2 u |m| r + 2 u |x|` and u of
//! the shift: `10 u (|m| r + |shift| + 2 size)`.
//!
//! Depth: the least w is lowered by 8 u r (6.2 u r and the subtraction). Its
//! reciprocal is raised by 8 u of itself. With parallel rays nearness is
//! `base - w`, true to 2 u of both, and raised by 8 u of both.
//!
//! Underflow: with w > 1e-25 and r < 1e25 nothing that counts is subnormal, and
//! nothing overflows. Comparisons are such that a NaN makes a box near.

use super::block::Block;
use super::view::{Projection, U, View};
use crate::kernel::{Isa, LANES, LaneMask};

/// Pixels and nearness of one box: columns and rows from the first to the last
/// one, both included.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Rect {
    /// First column.
    pub x0: u16,
    /// Last column.
    pub x1: u16,
    /// First row.
    pub y0: u16,
    /// Last row.
    pub y1: u16,
    /// Not below the box's greatest nearness: 1 / depth, or base - depth.
    pub nearness: f32,
}

impl Rect {
    /// Pixels.
    #[inline(always)]
    pub fn area(&self) -> u32 {
        u32::from(self.x1 - self.x0 + 1) * u32::from(self.y1 - self.y0 + 1)
    }
}

/// The rectangles of a block's boxes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Rects {
    /// First columns, pixels.
    pub x0: [i32; LANES],
    /// Last columns.
    pub x1: [i32; LANES],
    /// First rows.
    pub y0: [i32; LANES],
    /// Last rows.
    pub y1: [i32; LANES],
    /// As [`Rect::nearness`].
    pub nearness: [f32; LANES],
    /// Not above the least depth: what boxes are sorted by.
    pub depth: [f32; LANES],
    /// Bit 0: no ray of the image meets the box. Bit 1: no rectangle, too near.
    state: [u32; LANES],
}

const UNSEEN: u32 = 1;
const NEAR: u32 = 2;

impl Rects {
    /// Nothing yet.
    pub const NONE: Rects = Rects {
        x0: [0; LANES],
        x1: [0; LANES],
        y0: [0; LANES],
        y1: [0; LANES],
        nearness: [0.0; LANES],
        depth: [0.0; LANES],
        state: [NEAR; LANES],
    };

    /// One lane.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Rect {
        Rect {
            x0: self.x0[lane] as u16,
            x1: self.x1[lane] as u16,
            y0: self.y0[lane] as u16,
            y1: self.y1[lane] as u16,
            nearness: self.nearness[lane],
        }
    }

    /// The lanes that some ray of the image may meet, and those of all lanes that
    /// have a rectangle.
    #[inline(always)]
    pub fn lanes<I: Isa>(&self, isa: I) -> (LaneMask, LaneMask) {
        let words = isa.words(&self.state);
        let (unseen, near) = (isa.equal(words, UNSEEN), isa.equal(words, NEAR));
        (!unseen, !near)
    }

    /// Projects the boxes of a block.
    #[inline(always)]
    pub fn project(&mut self, block: &Block, view: &View) {
        // Of copies and into a new one: what cannot overlap with anything else is
        // what the compiler makes vectors of, wherever this is inlined.
        let (block, projection) = (*block, view.projection);
        *self = match view.parallel {
            true => Rects::parallel(&block, &projection),
            false => Rects::perspective(&block, &projection),
        };
    }

    #[inline(always)]
    fn perspective(block: &Block, p: &Projection) -> Rects {
        let mut rects = Rects::NONE;
        let [width, height] = p.size;
        for l in 0..LANES {
            let (c, r) = about_eye(block, l, p.eye, p.rest, p.far_from_zero);
            let [x, y, w] = [0, 1, 2].map(|row| products(&c, &p.rows[row]));
            let (mut least, mut x0, mut y0) = (f32::INFINITY, f32::INFINITY, f32::INFINITY);
            let (mut x1, mut y1) = (f32::NEG_INFINITY, f32::NEG_INFINITY);
            for corner in 0..8 {
                let depth = at_corner(&w, corner);
                let inverse = 1.0 / depth;
                let across = at_corner(&x, corner) * inverse;
                let down = at_corner(&y, corner) * inverse;
                least = smaller(depth, least);
                (x0, x1) = (smaller(across, x0), larger(across, x1));
                (y0, y1) = (smaller(down, y0), larger(down, y1));
            }
            let depth = least - 8.0 * U * r;
            let nearness = 1.0 / depth;
            let relative = r * nearness;
            let (slack_x, slack_y) = (p.slack[0] * relative, p.slack[1] * relative);
            let (x0, x1) = (x0 - slack_x, x1 + slack_x);
            let (y0, y1) = (y0 - slack_y, y1 + slack_y);
            let sound = (least > r * (1.0 / 4096.0)) & (least > 1e-25) & (r < 1e25);
            let seen = (x1 >= 0.0) & (x0 <= width) & (y1 >= 0.0) & (y0 <= height);
            rects.nearness[l] = nearness + nearness * (8.0 * U);
            rects.depth[l] = depth;
            rects.x0[l] = pixel(x0, width);
            rects.x1[l] = pixel(x1, width);
            rects.y0[l] = pixel(y0, height);
            rects.y1[l] = pixel(y1, height);
            rects.state[l] = state(sound, seen);
        }
        rects
    }

    #[inline(always)]
    fn parallel(block: &Block, p: &Projection) -> Rects {
        let mut rects = Rects::NONE;
        let [width, height] = p.size;
        for l in 0..LANES {
            let (c, r) = about_eye(block, l, p.eye, p.rest, p.far_from_zero);
            let (x0, x1) = range(&c, &p.rows[0]);
            let (y0, y1) = range(&c, &p.rows[1]);
            let (least, _) = range(&c, &p.rows[2]);
            let slack_x = p.slack[0] * r + p.slack_added[0];
            let slack_y = p.slack[1] * r + p.slack_added[1];
            let (x0, x1) = (x0 + p.shift[0] - slack_x, x1 + p.shift[0] + slack_x);
            let (y0, y1) = (y0 + p.shift[1] - slack_y, y1 + p.shift[1] + slack_y);
            let depth = least - 8.0 * U * r;
            let sound = r < 1e25;
            let seen = (x1 >= 0.0) & (x0 <= width) & (y1 >= 0.0) & (y0 <= height);
            rects.nearness[l] = (p.base - depth) + 8.0 * U * (p.base.abs() + depth.abs());
            rects.depth[l] = depth;
            rects.x0[l] = pixel(x0, width);
            rects.x1[l] = pixel(x1, width);
            rects.y0[l] = pixel(y0, height);
            rects.y1[l] = pixel(y1, height);
            rects.state[l] = state(sound, seen);
        }
        rects
    }
}

/// Six bounds about the eye, and what all errors are relative to.
#[inline(always)]
fn about_eye(
    block: &Block,
    lane: usize,
    eye: [f32; 3],
    rest: [f32; 3],
    far_from_zero: f32,
) -> ([[f32; 2]; 3], f32) {
    let mut c = [[0.0; 2]; 3];
    let mut r = far_from_zero;
    for axis in 0..3 {
        let low = (block.rows[axis][lane] - eye[axis]) - rest[axis];
        let high = (block.rows[3 + axis][lane] - eye[axis]) - rest[axis];
        c[axis] = [low, high];
        r += larger(low.abs(), high.abs());
    }
    (c, r)
}

/// The products of the lower and upper bounds with a row, axis by axis.
#[inline(always)]
fn products(c: &[[f32; 2]; 3], row: &[f32; 3]) -> [[f32; 2]; 3] {
    let mut products = [[0.0; 2]; 3];
    for axis in 0..3 {
        products[axis] = [row[axis] * c[axis][0], row[axis] * c[axis][1]];
    }
    products
}

/// Their sum at corner 0 to 7: bit `axis` takes the upper bound.
#[inline(always)]
fn at_corner(p: &[[f32; 2]; 3], corner: usize) -> f32 {
    (p[0][corner & 1] + p[1][corner >> 1 & 1]) + p[2][corner >> 2]
}

/// The least and the greatest product with a row at any corner.
#[inline(always)]
fn range(c: &[[f32; 2]; 3], row: &[f32; 3]) -> (f32, f32) {
    let mut low = [0.0; 3];
    let mut high = [0.0; 3];
    for axis in 0..3 {
        let (p, q) = (row[axis] * c[axis][0], row[axis] * c[axis][1]);
        low[axis] = smaller(p, q);
        high[axis] = larger(p, q);
    }
    ((low[0] + low[1]) + low[2], (high[0] + high[1]) + high[2])
}

#[inline(always)]
fn state(sound: bool, seen: bool) -> u32 {
    // No branches: each is a lane's select.
    let near = if sound { 0 } else { NEAR };
    let unseen = if seen { 0 } else { UNSEEN };
    if sound { unseen } else { near }
}

/// The pixel that holds a coordinate, or the nearest one.
#[inline(always)]
fn pixel(at: f32, size: f32) -> i32 {
    smaller(larger(at, 0.0), size - 1.0) as i32
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
