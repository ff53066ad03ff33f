//! Projections of sixteen boxes: rectangles of pixels and depths.
//!
//! Rectangles are rounded outward, depths towards the eye.
//!
//! # Error analysis
//!
//! u = 2^-24. A bound of a box is made relative to the eye by two subtractions: of the eye rounded
//! to f32, and of the remainder of that rounding (at most u of the eye's coordinate e). The first
//! subtraction is exact if the bound is within a factor of two of e. Otherwise its result is larger
//! than e / 2, and the second subtraction is negligible against it. So the coordinate c has
//! `|error| <= 2.01 u |c| + 1.01 u^2 |e|`.
//!
//! A sum of three products with a row m of the projection adds u for the row's own rounding, u for
//! the product and 2 u for the sums. Let r >= |c| + u |e|, where |c| is the length of the farthest
//! corner; then `|error| <= 6.2 u |m| r` by Cauchy-Schwarz. The row of depths has length 1.
//!
//! Perspective: let w be the least depth of a corner. Boxes with `w <= r / 4096` are *near*: they
//! have no rectangle and are never hidden. For the others the computed w is accurate to 1 part in
//! 600. X / w is wrong by at most `(r / w) u (6.3 |m| + 6.3 |x|)` from the sums and 2.1 u |x| from
//! reciprocal and product, together `(r / w) u (6.3 |m| + 8.4 |x|)`, as r / w >= 0.99. Corners in
//! the image, and up to one image size beside it, have |x| <= 2 size. So `10 u (|m| + 2 size) r /
//! w` is enough and leaves more than 3 u size for the subtraction of the slack itself. A corner
//! farther away may be wrong by more, but by less than its distance from the image (the factor is
//! below 1 / 400), and is clamped to the image anyway.
//!
//! Parallel rays: as above without the division, `6.2 u |m| r + 2 u |x|` and u of the shift: `10 u
//! (|m| r + |shift| + 2 size)`.
//!
//! Depth: the least w is lowered by 8 u r (6.2 u r and the subtraction). Its reciprocal is raised
//! by 8 u of itself. With parallel rays nearness is `base - w`, accurate to 2 u of both, and raised
//! by 8 u of both.
//!
//! Underflow: with w > 1e-25 and r < 1e25 no significant value is subnormal except coordinates with
//! parallel rays, whose loss is added to the slack. Overflow: boxes with |m| r > 1e37 are near too;
//! in windows so narrow that |m| is infinite in f32, all boxes are near. Comparisons are written so
//! that a NaN makes a box near.

use super::view::{Projection, U, View};
use crate::geometry::{BoxBlock, BoxCorner};
use crate::kernel::{Isa, LANES, LaneMask};

/// Pixel rectangle and nearness of one box; first and last are inclusive.
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
    /// Upper bound of the box's nearness: 1 / depth, or base - depth.
    pub nearness: f32,
}

/// A box to be tested for being hidden.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// Rectangle, valid unless `near`.
    pub rect: Rect,
    /// Position in tree order.
    pub position: u32,
    /// `true` if the box is too near to have a rectangle.
    pub near: bool,
}

/// Rectangles of a block's boxes.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub struct Rects {
    /// First columns, in pixels.
    pub x0: [i32; LANES],
    /// Last columns.
    pub x1: [i32; LANES],
    /// First rows.
    pub y0: [i32; LANES],
    /// Last rows.
    pub y1: [i32; LANES],
    /// [`Rect::nearness`] of each box.
    pub nearness: [f32; LANES],
    /// Lower bounds of the least depths, by which boxes are sorted.
    pub depth: [f32; LANES],
    /// Lanes that some ray of the image may meet.
    pub seen: LaneMask,
    /// Lanes that have a rectangle; the others are too near.
    pub flat: LaneMask,
}

impl Rects {
    /// Rectangle of one lane.
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

    /// Box of a lane, at a position of the tree.
    #[inline(always)]
    pub fn candidate(&self, lane: usize, position: usize) -> Candidate {
        Candidate {
            rect: self.get(lane),
            position: position as u32,
            near: self.flat >> lane & 1 == 0,
        }
    }

