//! Points in the frame of the camera, in f64, with a bound on their error.

use std::sync::Arc;

use glam::DVec3;

use super::super::rays::SampleGrid;
use super::clusters::Clusters;
use super::contract::TriangleCull;
use super::locals::{EIGHT, Locals, Points, Rule};
use super::selection::Selection;
use super::view::View;
use crate::camera::Lens;
use crate::kernel::{Isa, Kernel, Work, each};

/// Error of a coordinate per unit of the numbers in it. The axes are orthonormal to
/// some units of 2^-53; products, sums and a quotient add some more: 2^-40 is
/// thousands of times that.
const ERROR: f64 = 1.0 / (1u64 << 40) as f64;

/// 2^52: adding it rounds what is not negative to a whole number.
const WHOLE: f64 = (1u64 << 52) as f64;

/// A camera with a window, scene-local.
#[derive(Clone, Copy, Debug)]
pub struct Screen {
    eye: DVec3,
    axes: [DVec3; 3],
    window: [f64; 4],
    near: f64,
    far: f64,
    is_parallel: bool,
    grid: SampleGrid,
}

/// A back end that decides by where the points of clusters are on the screen.
pub struct Screened<R> {
    locals: Locals,
    rule: fn(Screen) -> R,
}

impl<R: Rule> Screened<R> {
    /// Copies the points. O(t).
    pub fn of(clusters: &Arc<Clusters>, rule: fn(Screen) -> R) -> Screened<R> {
        let locals = Locals::of(clusters);
        Screened { locals, rule }
    }
}

impl<R: Rule> TriangleCull for Screened<R> {
    fn cull(&self, view: &View, kernel: Kernel, kept: &mut Selection) {
        if let Some(screen) = Screen::of(view) {
            let (locals, rule) = (&self.locals, (self.rule)(screen));
            kernel.run(Query { locals, rule, kept });
        }
    }
}

struct Query<'a, R> {
    locals: &'a Locals,
    rule: R,
    kept: &'a mut Selection,
}

impl<R: Rule> Work for Query<'_, R> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        self.locals.retain(self.kept, &self.rule);
    }
}

/// Eight points: right, up, depth, and the error of each.
struct Seen {
    x: [f64; EIGHT],
    y: [f64; EIGHT],
    depth: [f64; EIGHT],
    error: [f64; EIGHT],
}

impl Screen {
    /// `None` for a view without a window.
    pub fn of(view: &View) -> Option<Screen> {
        let window = view.window.as_ref()?;
        let camera = window.rays.camera();
        let frame = &camera.frame;
        Some(Screen {
            eye: frame.eye - window.origin,
            axes: [frame.u(), frame.v(), frame.forward()],
            window: window.rays.window(),
            near: camera.lens.near(),
            far: camera.lens.far().unwrap_or(f64::INFINITY),
            is_parallel: matches!(camera.lens, Lens::Orthographic { .. }),
            grid: window.grid,
        })
    }

    // Plain loops over lanes: what the compiler makes vectors of.

    #[inline(always)]
    fn seen(&self, points: &Points) -> Seen {
        let zero = [0.0; EIGHT];
        let (mut x, mut y, mut depth, mut size) = (zero, zero, zero, zero);
        for (k, row) in points.iter().enumerate() {
            let (eye, [u, v, n]) = (self.eye[k], each(self.axes, |axis| axis[k]));
            let least = eye.abs() * (1.0 / 1024.0);
            for lane in 0..EIGHT {
                let way = f64::from(row[lane]) - eye;
                x[lane] += u * way;
                y[lane] += v * way;
                depth[lane] += n * way;
                size[lane] += way.abs() + least;
            }
        }
        let error = each(size, |size| ERROR * size);
        Seen { x, y, depth, error }
    }

    /// One bit for each plane that a point is surely outside of: left, right,
    /// bottom, top, near, far.
    #[inline(always)]
    pub(super) fn outcodes(&self, points: &Points) -> [u8; EIGHT] {
        let Seen { x, y, depth, error } = self.seen(points);
        let [left, right, bottom, top] = self.window;
        let mut codes = [0u64; EIGHT];
        let across = [
            (x, left, 1.0),
            (x, right, -1.0),
            (y, bottom, 1.0),
            (y, top, -1.0),
        ];
        for (bit, (at, slope, sign)) in across.into_iter().enumerate() {
            let slack = 1.0 + slope.abs();
            for lane in 0..EIGHT {
                let scale = if self.is_parallel { 1.0 } else { depth[lane] };
                let inside = (at[lane] - slope * scale) * sign + error[lane] * slack;
                codes[lane] |= u64::from(inside < 0.0) << bit;
            }
        }
        for lane in 0..EIGHT {
            codes[lane] |= u64::from(depth[lane] + error[lane] < self.near) << 4;
            codes[lane] |= u64::from(depth[lane] - error[lane] > self.far) << 5;
        }
        each(codes, |code| code as u8)
    }

