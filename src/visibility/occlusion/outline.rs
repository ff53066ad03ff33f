//! Outline of a box in the image, without clipping.
//!
//! The outline is a convex intersection of at most six half-planes; the nearness is the minimum of
//! at most three linear functions.
//!
//! # Half-planes
//!
//! Place the eye at the origin. If the eye is outside the box's slab on an axis, mirror the axis so
//! that the box is on its positive side: near bound n > 0, far bound f >= n, and g the ray's
//! direction on the axis. A ray crosses the near bound of such an axis i at depth `n_i / g_i`. It
//! hits the box if it enters all slabs before it leaves any: `n_i / g_i <= f_j / g_j` for each such
//! i and each far bound of each other axis j, or without division `f_j g_i - n_i g_j >= 0`.
//! Directions are linear functions of the position in the image, so these are half-planes, wherever
//! the box is: a box that crosses the plane of the eye needs no clipping. The depth is the maximum
//! of `n_i / g_i`, so the nearness 1 / depth is the minimum of `g_i / n_i`, again linear. With
//! parallel rays, the depth at which a slab is entered is itself linear, and nearness is a base
//! minus depth.
//!
//! # Open faces
//!
//! Let Z be the least z of all items as written. Let the eye be at or above Z, and let a box start
//! at z = Z. The box extended down to infinity hides nothing that is visible. Proof: let a ray
//! enter the extended box at a point p. If p is not below Z, it is in the box itself, which the ray
//! thus enters there or before, and not before the near plane (`View::entered_before_near`). If p
//! is below Z, the ray descends, as it started at or above Z, and could only meet things below Z
//! from there on: there are none. So that ray meets no item behind p, and items before p are not
//! behind the extension either.
//!
//! The same holds for the other five faces of the scene's bounds and for several at once: p is in
//! the box itself, or beyond an open face. Parallel rays must not run towards the inner side of an
//! open face. Comparisons are exact, on numbers as written. Occluders may be rounded inward: the
//! gap that the extension fills up to an open face is part of the box.

use glam::DVec3;

use super::rect::Rect;
use super::scene::Faces;
use super::view::{LinearFunction, MARGIN, TILE_HEIGHT, TILE_WIDTH, U, View};
use crate::geometry::Aabb;
use crate::kernel::each;

/// Bound of the covered columns: `at + slope * row`, rounded inward.
#[derive(Clone, Copy, Debug, Default)]
struct Bound {
    at: f32,
    slope: f32,
}

/// 2^23: adding it to a number in 0..=2^23 rounds that to an integer.
///
/// The lower bits of the sum then hold the integer.
const WHOLE_NUMBERS: f32 = (1u32 << 23) as f32;

/// Pixels that a box covers, and its nearness there.
#[derive(Clone, Default, Debug)]
pub struct Outline {
    /// Lower bounds of the columns; the first `lower_count` are in use.
    lower: [Bound; 8],
    lower_count: usize,
    upper: [Bound; 8],
    upper_count: usize,
    /// First row and the one past the last.
    rows: [f64; 2],
    /// Range of columns outside of which the outline is empty.
    columns_within: [f64; 2],
    /// Linear functions whose minimum is the nearness, already rounded down.
    faces: [LinearFunction; 3],
    face_count: usize,
    /// Lower bound of the nearness.
    floor: f64,
    /// Columns of the padded image.
    columns: f64,
    height: f64,
    /// True if the outline covers only whole pixels; else it covers pixel centres.
    covers_whole: bool,
}

