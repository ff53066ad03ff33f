//! Exact ray-triangle intersection: f64 with an error bound, else expansions.
//!
//! Triangles are closed: a ray through a common edge or corner meets all triangles that share it
//! and slips between none. A ray does not meet a triangle in whose plane it lies (nothing of the
//! triangle is seen), and no ray meets a triangle without area.

use std::cmp::Ordering;

use glam::{DVec3, I64Vec3, Vec3};

use crate::arithmetic::exact::{self, ExactVector};
use crate::arithmetic::{Expansion, two_sum};
use crate::kernel::each;
use crate::visibility::triangle::exact_normal;
use crate::visibility::{Ray, RayProbe};

/// Unit of the error bounds, u = 2^-53.
///
/// With A, B, C the corners about the ray's origin, U = B - A, V = C - A,
/// d the direction; D, L, M, S the largest absolute coordinate of d, of U and V, of A,
/// and of the shift from scene-local coordinates to those about the ray's origin:
///
/// - A is a rounded sum with a rounded shift: off by u (M + S); U, V by u L.
/// - Q = d x A: two products and a difference, with A's error u D (6 M + 2 S).
/// - U . Q and V . Q, the signed volumes of d with two of the edges: three products
///   and two sums of terms below 2 L D M, 18 u; Q's error three times; U's, 6 u:
///   together u D L (42 M + 6 S).
/// - N = U x V: 8 u L^2. d . N: 18 + 24 = 42 u D L^2.
/// - The third volume is d . N less the other two: their errors and two more
///   roundings, u D L (54 L + 108 M + 12 S).
/// - A . N: 18 + 24 u L^2 M, and 6 u L^2 (M + S) for A.
///
/// Terms of second order are below 2^-50 of these. So 128 u D L (L + M + S) is above
/// the error of each volume, 64 u D L^2 above that of d . N, 64 u L^2 (M + S) above
/// that of A . N, each by an eighth and more.
const UNIT: f64 = 1.0 / (1u64 << 53) as f64;

/// Meeting of a ray and a triangle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TriangleHit {
    /// Depth in f64; 0 where f64 does not determine it.
    pub depth: f64,
    /// Bound of the error of `depth`; may be infinite.
    pub error: f64,
    /// Corners of the triangle, as given.
    pub corners: [Vec3; 3],
}

impl TriangleHit {
    /// Lower bound of the depth at which the ray meets the triangle.
    #[inline]
    pub fn min_depth(&self) -> f64 {
        self.depth - self.error
    }
}

/// Ray prepared for exact tests against triangles.
///
/// Exact for corners, origins, eyes and direction components that are 0 or from 2^-100 to 2^100 in
/// size: products of six of them, such as those of two depths as fractions, are then within the
/// range of an expansion.
#[derive(Clone, Copy, Debug)]
pub struct TriangleProbe {
    ray: Ray,
    /// Translation of a scene-local point to the ray's origin: `shift + rest`.
    shift: DVec3,
    rest: DVec3,
    /// Largest coordinate of the direction, and of the shift.
    across: f64,
    far: f64,
}

impl RayProbe for TriangleProbe {
    type Hit = TriangleHit;

    #[inline]
    fn compare(&self, a: &TriangleHit, b: &TriangleHit) -> Ordering {
        if Self::max_depth(a) < b.min_depth() {
            return Ordering::Less;
        }
        if Self::max_depth(b) < a.min_depth() {
            return Ordering::Greater;
        }
        // Walls of two sides have two triangles in one plane, which the ray meets once.
        if are_in_one_plane(a.corners, b.corners) {
            return Ordering::Equal;
        }
        self.compare_exactly(a, b)
    }

    #[inline(always)]
    fn max_depth(at: &TriangleHit) -> f64 {
        at.depth + at.error
    }
}

impl TriangleProbe {
    /// Prepares a ray for triangles relative to an origin.
    #[inline]
    pub fn new(ray: Ray, origin: DVec3) -> TriangleProbe {
        let sums = each([0, 1, 2], |k| two_sum(origin[k], -ray.origin[k]));
        let shift = DVec3::from(each(sums, |sum| sum.0));
        TriangleProbe {
            shift,
            rest: DVec3::from(each(sums, |sum| sum.1)),
            across: ray.direction.abs().max_element(),
            far: shift.abs().max_element(),
            ray,
        }
    }

