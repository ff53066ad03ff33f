//! Exact side of a triangle that an eye is on: the truth of this stage.

use glam::{DVec3, Vec3};

use crate::arithmetic::exact::{self, ExactVector};
use crate::arithmetic::{Expansion, cross, cross_sizes, two_sum};
use crate::camera::Camera;
use crate::kernel::each;

/// Eye in homogeneous scene-local coordinates, an exact sum of two f64 per axis.
///
/// For an eye at infinity `weight` is 0 and the rest is the direction towards it. A triangle `a`,
/// `b`, `c` faces the eye `e` if `((b - a) x (c - a)) . (e - weight a) > 0`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Eye {
    /// The larger part of the sum.
    pub high: DVec3,
    /// Rounding remainder: at most half an ulp of `high`.
    pub low: DVec3,
    /// 1 for a point, 0 for a direction.
    pub weight: f32,
    /// Nearest f32 point.
    pub nearest: Vec3,
    /// Upper bound of the distance from the eye to `nearest`.
    pub error: f64,
}

impl Eye {
    /// Eye of a camera, relative to the origin of surfaces.
    pub fn of(camera: &Camera, origin: DVec3) -> Eye {
        if !camera.lens.is_orthographic() {
            return Eye::at(camera.frame.eye, origin);
        }
        // Direction of the rays, rounded once.
        Eye::along(camera.frame.forward())
    }

    /// A world point relative to a scene's origin. Exact.
    pub fn at(world: DVec3, origin: DVec3) -> Eye {
        let [x, y, z] = [0, 1, 2].map(|k| two_sum(world[k], -origin[k]));
        let high = DVec3::new(x.0, y.0, z.0);
        Eye::new(high, DVec3::new(x.1, y.1, z.1), 1.0)
    }

    /// A scene-local point.
    pub fn local(point: DVec3) -> Eye {
        Eye::new(point, DVec3::ZERO, 1.0)
    }

    /// An eye at infinity that looks along `forward`.
    pub fn along(forward: DVec3) -> Eye {
        Eye::new(-forward, DVec3::ZERO, 0.0)
    }

    fn new(high: DVec3, low: DVec3, weight: f32) -> Eye {
        let nearest = high.as_vec3();
        // Some roundings of 2^-53 each; the factor is far above them.
        let error = (high - nearest.as_dvec3()).length() + low.length();
        Eye {
            high,
            low,
            weight,
            nearest,
            error: error * (1.0 + 1e-12),
        }
    }
}

/// Error of the filter, relative to the permanent.
///
/// Three differences of one rounding each, two products, a difference, a product and two sums:
/// eight roundings on the longest path, 8 * 2^-53 and terms of second order (Shewchuk 1997 proves 7
/// for this order of operations); 16 is twice that.
const FILTER: f64 = 16.0 / (1u64 << 53) as f64;

/// Returns `true` if the eye is strictly in front of a triangle.
///
/// Its corners then turn counter-clockwise as seen by the eye. A one-sided triangle is not visible
/// from behind or from its plane, and one without area from nowhere.
///
/// Exact for finite corners and an eye whose coordinates are zero or between 2^-500 and 2^500.
pub fn faces(eye: &Eye, corners: [Vec3; 3]) -> bool {
    let [a, b, c] = each(corners, |p: Vec3| p.as_dvec3());
    let (u, v) = (b - a, c - a);
    let w = eye.high - a * f64::from(eye.weight);
    let determinant = w.dot(u.cross(v));
    let minors = cross_sizes(u.abs(), v.abs());
    let (size, low) = (w.abs().dot(minors), eye.low.abs().dot(minors));
    // Every product is zero: the triangle's plane contains the direction of a view along an axis.
    if size + low == 0.0 {
        return false;
    }
    // Adds the contribution of the eye's low part, doubled for the roundings here, and a bound of
    // the underflow.
    let bound = FILTER * size + 2.0 * low + 1e-300;
    if determinant.abs() > bound {
        return determinant > 0.0;
    }
    orientation(eye, corners) > 0
}

/// Sign of the determinant by expansions.
#[cold]
fn orientation(eye: &Eye, corners: [Vec3; 3]) -> i32 {
    let a = corners[0] * eye.weight;
    let way = [0, 1, 2].map(|k| Expansion::sum([eye.low[k], eye.high[k], f64::from(-a[k])]));
    exact::dot(&way, &exact_normal(corners)).sign()
}

/// Normal of a triangle, each component accurate to 2^-50 of itself.
///
/// Zero exactly if the triangle has no area. Not of unit length.
pub fn normal(corners: [Vec3; 3]) -> DVec3 {
    let [a, b, c] = each(corners, |p: Vec3| p.as_dvec3());
    let is_exact = |p: DVec3, q: DVec3| (0..3).all(|k| two_sum(p[k], -q[k]).1 == 0.0);
    if is_exact(b, a) && is_exact(c, a) {
        // Kahan's products do not cancel: two roundings at most.
        return cross(b - a, c - a);
    }
    exact::estimate(&exact_normal(corners))
}

