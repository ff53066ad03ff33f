//! Points in the frame of the camera, in f64, with a bound on their error.

use std::ops::RangeInclusive;

use glam::{DVec3, Vec3};

use super::super::rays::SampleGrid;
use super::view::View;
use crate::camera::Lens;

/// Error of a coordinate per unit of the numbers in it. The axes are orthonormal to
/// some units of 2^-53; products, sums and a quotient add some more: 2^-40 is
/// thousands of times that.
const ERROR: f64 = 1.0 / (1u64 << 40) as f64;

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

    /// Columns and rows of the samples that the screen box of some points holds;
    /// `None` if one is not surely in front of the eye.
    #[inline(always)]
    pub fn samples(&self, points: [Vec3; 3]) -> Option<[RangeInclusive<i64>; 2]> {
        let [left, right, bottom, top] = self.window;
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in points {
            let Seen { x, y, depth, error } = self.seen(p);
            if depth <= error {
                return None;
            }
            let (x, y) = match self.is_parallel {
                true => (x, y),
                false => (x / depth, y / depth),
            };
            let scale = if self.is_parallel { 1.0 } else { depth - error };
            let slack = |at: f64| error / scale * (1.0 + at.abs()) + ERROR * at.abs();
            let slack = DVec3::new(slack(x), slack(y), 0.0);
            let at = DVec3::new(x, y, 0.0);
            low = low.min(at - slack);
            high = high.max(at + slack);
        }
        // A sample is at the centre of its pixel: index + 1/2.
        let within = |low: f64, high: f64, count: u32| {
            let slack = ERROR * f64::from(count) * (1.0 + low.abs() + high.abs());
            let first = libm::ceil(low * f64::from(count) - 0.5 - slack).max(0.0);
            let last = libm::floor(high * f64::from(count) - 0.5 + slack);
            first as i64..=last.min(f64::from(count) - 1.0) as i64
        };
        let (width, height) = (right - left, top - bottom);
        let columns = within(
            (low.x - left) / width,
            (high.x - left) / width,
            self.grid.width,
        );
        let rows = within(
            (top - high.y) / height,
            (top - low.y) / height,
            self.grid.height,
        );
        Some([columns, rows])
    }
}