    /// Stores a rectangle in a lane; the lane's other fields stay as they are.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, rect: &Rect) {
        self.x0[lane] = i32::from(rect.x0);
        self.x1[lane] = i32::from(rect.x1);
        self.y0[lane] = i32::from(rect.y0);
        self.y1[lane] = i32::from(rect.y1);
        self.nearness[lane] = rect.nearness;
    }

    /// Projects the boxes of a block.
    #[inline(always)]
    pub fn project<I: Isa>(&mut self, isa: I, block: &BoxBlock, view: &View) {
        let p = &view.projection;
        let boxes = AboutEye::of(isa, block, p);
        match view.parallel {
            true => self.project_parallel(isa, &boxes, p),
            false => self.project_perspective(isa, &boxes, p),
        }
    }

    #[inline(always)]
    fn project_perspective<I: Isa>(&mut self, isa: I, boxes: &AboutEye<I>, p: &Projection) {
        let depths = boxes.products(isa, &p.rows[2]);
        let mut inverse = [[0.0; LANES]; 8];
        let mut least = isa.splat(f32::INFINITY);
        for (corner, row) in inverse.iter_mut().enumerate() {
            let depth = at_corner(isa, &depths, corner);
            least = isa.min(depth, least);
            *row = inverses(isa.to_array(depth));
        }
        // Least and greatest x and y.
        let none = [isa.splat(f32::INFINITY), isa.splat(f32::NEG_INFINITY)];
        let mut extremes = [none; 2];
        for (axis, row) in p.rows[..2].iter().enumerate() {
            let products = boxes.products(isa, row);
            for (corner, inverse) in inverse.iter().enumerate() {
                let at = isa.mul(at_corner(isa, &products, corner), isa.load(inverse));
                let [low, high] = &mut extremes[axis];
                *low = isa.min(at, *low);
                *high = isa.max(at, *high);
            }
        }
        let depth = isa.add(least, isa.mul(boxes.minus_size, isa.splat(8.0 * U)));
        let nearness = isa.load(&inverses(isa.to_array(depth)));
        // - r / w
        let relative = isa.mul(boxes.minus_size, nearness);
        for (axis, [low, high]) in extremes.iter_mut().enumerate() {
            let slack = p.slack[axis];
            *low = isa.add(*low, isa.mul(relative, isa.splat(slack)));
            *high = isa.add(*high, isa.mul(relative, isa.splat(-slack)));
        }
        let behind = isa.mul(boxes.minus_size, isa.splat(-1.0 / 4096.0));
        let near = isa.at_most(least, behind) | isa.at_most(least, isa.splat(1e-25));
        let raised = isa.add(nearness, isa.mul(nearness, isa.splat(8.0 * U)));
        self.finish(isa, boxes, p, &extremes, [depth, raised], near);
    }

    #[inline(always)]
    fn project_parallel<I: Isa>(&mut self, isa: I, boxes: &AboutEye<I>, p: &Projection) {
        let mut extremes = [[isa.splat(0.0); 2]; 2];
        for (axis, extremes) in extremes.iter_mut().enumerate() {
            let [low, high] = boxes.range(isa, &p.rows[axis]);
            let (slack, added) = (p.slack[axis], p.slack_added[axis]);
            let under = isa.mul(boxes.minus_size, isa.splat(slack));
            let under = isa.add(under, isa.splat(-added));
            let above = isa.mul(boxes.minus_size, isa.splat(-slack));
            let above = isa.add(above, isa.splat(added));
            let shift = isa.splat(p.shift[axis]);
            let (low, high) = (isa.add(low, shift), isa.add(high, shift));
            *extremes = [isa.add(low, under), isa.add(high, above)];
        }
        let [least, _] = boxes.range(isa, &p.rows[2]);
        let depth = isa.add(least, isa.mul(boxes.minus_size, isa.splat(8.0 * U)));
        let minus = isa.splat(-1.0);
        // -|depth|
        let size = isa.min(depth, isa.mul(depth, minus));
        let slack = isa.mul(size, isa.splat(-8.0 * U));
        // Depths may be subnormal and lose their lower bits.
        let lost = isa.splat(8.0 * U * p.base.abs() + f32::from_bits(16));
        let slack = isa.add(slack, lost);
        let nearness = isa.add(isa.splat(p.base), isa.mul(depth, minus));
        let raised = isa.add(nearness, slack);
        self.finish(isa, boxes, p, &extremes, [depth, raised], 0);
    }

    /// Converts least and greatest x and y to pixels.
    #[inline(always)]
    fn finish<I: Isa>(
        &mut self,
        isa: I,
        boxes: &AboutEye<I>,
        p: &Projection,
        [[x0, x1], [y0, y1]]: &[[I::Floats; 2]; 2],
        [depth, nearness]: [I::Floats; 2],
        near: LaneMask,
    ) {
        let [width, height] = p.size;
        let zero = isa.splat(0.0);
        let within_x = isa.at_most(*x0, isa.splat(width)) & isa.at_most(zero, *x1);
        let within_y = isa.at_most(*y0, isa.splat(height)) & isa.at_most(zero, *y1);
        self.flat = isa.at_most(isa.splat(-p.most_size), boxes.minus_size) & !near;
        self.seen = within_x & within_y | !self.flat;
        self.depth = isa.to_array(depth);
        self.nearness = isa.to_array(nearness);
        self.x0 = pixels(isa, *x0, width);
        self.x1 = pixels(isa, *x1, width);
        self.y0 = pixels(isa, *y0, height);
        self.y1 = pixels(isa, *y1, height);
    }
}

