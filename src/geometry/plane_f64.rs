//! A plane in f64, for the plane test that promotes boxes exactly.

use glam::DVec3;

use super::{Aabb, Plane};

/// A half-space in f64: the points `x` with `normal . x + d >= 0` (closed).
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PlaneF64 {
    /// Points inward; of any length.
    pub normal: DVec3,
    /// Offset: above 0 where the zero point is inside.
    pub d: f64,
}

impl PlaneF64 {
    /// The half-space `normal . x + d >= 0`.
    pub const fn new(normal: DVec3, d: f64) -> Self {
        PlaneF64 { normal, d }
    }

    /// `((nx*x + ny*y) + nz*z) + d` in f64, as [`Plane::value_at`] does it in
    /// f32. An f32 coordinate is an f64 number, so nothing is rounded before
    /// the first product.
    #[inline(always)]
    pub fn value_at(&self, x: DVec3) -> f64 {
        ((self.normal.x * x.x + self.normal.y * x.y) + self.normal.z * x.z) + self.d
    }

    #[inline(always)]
    fn p_vertex(&self, b: &Aabb) -> DVec3 {
        let pick = |n: f64, low: f32, high: f32| f64::from(if n >= 0.0 { high } else { low });
        DVec3::new(
            pick(self.normal.x, b.min.x, b.max.x),
            pick(self.normal.y, b.min.y, b.max.y),
            pick(self.normal.z, b.min.z, b.max.z),
        )
    }

    /// Returns whether the whole box lies strictly outside. Touching is not outside.
    #[inline(always)]
    pub fn excludes(&self, b: &Aabb) -> bool {
        self.value_at(self.p_vertex(b)) < 0.0
    }

    /// Returns whether the whole box lies inside.
    #[inline(always)]
    pub fn contains(&self, b: &Aabb) -> bool {
        self.value_at(self.p_vertex(&Aabb::new(b.max, b.min))) >= 0.0
    }

    /// The same plane in coordinates about another point.
    pub fn about(&self, zero: DVec3) -> PlaneF64 {
        PlaneF64::new(self.normal, self.normal.dot(zero) + self.d)
    }

    /// Rounded once to f32.
    pub fn narrow(&self) -> Plane {
        Plane::new(self.normal.as_vec3(), self.d as f32)
    }
}

impl From<&Plane> for PlaneF64 {
    fn from(plane: &Plane) -> Self {
        PlaneF64::new(plane.normal.as_dvec3(), f64::from(plane.d))
    }
}
