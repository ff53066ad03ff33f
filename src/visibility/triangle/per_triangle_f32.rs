//! Every triangle for itself in f32, as engines do it: sixteen at a time, without a
//! margin.

use std::sync::Arc;

use glam::Vec3;

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::contract::{Criterion, TriangleCull, TriangleRow};
use super::plane_blocks::PlaneBlocks;
use super::selection::Selection;
use super::view::View;
use crate::kernel::{Isa, Kernel, LANES, Work};

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "per-triangle-f32",
    summary: "The side of each triangle's plane in f32, no margin; 24 B a triangle",
    guarantee: Guarantee::Unproven,
    criterion: Criterion::Facing,
    build,
};

struct PerTriangle(PlaneBlocks);

fn build(clusters: &Arc<Clusters>) -> Box<dyn TriangleCull> {
    let normal = |[a, b, c]: [Vec3; 3]| Some((b - a).cross(c - a));
    Box::new(PerTriangle(PlaneBlocks::of(clusters, 0.0, normal)))
}

impl TriangleCull for PerTriangle {
    fn cull(&self, view: &View, kernel: Kernel, kept: &mut Selection) {
        kernel.run(Query {
            planes: &self.0,
            view,
            kept,
        });
    }
}

struct Query<'a> {
    planes: &'a PlaneBlocks,
    view: &'a View,
    kept: &'a mut Selection,
}

impl Work for Query<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let [x, y, z] = (-self.view.eye.nearest).to_array();
        let minus_eye = [isa.splat(x), isa.splat(y), isa.splat(z)];
        let is_parallel = self.view.eye.weight == 0.0;
        for (cluster, word) in self.kept.words_mut().iter_mut().enumerate() {
            let rows = self.planes.of_cluster(cluster);
            if *word == 0 || rows.is_empty() {
                continue;
            }
            let mut front = 0;
            for (row, planes) in rows.iter().enumerate() {
                let term = |k: usize| {
                    let corner = isa.load(&planes.corner[k]);
                    let way = match is_parallel {
                        true => minus_eye[k],
                        false => isa.add(corner, minus_eye[k]),
                    };
                    isa.mul(isa.load(&planes.normal[k]), way)
                };
                let side = isa.add(isa.add(term(0), term(1)), term(2));
                front |= u64::from(isa.below_zero(side)) << (LANES * row);
            }
            *word &= front;
        }
    }
}