/// Sixteen boxes relative to the eye.
struct AboutEye<I: Isa> {
    /// Lower and upper bounds, by axis.
    bounds: [[I::Floats; 2]; 3],
    /// Size that all errors are relative to, negated: -r.
    minus_size: I::Floats,
}

impl<I: Isa> AboutEye<I> {
    #[inline(always)]
    fn of(isa: I, block: &BoxBlock, p: &Projection) -> Self {
        let minus = isa.splat(-1.0);
        let corner = |high| block.corner_rows(BoxCorner([high; 3]));
        let (lower, upper) = (corner(false), corner(true));
        let mut bounds = [[isa.splat(0.0); 2]; 3];
        let mut minus_size = isa.splat(-p.far_from_zero);
        for (axis, bounds) in bounds.iter_mut().enumerate() {
            let (eye, rest) = (isa.splat(-p.eye[axis]), isa.splat(-p.rest[axis]));
            let about = |row: &[f32; LANES]| isa.add(isa.add(isa.load(row), eye), rest);
            let (low, high) = (about(lower[axis]), about(upper[axis]));
            *bounds = [low, high];
            // low <= high, so the greater size is that of -low or of high.
            minus_size = isa.add(minus_size, isa.min(low, isa.mul(high, minus)));
        }
        AboutEye { bounds, minus_size }
    }

    /// Products of the bounds with a row.
    #[inline(always)]
    fn products(&self, isa: I, row: &[f32; 3]) -> [[I::Floats; 2]; 3] {
        let mut products = self.bounds;
        for axis in 0..3 {
            let factor = isa.splat(row[axis]);
            let [low, high] = self.bounds[axis];
            products[axis] = [isa.mul(low, factor), isa.mul(high, factor)];
        }
        products
    }

    /// Least and greatest product of a row with any corner.
    #[inline(always)]
    fn range(&self, isa: I, row: &[f32; 3]) -> [I::Floats; 2] {
        let mut low = [isa.splat(0.0); 3];
        let mut high = low;
        for (axis, [p, q]) in self.products(isa, row).into_iter().enumerate() {
            low[axis] = isa.min(p, q);
            high[axis] = isa.max(p, q);
        }
        [
            isa.add(isa.add(low[0], low[1]), low[2]),
            isa.add(isa.add(high[0], high[1]), high[2]),
        ]
    }
}

/// Sum of products at corner 0 to 7: bit `axis` selects the upper bound.
#[inline(always)]
fn at_corner<I: Isa>(isa: I, p: &[[I::Floats; 2]; 3], corner: usize) -> I::Floats {
    let across = isa.add(p[0][corner & 1], p[1][corner >> 1 & 1]);
    isa.add(across, p[2][corner >> 2])
}

#[inline(always)]
fn inverses(mut row: [f32; LANES]) -> [f32; LANES] {
    for x in &mut row {
        *x = 1.0 / *x;
    }
    row
}

/// Pixels that contain the coordinates, clamped to the image.
#[inline(always)]
fn pixels<I: Isa>(isa: I, at: I::Floats, size: f32) -> [i32; LANES] {
    // Returns the bound if `at` is NaN.
    let at = isa.max(at, isa.splat(0.0));
    isa.whole(isa.min(at, isa.splat(size - 1.0)))
}
