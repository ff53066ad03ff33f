//! Exact back-face test of each triangle.
//!
//! Sixteen planes at a time in f32 with an error bound, and the exact test where that does not
//! decide.
//!
//! Normals are scaled so that their largest component is about 1. Let u = 2^-24 and E the error of
//! the f32 eye. The vector from corner to eye is wrong by E and u of itself, a normal's component
//! by u, three products and two sums by 3.01 u. Together the signed distance is wrong by at most
//! 1.75 E + 5.1 u |v|, where |v| is the sum of the vector's absolute components and 1.75
//! exceeds the square root of three. The code takes 8 u, to cover the rounding of the bound itself
//! (5 u of it).

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::clusters::Clusters;
use super::cones::{FAR, dot};
use super::exact::{Eye, normal};
use super::{Selection, TriangleCull, facing};
use crate::arithmetic::rounding::round_up;
use crate::kernel::{Isa, Kernel, LANES, Work};

/// Error relative to |v|: derived above.
const ERROR: f32 = 8.0 / (1u32 << 24) as f32;
/// Least error bound, for underflow.
const MIN_ERROR: f64 = 1e-30;

/// Sixteen triangles: scaled normals and first corners.
///
/// If a lane has no triangle, or one without area, its normal is NaN: never in front.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Planes {
    normal: [[f32; LANES]; 3],
    corner: [[f32; LANES]; 3],
}

impl Planes {
    const EMPTY: Planes = Planes {
        normal: [[f32::NAN; LANES]; 3],
        corner: [[0.0; LANES]; 3],
    };
}

pub struct PerTriangle {
    clusters: Arc<Clusters>,
    /// First plane block of each cluster, then the end.
    ///
    /// A two-sided cluster has no planes.
    starts: Vec<u32>,
    planes: Vec<Planes>,
    /// `true` if all corners are near enough for f32.
    is_near: bool,
}

impl PerTriangle {
    /// Prepares the planes. O(t).
    pub fn of(clusters: &Arc<Clusters>) -> PerTriangle {
        let (mut starts, mut planes) = (vec![0], Vec::new());
        for cluster in 0..clusters.len() {
            let first = planes.len();
            if !clusters.is_two_sided(cluster) {
                let rows = clusters.triangles_of(cluster).len().div_ceil(LANES);
                planes.resize(first + rows, Planes::EMPTY);
                for (bit, corners) in clusters.corners_of(cluster).enumerate() {
                    let (row, lane): (&mut Planes, _) =
                        (&mut planes[first + bit / LANES], bit % LANES);
                    let n = normal(corners);
                    let n = match n == DVec3::ZERO {
                        true => Vec3::NAN,
                        false => (n / n.abs().max_element()).as_vec3(),
                    };
                    for k in 0..3 {
                        row.normal[k][lane] = n[k];
                        row.corner[k][lane] = corners[0][k];
                    }
                }
            }
            starts.push(planes.len() as u32);
        }
        let points = &clusters.surfaces.points;
        PerTriangle {
            clusters: clusters.clone(),
            starts,
            planes,
            is_near: points.iter().all(|p| p.abs().max_element() < FAR),
        }
    }
}

impl TriangleCull for PerTriangle {
    fn cull(&self, eye: &Eye, kernel: Kernel, kept: &mut Selection) {
        match self.is_near && eye.nearest.abs().max_element() < FAR {
            true => kernel.run(Query(self, eye, kept)),
            false => *kept = facing(&self.clusters, eye, kept),
        }
    }
}

struct Query<'a>(&'a PerTriangle, &'a Eye, &'a mut Selection);

impl Work for Query<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Query(all, eye, kept) = self;
        let lanes = EyeLanes::of(isa, eye);
        let PerTriangle { starts, planes, .. } = all;
        for (cluster, word) in kept.words_mut().iter_mut().enumerate() {
            let rows = &planes[starts[cluster] as usize..starts[cluster + 1] as usize];
            if *word == 0 || rows.is_empty() {
                continue;
            }
            let (mut front, mut doubt) = (0, 0);
            for (row, planes) in rows.iter().enumerate() {
                let [sure, unsure] = sides(isa, planes, &lanes);
                front |= sure << (LANES * row);
                doubt |= unsure << (LANES * row);
            }
            let left = *word & doubt;
            if left != 0 {
                front |= all.clusters.seen(eye, cluster, left);
            }
            *word &= front;
        }
    }
}

/// Eye broadcast to all lanes.
struct EyeLanes<I: Isa> {
    at: [I::Floats; 3],
    /// -1 for a point, 0 for a direction.
    minus_weight: I::Floats,
    minus_one: I::Floats,
    minus_error: I::Floats,
    margin: I::Floats,
}

impl<I: Isa> EyeLanes<I> {
    #[inline(always)]
    fn of(isa: I, eye: &Eye) -> EyeLanes<I> {
        let [x, y, z] = eye.nearest.to_array();
        EyeLanes {
            at: [isa.splat(x), isa.splat(y), isa.splat(z)],
            minus_weight: isa.splat(-eye.weight),
            minus_one: isa.splat(-1.0),
            minus_error: isa.splat(-ERROR),
            margin: isa.splat(round_up(1.75 * eye.error + MIN_ERROR)),
        }
    }
}

/// Lanes that certainly face the eye, and undecided lanes.
#[inline(always)]
fn sides<I: Isa>(isa: I, planes: &Planes, eye: &EyeLanes<I>) -> [u64; 2] {
    let x = to_eye(isa, &planes.corner[0], eye.at[0], eye);
    let y = to_eye(isa, &planes.corner[1], eye.at[1], eye);
    let z = to_eye(isa, &planes.corner[2], eye.at[2], eye);
    let [a, b, c] = [&planes.normal[0], &planes.normal[1], &planes.normal[2]];
    let [a, b, c] = [isa.load(a), isa.load(b), isa.load(c)];
    let side = dot(isa, [a, b, c], [x, y, z]);
    // Negated absolute values, as there is only a minimum.
    let [x, y, z] = [
        neg_abs(isa, x, eye),
        neg_abs(isa, y, eye),
        neg_abs(isa, z, eye),
    ];
    let length = isa.add(isa.add(x, y), z);
    let bound = isa.add(isa.mul(length, eye.minus_error), eye.margin);
    let above = isa.at_most(bound, side);
    let is_in = isa.at_most(isa.mul(bound, eye.minus_one), side) & isa.at_most(side, bound);
    [u64::from(above & !is_in), u64::from(is_in)]
}

#[inline(always)]
fn to_eye<I: Isa>(isa: I, corner: &[f32; LANES], at: I::Floats, eye: &EyeLanes<I>) -> I::Floats {
    isa.add(at, isa.mul(isa.load(corner), eye.minus_weight))
}

/// Computes -|x|.
#[inline(always)]
fn neg_abs<I: Isa>(isa: I, x: I::Floats, eye: &EyeLanes<I>) -> I::Floats {
    isa.min(x, isa.mul(x, eye.minus_one))
}
