//! Every triangle for itself, exactly: its plane in f64 with a bound on its error,
//! and expansions where that does not decide.

use std::sync::Arc;

use glam::Vec3;

use super::super::guarantee::Guarantee;
use super::clusters::{Clusters, MOST_TRIANGLES};
use super::contract::{Criterion, TriangleCull, TriangleRow};
use super::exact::{faces, normal};
use super::eye::Eye;
use super::selection::Selection;
use super::view::View;
use crate::kernel::{Isa, Kernel, LANES, Work};

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "per-triangle",
    summary: "The side of each triangle's plane, exactly (f64, then expansions)",
    guarantee: Guarantee::Exact,
    criterion: Criterion::Facing,
    build,
};

/// Error of the plane test per unit of |n| times the length of the way from corner
/// to eye, components added. The normal: 2^-50. The way: one rounding of 2^-53. A
/// product and two sums: three. Together below 2^-50 + 4 * 2^-53 and terms of second
/// order, 1.5 * 2^-50; 2^-48 is above twice that.
const ERROR: f64 = 1.0 / (1u64 << 48) as f64;

/// The planes of 16 triangles, lane by lane.
#[derive(Clone, Copy)]
struct Planes {
    normal: [[f64; LANES]; 3],
    corner: [[f32; LANES]; 3],
    /// `ERROR` times the largest component of the normal; negative where a lane is
    /// to be kept whatever the eye (two-sided).
    error: [f64; LANES],
}

/// Sixteen triangles a row, four rows a cluster.
const ROWS: usize = MOST_TRIANGLES / LANES;

struct PerTriangle {
    clusters: Arc<Clusters>,
    /// Rows of each cluster; one more at the end.
    starts: Vec<u32>,
    planes: Vec<Planes>,
}

fn build(clusters: &Arc<Clusters>) -> Box<dyn TriangleCull> {
    let mut starts = vec![0];
    let mut planes: Vec<Planes> = Vec::new();
    for cluster in 0..clusters.len() {
        let is_two_sided = clusters.is_two_sided(cluster);
        for (bit, corners) in clusters.corners_of(cluster).enumerate() {
            if bit % LANES == 0 {
                planes.push(Planes {
                    normal: [[0.0; LANES]; 3],
                    corner: [[0.0; LANES]; 3],
                    error: [0.0; LANES],
                });
            }
            let row = planes.last_mut().expect("a row was just begun");
            let (lane, n) = (bit % LANES, normal(corners));
            for k in 0..3 {
                row.normal[k][lane] = n[k];
                row.corner[k][lane] = corners[0][k];
            }
            let error = ERROR * n.abs().max_element();
            row.error[lane] = if is_two_sided { -1.0 } else { error };
        }
        starts.push(planes.len() as u32);
    }
    Box::new(PerTriangle {
        clusters: clusters.clone(),
        starts,
        planes,
    })
}

impl TriangleCull for PerTriangle {
    fn cull(&self, view: &View, kernel: Kernel, kept: &mut Selection) {
        kernel.run(Query {
            all: self,
            eye: &view.eye,
            kept,
        });
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.planes[..]) + size_of_val(&self.starts[..])
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
    fn run<I: Isa>(self, _: I) {
        for (cluster, word) in self.kept.words_mut().iter_mut().enumerate() {
            if *word == 0 {
                continue;
            }
            let rows = self.all.starts[cluster] as usize..self.all.starts[cluster + 1] as usize;
            let (mut front, mut doubt) = (0, 0);
            for (row, planes) in self.all.planes[rows].iter().enumerate().take(ROWS) {
                let [plus, unsure] = sides(planes, self.eye);
                front |= plus << (LANES * row);
                doubt |= unsure << (LANES * row);
            }
            let mut left = *word & doubt;
            if left != 0 {
                let clusters = &self.all.clusters;
                while left != 0 {
                    let bit = left.trailing_zeros();
                    left &= left - 1;
                    let triangle = clusters.triangles_of(cluster)[bit as usize];
                    let corners: [Vec3; 3] = clusters.surfaces.corners(triangle);
                    front |= u64::from(faces(self.eye, corners)) << bit;
                }
            }
            *word &= front;
        }
    }
}

/// The lanes surely in front, and those in doubt.
#[inline(always)]
fn sides(planes: &Planes, eye: &Eye) -> [u64; 2] {
    let weight = f64::from(eye.weight);
    let (mut side, mut reach) = ([0.0; LANES], [1e-300; LANES]);
    for k in 0..3 {
        // The low part doubles as its own error.
        let slack = eye.low[k].abs() * (2.0 / ERROR);
        for lane in 0..LANES {
            let way = eye.high[k] - f64::from(planes.corner[k][lane]) * weight;
            side[lane] += planes.normal[k][lane] * way;
            reach[lane] += way.abs() + slack;
        }
    }
    let (mut front, mut doubt) = ([0u64; LANES], [0u64; LANES]);
    for lane in 0..LANES {
        let bound = planes.error[lane] * reach[lane];
        front[lane] = u64::from(side[lane] > bound || bound < 0.0) << lane;
        doubt[lane] = u64::from(side[lane].abs() <= bound) << lane;
    }
    let all = |lanes: [u64; LANES]| lanes.iter().fold(0, |all, bit| all | bit);
    [all(front), all(doubt)]
}
