//! Points in the frame of the camera, in f64, with a bound on their error.

use glam::{DVec3, Vec3};

use super::super::rays::SampleGrid;
use super::view::View;
use crate::camera::Lens;

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

/// A point: right, up, depth, and the error of each.
struct Seen {
    x: f64,
    y: f64,
    depth: f64,
    error: f64,
}

impl Screen {
    /// Bits of an outcode that are about depth: nearer than near, beyond far.
    pub const DEPTH: u8 = 0b11_0000;

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

    #[inline(always)]
    fn seen(&self, p: Vec3) -> Seen {
        let way = p.as_dvec3() - self.eye;
        let size = way.abs() + self.eye.abs() * (1.0 / 1024.0);
        let [x, y, depth] = self.axes.map(|axis| axis.dot(way));
        let error = ERROR * (size.x + size.y + size.z);
        Seen { x, y, depth, error }
    }

    /// The scale of the window at a depth.
    #[inline(always)]
    fn scale(&self, depth: f64) -> f64 {
        if self.is_parallel { 1.0 } else { depth }
    }

    /// One bit for each plane that a point is surely outside of: left, right,
    /// bottom, top, near, far.
    #[inline(always)]
    pub fn outcode(&self, p: Vec3) -> u8 {
        let Seen { x, y, depth, error } = self.seen(p);
        let [left, right, bottom, top] = self.window;
        let scale = self.scale(depth);
        let slack = |slope: f64| error * (1.0 + slope.abs());
        let bits = [
            x + slack(left) < left * scale,
            x - slack(right) > right * scale,
            y + slack(bottom) < bottom * scale,
            y - slack(top) > top * scale,
            depth + error < self.near,
            depth - error > self.far,
        ];
        (0..6).fold(0, |code, k| code | u8::from(bits[k]) << k)
    }

    /// Whether a point in front of the eye is in a window `band` times as large.
    pub fn is_within(&self, p: Vec3, band: f64) -> bool {
        let Seen { x, y, depth, .. } = self.seen(p);
        let [left, right, bottom, top] = self.window;
        let scale = self.scale(depth);
        let within = |at: f64, low: f64, high: f64| {
            let (centre, half) = ((low + high) / 2.0, (high - low) / 2.0 * band);
            (at - centre * scale).abs() <= half * scale
        };
        within(x, left, right) && within(y, bottom, top)
    }

    /// Where a point may be in the image; everywhere if it is not surely in front of
    /// the eye.
    #[inline(always)]
    pub fn pixels(&self, p: Vec3) -> PixelBox {
        let Seen { x, y, depth, error } = self.seen(p);
        let [left, right, bottom, top] = self.window;
        // The error of a quotient: that of its parts, by the least depth there is.
        let (scale, least) = match self.is_parallel {
            true => (1.0, 1.0),
            false => (1.0 / depth, depth - error),
        };
        if !(depth > error && least > 1e-300) {
            return PixelBox::EVERYWHERE;
        }
        let (x, y, slack) = (x * scale, y * scale, error / least);
        let columns = f64::from(self.grid.width) / (right - left);
        let rows = f64::from(self.grid.height) / (top - bottom);
        let span = |at: f64, from: f64, unit: f64| {
            let slack = slack * (1.0 + at.abs()) + ERROR * (at.abs() + from.abs() + 1.0);
            // A sample is at the centre of its pixel: index + 1/2.
            let middle = at * unit - from * unit - 0.5;
            let slack = slack * unit + ERROR * middle.abs();
            (middle - slack, middle + slack)
        };
        let (first_column, last_column) = span(x, left, columns);
        // Rows are counted downward.
        let (first_row, last_row) = span(-y, -top, rows);
        PixelBox {
            low: [first_column, first_row],
            high: [last_column, last_row],
        }
    }

    /// Whether a sample lies in the box.
    #[inline(always)]
    pub fn has_sample(&self, all: &PixelBox) -> bool {
        let within = |low: f64, high: f64, count: u32| {
            let count = f64::from(count);
            let low = -least(-low, 0.0);
            let low = least(low, count);
            // Near 2^52 only whole numbers are left: the nearest one, without a call.
            let whole = (low + WHOLE) - WHOLE;
            let next = if whole < low { whole + 1.0 } else { whole };
            next <= least(high, count - 1.0)
        };
        within(all.low[0], all.high[0], self.grid.width)
            && within(all.low[1], all.high[1], self.grid.height)
    }
}

/// Column and row of what is seen, in samples: 0 is the first one.
#[derive(Clone, Copy, Default, Debug)]
pub struct PixelBox {
    low: [f64; 2],
    high: [f64; 2],
}

impl PixelBox {
    /// The whole plane.
    const EVERYWHERE: PixelBox = PixelBox {
        low: [f64::NEG_INFINITY; 2],
        high: [f64::INFINITY; 2],
    };

    /// The box of two.
    #[inline(always)]
    pub fn union(self, other: PixelBox) -> PixelBox {
        let low = |k: usize| least(self.low[k], other.low[k]);
        let high = |k: usize| -least(-self.high[k], -other.high[k]);
        PixelBox {
            low: [low(0), low(1)],
            high: [high(0), high(1)],
        }
    }
}

/// The lesser of two numbers, neither a NaN: one instruction.
#[inline(always)]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}