    /// Where points may be in the image; everywhere if they are not surely in front of
    /// the eye.
    #[inline(always)]
    pub(super) fn pixels(&self, points: &Points) -> [PixelBox; EIGHT] {
        let Seen {
            mut x,
            mut y,
            depth,
            error,
        } = self.seen(points);
        let [left, right, bottom, top] = self.window;
        // The error of a quotient: that of its parts, by the least depth there is.
        let mut slack = error;
        if !self.is_parallel {
            for lane in 0..EIGHT {
                let scale = 1.0 / depth[lane];
                x[lane] *= scale;
                // Rows are counted downward.
                y[lane] *= -scale;
                // 1 / (depth - error), and something more, where error is far below
                // depth; elsewhere the point is not used.
                slack[lane] *= scale * (1.0 + 4.0 * ERROR);
            }
        } else {
            y = y.map(|y| -y);
        }
        let columns = span(&x, &slack, left, 1.0 / (right - left), self.grid.width);
        let rows = span(&y, &slack, -top, 1.0 / (top - bottom), self.grid.height);
        let mut boxes = [PixelBox::EVERYWHERE; EIGHT];
        for lane in 0..EIGHT {
            // Far below: 2^-1 of it is enough for the slack above, doubled there.
            let is_ahead = depth[lane] * 0.5 > error[lane] && depth[lane] > 1e-300;
            if is_ahead {
                let least = [
                    columns[0][lane],
                    rows[0][lane],
                    columns[1][lane],
                    rows[1][lane],
                ];
                boxes[lane] = PixelBox { least };
            }
        }
        boxes
    }
}

/// First and negated last sample between offsets `at` with their errors, `count`
/// samples per width, the first one beginning at `from`; none outside the image.
#[inline(always)]
fn span(
    at: &[f64; EIGHT],
    error: &[f64; EIGHT],
    from: f64,
    per_width: f64,
    count: u32,
) -> [[i32; EIGHT]; 2] {
    let count = f64::from(count.min(FAR as u32));
    let unit = per_width * count;
    let (mut first, mut minus_last) = ([0; EIGHT], [0; EIGHT]);
    for lane in 0..EIGHT {
        let size = at[lane].abs();
        let slack = 2.0 * error[lane] * (1.0 + size) + ERROR * (size + from.abs() + 1.0);
        // A sample is at the centre of its pixel: index + 1/2.
        let middle = (at[lane] - from) * unit - 0.5;
        let slack = slack * unit + ERROR * middle.abs();
        // Near 2^52 only whole numbers are left, in the lowest bits: the nearest one
        // without a call, and from there up or down.
        let low = least(-least(-(middle - slack), 0.0), count);
        let near = low + WHOLE;
        first[lane] = near.to_bits() as i32 + i32::from(near - WHOLE < low);
        let above = least(-least(-(middle + slack + 1.0), 0.0), count);
        let near = above + WHOLE;
        minus_last[lane] = 1 - near.to_bits() as i32 + i32::from(near - WHOLE > above);
    }
    [first, minus_last]
}

/// Beyond any column or row.
const FAR: i32 = 1 << 29;

/// Columns and rows of samples: first column and row, last ones negated. Clipped to
/// the image.
#[derive(Clone, Copy, Default, Debug)]
pub struct PixelBox {
    least: [i32; 4],
}

impl PixelBox {
    /// The whole plane.
    const EVERYWHERE: PixelBox = PixelBox { least: [-FAR; 4] };

    /// The box of two.
    #[inline(always)]
    pub fn union(self, other: PixelBox) -> PixelBox {
        let mut least = self.least;
        for (least, other) in least.iter_mut().zip(other.least) {
            *least = (*least).min(other);
        }
        PixelBox { least }
    }

    /// Whether a sample lies in it.
    #[inline(always)]
    pub fn has_sample(self) -> bool {
        let [column, row, minus_column, minus_row] = self.least;
        // Both, without a branch that could not be predicted.
        (column + minus_column <= 0) & (row + minus_row <= 0)
    }
}

/// The lesser of two numbers, neither a NaN: one instruction.
#[inline(always)]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}
