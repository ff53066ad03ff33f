//! Normal cones in f32 with a proven margin, one per cluster, sixteen at a time.
//!
//! Let all normals be within the angle alpha of the axis A, and the apex P not in
//! front of any triangle. For an eye e with v = P - e and v.A >= sin(alpha) |A| |v|,
//! the angle of v and A is at most 90° - alpha, so n.v >= 0 for every normal n, and
//! n.(e - a) = n.(P - a) - n.v <= 0: no triangle faces e. (The test is
//! meshoptimizer's, which has no term for rounding.)
//!
//! Rounding, u = 2^-24. The eye is rounded to f32 with an error E, known per view;
//! v' = P - e' rounds once more: |v - v'| <= E + u |v'|. Let s' be the computed
//! v'.A and q' the computed |v'|², wrong by at most 3.01 u |v'| |A| and 3.01 u |v'|².
//! The test, with rounding in each step, is
//!
//! ```text
//! t = s' - M >= 0   and   t² >= k² q'
//! ```
//!
//! For |A| <= 1 + 2^-20 it implies v'.A >= M + |v'| (k (1 - 3.7 u) - 3.01 u |A|).
//! The proof needs v.A >= sin(alpha) |A| |v|, for which v'.A >=
//! sin(alpha) |A| |v'| + 2 |A| (E + u |v'|) is enough. So M >= 2 |A| E and
//! k >= sin(alpha) |A| + 9 u suffice; the code takes 10 u. M is at least 2^-40, so
//! that |v'| > 2^-41 wherever the test holds and neither k² q' nor t² underflows;
//! below 2^59 nothing overflows.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::clusters::Clusters;
use super::exact::{Eye, faces, normal};
use super::{Selection, TriangleCull};
use crate::arithmetic::rounding::round_up;
use crate::geometry::Aabb;
use crate::kernel::{Isa, Kernel, LANES, LaneMask, Work};

/// Slack of the sine for the rounding of the test: derived above.
const SLACK: f64 = 10.0 / (1u64 << 24) as f64;
/// Bound of the error of a cosine of two normals in f64.
///
/// Some units of 2^-50, including the error of the normals (2^-50 each).
const COSINE: f64 = 64.0 / (1u64 << 53) as f64;
/// Coordinate above which products of three numbers may overflow.
pub const FAR: f32 = (1u64 << 59) as f32;
/// Least margin in world units.
const LEAST_MARGIN: f64 = 1.0 / (1u64 << 40) as f64;
/// Iterations of the axis search.
const STEPS: u32 = 48;

/// Apex, axis and sine of a cone, with the slack of [`Cone::fit`].
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Cone {
    /// Point in front of no triangle.
    pub apex: Vec3,
    /// Axis of length at most 1 + 2^-20.
    pub axis: Vec3,
    /// k: at least sin(alpha) |axis| plus the slack.
    pub sine: f64,
}

impl Cone {
    /// Fits a cone to triangles; `None` if every eye may see one of them.
    pub fn fit(triangles: &[[Vec3; 3]]) -> Option<Cone> {
        // A triangle without area is never visible.
        let planes = triangles.iter().map(|corners| (*corners, normal(*corners)));
        let with_area = planes.filter(|(_, n)| *n != DVec3::ZERO);
        let planes = with_area.map(|(corners, n)| (corners, n.normalize()));
        let planes: Vec<([Vec3; 3], DVec3)> = planes.collect();
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
}

/// Direction that approximately minimizes the largest angle to the normals.
///
/// Approximates the centre of their smallest enclosing ball (Bădoiu and Clarkson 2003, "Smaller
/// core-sets for balls").
fn axis_of(normals: impl Iterator<Item = DVec3> + Clone) -> Option<DVec3> {
    let mut centre = normals.clone().sum::<DVec3>() / normals.clone().count() as f64;
    for step in 0..STEPS {
        let far = |a: &DVec3, b: &DVec3| {
            let distance = |n: &DVec3| n.distance_squared(centre);
            distance(a).total_cmp(&distance(b))
        };
        // `None` without normals.
        let farthest = normals.clone().max_by(far)?;
        centre += (farthest - centre) / f64::from(step + 2);
    }
    centre.try_normalize()
}

/// A point in f32 that is in front of no triangle, proven by the exact test.
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

/// Back end with one cone per cluster.
#[derive(Clone, Debug)]
pub struct Cones(Vec<ConeBlock>);

impl Cones {
    /// Fits the cones. O(t).
    pub fn of(clusters: &Arc<Clusters>) -> Cones {
        let mut cones = vec![ConeBlock::EMPTY; clusters.len().div_ceil(LANES)];
        for (cluster, triangles) in clusters.one_sided() {
            if let Some(cone) = Cone::fit(&triangles) {
                cones[cluster / LANES].set(cluster % LANES, &cone);
            }
        }
        Cones(cones)
    }
}

impl TriangleCull for Cones {
    fn cull(&self, eye: &Eye, kernel: Kernel, kept: &mut Selection) {
        // Farther away the test could overflow.
        if eye.nearest.abs().max_element() < FAR {
            kernel.run(Query(&self.0, eye, &mut kept.blocks));
        }
    }
}

struct Query<'a>(&'a [ConeBlock], &'a Eye, &'a mut [[u64; LANES]]);

