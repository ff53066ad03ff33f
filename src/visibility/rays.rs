//! Camera rays, one per sample of an image.
//!
//! Direction and origin of a ray are f64, rounded once and exact from then on, so that every back
//! end and the truth test the same line.

use std::cmp::Ordering;
use std::fmt::Debug;

use glam::DVec3;

use crate::camera::{Camera, CameraError};

/// An image's samples: one at the centre of each pixel.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct SampleGrid {
    /// Columns, from the left.
    pub width: u32,
    /// Rows, from the top.
    pub height: u32,
}

impl SampleGrid {
    /// A grid of `width` columns and `height` rows.
    pub const fn new(width: u32, height: u32) -> SampleGrid {
        SampleGrid { width, height }
    }

    /// Number of samples.
    pub fn samples(self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Centre of a pixel: column from the left, row from the top.
    ///
    /// (0, 0) is the upper left corner of the image, (1, 1) the lower right one.
    fn centre(self, column: u32, row: u32) -> [f64; 2] {
        let at = |index: u32, count: u32| (f64::from(index) + 0.5) / f64::from(count);
        [at(column, self.width), at(row, self.height)]
    }

    /// Centres of all pixels, row by row.
    pub fn centres(self) -> impl Iterator<Item = [f64; 2]> {
        let rows = 0..self.height;
        rows.flat_map(move |row| (0..self.width).map(move |column| self.centre(column, row)))
    }
}

/// Half-line `origin + t * direction`; `t` is the depth.
///
/// The direction has length 1 along the axis of view (up to rounding), so it is not a unit vector.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ray {
    /// World coordinates; the eye, except for an orthographic lens.
    pub origin: DVec3,
    /// Per unit of depth.
    pub direction: DVec3,
    /// Least visible depth; nearer surfaces hide nothing.
    pub near: f64,
    /// Largest visible depth; `f64::INFINITY` without a far plane.
    pub far: f64,
}

impl Ray {
    /// Point at a depth, rounded.
    pub fn at(&self, depth: f64) -> DVec3 {
        self.origin + self.direction * depth
    }
}

/// All rays of a camera.
#[derive(Clone, Copy, Debug)]
pub struct Rays {
    /// Camera of the rays, with an eye and a lens.
    pub camera: Camera,
    /// Left, right, bottom and top edge of the image.
    ///
    /// Slopes per unit of depth; for an orthographic lens offsets in world units.
    pub window: [f64; 4],
}

impl Rays {
    /// Rays of a camera; a matrix is unprojected first.
    ///
    /// # Errors
    /// The errors of [`Camera::unprojected`].
    pub fn of(camera: &Camera) -> Result<Rays, CameraError> {
        let camera = camera.unprojected()?;
        let window = camera.lens.window();
        Ok(Rays { camera, window })
    }

    /// Place in the window of a point of the image, to the right and up.
    ///
    /// (0, 0) is the upper left corner, (1, 1) the lower right one.
    pub fn in_window(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [left, right, bottom, top] = self.window;
        [left + (right - left) * x, top + (bottom - top) * y]
    }

    /// The ray through a point of the image.
    ///
    /// (0, 0) is the upper left corner, (1, 1) the lower right one.
    pub fn through(&self, x: f64, y: f64) -> Ray {
        let [across, up] = self.in_window([x, y]);
        let frame = &self.camera.frame;
        let aside = frame.u() * across + frame.v() * up;
        let lens = &self.camera.lens;
        let (origin, direction) = match lens.is_orthographic() {
            true => (frame.eye + aside, frame.forward()),
            false => (frame.eye, aside + frame.forward()),
        };
        Ray {
            origin,
            direction,
            near: lens.near(),
            far: lens.far().unwrap_or(f64::INFINITY),
        }
    }

    /// Corners of the image on the near plane.
    pub fn near_corners(&self) -> [DVec3; 4] {
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        corners.map(|[x, y]| self.through(x, y).at(self.camera.lens.near()))
    }

    /// Rays of all samples, row by row.
    pub fn of_grid(&self, grid: SampleGrid) -> impl Iterator<Item = Ray> {
        grid.centres().map(|[x, y]| self.through(x, y))
    }

    /// Ray through a pixel's centre: column from the left, row from the top.
    pub fn sample(&self, grid: SampleGrid, column: u32, row: u32) -> Ray {
        let [x, y] = grid.centre(column, row);
        self.through(x, y)
    }
}

/// A ray prepared for exact tests against one kind of body.
pub trait RayProbe: Copy {
    /// A point of the ray on the surface of a body.
    type Hit: Copy + Debug;

    /// Compares the depths of two such points along the ray, exactly.
    fn compare(&self, a: &Self::Hit, b: &Self::Hit) -> Ordering;

    /// Upper bound of the true depth of a point.
    fn max_depth(at: &Self::Hit) -> f64;
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::camera::{Lens, look_at};

    /// Position of a point in the image, across and down, rounded; `None` outside.
    ///
    /// The ray [`through`](Rays::through) this position leads to the point.
    pub fn in_image(rays: &Rays, point: DVec3) -> Option<[f64; 2]> {
        let frame = &rays.camera.frame;
        let about = point - frame.eye;
        let depth = match rays.camera.lens.is_orthographic() {
            true => 1.0,
            false => about.dot(frame.forward()),
        };
        let [left, right, bottom, top] = rays.window;
        let across = about.dot(frame.u()) / depth;
        let up = about.dot(frame.v()) / depth;
        let at = [
            (across - left) / (right - left),
            (up - top) / (bottom - top),
        ];
        let is_inside = depth > 0.0 && at.iter().all(|x| (0.0..=1.0).contains(x));
        is_inside.then_some(at)
    }

    #[test]
    fn rays_pass_through_the_corners_of_the_view() {
        let frame = look_at(DVec3::new(3.0, -2.0, 5.0), DVec3::ZERO, DVec3::Z).unwrap();
        for lens in [
            Lens::perspective(70.0, 1.5, 0.5, Some(40.0)).unwrap(),
            Lens::orthographic(8.0, 1.5, 0.5, 40.0).unwrap(),
            Lens::off_axis([-0.1, 0.4, -0.2, 0.3], 0.5, Some(40.0)).unwrap(),
        ] {
            let rays = Rays::of(&Camera { frame, lens }).unwrap();
            let corners = lens.corners(&frame).unwrap();
            let [x, y] = in_image(&rays, rays.through(0.3, 0.8).at(7.0)).unwrap();
            assert!((x - 0.3).abs() < 1e-12 && (y - 0.8).abs() < 1e-12);
            assert_eq!(in_image(&rays, rays.through(1.1, 0.8).at(7.0)), None);
            for (i, (x, y)) in [(0.0, 1.0), (1.0, 1.0), (0.0, 0.0), (1.0, 0.0)]
                .iter()
                .enumerate()
            {
                let ray = rays.through(*x, *y);
                for (depth, corner) in [(ray.near, corners[i]), (ray.far, corners[4 + i])] {
                    assert!(
                        ray.at(depth).distance(corner) < 1e-12 * ray.far,
                        "{lens:?} {i}"
                    );
                }
            }
        }
    }
}
