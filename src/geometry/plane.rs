//! The plane and THE plane test.
//!
//! Every structure, kernel and cross-check of this crate uses the arithmetic of
//! [`Plane::value_at`]; changing one operation of it changes what the whole toolkit calls visible.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::Aabb;
use crate::arithmetic::combinations;

/// A half-space: the points `x` with `normal . x + d >= 0` (closed).
///
/// The normal points inward and need not have unit length. A zero normal with `d >= 0` is no
/// constraint; with `d < 0` no point satisfies it.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[repr(C)]
pub struct Plane {
    /// Points inward; of any length.
    pub normal: Vec3,
    /// Offset: positive if the origin is strictly inside.
    pub d: f32,
}

/// A half-space in f64: the points `x` with `normal . x + d >= 0` (closed).
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PlaneF64 {
    /// Points inward; of any length.
    pub normal: DVec3,
    /// Offset: positive if the origin is strictly inside.
    pub d: f64,
}

/// The plane and its test, in f32 and in f64.
macro_rules! half_space {
    ($Plane:ident, $Vector:ident, $Real:ident) => {
        impl $Plane {
            /// The half-space `normal . x + d >= 0`.
            pub const fn new(normal: $Vector, d: $Real) -> Self {
                $Plane { normal, d }
            }

            /// `((nx*x + ny*y) + nz*z) + d` in the precision of the plane.
            ///
            /// Three products, three sums, in this order, no fused multiply-add.
            ///
            /// Each operation is monotone under round-to-nearest, so a corner that is farther along
            /// the normal on every axis never evaluates lower. So a parent box never contradicts
            /// its child, and trees return the same set as a linear scan, bit for bit. A box's f32
            /// coordinate is an f64 number, so nothing is rounded before the first product.
            #[inline(always)]
            pub fn value_at(&self, x: $Vector) -> $Real {
                ((self.normal.x * x.x + self.normal.y * x.y) + self.normal.z * x.z) + self.d
            }

            /// The corner of `b` farthest along the normal (the p-vertex).
            ///
            /// Greene 1994, "Detecting intersection of a rectangular solid and a convex
            /// polyhedron", Graphics Gems IV, p. 74.
            #[inline(always)]
            pub fn p_vertex(&self, b: &Aabb) -> $Vector {
                let pick =
                    |n: $Real, low: f32, high: f32| $Real::from(if n >= 0.0 { high } else { low });
                $Vector::new(
                    pick(self.normal.x, b.min.x, b.max.x),
                    pick(self.normal.y, b.min.y, b.max.y),
                    pick(self.normal.z, b.min.z, b.max.z),
                )
            }

            /// The corner that `p_vertex` selects, the same for every box.
            pub fn p_vertex_corner(&self) -> BoxCorner {
                BoxCorner(self.normal.to_array().map(|n| n >= 0.0))
            }

            /// The corner of `b` farthest against the normal (the n-vertex).
            #[inline(always)]
            pub fn n_vertex(&self, b: &Aabb) -> $Vector {
                self.p_vertex(&Aabb::new(b.max, b.min))
            }

            /// Returns whether the whole box lies strictly outside.
            ///
            /// Its p-vertex evaluates below zero. Touching is not outside.
            #[inline(always)]
            pub fn excludes(&self, b: &Aabb) -> bool {
                self.value_at(self.p_vertex(b)) < 0.0
            }

            /// Returns whether the whole box lies inside.
            ///
            /// Its n-vertex evaluates to at least zero.
            #[inline(always)]
            pub fn contains(&self, b: &Aabb) -> bool {
                self.value_at(self.n_vertex(b)) >= 0.0
            }

            /// Returns whether the point lies in the closed half-space.
            #[inline(always)]
            pub fn contains_point(&self, x: $Vector) -> bool {
                self.value_at(x) >= 0.0
            }

            /// Returns whether all four numbers are finite.
            pub fn is_finite(&self) -> bool {
                self.normal.is_finite() && self.d.is_finite()
            }

            /// No constraint: a zero normal with `d >= 0`.
            pub fn is_trivial(&self) -> bool {
                self.normal == $Vector::ZERO && self.d >= 0.0
            }
        }
    };
}

half_space!(Plane, Vec3, f32);
half_space!(PlaneF64, DVec3, f64);

impl Plane {
    /// The plane through `point` with inward `normal`.
    pub fn through(point: Vec3, normal: Vec3) -> Self {
        Plane::new(normal, -normal.dot(point))
    }
}