impl Work for Query<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Query(cones, eye, words) = self;
        let view = Broadcast::of(isa, eye);
        for (block, words) in cones.iter().zip(words) {
            clear(words, rejected(isa, block, &view));
        }
    }
}

/// Sixteen cones in f32: 28 bytes per cone.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct ConeBlock {
    apex: [[f32; LANES]; 3],
    axis: [[f32; LANES]; 3],
    /// k², rounded up; infinite for a lane that is never rejected.
    square: [f32; LANES],
}

impl ConeBlock {
    /// Block of cones that reject nothing.
    const EMPTY: ConeBlock = ConeBlock {
        apex: [[0.0; LANES]; 3],
        axis: [[0.0; LANES]; 3],
        square: [f32::INFINITY; LANES],
    };

    /// Stores a cone in a lane.
    fn set(&mut self, lane: usize, cone: &Cone) {
        for k in 0..3 {
            self.apex[k][lane] = cone.apex[k];
            self.axis[k][lane] = cone.axis[k];
        }
        self.square[lane] = round_up(cone.sine * cone.sine * (1.0 + COSINE));
    }
}

/// Lanes from which no triangle is visible: 21 operations at least.
#[inline(always)]
fn rejected<I: Isa>(isa: I, block: &ConeBlock, view: &Broadcast<I>) -> LaneMask {
    // Written out, as a closure would be compiled for the portable instruction set.
    let [x, y, z] = [&block.apex[0], &block.apex[1], &block.apex[2]];
    let [x, y, z] = [isa.load(x), isa.load(y), isa.load(z)];
    let [a, b, c] = [&block.axis[0], &block.axis[1], &block.axis[2]];
    let [a, b, c] = [isa.load(a), isa.load(b), isa.load(c)];
    let square = isa.load(&block.square);
    let [ex, ey, ez] = view.minus_eye;
    let [x, y, z] = match view.is_parallel {
        true => [ex, ey, ez],
        false => [isa.add(x, ex), isa.add(y, ey), isa.add(z, ez)],
    };
    let way = [x, y, z];
    let t = isa.add(dot(isa, way, [a, b, c]), view.minus_margin);
    let needed = isa.mul(square, dot(isa, way, way));
    isa.at_most(view.zero, t) & isa.at_most(needed, isa.mul(t, t))
}

#[inline(always)]
pub fn dot<I: Isa>(isa: I, [x, y, z]: [I::Floats; 3], [a, b, c]: [I::Floats; 3]) -> I::Floats {
    let xy = isa.add(isa.mul(x, a), isa.mul(y, b));
    isa.add(xy, isa.mul(z, c))
}

/// Eye broadcast to all lanes.
#[derive(Clone, Copy)]
struct Broadcast<I: Isa> {
    /// Negated eye, so that a difference is a sum.
    minus_eye: [I::Floats; 3],
    /// -M, see above.
    minus_margin: I::Floats,
    zero: I::Floats,
    /// `true` if the eye is at infinity: the apex does not matter.
    is_parallel: bool,
}

impl<I: Isa> Broadcast<I> {
    #[inline(always)]
    fn of(isa: I, eye: &Eye) -> Broadcast<I> {
        let [x, y, z] = (-eye.nearest).to_array();
        let margin = 2.0 * eye.error * (1.0 + 1.0 / (1 << 19) as f64);
        Broadcast {
            minus_eye: [isa.splat(x), isa.splat(y), isa.splat(z)],
            minus_margin: isa.splat(-round_up(margin.max(LEAST_MARGIN))),
            zero: isa.splat(0.0),
            is_parallel: eye.weight == 0.0,
        }
    }
}

/// Four words for each number below 16: all ones where its bit is set.
const SPREAD: [[u64; 4]; 16] = {
    let mut spread = [[0; 4]; 16];
    let mut bits = 0;
    while bits < 16 {
        let mut lane = 0;
        while lane < 4 {
            if bits >> lane & 1 == 1 {
                spread[bits][lane] = u64::MAX;
            }
            lane += 1;
        }
        bits += 1;
    }
    spread
};

/// Clears the words of the lanes in `gone`, without branches.
///
/// Four lanes at a time, by a table: compilers turn a comparison here into masked stores.
#[inline(always)]
fn clear(words: &mut [u64; LANES], gone: LaneMask) {
    if gone == 0 {
        return;
    }
    for part in 0..LANES / 4 {
        let spread = &SPREAD[usize::from(gone >> (4 * part)) & 15];
        for lane in 0..4 {
            words[4 * part + lane] &= !spread[lane];
        }
    }
}
