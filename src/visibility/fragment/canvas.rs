//! Samples of an image: rays, screen rectangles of bodies, and the stencil test.

use std::ops::Range;

use glam::{DVec3, Vec3};

use crate::kernel::each;
use crate::scene::WorldBox;
use crate::visibility::truth::{Body, SolidBox};
use crate::visibility::{Rays, SampleGrid};

/// Range of columns and rows of samples.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Rectangle {
    /// Columns, counted from the left.
    pub columns: Range<u32>,
    /// Rows, counted from the top.
    pub rows: Range<u32>,
}

impl Rectangle {
    /// Number of samples in the rectangle.
    pub fn samples(&self) -> u64 {
        self.columns.len() as u64 * self.rows.len() as u64
    }
}

/// Widening of a corner's projected slope, relative to the corner's distance.
///
/// Let u = 2^-53 and D the sum of the absolute components of `corner - eye`. The difference is
/// accurate to u D and each dot product to 4 u D, so a slope `s = x / w` is accurate to 9 u (1 +
/// |s|) D / w. The constant is 512 u.
const SLOPE_PAD: f64 = 1.0 / (1u64 << 44) as f64;

/// Widening where an edge is clipped at the near plane, relative to D.
///
/// The edge's ends differ in depth by at least [`MIN_CLIP_DEPTH`] D, so the clip point is accurate
/// to 2^20 * 16 u D. The constant is twice that.
const CLIP_PAD: f64 = 1.0 / (1u64 << 28) as f64;

/// Least depth difference of a clipped edge, relative to D.
///
/// An edge that crosses the near plane with a smaller difference is not clipped: its body gets the
/// whole image.
const MIN_CLIP_DEPTH: f64 = 1.0 / (1u64 << 20) as f64;

/// Upper bound of the rounding errors of a camera's rays and axes, as slopes.
const AXIS_PAD: f64 = 1e-12;

/// A camera's image plane, onto which bodies are projected.
#[derive(Clone, Copy, Debug)]
pub struct Screen {
    /// Sample grid of the image.
    pub grid: SampleGrid,
    window: [f64; 4],
    eye: DVec3,
    axes: [DVec3; 3],
    /// Least depth that is drawn, slightly before the near plane.
    near: f64,
    far: f64,
    parallel: bool,
    /// Rounding error of the origins of parallel rays, which are world coordinates.
    off: f64,
}

impl Screen {
    /// Image plane of a camera.
    pub fn of(rays: &Rays, grid: SampleGrid) -> Screen {
        let camera = &rays.camera;
        let (frame, lens) = (&camera.frame, &camera.lens);
        let (near, far) = (lens.near(), lens.far().unwrap_or(f64::INFINITY));
        Screen {
            grid,
            window: rays.window,
            eye: frame.eye,
            axes: [frame.u(), frame.v(), frame.forward()],
            near: near - near.abs() * 1e-9,
            far: far + far.abs() * 1e-9,
            parallel: lens.is_orthographic(),
            off: match lens.is_orthographic() {
                true => f64::EPSILON * frame.eye.abs().element_sum(),
                false => 0.0,
            },
        }
    }

    /// Screen rectangle with every sample whose ray meets the box.
    ///
    /// Conservative; `None` if certainly no ray meets the box.
    pub fn rectangle(&self, b: &WorldBox) -> Option<Rectangle> {
        let mut corners = [[0.0; 4]; 8];
        for (i, corner) in corners.iter_mut().enumerate() {
            let pick = |k: usize| if i >> k & 1 == 1 { b.max[k] } else { b.min[k] };
            *corner = self.project(DVec3::new(pick(0), pick(1), pick(2)) - self.eye, 0.0);
        }
        self.hull(&corners, |from, to| (from ^ to).is_power_of_two())
    }

    /// Screen rectangle of a triangle whose corners are relative to `origin`.
    pub fn triangle(&self, corners: [Vec3; 3], origin: DVec3) -> Option<Rectangle> {
        let shift = origin - self.eye;
        let mut projected = [[0.0; 4]; 3];
        for (corner, projected) in corners.iter().zip(&mut projected) {
            let corner = corner.as_dvec3();
            // The shift and the sum round once each.
            let off = 2.0 * f64::EPSILON * (corner.abs() + shift.abs()).element_sum();
            *projected = self.project(corner + shift, off);
        }
        self.hull(&projected, |from, to| from != to)
    }

    /// Projects a point relative to the eye to `[across, up, depth, size]`.
    ///
    /// Errors are relative to `size`. The point itself may be wrong by `off`.
    #[inline]
    fn project(&self, at: DVec3, off: f64) -> [f64; 4] {
        let [x, y, w] = each(self.axes, |axis| at.dot(axis));
        // `off` is an error of the depth as well.
        let size = at.abs().element_sum() + (off + self.off) / SLOPE_PAD;
        [x, y, w, size]
    }

