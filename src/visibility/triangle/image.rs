//! Which triangles the image takes in: the truth of the rows that decide by its window
//! and by its samples.

use glam::{DVec3, Vec3};

use super::super::rays::{Rays, SampleGrid};
use super::super::truth::TriangleProbe;
use super::view::{View, Window};
use crate::camera::Lens;
use crate::kernel::each;

/// Error of a rounded coordinate per unit of the numbers in it, a million times what it
/// can be: whatever is that near to a plane is on no side for sure.
const SLACK: f64 = 1e-9;
/// The same per unit of the distance between eye and zero.
const FAR_OUT: f64 = 1e-13;

/// The frustum of a view, about the eye.
#[derive(Clone, Copy, Debug)]
pub struct Image {
    rays: Rays,
    origin: DVec3,
    grid: SampleGrid,
    /// The axes right, up and forward.
    axes: [DVec3; 3],
    /// Coefficients of right, up, depth and 1: not below zero on the inner side.
    planes: [[f64; 4]; 6],
}

impl Image {
    /// `None` for a view without a window.
    pub fn of(view: &View) -> Option<Image> {
        let Window { rays, origin, grid } = view.window?;
        let camera = rays.camera();
        let frame = &camera.frame;
        let [left, right, bottom, top] = rays.window();
        // Sides go through the eye, or run along the axis of a parallel lens.
        let side = |sign: f64, axis: usize, bound: f64| {
            let mut plane = [0.0; 4];
            plane[axis] = sign;
            let is_parallel = matches!(camera.lens, Lens::Orthographic { .. });
            plane[if is_parallel { 3 } else { 2 }] = -sign * bound;
            plane
        };
        let depth = |sign: f64, at: Option<f64>| match at {
            Some(at) => [0.0, 0.0, sign, -sign * at],
            None => [0.0, 0.0, 0.0, f64::INFINITY],
        };
        Some(Image {
            rays,
            origin,
            grid,
            axes: [frame.u(), frame.v(), frame.forward()],
            planes: [
                depth(1.0, Some(camera.lens.near())),
                depth(-1.0, camera.lens.far()),
                side(1.0, 0, left),
                side(-1.0, 0, right),
                side(1.0, 1, bottom),
                side(-1.0, 1, top),
            ],
        })
    }

    /// Whether some point of a triangle is surely within the window and between near and
    /// far: cut by each plane in turn, some of it is left.
    pub fn surely_holds(&self, corners: [Vec3; 3]) -> bool {
        let (corners, slack) = self.about_eye(corners);
        !self.cut(&corners, slack).is_empty()
    }

    /// Whether the ray of some sample meets a triangle, from either side, exactly.
    pub fn is_sampled(&self, corners: [Vec3; 3]) -> bool {
        let (about_eye, slack) = self.about_eye(corners);
        let left = self.cut(&about_eye, -slack);
        let Some([columns, rows]) = self.samples(&left, slack) else {
            return false;
        };
        let mut samples = (rows[0]..rows[1])
            .flat_map(|row| (columns[0]..columns[1]).map(move |column| (column, row)));
        samples.any(|(column, row)| {
            let ray = self.rays.sample(self.grid, column, row);
            let probe = TriangleProbe::new(ray, self.origin);
            probe.meet(corners, true, ray.far).is_some()
        })
    }

    /// Corners in the camera's axes, and how far a plane may be off there.
    fn about_eye(&self, corners: [Vec3; 3]) -> (Vec<DVec3>, f64) {
        let eye = self.rays.camera().frame.eye;
        let corners = each(corners, |p: Vec3| {
            let way = p.as_dvec3() + (self.origin - eye);
            DVec3::from(each(self.axes, |axis| axis.dot(way)))
        });
        let size = |p: &DVec3| p.abs().max_element();
        let largest = corners.iter().map(size).fold(0.0, f64::max);
        let far_out = size(&eye).max(size(&self.origin));
        (corners.into(), SLACK * largest + FAR_OUT * far_out)
    }

    /// What is left of a polygon on the inner sides of all planes, each moved inward by
    /// `slack` (Sutherland and Hodgman 1974).
    fn cut(&self, polygon: &[DVec3], slack: f64) -> Vec<DVec3> {
        self.planes.iter().fold(polygon.to_vec(), |polygon, plane| {
            let [a, b, c, d] = plane;
            let height = |p: DVec3| DVec3::new(*a, *b, *c).dot(p) + d - slack;
            let mut left = Vec::with_capacity(polygon.len() + 1);
            for (i, &p) in polygon.iter().enumerate() {
                let q = polygon[(i + 1) % polygon.len()];
                let [at_p, at_q] = [height(p), height(q)];
                if at_p >= 0.0 {
                    left.push(p);
                }
                if (at_p >= 0.0) != (at_q >= 0.0) {
                    left.push(p + (q - p) * (at_p / (at_p - at_q)));
                }
            }
            left
        })
    }

    /// Columns and rows of the samples within the bounds of a polygon in the image, one
    /// more on each side; all of them where it comes too near to the eye.
    fn samples(&self, polygon: &[DVec3], slack: f64) -> Option<[[u32; 2]; 2]> {
        let (width, height) = (self.grid.width, self.grid.height);
        let is_parallel = matches!(self.rays.camera().lens, Lens::Orthographic { .. });
        if !is_parallel && polygon.iter().any(|p| p.z <= 4.0 * slack) {
            return Some([[0, width], [0, height]]);
        }
        let [left, right, bottom, top] = self.rays.window();
        let place = |p: &DVec3| {
            let scale = if is_parallel { 1.0 } else { p.z };
            let (x, y) = (p.x / scale, p.y / scale);
            [(x - left) / (right - left), (y - top) / (bottom - top)]
        };
        let places: Vec<[f64; 2]> = polygon.iter().map(place).collect();
        let range = |axis: usize, count: u32| {
            let at = places.iter().map(|place| place[axis] * f64::from(count));
            let (low, high) = at.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            });
            let clamp = |x: f64| x.clamp(0.0, f64::from(count)) as u32;
            [clamp((low - 1.5).floor()), clamp((high + 1.5).ceil())]
        };
        (!places.is_empty()).then(|| [range(0, width), range(1, height)])
    }
}