impl Outline {
    /// Outline of a box; `None` if it covers no pixel or the eye is in it.
    ///
    /// The `open` faces are drawn as if they were infinitely far out.
    #[inline(always)]
    pub fn of(inner: &Aabb, open: Faces, view: &View, covers_whole: bool) -> Option<Outline> {
        if inner.is_empty() {
            return None;
        }
        let mut low = inner.min.as_dvec3() - view.eye;
        let mut high = inner.max.as_dvec3() - view.eye;
        for axis in 0..3 {
            if open >> axis & 1 == 1 {
                low[axis] = f64::NEG_INFINITY;
            }
            if open >> (3 + axis) & 1 == 1 {
                high[axis] = f64::INFINITY;
            }
        }
        let [columns, height] = view.padded;
        let mut outline = Outline {
            height,
            rows: [0.0, height],
            columns_within: [0.0, columns],
            faces: [LinearFunction::constant(f64::INFINITY); 3],
            columns,
            covers_whole,
            ..Outline::default()
        };
        match view.parallel {
            true => outline.add_parallel(low, high, view),
            false => outline.add_perspective(low, high, view),
        }
        let drawn = outline.face_count > 0 && outline.rows[0] < outline.rows[1];
        drawn.then_some(outline)
    }

    fn add_perspective(&mut self, low: DVec3, high: DVec3, view: &View) {
        let side = |axis: usize| low[axis].max(0.0) + high[axis].min(0.0);
        let (toward, near, far, along) = mirrored(low, high, view, side);
        let zero = view.far_from_zero;
        for i in (0..3).filter(|&i| toward[i]) {
            let (n, g) = (near[i], &along[i]);
            for j in (0..3).filter(|&j| j != i) {
                let d = &along[j];
                let margin = |f: f64| MARGIN * (f.abs() + n + zero) * view.reach;
                let ahead = MARGIN * view.reach;
                let mut edge = |bound: f64, a: f64, b: f64| match bound.is_finite() {
                    true => self.keep(g.blend(a, d, b), margin(bound)),
                    false => self.keep(*g, ahead),
                };
                if toward[j] {
                    edge(far[j], far[j], -n);
                } else {
                    edge(high[j], high[j], -n);
                    edge(low[j], -low[j], n);
                }
            }
            // Moved slightly farther away to cover the errors of n and of the dividend.
            let n = n + MARGIN * (n + zero);
            let mut nearness = g.times(1.0 / n);
            nearness.c -= MARGIN * view.reach / n;
            self.faces[self.face_count] = nearness;
            self.face_count += 1;
        }
        let (depth, size) = farthest(low, high, view.forward);
        self.floor = 1.0 / (depth + MARGIN * (size + zero));
    }

    fn add_parallel(&mut self, low: DVec3, high: DVec3, view: &View) {
        let f = view.forward.abs();
        let (toward, near, far, beside) = mirrored(low, high, view, |axis| view.forward[axis]);
        let zero = view.far_from_zero + view.reach;
        // Rays parallel to a slab are inside it everywhere or nowhere.
        for j in (0..3).filter(|&j| !toward[j]) {
            let margin = |bound: f64| MARGIN * (bound.abs() + zero);
            if high[j].is_finite() {
                let under = LinearFunction::constant(high[j]).blend(1.0, &beside[j], -1.0);
                self.keep(under, margin(high[j]));
            }
            if low[j].is_finite() {
                let over = beside[j].blend(1.0, &LinearFunction::constant(low[j]), -1.0);
                self.keep(over, margin(low[j]));
            }
        }
        for i in (0..3).filter(|&i| toward[i]) {
            // Depths of entering i and leaving j, both times |f_i f_j|.
            let entered = LinearFunction::constant(near[i]).blend(1.0, &beside[i], -1.0);
            for j in (0..3).filter(|&j| j != i && toward[j] && far[j].is_finite()) {
                let left = LinearFunction::constant(far[j]).blend(1.0, &beside[j], -1.0);
                let edge = left.blend(f[i], &entered, -f[j]);
                self.keep(edge, MARGIN * (near[i].abs() + far[j].abs() + zero));
            }
            let error = MARGIN * (near[i].abs() + zero + f[i] * view.far.abs());
            let mut nearness = entered.times(-1.0 / f[i]);
            nearness.c += view.far - error / f[i];
            self.faces[self.face_count] = nearness;
            self.face_count += 1;
        }
        let (depth, size) = farthest(low, high, view.forward);
        self.floor = (view.far - depth) - MARGIN * (size + zero + view.far.abs());
    }