    /// Screen rectangle of the convex hull of some corners.
    ///
    /// `is_edge` returns true for two corners if the hull has an edge between them.
    fn hull<const N: usize>(
        &self,
        corners: &[[f64; 4]; N],
        is_edge: impl Fn(usize, usize) -> bool,
    ) -> Option<Rectangle> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut add = |project: [f64; 2], pad: f64| {
            for (axis, at) in project.into_iter().enumerate() {
                let pad = pad * (1.0 + at.abs());
                low[axis] = low[axis].min(at - pad);
                high[axis] = high[axis].max(at + pad);
            }
        };
        let least = corners.iter().map(|c| c[2] - c[3] * SLOPE_PAD);
        if least.fold(f64::INFINITY, f64::min) > self.far {
            return None;
        }
        if self.parallel {
            corners
                .iter()
                .for_each(|&[x, y, _, size]| add([x, y], size * SLOPE_PAD + AXIS_PAD));
            return self.cells(low, high);
        }
        if corners.iter().all(|c| c[2] + c[3] * SLOPE_PAD < self.near) {
            return None;
        }
        for (i, &[x, y, w, size]) in corners.iter().enumerate() {
            if w >= self.near {
                add([x / w, y / w], size / w * SLOPE_PAD + AXIS_PAD);
                continue;
            }
            // Rounding hides on which side of the near plane the corner lies.
            if w + size * SLOPE_PAD >= self.near {
                return self.cells([f64::NEG_INFINITY; 2], [f64::INFINITY; 2]);
            }
            for (to, &[to_x, to_y, to_w, to_size]) in corners.iter().enumerate() {
                let size = size.max(to_size);
                if !is_edge(i, to) || to_w + size * SLOPE_PAD < self.near {
                    continue;
                }
                if to_w - w < size * MIN_CLIP_DEPTH {
                    return self.cells([f64::NEG_INFINITY; 2], [f64::INFINITY; 2]);
                }
                let part = (self.near - w) / (to_w - w);
                let at = |a: f64, b: f64| (a + (b - a) * part) / self.near;
                let pad = size / self.near * CLIP_PAD + AXIS_PAD;
                add([at(x, to_x), at(y, to_y)], pad);
            }
        }
        self.cells(low, high)
    }

    fn cells(&self, low: [f64; 2], high: [f64; 2]) -> Option<Rectangle> {
        let [left, right, bottom, top] = self.window;
        let cells = |low: f64, high: f64, from: f64, to: f64, count: u32| {
            let n = f64::from(count);
            let at = |slope: f64| (slope - from) / (to - from) * n - 0.5;
            let (a, b) = (at(low), at(high));
            // A thousandth of a pixel covers the rounding of this formula and of the rays.
            let first = (a.min(b) - 1e-3).ceil().clamp(0.0, n) as u32;
            let last = (a.max(b) + 1e-3).floor().clamp(-1.0, n - 1.0) + 1.0;
            first..last as u32
        };
        let SampleGrid { width, height } = self.grid;
        let columns = cells(low[0], high[0], left, right, width);
        let rows = cells(low[1], high[1], top, bottom, height);
        (!columns.is_empty() && !rows.is_empty()).then_some(Rectangle { columns, rows })
    }
}

/// Stencil: the samples that may be drawn.
#[derive(Clone, Debug)]
pub struct Stencil {
    /// `true` for each sample that may be drawn.
    pub marked: Vec<bool>,
    /// Number of samples whose rays were tested to make the stencil.
    pub tested: u64,
}

/// Samples of an image with their rays.
///
/// 88 bytes per sample for boxes, 128 for triangles.
#[derive(Clone, Debug)]
pub struct Canvas<B: Body = SolidBox> {
    /// Image plane, onto which boxes and triangles are projected.
    pub screen: Screen,
    /// Origin of the bodies' local coordinates.
    pub(super) origin: DVec3,
    /// The ray of each sample.
    pub(super) probes: Vec<B::Probe>,
}

impl<B: Body> Canvas<B> {
    /// Canvas of a camera's image, for bodies relative to `origin`.
    pub fn about(rays: &Rays, grid: SampleGrid, origin: DVec3) -> Canvas<B> {
        let mut canvas = Canvas {
            screen: Screen::of(rays, grid),
            origin,
            probes: Vec::with_capacity(grid.samples()),
        };
        canvas.set_camera(rays);
        canvas
    }

    /// Replaces the rays by those of another camera, in the same memory.
    pub fn set_camera(&mut self, rays: &Rays) {
        let grid = self.screen.grid;
        self.screen = Screen::of(rays, grid);
        self.probes.clear();
        let all = rays.of_grid(grid);
        all.for_each(|ray| self.probes.push(B::probe(&ray, self.origin)));
    }

    /// Calls `visit` with each sample of a rectangle that the stencil lets through.
    ///
    /// Returns the numbers of samples that pass the stencil and that it rejects.
    pub(super) fn scan(
        &self,
        rectangle: Option<Rectangle>,
        stencil: Option<&Stencil>,
        mut visit: impl FnMut(usize, &B::Probe),
    ) -> [u64; 2] {
        let [mut tested, mut kept_out] = [0; 2];
        let Rectangle { columns, rows } = rectangle.unwrap_or_default();
        for row in rows {
            for column in columns.clone() {
                let sample = (row * self.screen.grid.width + column) as usize;
                if stencil.is_some_and(|stencil| !stencil.marked[sample]) {
                    kept_out += 1;
                    continue;
                }
                tested += 1;
                visit(sample, &self.probes[sample]);
            }
        }
        [tested, kept_out]
    }
}