impl PlaneF64 {
    /// The same plane in coordinates relative to `zero`.
    pub fn about(&self, zero: DVec3) -> PlaneF64 {
        PlaneF64::new(self.normal, self.normal.dot(zero) + self.d)
    }

    /// Sum of the magnitudes of the terms of the value at a point.
    #[inline(always)]
    pub fn size_at(&self, x: DVec3) -> f64 {
        (self.normal * x).abs().element_sum() + self.d.abs()
    }

    /// The value at a point relative to the sum of magnitudes of its terms.
    pub fn share_at(&self, x: DVec3) -> f64 {
        let size = self.size_at(x);
        match size == 0.0 {
            true => 0.0,
            false => self.value_at(x) / size,
        }
    }

    /// The corners of the volume inside all faces, to f64 rounding.
    pub fn corners(faces: &[PlaneF64]) -> Vec<DVec3> {
        /// Most relative distance outside a face that rounding may cause.
        const OUTSIDE: f64 = 1e-10;
        let triples = combinations(faces.len()).map(|triple| triple.map(|face| &faces[face]));
        let within = |p: &DVec3| faces.iter().all(|face| face.share_at(*p) >= -OUTSIDE);
        let points = triples.filter_map(PlaneF64::meeting_point);
        points.filter(within).collect()
    }

    /// The common point of three planes, by Cramer's rule, rounded.
    fn meeting_point([a, b, c]: [&PlaneF64; 3]) -> Option<DVec3> {
        let crossed = b.normal.cross(c.normal);
        let sum = crossed * a.d + c.normal.cross(a.normal) * b.d + a.normal.cross(b.normal) * c.d;
        let point = -sum / a.normal.dot(crossed);
        point.is_finite().then_some(point)
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

/// Corner of a box: on each axis the upper bound if true, else the lower one.
///
/// The p-vertex of a plane (the corner farthest along its normal) is the same corner of every box:
/// three fixed rows of a block.
// Booleans instead of numbers: indexing a row needs no bounds check.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct BoxCorner(pub [bool; 3]);

impl BoxCorner {
    /// The opposite corner of the box; the n-vertex for a p-vertex.
    #[inline(always)]
    pub(super) fn opposite(self) -> BoxCorner {
        let BoxCorner([x, y, z]) = self;
        BoxCorner([!x, !y, !z])
    }

    /// Rows of a block that hold its coordinates.
    #[inline(always)]
    pub(super) fn rows(self) -> [usize; 3] {
        let BoxCorner([x, y, z]) = self;
        [
            3 * usize::from(x),
            1 + 3 * usize::from(y),
            2 + 3 * usize::from(z),
        ]
    }
}

/// Planes in a tree; nodes refer to each other by index.
#[derive(Clone, Default, PartialEq, Debug)]
pub struct PlaneTree {
    /// Nodes, in any order.
    pub nodes: Vec<PlaneTreeNode>,
    /// `None` for undivided space.
    pub root: Option<u32>,
}

/// A dividing plane; its inner side is the front.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PlaneTreeNode {
    /// Its normal points to the front.
    pub plane: Plane,
    /// Front, then back; `None` at a leaf.
    pub children: [Option<u32>; 2],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_p_vertex_is_the_farthest_corner_of_all_eight() {
        let b = Aabb::new(Vec3::new(-1.0, 2.0, -3.0), Vec3::new(4.0, 5.0, 6.0));
        for normal in [
            Vec3::new(1.0, -2.0, 3.0),
            Vec3::new(-1.0, 0.0, -0.0),
            Vec3::new(-0.5, -0.5, 2.0),
        ] {
            let plane = Plane::new(normal, 0.25);
            let values = (0..8).map(|i| plane.value_at(b.corner(i)));
            let (low, high) = values.fold((f32::MAX, f32::MIN), |(l, h), v| (l.min(v), h.max(v)));
            assert_eq!(plane.value_at(plane.p_vertex(&b)), high);
            assert_eq!(plane.value_at(plane.n_vertex(&b)), low);
        }
    }

    #[test]
    fn touching_counts_as_inside_and_one_ulp_beyond_does_not() {
        let plane = Plane::new(Vec3::X, -1.0);
        let touching = Aabb::new(Vec3::ZERO, Vec3::ONE);
        assert!(!plane.excludes(&touching));
        let short = Aabb::new(Vec3::ZERO, Vec3::new(1.0f32.next_down(), 1.0, 1.0));
        assert!(plane.excludes(&short));
        // -0.0 >= 0.0: a test of the sign bit would fail here.
        assert!(Plane::new(Vec3::X, -0.0).contains_point(Vec3::new(-0.0, 0.0, 0.0)));
    }
}
