//! Camera in the form that the occlusion stage needs.
//!
//! Rays of an image as linear functions of the position in the image (f64, for drawing), and the
//! projection of points to the image (f32, for the sixteen boxes of a block).
//!
//! The image has x from 0 to width and y from 0, the top, to height: the pixel in column c and row
//! r is the closed square `[c, c + 1] x [r, r + 1]`.

use glam::DVec3;

use super::scene::{Faces, OccluderTree, faces};
use crate::geometry::{Aabb, ConvexVolume};
use crate::visibility::{Rays, SampleGrid};

/// Half a unit in the last place of 1 in f32.
pub const U: f32 = 1.0 / (1u32 << 24) as f32;

/// Columns of a tile of the depth buffer.
pub const TILE_WIDTH: usize = 8;
/// Rows of a tile of the depth buffer.
pub const TILE_HEIGHT: usize = 4;

/// Linear function `x * a + y * b + c` over the image.
#[derive(Clone, Copy, PartialEq, Default, Debug)]
pub struct LinearFunction {
    /// Coefficient per column.
    pub x: f64,
    /// Coefficient per row.
    pub y: f64,
    /// Value at the image's upper left corner.
    pub c: f64,
}

impl LinearFunction {
    /// Constant function.
    pub const fn constant(c: f64) -> LinearFunction {
        LinearFunction { x: 0.0, y: 0.0, c }
    }

    /// `a * self + b * other`.
    #[inline(always)]
    pub fn blend(&self, a: f64, other: &LinearFunction, b: f64) -> LinearFunction {
        LinearFunction {
            x: a * self.x + b * other.x,
            y: a * self.y + b * other.y,
            c: a * self.c + b * other.c,
        }
    }

    /// `a * self`.
    #[inline(always)]
    pub fn times(&self, a: f64) -> LinearFunction {
        LinearFunction {
            x: a * self.x,
            y: a * self.y,
            c: a * self.c,
        }
    }
}

/// Projection of positions to pixels, in f32 and relative to the eye.
#[derive(Clone, Copy, Debug)]
pub struct Projection {
    /// Eye, rounded to f32.
    pub eye: [f32; 3],
    /// Remainder of the rounding, subtracted after the eye.
    pub rest: [f32; 3],
    /// Rows for x, y and depth.
    ///
    /// For a perspective lens x and y are still to be divided by the depth.
    pub rows: [[f32; 3]; 3],
    /// Offset of x and y; zero for a perspective lens.
    pub shift: [f32; 2],
    /// Width and height of the image in pixels.
    pub size: [f32; 2],
    /// Error of a coordinate, apart from the box's own size, in units of 2 u.
    ///
    /// See `rect`.
    pub far_from_zero: f32,
    /// Factors of the slack in x and y: see `rect`.
    pub slack: [f32; 2],
    /// Part of the slack that is independent of the box's size.
    pub slack_added: [f32; 2],
    /// Base of the nearness of an orthographic lens: nearness = base - depth.
    pub base: f32,
    /// Boxes farther away than this count as near: see `rect`. Below 0 all of them do.
    pub most_size: f32,
}

/// Rays of a camera through the pixels of a buffer, in scene coordinates.
#[derive(Clone, Debug)]
pub struct View<'v> {
    /// Volume whose planes decide which items are in the view.
    pub volume: &'v ConvexVolume,
    /// Grid of pixels.
    pub grid: SampleGrid,
    /// Width and height of the image in pixels, rounded up to whole tiles.
    pub padded: [f64; 2],
    /// `true` if all rays are parallel.
    pub parallel: bool,
    /// Eye in scene coordinates.
    pub eye: DVec3,
    /// Axis of view.
    pub forward: DVec3,
    /// Rays by axis, as linear functions of the position in the image.
    ///
    /// Perspective: direction per unit of depth. Parallel: start in the plane of the eye, relative
    /// to the eye.
    pub rays: [LinearFunction; 3],
    /// Largest sum of absolute coordinates of `rays` in the padded image.
    pub reach: f64,
    /// Error of the eye's coordinates, in units of 2^-52.
    pub far_from_zero: f64,
    /// Least visible depth.
    pub near: f64,
    /// Largest visible depth, or infinity.
    pub far: f64,
    /// Box with all points of rays before the near plane (perspective lenses).
    pub before_near: [DVec3; 2],
    /// Faces of the scene's bounds that no ray crosses from outside.
    ///
    /// See `outline`.
    pub open: Faces,
    /// Projection for the boxes of a block.
    pub projection: Projection,
}