    /// Restricts the outline to `edge >= margin`.
    ///
    /// Applies to pixel centres, or to all corners of a pixel. The margin is 2^-44 of what the
    /// edge's terms can reach in the padded image; dividing by its slope, adding and rounding lose
    /// less than 2^-50 of that.
    #[inline(always)]
    fn keep(&mut self, edge: LinearFunction, margin: f64) {
        let LinearFunction { x, y, c } = edge;
        let c = c - margin
            + match self.covers_whole {
                true => x.min(0.0) + y.min(0.0),
                false => 0.5 * (x + y),
            };
        if x.abs() * self.columns >= margin {
            // In f32: u of each term for its rounding, u of the product, u of both for the sum, and
            // u of a column for the half that is added: 4 u of the terms and 2 u of the width cover
            // it. Lines that run almost along the rows have large terms, but only a shift across
            // them counts.
            let (at, slope) = (-c / x, -y / x);
            let size = at.abs() + slope.abs() * self.height;
            let error = f64::from(U) * (4.0 * size + 2.0 * (self.columns + 1.0));
            let inward = if x > 0.0 { at + error } else { at - error };
            let bound = Bound {
                at: inward as f32,
                slope: slope as f32,
            };
            if x > 0.0 {
                self.lower[self.lower_count & 7] = bound;
                self.lower_count += 1;
            } else {
                self.upper[self.upper_count & 7] = bound;
                self.upper_count += 1;
            }
            return;
        }
        // Along the rows, except for less than the margin over the whole width.
        let c = c - margin;
        let [first, end] = self.rows;
        if y.abs() * end < margin {
            // Everywhere or nowhere; NaN means nowhere.
            let is_here = c - margin >= 0.0;
            if !is_here {
                self.rows = [0.0, 0.0];
            }
        } else if y > 0.0 {
            self.rows[0] = first.max((-c / y).ceil());
        } else {
            self.rows[1] = end.min((c / -y).floor() + 1.0);
        }
    }

    /// Clips the outline to the box's own rectangle enlarged by one tile.
    ///
    /// Almost all pixels that open faces add beyond that hide only what is below the floor, or
    /// beyond another face.
    pub fn within(&mut self, rect: &Rect) {
        let tile = [TILE_WIDTH as f64, TILE_HEIGHT as f64];
        let [left, right] = self.columns_within;
        let (x0, x1) = (f64::from(rect.x0), f64::from(rect.x1) + 1.0);
        self.columns_within = [left.max(x0 - tile[0]), right.min(x1 + tile[0])];
        let [top, bottom] = self.rows;
        let (y0, y1) = (f64::from(rect.y0), f64::from(rect.y1) + 1.0);
        self.rows = [top.max(y0 - tile[1]), bottom.min(y1 + tile[1])];
    }

    /// First row and the one past the last that may have columns.
    pub fn rows(&self) -> (usize, usize) {
        (self.rows[0] as usize, self.rows[1] as usize)
    }

    /// For `N` rows from `first` on: first column and the one past the last.
    ///
    /// A row is empty if the second is not above the first.
    #[inline(always)]
    pub fn spans<const N: usize>(&self, first: usize) -> ([i32; N], [i32; N]) {
        let [left, right] = self.columns_within;
        let [top, bottom] = each(self.rows, |row| row as f32);
        let first = first as f32;
        let mut low = [left as f32; N];
        let mut high = [right as f32 - 1.0; N];
        for bound in &self.lower[..self.lower_count.min(8)] {
            for (i, low) in low.iter_mut().enumerate() {
                let at = bound.at + bound.slope * (first + i as f32);
                *low = if at > *low { at } else { *low };
            }
        }
        for bound in &self.upper[..self.upper_count.min(8)] {
            for (i, high) in high.iter_mut().enumerate() {
                let at = bound.at + bound.slope * (first + i as f32);
                *high = if at < *high { at } else { *high };
            }
        }
        let mut start = [0; N];
        let mut end = [0; N];
        for i in 0..N {
            // Half a column is added and the sum rounded to nearest: this rounds the first column
            // up and gives the end column, one past the rounded-down last one. Ties may lose a
            // column.
            let row = first + i as f32;
            let within =
                (row >= top) & (row < bottom) & (high[i] >= 0.0) & (low[i] <= right as f32);
            let low = if within { low[i] } else { 1.0 };
            let high = if within { high[i] } else { 0.0 };
            start[i] = ((low + 0.5) + WHOLE_NUMBERS).to_bits() as i32 & 0x7f_ffff;
            end[i] = ((high + 0.5) + WHOLE_NUMBERS).to_bits() as i32 & 0x7f_ffff;
        }
        (start, end)
    }

