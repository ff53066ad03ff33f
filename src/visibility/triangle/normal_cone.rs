//! The cone of eyes that see no triangle of a cluster, with rounding proven.
//!
//! Let all normals be within the angle alpha of the axis A, and the apex P not in
//! front of any triangle. For an eye e with v = P - e and v.A >= sin(alpha) |A| |v|,
//! the angle of v and A is at most 90° - alpha, so n.v >= 0 for every normal n, and
//! n.(e - a) = n.(P - a) - n.v <= 0: no triangle turns its front to e. (The test is
//! meshoptimizer's, there without a term for rounding.)
//!
//! Rounding, u = 2^-24. The eye is rounded to f32 with an error E, known per view;
//! v' = P - e' rounds once more: |v - v'| <= E + u |v'|. Let s' be the computed
//! v'.A and q' the computed |v'|², both off by at most 3.01 u (|v'| |A|, |v'|²). The
//! test is, with rounding in each step,
//!
//! ```text
//! t = s' - M >= 0   and   t² >= k² q'
//! ```
//!
//! from which, for |A| <= 1 + 2^-20, v'.A >= M + |v'| (k (1 - 3.7 u) - 3.01 u |A|).
//! Wanted is v.A >= sin(alpha) |A| |v|, for which it is enough that v'.A >=
//! sin(alpha) |A| |v'| + 2 |A| (E + u |v'|). So M >= 2 |A| E and
//! k >= sin(alpha) |A| + 9 u prove it: 10 u is taken. M is at least 2^-40, so that
//! |v'| > 2^-41 wherever the test holds and neither k² q' nor t² underflows; below
//! 2^59 nothing overflows.

use glam::{DVec3, Vec3};

use super::exact::{faces, normal};
use super::eye::Eye;
use crate::arithmetic::rounding::round_up;
use crate::geometry::Aabb;

/// Slack of the sine for the rounding of the test: see above.
const SLACK: f64 = 10.0 / (1u64 << 24) as f64;
/// Error of a cosine of two normals in f64, with the error of the normals (2^-50
/// each): some units of 2^-50.
const COSINE: f64 = 64.0 / (1u64 << 53) as f64;
/// Coordinate above which products of three numbers may overflow.
const FAR: f32 = (1u64 << 59) as f32;
/// Least margin in world units.
const LEAST_MARGIN: f64 = 1.0 / (1u64 << 40) as f64;
/// Steps in which the axis is found.
const STEPS: u32 = 48;

/// Apex, axis and sine of a cone, with the slack of [`Cone::fit`].
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Cone {
    /// Not in front of any triangle.
    pub apex: Vec3,
    /// Not longer than 1 + 2^-20.
    pub axis: Vec3,
    /// k: at least sin(alpha) |axis| and the slack.
    pub sine: f64,
}

impl Cone {
    /// The cone of some triangles; `None` if every eye may see one of them.
    pub fn fit(triangles: &[[Vec3; 3]]) -> Option<Cone> {
        // A triangle without area is never seen.
        let with_area = triangles.iter().map(|corners| (*corners, normal(*corners)));
        let planes: Vec<([Vec3; 3], DVec3)> = with_area
            .filter(|(_, n)| *n != DVec3::ZERO)
            .map(|(corners, n)| (corners, n.normalize()))
            .collect();
        let axis = axis_of(planes.iter().map(|(_, n)| *n))?.as_vec3();
        let exact = axis.as_dvec3();
        let length = exact.length();
        if !(length > 0.5 && length <= 1.0 + 1.0 / (1 << 21) as f64) {
            return None;
        }
        let unit = exact / length;
        let cosines = planes.iter().map(|(_, n)| n.dot(unit));
        let cosine = cosines.fold(1.0, f64::min) - COSINE;
        if cosine <= 0.0 {
            return None;
        }
        let sine = (1.0 - cosine).sqrt() * (1.0 + cosine).sqrt() * length * (1.0 + COSINE);
        let apex = apex_of(&planes, unit)?;
        Some(Cone {
            apex,
            axis,
            sine: sine + SLACK,
        })
    }

    /// The share of all directions of view along which all triangles face away.
    ///
    /// They are a cap of 90° - alpha about the axis.
    pub fn turned_away(&self) -> f64 {
        ((1.0 - self.sine) / 2.0).max(0.0)
    }

    /// k² as f32, rounded up.
    pub fn square(&self) -> f32 {
        round_up(self.sine * self.sine * (1.0 + COSINE))
    }
}

/// The direction whose largest angle to the normals is least, nearly: the centre of
/// their smallest ball (Bădoiu and Clarkson 2003, "Smaller core-sets for balls").
fn axis_of(normals: impl Iterator<Item = DVec3> + Clone) -> Option<DVec3> {
    let count = normals.clone().count();
    if count == 0 {
        return None;
    }
    let mut centre = normals.clone().sum::<DVec3>() / count as f64;
    for step in 0..STEPS {
        let far = |a: &DVec3, b: &DVec3| {
            let distance = |n: &DVec3| n.distance_squared(centre);
            distance(a).total_cmp(&distance(b))
        };
        let farthest = normals.clone().max_by(far)?;
        centre += (farthest - centre) / f64::from(step + 2);
    }
    centre.try_normalize()
}

/// A point of f32 that is in front of no triangle: proven by the exact test.
fn apex_of(planes: &[([Vec3; 3], DVec3)], axis: DVec3) -> Option<Vec3> {
    let bounds = Aabb::of_points(planes.iter().flat_map(|(corners, _)| *corners));
    let [low, high] = [bounds.min, bounds.max].map(Vec3::as_dvec3);
    let centre = (low + high) * 0.5;
    let distances = planes
        .iter()
        .map(|(corners, n)| n.dot(centre - corners[0].as_dvec3()) / n.dot(axis));
    let back = distances.fold(f64::NEG_INFINITY, f64::max);
    let scale = centre.abs().max_element() + back.abs() + (high - low).length();
    let mut more = 0.0;
    for step in 0..12 {
        let apex = (centre - axis * (back + more)).as_vec3();
        let eye = Eye::local(apex.as_dvec3());
        let is_near = apex.abs().max_element() < FAR;
        if is_near && !planes.iter().any(|(corners, _)| faces(&eye, *corners)) {
            return Some(apex);
        }
        more = scale * libm::exp2(f64::from(2 * step - 25));
    }
    None
}

/// A view, prepared for tests of cones.
#[derive(Clone, Copy, Debug)]
pub struct Prepared {
    /// The eye in f32, negated: a difference is then a sum.
    pub minus_eye: [f32; 3],
    /// -M.
    pub minus_margin: f32,
    /// `true` if the eye is at infinity: the apex does not matter.
    pub is_parallel: bool,
}

impl Prepared {
    /// `None` if the eye is so far away that the test could overflow.
    pub fn of(eye: &Eye) -> Option<Prepared> {
        let margin = 2.0 * eye.error * (1.0 + 1.0 / (1 << 19) as f64);
        let is_near = eye.nearest.abs().max_element() < FAR;
        is_near.then(|| Prepared {
            minus_eye: (-eye.nearest).to_array(),
            minus_margin: -round_up(margin.max(LEAST_MARGIN)),
            is_parallel: eye.weight == 0.0,
        })
    }
}