impl<'v> View<'v> {
    /// Rays of a camera in a scene.
    ///
    /// The volume decides which items are in the view; it should contain everything that the rays
    /// meet.
    pub fn new(
        rays: &Rays,
        volume: &'v ConvexVolume,
        scene: &OccluderTree,
        grid: SampleGrid,
    ) -> View<'v> {
        let camera = &rays.camera;
        let frame = &camera.frame;
        let parallel = camera.lens.is_orthographic();
        let [left, right, bottom, top] = rays.window;
        let (width, height) = (f64::from(grid.width), f64::from(grid.height));
        let (u, v, forward) = (frame.u(), frame.v(), frame.forward());
        let corner = u * left + v * top;
        let corner = if parallel { corner } else { corner + forward };
        let across = u * ((right - left) / width);
        let down = v * ((bottom - top) / height);
        let lines = [0, 1, 2].map(|axis| LinearFunction {
            x: across[axis],
            y: down[axis],
            c: corner[axis],
        });
        let columns = (grid.width as usize).next_multiple_of(TILE_WIDTH);
        let rows = (grid.height as usize).next_multiple_of(TILE_HEIGHT);
        let padded = [columns, rows].map(|size| size as f64);
        let reach = |l: &LinearFunction| l.x.abs() * padded[0] + l.y.abs() * padded[1] + l.c.abs();
        let reach: f64 = lines.iter().map(reach).sum();
        let eye = frame.eye - scene.origin;
        // Each parallel ray has its own start, rounded in world coordinates; the common start of
        // other rays is exact there.
        let in_world = if parallel { frame.eye } else { DVec3::ZERO };
        let far_from_zero = eye.abs().element_sum() + 4.0 * in_world.abs().element_sum();
        let near = camera.lens.near();
        View {
            volume,
            grid,
            padded,
            parallel,
            eye,
            forward,
            rays: lines,
            reach,
            far_from_zero,
            near,
            far: camera.lens.far().unwrap_or(f64::INFINITY),
            before_near: before_near(rays, near, eye, far_from_zero),
            // Faces that the eye is not beyond, or that parallel rays do not enter by.
            open: match parallel {
                true => faces(forward.cmple(DVec3::ZERO), forward.cmpge(DVec3::ZERO)),
                false => faces(
                    frame.eye.cmpge(scene.bounds.min),
                    frame.eye.cmple(scene.bounds.max),
                ),
            },
            projection: Projection::new(rays, eye, far_from_zero, grid),
        }
    }

    /// Returns `true` if some ray may enter the box, or start in it, before near.
    ///
    /// Such a box may not be drawn: that ray does not meet it.
    #[inline(always)]
    pub fn entered_before_near(&self, outer: &Aabb) -> bool {
        let (low, high) = (outer.min.as_dvec3(), outer.max.as_dvec3());
        if self.parallel {
            let (low, high) = (low - self.eye, high - self.eye);
            let f = self.forward;
            let least: f64 = (0..3).map(|k| (f[k] * low[k]).min(f[k] * high[k])).sum();
            let size = low.abs().max(high.abs()).element_sum() + self.far_from_zero;
            return least <= self.near + size * MARGIN;
        }
        let [first, last] = self.before_near;
        low.cmple(last).all() && first.cmple(high).all()
    }
}

/// Margin of f64 sums of a few products, relative to their sizes: 2^-44.
///
/// Each coordinate relative to the eye is wrong by at most 2^-52 of itself and of the eye's (the
/// eye in scene coordinates was rounded once, the difference once), each coefficient of a ray by
/// less than 2^-50 of the ray's reach, the truth's own rays by as much, and a sum of three products
/// adds 2^-51 of their sizes: less than 2^-47 in all.
pub const MARGIN: f64 = 1.0 / (1u64 << 44) as f64;

/// Bounds of the pyramid from the eye to the near window, moved outward.
fn before_near(rays: &Rays, near: f64, eye: DVec3, far_from_zero: f64) -> [DVec3; 2] {
    let frame = &rays.camera.frame;
    let [left, right, bottom, top] = rays.window;
    let (mut low, mut high) = (eye, eye);
    for (x, y) in [(left, bottom), (right, bottom), (left, top), (right, top)] {
        let corner = eye + (frame.u() * x + frame.v() * y + frame.forward()) * near;
        (low, high) = (low.min(corner), high.max(corner));
    }
    let width = near * (1.0 + left.abs() + right.abs() + bottom.abs() + top.abs());
    let slack = DVec3::splat((far_from_zero + width) * MARGIN);
    [low - slack, high + slack]
}

impl Projection {
    fn new(rays: &Rays, eye: DVec3, far_from_zero: f64, grid: SampleGrid) -> Projection {
        let (frame, parallel) = (&rays.camera.frame, rays.camera.lens.is_orthographic());
        let [left, right, bottom, top] = rays.window;
        let size = [grid.width, grid.height].map(f64::from);
        let (per_x, per_y) = (size[0] / (right - left), size[1] / (bottom - top));
        let (u, v, f) = (frame.u(), frame.v(), frame.forward());
        let tilted = [(u - f * left) * per_x, (v - f * top) * per_y, f];
        let (rows, shift) = match parallel {
            true => ([u * per_x, v * per_y, f], [-left * per_x, -top * per_y]),
            false => (tilted, [0.0, 0.0]),
        };
        let local = eye.as_vec3();
        let rest = (eye - local.as_dvec3()).as_vec3();
        let u_f64 = f64::from(U);
        let base = rays.camera.lens.far().unwrap_or(0.0);
        // 10 u: derived in `rect`.
        let sizes = if parallel { 0.0 } else { 2.0 };
        let factor = |row: DVec3, size: f64| (10.0 * u_f64 * (row.length() + sizes * size)) as f32;
        // Subnormal coordinates relative to the eye lose 2^-149 each.
        let lost = |row: DVec3| 4.0 * f64::from(f32::from_bits(1)) * row.abs().element_sum();
        let added = |row: DVec3, shift: f64, size: f64| {
            (lost(row) + 10.0 * u_f64 * (shift.abs() + 2.0 * size)) as f32
        };
        let largest = rows[0].abs().max(rows[1].abs()).max_element();
        let most_size = match largest <= 1e37 && shift.iter().all(|s| s.abs() <= 1e37) {
            true => (1e37 / largest).min(1e25),
            // Infinite in f32, or NaN.
            false => -1.0,
        };
        Projection {
            eye: local.to_array(),
            rest: rest.to_array(),
            rows: rows.map(|row| row.as_vec3().to_array()),
            shift: shift.map(|s| s as f32),
            size: size.map(|s| s as f32),
            far_from_zero: (u_f64 * far_from_zero) as f32,
            slack: [0, 1].map(|axis| factor(rows[axis], size[axis])),
            slack_added: [0, 1].map(|axis| added(rows[axis], shift[axis], size[axis])),
            base: base as f32,
            most_size: most_size as f32,
        }
    }
}