    /// Meeting of the ray and a triangle, if that is from near to far.
    ///
    /// A one-sided triangle is met from its front only, where its corners turn counter-clockwise.
    /// Also `None` if the ray certainly meets it beyond `limit`.
    #[inline(always)]
    pub fn hit(&self, corners: [Vec3; 3], two_sided: bool, limit: f64) -> Option<TriangleHit> {
        let [a, b, c] = each(corners, |p: Vec3| p.as_dvec3());
        let direction = self.ray.direction;
        let (u, v, at) = (b - a, c - a, a + self.shift);
        let normal = u.cross(v);
        let towards = direction.dot(normal);
        let size = u.abs().max(v.abs()).max_element();
        let towards_off = 64.0 * UNIT * self.across * size * size;
        // Back-facing, like about half of the triangles of a closed mesh.
        if !two_sided && towards > towards_off {
            return None;
        }
        // Twice the signed volumes of the direction with each edge: all of one sign if the ray
        // passes inside, and negative if it comes from the front.
        let turned = direction.cross(at);
        let (ab, ca) = (u.dot(turned), -v.dot(turned));
        let bc = towards - ab - ca;
        let reach = at.abs().max_element() + self.far;
        let bound = 128.0 * UNIT * self.across * size * (size + reach);
        let (low, high) = (ab.min(bc).min(ca), ab.max(bc).max(ca));
        if high > bound && (low < -bound || !two_sided) {
            return None;
        }
        let certainly = high < -bound || (two_sided && low > bound);
        if !certainly && !self.pierces(corners, two_sided) {
            return None;
        }
        let (mut depth, mut error) = (0.0, f64::INFINITY);
        // The true d . N is then at least half of the rounded one.
        if towards.abs() > 2.0 * towards_off {
            depth = at.dot(normal) / towards;
            let along_off = 64.0 * UNIT * size * size * reach;
            error = 2.0 * (along_off + depth.abs() * towards_off) / towards.abs()
                + 4.0 * UNIT * depth.abs();
        }
        let hit = TriangleHit {
            depth,
            error,
            corners,
        };
        let (near, far) = (self.ray.near, self.ray.far);
        if hit.min_depth() > limit || hit.min_depth() > far || Self::max_depth(&hit) < near {
            return None;
        }
        if hit.min_depth() < near && self.compare_with(&hit, near).is_lt() {
            return None;
        }
        if Self::max_depth(&hit) > far && self.compare_with(&hit, far).is_gt() {
            return None;
        }
        Some(hit)
    }

    #[cold]
    fn compare_exactly(&self, a: &TriangleHit, b: &TriangleHit) -> Ordering {
        let (above_a, below_a) = self.fraction(a.corners);
        let (above_b, below_b) = self.fraction(b.corners);
        let difference = &(&above_a * &below_b) - &(&above_b * &below_a);
        difference.sign().cmp(&0)
    }

    /// Compares a meeting with a depth, exactly.
    #[cold]
    fn compare_with(&self, a: &TriangleHit, depth: f64) -> Ordering {
        if depth.is_infinite() {
            return 0.0_f64.total_cmp(&depth);
        }
        let (above, below) = self.fraction(a.corners);
        let difference = &above - &(&below * &Expansion::from(depth));
        difference.sign().cmp(&0)
    }

    /// Returns `true` if the ray's line meets the closed triangle on a visible side.
    #[cold]
    fn pierces(&self, corners: [Vec3; 3], two_sided: bool) -> bool {
        let d = exact::vector(self.ray.direction);
        let about = corners.map(|corner| self.about(corner));
        let volume =
            |i: usize, j: usize| exact::dot(&d, &exact::cross(&about[i], &about[j])).sign();
        let signs = [volume(0, 1), volume(1, 2), volume(2, 0)];
        // Their sum is d . N, which is zero only if all are.
        match (signs.contains(&1), signs.contains(&-1)) {
            (false, true) => true,
            (true, false) => two_sided,
            _ => false,
        }
    }

    /// Depth as a fraction, A . N over d . N, with a positive denominator.
    fn fraction(&self, corners: [Vec3; 3]) -> (Expansion, Expansion) {
        let normal = exact_normal(corners);
        let above = exact::dot(&self.about(corners[0]), &normal);
        let below = exact::dot(&exact::vector(self.ray.direction), &normal);
        match below.sign() {
            -1 => (-&above, -&below),
            _ => (above, below),
        }
    }

    /// Scene-local point relative to the ray's origin.
    fn about(&self, p: Vec3) -> ExactVector {
        [0, 1, 2].map(|k| Expansion::sum([self.rest[k], self.shift[k], p[k].into()]))
    }
}