/// Exact cross product of two edges.
pub fn exact_normal(corners: [Vec3; 3]) -> ExactVector {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    exact::cross(&exact::difference(b, a), &exact::difference(c, a))
}

#[cfg(test)]
mod tests {
    use dashu_int::IBig;

    use super::*;
    use crate::scene::SeededRng;

    /// A number as an integer count of 2^-300.
    fn units(x: f64) -> IBig {
        let bits = x.abs().to_bits();
        let mantissa = bits & ((1 << 52) - 1) | 1 << 52;
        let shift = (bits >> 52) as i64 - 1075 + 300;
        assert!(x == 0.0 || shift >= 0, "too small for this test");
        let size = if x == 0.0 {
            IBig::ZERO
        } else {
            IBig::from(mantissa) << shift as usize
        };
        if x < 0.0 { -size } else { size }
    }

    fn in_integers(eye: &Eye, corners: [Vec3; 3]) -> bool {
        let point = |p: Vec3| [0, 1, 2].map(|k| units(f64::from(p[k])));
        let [a, b, c] = corners.map(point);
        let minus = |p: &[IBig; 3], q: &[IBig; 3]| [0, 1, 2].map(|k| &p[k] - &q[k]);
        let (u, v) = (minus(&b, &a), minus(&c, &a));
        let weight = IBig::from(eye.weight as i32);
        let w = [0, 1, 2].map(|k| units(eye.high[k]) + units(eye.low[k]) - &weight * &a[k]);
        let minor = |i: usize, j: usize| &u[i] * &v[j] - &u[j] * &v[i];
        let sum = &w[0] * minor(1, 2) + &w[1] * minor(2, 0) + &w[2] * minor(0, 1);
        sum > IBig::ZERO
    }

    #[test]
    fn the_side_of_a_triangle_is_that_of_whole_numbers() {
        let mut rng = SeededRng::new(1);
        let (mut near, mut fronts) = (0, 0);
        for round in 0..20_000 {
            let far = [0.0, 1.0, 1e4, 1e7][round % 4];
            let size = [1.0, 1e-3, 100.0][round % 3];
            let mut point = || (rng.normal3() * size + far).as_vec3();
            let mut corners = [point(), point(), point()];
            if round % 5 == 0 {
                corners[2] = corners[0] + (corners[1] - corners[0]) * 0.3;
            }
            let [a, b, c] = corners.map(Vec3::as_dvec3);
            // In the plane except for rounding, or an ulp or two away from it.
            let (s, t) = (rng.between(-9.0, 9.0), rng.between(-9.0, 9.0));
            let mut at = a + (b - a) * s + (c - a) * t;
            at[round % 3] += at[round % 3].abs() * f64::EPSILON * (rng.below(5) as f64 - 2.0);
            let eye = match round % 7 {
                0 => Eye::along(b - a),
                1 | 2 => Eye::at(at + 1e9, DVec3::splat(1e9 + 0.1)),
                3 => Eye::local(at.as_vec3().as_dvec3()),
                _ => Eye::local(at),
            };
            assert_eq!(faces(&eye, corners), in_integers(&eye, corners), "{round}");
            fronts += u32::from(faces(&eye, corners));
            let plain = (eye.high - a * f64::from(eye.weight)).dot((b - a).cross(c - a)) > 0.0;
            near += u32::from(plain != in_integers(&eye, corners));
        }
        assert!(
            near > 300,
            "{near}: the premise: plain f64 is often wrong here"
        );
        assert!((2000..18_000).contains(&fronts), "{fronts}");
    }

    #[test]
    fn normals_keep_their_digits_and_are_zero_only_without_area() {
        let flat = [
            Vec3::ZERO,
            Vec3::new(1.0, 2.0, 3.0),
            Vec3::new(3.0, 6.0, 9.0),
        ];
        assert_eq!(normal(flat), DVec3::ZERO);
        let thin = [Vec3::ZERO, Vec3::ONE, Vec3::new(2.0, 2.0, 2f32.next_up())];
        // An ulp of 2 is 2^-22.
        let ulp = 2f64.powi(-22);
        assert_eq!(normal(thin), DVec3::new(ulp, -ulp, 0.0));
        // Edges that f64 cannot represent.
        let (tiny, far) = (2f32.powi(-100), 2f32.powi(20));
        let wide = [Vec3::X * tiny, Vec3::X * far, Vec3::new(far, tiny, 0.0)];
        assert!(normal(wide).z > 0.0);
    }
}
