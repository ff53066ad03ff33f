//! Every triangle for itself in f32, as engines do it: sixteen at a time, without a
//! margin.

use std::sync::Arc;

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::contract::{Criterion, TriangleCull, TriangleRow};
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

/// Sixteen triangles: normal and corner.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Planes {
    normal: [[f32; LANES]; 3],
    corner: [[f32; LANES]; 3],
}

struct PerTriangle {
    /// Rows of each cluster; one more at the end.
    starts: Vec<u32>,
    planes: Vec<Planes>,
    is_two_sided: Vec<bool>,
}

fn build(clusters: &Arc<Clusters>) -> Box<dyn TriangleCull> {
    let mut starts = vec![0];
    let mut planes: Vec<Planes> = Vec::new();
    let empty = Planes {
        normal: [[0.0; LANES]; 3],
        corner: [[0.0; LANES]; 3],
    };
    for cluster in 0..clusters.len() {
        for (bit, [a, b, c]) in clusters.corners_of(cluster).enumerate() {
            if bit % LANES == 0 {
                planes.push(empty);
            }
            let row = planes.last_mut().expect("a row was just begun");
            let n = (b - a).cross(c - a);
            for k in 0..3 {
                row.normal[k][bit % LANES] = n[k];
                row.corner[k][bit % LANES] = a[k];
            }
        }
        starts.push(planes.len() as u32);
    }
    let is_two_sided = (0..clusters.len()).map(|cluster| clusters.is_two_sided(cluster));
    Box::new(PerTriangle {
        starts,
        planes,
        is_two_sided: is_two_sided.collect(),
    })
}

impl TriangleCull for PerTriangle {
    fn cull(&self, view: &View, kernel: Kernel, kept: &mut Selection) {
        kernel.run(Query {
            all: self,
            view,
            kept,
        });
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.planes[..]) + size_of_val(&self.starts[..])
    }
}

struct Query<'a> {
    all: &'a PerTriangle,
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
            if *word == 0 || self.all.is_two_sided[cluster] {
                continue;
            }
            let rows = self.all.starts[cluster] as usize..self.all.starts[cluster + 1] as usize;
            let mut front = 0;
            for (row, planes) in self.all.planes[rows].iter().enumerate() {
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