/// Returns `true` if the second triangle is in the first one's plane.
///
/// Also `false` if their coordinates are not integers of 36 bits in some common unit.
fn are_in_one_plane(a: [Vec3; 3], b: [Vec3; 3]) -> bool {
    if a == b {
        return true;
    }
    const BITS: i32 = 36;
    let corners = [a[0], a[1], a[2], b[0], b[1], b[2]];
    let largest = corners.iter().fold(Vec3::ZERO, |most, p| most.max(p.abs()));
    // Unit such that all coordinates are at most one.
    let above = libm::frexp(f64::from(largest.max_element())).1;
    let scale = libm::ldexp(1.0, BITS - above);
    let mut integers = [I64Vec3::ZERO; 6];
    for (at, corner) in integers.iter_mut().zip(corners) {
        let scaled = corner.as_dvec3() * scale;
        let rounded = scaled.as_i64vec3();
        if rounded.as_dvec3() != scaled {
            return false;
        }
        *at = rounded;
    }
    let [a, b, c, p, q, r] = integers;
    // Sides have 37 bits, products of two sums 75, of three 114.
    let (u, v) = (b - a, c - a);
    let of_two = |i: usize, j: usize| {
        i128::from(u[i]) * i128::from(v[j]) - i128::from(u[j]) * i128::from(v[i])
    };
    let normal = [of_two(1, 2), of_two(2, 0), of_two(0, 1)];
    let is_in = |p: I64Vec3| {
        let at = p - a;
        let [x, y, z] = each([0, 1, 2], |k| normal[k] * i128::from(at[k]));
        x + y + z == 0
    };
    is_in(p) && is_in(q) && is_in(r)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SeededRng;

    const ACROSS: [Vec3; 3] = [
        Vec3::new(1.0, -1.0, -1.0),
        Vec3::new(1.0, 0.0, 2.0),
        Vec3::new(1.0, 1.0, -1.0),
    ];

    fn ray(near: f64, far: f64) -> Ray {
        Ray {
            origin: DVec3::ZERO,
            direction: DVec3::X * 3.0,
            near,
            far,
        }
    }

    #[test]
    fn near_and_far_are_decided_to_the_last_bit() {
        // A third lies between two neighbouring doubles.
        let (below, above) = (1.0 / 3.0, (1.0_f64 / 3.0).next_up());
        let met = |near, far| {
            let probe = TriangleProbe::new(ray(near, far), DVec3::ZERO);
            probe.hit(ACROSS, false, f64::INFINITY).is_some()
        };
        assert!(met(below, f64::INFINITY) && !met(above, f64::INFINITY));
        assert!(met(0.0, above) && !met(0.0, below));
        // A depth that is a double is met even if near and far equal it.
        let twice = ACROSS.map(|p| p * 1.5);
        let probe = TriangleProbe::new(ray(0.5, 0.5), DVec3::ZERO);
        assert!(probe.hit(twice, false, f64::INFINITY).is_some());
    }

    #[test]
    fn a_triangle_of_one_side_is_met_from_there_alone() {
        let [a, b, c] = ACROSS;
        let probe = TriangleProbe::new(ray(0.0, f64::INFINITY), DVec3::ZERO);
        for (corners, two_sided, met) in [
            ([a, b, c], false, true),
            ([a, c, b], false, false),
            ([a, c, b], true, true),
            ([a, a, b], true, false),
        ] {
            // Through the centre, a corner, and an edge.
            for at in [Vec3::ZERO, a, (a + b) * 0.5] {
                let off = Vec3::new(0.0, at.y, at.z);
                // The smaller triangle is beyond what f64 decides.
                for size in [1.0, 2f32.powi(-70)] {
                    let corners = corners.map(|p| (p - off) * Vec3::new(1.0, size, size));
                    let found = probe.hit(corners, two_sided, f64::INFINITY);
                    assert_eq!(found.is_some(), met, "{corners:?}");
                }
            }
        }
    }

    /// Rays in the plane of a triangle except for rounding.
    ///
    /// Only the exact sign shows from which side they come.
    #[test]
    fn grazing_rays_hit_a_one_sided_triangle_only_from_its_front() {
        let mut rng = SeededRng::new(29);
        let [mut met, mut passed_by] = [0, 0];
        for _ in 0..20_000 {
            let corners = [(); 3].map(|()| (rng.point() * 100.0).as_vec3());
            let [a, b, c] = corners.map(|p| p.as_dvec3());
            let [s, t] = [rng.unit(), rng.unit()];
            let direction = ((b - a) * (s - 0.5) + (c - a) * (t - 0.5)) * 0.01;
            let ray = Ray {
                origin: (a + b + c) / 3.0 - direction,
                direction,
                near: f64::NEG_INFINITY,
                far: f64::INFINITY,
            };
            let probe = TriangleProbe::new(ray, DVec3::ZERO);
            let found = probe.hit(corners, false, f64::INFINITY).is_some();
            assert_eq!(found, probe.pierces(corners, false), "{ray:?} {corners:?}");
            met += u32::from(found);
            passed_by += u32::from(!found);
        }
        assert!(met > 1000 && passed_by > 1000, "{met} {passed_by}");
    }
}
