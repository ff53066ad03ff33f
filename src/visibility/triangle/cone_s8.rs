//! One cone per cluster with axis and sine in eight bits: rounded outward, so that
//! what it rejects is a subset of what the exact cone about the rounded axis does.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::cone_block::{ConeRows, cull_clusters};
use super::contract::{Criterion, TriangleCull, TriangleRow};
use super::normal_cone::Cone;
use super::selection::Selection;
use super::view::View;
use crate::kernel::{Isa, Kernel, LANES};

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "cone-s8",
    summary: "One normal cone per cluster, axis and sine in 8 bits, rounding proven; 16 B",
    guarantee: Guarantee::Conservative,
    criterion: Criterion::Facing,
    build: |clusters| Box::new(ByteCones::of(clusters)),
};

/// Steps per unit of axis and sine. A power of two: decoding is exact.
const STEPS: f64 = 128.0;
/// The sine of a lane that is never rejected: 255 / 128, above any cosine.
const NEVER: u8 = 255;

/// Sixteen cones: 16 bytes a cone.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct ByteBlock {
    apex: [[f32; LANES]; 3],
    axis: [[i8; LANES]; 3],
    sine: [u8; LANES],
}

impl ConeRows for ByteBlock {
    #[inline(always)]
    fn rows<I: Isa>(&self, isa: I) -> [I::Floats; 7] {
        // One by one: a closure would be compiled for the portable set.
        [
            isa.load(&self.apex[0]),
            isa.load(&self.apex[1]),
            isa.load(&self.apex[2]),
            isa.load(&decoded(&self.axis[0])),
            isa.load(&decoded(&self.axis[1])),
            isa.load(&decoded(&self.axis[2])),
            isa.load(&squares(&self.sine)),
        ]
    }
}

/// The unit of the stored numbers.
const UNIT: f32 = 1.0 / STEPS as f32;

#[inline(always)]
fn decoded(row: &[i8; LANES]) -> [f32; LANES] {
    let mut out = [0.0; LANES];
    for lane in 0..LANES {
        out[lane] = f32::from(row[lane]) * UNIT;
    }
    out
}

/// At most 16 bits before scaling: exact.
#[inline(always)]
fn squares(row: &[u8; LANES]) -> [f32; LANES] {
    let mut out = [0.0; LANES];
    for lane in 0..LANES {
        let sine = f32::from(row[lane]) * UNIT;
        out[lane] = sine * sine;
    }
    out
}

/// The axis in whole steps; at most 127 each, so shorter than 1.
fn rounded(axis: DVec3) -> Vec3 {
    ((axis * (STEPS - 1.0)).round() / STEPS).as_vec3()
}

/// The cones of clusters.
#[derive(Clone, Debug)]
pub struct ByteCones {
    blocks: Vec<ByteBlock>,
}

impl ByteCones {
    /// One cone per cluster. O(t).
    pub fn of(clusters: &Arc<Clusters>) -> ByteCones {
        let empty = ByteBlock {
            apex: [[0.0; LANES]; 3],
            axis: [[0; LANES]; 3],
            sine: [NEVER; LANES],
        };
        let mut blocks = vec![empty; clusters.len().div_ceil(LANES)];
        for (cluster, triangles) in clusters.one_sided() {
            let Some(cone) = Cone::fit(&triangles, rounded) else {
                continue;
            };
            let (block, lane) = (&mut blocks[cluster / LANES], cluster % LANES);
            for k in 0..3 {
                block.apex[k][lane] = cone.apex[k];
                block.axis[k][lane] = (f64::from(cone.axis[k]) * STEPS) as i8;
            }
            block.sine[lane] = libm::ceil(cone.sine * STEPS) as u8;
        }
        ByteCones { blocks }
    }
}

impl TriangleCull for ByteCones {
    fn cull(&self, view: &View, kernel: Kernel, kept: &mut Selection) {
        cull_clusters(&self.blocks, view, kernel, kept);
    }
}
