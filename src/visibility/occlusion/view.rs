//! A camera as the occlusion stage needs it.
//!
//! Rays of an image, as linear functions of the place in the image (f64, for what
//! is drawn), and a point's place in it (f32, for the sixteen boxes of a block).
//!
//! The image has x from 0 to width and y from 0, the top, to height: the pixel in
//! column c and row r is the closed square `[c, c + 1] x [r, r + 1]`.

use glam::DVec3;

use super::scene::{Faces, OccluderScene, faces};
use crate::geometry::{Aabb, ConvexVolume};
use crate::visibility::{Rays, SampleGrid};

/// Half a unit in the last place of 1, of f32.
pub const U: f32 = 1.0 / (1u32 << 24) as f32;

/// Columns of a tile of the buffer.
pub const TILE_WIDTH: usize = 8;
/// Rows of a tile of the buffer.
pub const TILE_HEIGHT: usize = 4;

/// `x * a + y * b + c` over the image.
#[derive(Clone, Copy, PartialEq, Default, Debug)]
pub struct Linear {
    /// Per column.
    pub x: f64,
    /// Per row.
    pub y: f64,
    /// At the image's upper left corner.
    pub c: f64,
}

impl Linear {
    /// A function that is the same everywhere.
    pub const fn constant(c: f64) -> Linear {
        Linear { x: 0.0, y: 0.0, c }
    }

    /// `a * self + b * other`.
    #[inline(always)]
    pub fn blend(&self, a: f64, other: &Linear, b: f64) -> Linear {
        Linear {
            x: a * self.x + b * other.x,
            y: a * self.y + b * other.y,
            c: a * self.c + b * other.c,
        }
    }

    /// `a * self`.
    #[inline(always)]
    pub fn times(&self, a: f64) -> Linear {
        Linear {
            x: a * self.x,
            y: a * self.y,
            c: a * self.c,
        }
    }
}

/// How positions become pixels, in f32 and about the eye.
#[derive(Clone, Copy, Debug)]
pub struct Projection {
    /// The eye, rounded to f32, and what the rounding left.
    pub eye: [f32; 3],
    /// To be subtracted after the eye.
    pub rest: [f32; 3],
    /// Rows for x, y and depth: of a perspective lens x and y are still to be
    /// divided by the depth.
    pub rows: [[f32; 3]; 3],
    /// Added to x and y; zero for a perspective lens.
    pub shift: [f32; 2],
    /// Width and height of the image.
    pub size: [f32; 2],
    /// Error of a coordinate, apart from the box's own size, in units of
    /// two u: see `rect`.
    pub far_from_zero: f32,
    /// Factors of the slack in x and y: see `rect`.
    pub slack: [f32; 2],
    /// The part of it that no size of a box changes.
    pub slack_added: [f32; 2],
    /// Depth that depths are subtracted from for an orthographic lens.
    pub base: f32,
    /// Boxes farther away than this are near: see `rect`. Below 0 all of them are.
    pub most_size: f32,
}

/// A camera's rays over the pixels of a buffer, in a scene's coordinates.
#[derive(Clone, Debug)]
pub struct View<'v> {
    /// The volume whose planes say what is in the view at all.
    pub volume: &'v ConvexVolume,
    /// Pixels.
    pub grid: SampleGrid,
    /// Width and height of the image in pixels, rounded up to whole tiles.
    pub padded: [f64; 2],
    /// `true` if all rays are parallel.
    pub parallel: bool,
    /// The eye in scene coordinates.
    pub eye: DVec3,
    /// The axis of view.
    pub forward: DVec3,
    /// Perspective: a ray's direction for unit depth, axis by axis. Parallel rays:
    /// where the ray leaves the plane of the eye, about the eye.
    pub rays: [Linear; 3],
    /// Largest coordinate of `rays` within the padded image, all axes
    /// together.
    pub reach: f64,
    /// Error of the eye's coordinates, in units of 2^-52.
    pub far_from_zero: f64,
    /// Least visible depth.
    pub near: f64,
    /// Largest visible depth, or infinity.
    pub far: f64,
    /// A box that holds all points of rays before the near plane (perspective lenses).
    pub before_near: [DVec3; 2],
    /// The faces of the scene's bounds that no ray passes and comes back through: see
    /// `outline`.
    pub open: Faces,
    /// For the boxes of a block.
    pub projection: Projection,
}

impl<'v> View<'v> {
    /// A camera's rays in a scene.
    ///
    /// The volume decides which items are in the view; it should hold all that the rays meet.
    pub fn new(
        rays: &Rays,
        volume: &'v ConvexVolume,
        scene: &OccluderScene,
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
        let lines = [0, 1, 2].map(|axis| Linear {
            x: across[axis],
            y: down[axis],
            c: corner[axis],
        });
        let columns = (grid.width as usize).next_multiple_of(TILE_WIDTH);
        let rows = (grid.height as usize).next_multiple_of(TILE_HEIGHT);
        let padded = [columns, rows].map(|size| size as f64);
        let reach = |l: &Linear| l.x.abs() * padded[0] + l.y.abs() * padded[1] + l.c.abs();
        let reach: f64 = lines.iter().map(reach).sum();
        let eye = frame.eye - scene.origin;
        // Parallel rays begin at points of their own, which were rounded in world
        // coordinates; one that all rays share is exact there.
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
            // Those that the eye is not beyond, or that parallel rays do not leave by.
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

    /// Returns `true` if some ray may enter the box, or begin in it, before near.
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

/// Margin of f64 sums of a few products, relative to the sum of their sizes: 2^-44.
///
/// Each coordinate about the eye is wrong by at most
/// 2^-52 of itself and of the eye's (the eye in scene coordinates was rounded
/// once, the difference once), each coefficient of a ray by less than 2^-50 of the
/// ray's reach, the truth's own rays by as much, and a sum of three products adds
/// 2^-51 of their sizes: less than 2^-47 in all.
pub const MARGIN: f64 = 1.0 / (1u64 << 44) as f64;

/// The bounds of the pyramid from the eye to the near window, moved outward.
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
        // Subnormal coordinates about the eye lose 2^-149 each.
        let lost = |row: DVec3| 4.0 * f64::from(f32::from_bits(1)) * row.abs().element_sum();
        let added = |row: DVec3, shift: f64, size: f64| {
            (lost(row) + 10.0 * u_f64 * (shift.abs() + 2.0 * size)) as f32
        };
        let largest = rows[0].abs().max(rows[1].abs()).max_element();
        let most_size = match largest <= 1e37 && shift.iter().all(|s| s.abs() <= 1e37) {
            true => (1e37 / largest).min(1e25),
            // Infinite in f32, or no number.
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
