//! A word per cluster and direction: the triangles that may face an eye there. The
//! directions are the cells of a cube around the cluster; a query reads one word.
//! (Precomputed facing per cell of eyes: Zhang and Hoff 1997, "Fast backface culling
//! using normal masks", turned round.)
//!
//! An eye at `c + m d`, where d is on the cube of half edge 1 and m >= T, is behind
//! a triangle (a, n) where `n.(c - a) + m n.d <= 0`. Over a cell n.d is largest at
//! one of its corners; call it g. With g <= 0 the sum is largest at m = T.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::contract::{Criterion, TriangleCull, TriangleRow};
use super::exact::normal;
use super::eye::Eye;
use super::selection::Selection;
use super::view::View;
use crate::kernel::Kernel;

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "masks",
    summary: "A word per cluster for each of 96 directions of the eye; 12 B a triangle",
    guarantee: Guarantee::Conservative,
    criterion: Criterion::Facing,
    build,
};

/// Cells along an edge of the cube.
const SIDE: usize = 4;
/// Cells in all.
const CELLS: usize = 6 * SIDE * SIDE;
/// T over half the largest edge of the cluster's box.
const REACH: f32 = 3.0;
/// How far cells reach beyond their edges, for the rounding of a query: its d is
/// true to 2^-22 or it is not used.
const OVERLAP: f64 = 1.0 / (1u64 << 20) as f64;
/// Rounding of the sums here, per unit of the lengths in them: some units of 2^-50.
const SLACK: f64 = 1.0 / (1u64 << 44) as f64;

struct Cell {
    centre: Vec3,
    /// T: a nearer eye keeps everything.
    least: f32,
    words: [u64; CELLS],
}

struct Masks {
    cells: Vec<Cell>,
}

fn build(clusters: &Arc<Clusters>) -> Box<dyn TriangleCull> {
    let cells: Vec<[DVec3; 4]> = (0..CELLS).map(corners_of).collect();
    let cell = |cluster| {
        let is_two_sided = clusters.is_two_sided(cluster);
        let bounds = clusters.bounds(cluster);
        let centre = bounds.centre();
        let least = bounds.extent().max_element() * 0.5 * REACH;
        let mut words = [0; CELLS];
        for (bit, corners) in clusters.corners_of(cluster).enumerate() {
            let n = normal(corners).normalize_or_zero();
            if n == DVec3::ZERO && !is_two_sided {
                continue;
            }
            let way = centre.as_dvec3() - corners[0].as_dvec3();
            let (height, reach) = (n.dot(way), f64::from(least));
            let slack = SLACK * (way.length() + reach);
            for (cell, word) in cells.iter().zip(&mut words) {
                let most = cell.iter().map(|d| n.dot(*d)).fold(-2.0, f64::max) + SLACK;
                let is_behind = most <= 0.0 && height + reach * most + slack <= 0.0;
                if !is_behind || is_two_sided {
                    *word |= 1 << bit;
                }
            }
        }
        Cell {
            centre,
            least,
            words,
        }
    };
    Box::new(Masks {
        cells: (0..clusters.len()).map(cell).collect(),
    })
}

/// The corners of a cell on the cube of half edge 1, and a little beyond.
fn corners_of(cell: usize) -> [DVec3; 4] {
    let (face, row, column) = (cell / (SIDE * SIDE), cell / SIDE % SIDE, cell % SIDE);
    let (axis, sign) = (face / 2, if face % 2 == 0 { 1.0 } else { -1.0 });
    let at = |index: usize, end: usize| {
        let edge = (index + end) as f64 * 2.0 / SIDE as f64 - 1.0;
        edge + OVERLAP * (2.0 * end as f64 - 1.0)
    };
    std::array::from_fn(|corner| {
        let mut d = DVec3::ZERO;
        d[axis] = sign;
        d[(axis + 1) % 3] = at(row, corner & 1);
        d[(axis + 2) % 3] = at(column, corner >> 1);
        d
    })
}

/// The cell of an eye as seen from a cluster; `None` if it is too near.
#[inline(always)]
fn cell_of(eye: &Eye, centre: Vec3, least: f32) -> Option<usize> {
    let d = eye.high - centre.as_dvec3() * f64::from(eye.weight);
    let size = d.abs();
    let most = size.max_element();
    let is_far = most > f64::from(least * eye.weight) * (1.0 + OVERLAP);
    let is_true = eye.low.abs().max_element() * (1u64 << 23) as f64 <= most;
    if !(is_far && is_true && most.is_finite()) {
        return None;
    }
    let axis = match most {
        m if m == size.x => 0,
        m if m == size.y => 1,
        _ => 2,
    };
    let face = 2 * axis + usize::from(d[axis] < 0.0);
    let scale = SIDE as f64 / 2.0 / most;
    let at = |k: usize| ((d[k % 3] * scale + SIDE as f64 / 2.0) as usize).min(SIDE - 1);
    Some((face * SIDE + at(axis + 1)) * SIDE + at(axis + 2))
}

impl TriangleCull for Masks {
    fn cull(&self, view: &View, _: Kernel, kept: &mut Selection) {
        for (cell, word) in self.cells.iter().zip(kept.words_mut()) {
            if *word != 0
                && let Some(index) = cell_of(&view.eye, cell.centre, cell.least)
            {
                *word &= cell.words[index];
            }
        }
    }
}
