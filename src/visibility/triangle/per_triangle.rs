//! Every triangle for itself, exactly: sixteen planes at a time in f32 with a bound
//! on the error, and the exact test where that does not decide.
//!
//! Normals are scaled so that their largest component is about 1. Let u = 2^-24, E
//! the error of the f32 eye. The way from corner to eye is off by E and u of itself,
//! a normal's component by u, three products and two sums by 3.01 u: together the
//! side is off by at most 1.75 E + 5.1 u |way|, where |way| adds components and 1.75
//! is above the root of three. The bound takes 8 u, for its own rounding (5 u of it).

use std::sync::Arc;

use glam::DVec3;

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::contract::{TriangleCull, TriangleRow};
use super::exact::{faces, normal};
use super::eye::Eye;
use super::plane_blocks::{PlaneBlocks, Planes};
use super::selection::Selection;
use crate::arithmetic::rounding::round_up;
use crate::kernel::{Isa, Kernel, LANES, Work};

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "per-triangle",
    summary: "The side of each triangle's plane, exactly (f32, f64, then expansions)",
    guarantee: Guarantee::Exact,
    build,
};

/// Error per unit of the way: see above.
const ERROR: f32 = 8.0 / (1u32 << 24) as f32;
/// Where sums may overflow.
const FAR: f32 = (1u64 << 59) as f32;
/// For what underflows.
const LEAST: f64 = 1e-30;

struct PerTriangle {
    clusters: Arc<Clusters>,
    /// Without area, or without a triangle, a lane is NaN: never in front.
    planes: PlaneBlocks,
    /// Whether all corners are near enough for f32.
    is_near: bool,
}

fn build(clusters: &Arc<Clusters>) -> Box<dyn TriangleCull> {
    let scaled = |corners| {
        let n = normal(corners);
        (n != DVec3::ZERO).then(|| (n / n.abs().max_element()).as_vec3())
    };
    let points = &clusters.surfaces.points;
    Box::new(PerTriangle {
        clusters: clusters.clone(),
        planes: PlaneBlocks::of(clusters, f32::NAN, scaled),
        is_near: points.iter().all(|p| p.abs().max_element() < FAR),
    })
}

impl TriangleCull for PerTriangle {
    fn cull(&self, eye: &Eye, kernel: Kernel, kept: &mut Selection) {
        let all = self;
        if !(self.is_near && eye.nearest.abs().max_element() < FAR) {
            let clusters = &self.clusters;
            kept.retain(|cluster, bit| {
                let triangle = clusters.triangles_of(cluster)[bit];
                clusters.is_two_sided(cluster) || faces(eye, clusters.surfaces.corners(triangle))
            });
            return;
        }
        kernel.run(Query { all, eye, kept });
    }
}

struct Query<'a> {
    all: &'a PerTriangle,
    eye: &'a Eye,
    kept: &'a mut Selection,
}

impl Work for Query<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let eye = Lanes::of(isa, self.eye);
        for (cluster, word) in self.kept.words_mut().iter_mut().enumerate() {
            let rows = self.all.planes.of_cluster(cluster);
            if *word == 0 || rows.is_empty() {
                continue;
            }
            let (mut front, mut doubt) = (0, 0);
            for (row, planes) in rows.iter().enumerate() {
                let [sure, unsure] = sides(isa, planes, &eye);
                front |= sure << (LANES * row);
                doubt |= unsure << (LANES * row);
            }
            let left = *word & doubt;
            if left != 0 {
                front |= in_doubt(&self.all.clusters, cluster, left, self.eye);
            }
            *word &= front;
        }
    }
}

/// Those of some triangles of a cluster that the eye is in front of.
#[cold]
fn in_doubt(clusters: &Clusters, cluster: usize, mut left: u64, eye: &Eye) -> u64 {
    let mut front = 0;
    while left != 0 {
        let bit = left.trailing_zeros();
        left &= left - 1;
        let triangle = clusters.triangles_of(cluster)[bit as usize];
        front |= u64::from(faces(eye, clusters.surfaces.corners(triangle))) << bit;
    }
    front
}

/// The eye in all lanes.
struct Lanes<I: Isa> {
    at: [I::Floats; 3],
    /// -1 for a point, 0 for a direction.
    minus_weight: I::Floats,
    minus_one: I::Floats,
    minus_error: I::Floats,
    margin: I::Floats,
}

impl<I: Isa> Lanes<I> {
    #[inline(always)]
    fn of(isa: I, eye: &Eye) -> Lanes<I> {
        let [x, y, z] = eye.nearest.to_array();
        Lanes {
            at: [isa.splat(x), isa.splat(y), isa.splat(z)],
            minus_weight: isa.splat(-eye.weight),
            minus_one: isa.splat(-1.0),
            minus_error: isa.splat(-ERROR),
            margin: isa.splat(round_up(1.75 * eye.error + LEAST)),
        }
    }
}

/// The lanes surely in front, and those in doubt.
#[inline(always)]
fn sides<I: Isa>(isa: I, planes: &Planes, eye: &Lanes<I>) -> [u64; 2] {
    let x = way(isa, &planes.corner[0], eye.at[0], eye);
    let y = way(isa, &planes.corner[1], eye.at[1], eye);
    let z = way(isa, &planes.corner[2], eye.at[2], eye);
    let side = isa.add(
        isa.add(
            isa.mul(isa.load(&planes.normal[0]), x),
            isa.mul(isa.load(&planes.normal[1]), y),
        ),
        isa.mul(isa.load(&planes.normal[2]), z),
    );
    // The negated lengths, as there is only a minimum.
    let length = isa.add(
        isa.add(least(isa, x, eye), least(isa, y, eye)),
        least(isa, z, eye),
    );
    let bound = isa.add(isa.mul(length, eye.minus_error), eye.margin);
    let above = isa.at_most(bound, side);
    let is_in = isa.at_most(isa.mul(bound, eye.minus_one), side) & isa.at_most(side, bound);
    [u64::from(above & !is_in), u64::from(is_in)]
}

#[inline(always)]
fn way<I: Isa>(isa: I, corner: &[f32; LANES], at: I::Floats, eye: &Lanes<I>) -> I::Floats {
    isa.add(at, isa.mul(isa.load(corner), eye.minus_weight))
}

/// -|x|
#[inline(always)]
fn least<I: Isa>(isa: I, x: I::Floats, eye: &Lanes<I>) -> I::Floats {
    isa.min(x, isa.mul(x, eye.minus_one))
}