    /// Nearness within tiles, in f32, never above that of any covered pixel.
    #[inline(always)]
    pub fn per_tile(&self) -> Nearness {
        let mut faces = [[f32::INFINITY, 0.0, 0.0]; 3];
        for (i, face) in self.faces[..self.face_count].iter().enumerate() {
            // Six u of the largest terms: one for rounding each coefficient, one for each product,
            // two sums.
            let size = face.c.abs() + face.x.abs() * self.columns + face.y.abs() * self.height;
            let constant = face.c - 6.0 * f64::from(U) * size;
            // A face that overflows f32 is ignored: the floor decides.
            faces[i] = match size < 1e38 {
                true => [constant as f32, face.x as f32, face.y as f32],
                false => [f32::NEG_INFINITY, 0.0, 0.0],
            };
        }
        Nearness {
            faces,
            floor: (self.floor as f32).next_down(),
        }
    }
}

/// Facing axes, near and far bounds, and rays, mirrored to positive sides.
///
/// An axis is mirrored if its `side` is below zero, so that rays enter through the near bound. If
/// `side` is zero, no face of the axis faces the eye.
#[inline(always)]
fn mirrored(
    low: DVec3,
    high: DVec3,
    view: &View,
    side: impl Fn(usize) -> f64,
) -> ([bool; 3], [f64; 3], [f64; 3], [LinearFunction; 3]) {
    let (mut toward, mut along) = ([false; 3], view.rays);
    let (mut near, mut far) = ([0.0; 3], [0.0; 3]);
    for axis in 0..3 {
        let side = side(axis);
        if side > 0.0 {
            (near[axis], far[axis]) = (low[axis], high[axis]);
        } else if side < 0.0 {
            (near[axis], far[axis]) = (-high[axis], -low[axis]);
            along[axis] = along[axis].times(-1.0);
        }
        toward[axis] = side != 0.0;
    }
    (toward, near, far, along)
}

/// Nearness of an outline in f32.
#[derive(Clone, Copy, Debug)]
pub struct Nearness {
    faces: [[f32; 3]; 3],
    floor: f32,
}

impl Nearness {
    /// Lower bound of the nearness in a rectangle of the image.
    ///
    /// The rectangle is given by pixel edges: columns `left` to `right`, rows `top` to `bottom`.
    #[inline(always)]
    pub fn within(&self, [left, right]: [f32; 2], [top, bottom]: [f32; 2]) -> f32 {
        // Value at the farthest corner of each face.
        let at = |f: [f32; 3]| {
            let column = if f[1] < 0.0 { right } else { left };
            let row = if f[2] < 0.0 { bottom } else { top };
            (f[0] + f[2] * row) + f[1] * column
        };
        let (least, floor) = (least(each(self.faces, at)), self.floor);
        if least > floor { least } else { floor }
    }
}

/// Greatest depth of the box, and the sum of the sizes of its terms.
///
/// Infinite if an open face makes it so.
fn farthest(low: DVec3, high: DVec3, forward: DVec3) -> (f64, f64) {
    let mut depth = 0.0;
    let mut size = 0.0;
    for axis in (0..3).filter(|&k| forward[k] != 0.0) {
        let bound = if forward[axis] > 0.0 { high } else { low };
        let term = forward[axis] * bound[axis];
        depth += term;
        size += term.abs();
    }
    (depth, size)
}

#[inline(always)]
fn least([a, b, c]: [f32; 3]) -> f32 {
    let ab = if a < b { a } else { b };
    if ab < c { ab } else { c }
}
