//! Extended planes, which complete the six planes of a frustum.
//!
//! With them the p-vertex test is the full separating axis test. They are selected in f64 for
//! speed; every selected plane is safe, because it is a sum of given planes. The oracle has the
//! theory and the exact version.
//!
//! All planes are relative to a point near the volume (the eye): relative to a far origin the
//! digits of small features would be lost.

use glam::DVec3;

use crate::arithmetic::{combinations, cross};
use crate::geometry::{MAX_PLANES, PlaneF64};

/// Rounding error of a sum of unit normals that is zero: some units of 2^-53 each.
const RESIDUE: f64 = 1.0 / (1u64 << 49) as f64;

/// Axis-parallel bounds of the volume: up to six planes, fewer if it is unbounded.
///
/// Each is a sum of three faces, with positive weights, whose normal is parallel to an axis, moved
/// outward by the rounding errors of the sum at points within `reach` of the origin. O(m^3) for m
/// faces.
pub fn bounds(faces: &[PlaneF64], reach: f64) -> Vec<PlaneF64> {
    /// Rounding error of a product of unit vectors.
    const ROUNDING: f64 = 1e-14;
    /// Largest rounding error of a sum of length 1.
    const UNIT: f64 = 1.0 / (1u64 << 24) as f64;
    /// Least length of a sum with significant digits.
    ///
    /// Views of up to 179.99 degrees keep their bounds with it.
    const CANCELLED: f64 = 2e-9;
    let mut tightest: [Option<f64>; 6] = [None; 6];
    for [a, b, c] in combinations(faces.len()).map(|triple| triple.map(|face| &faces[face])) {
        let crossed = [
            cross(b.normal, c.normal),
            cross(c.normal, a.normal),
            cross(a.normal, b.normal),
        ];
        for axis in 0..3 {
            // Zero, up to rounding, if two faces suffice (an edge perpendicular to the axis).
            let clean = |w: f64| if w.abs() < ROUNDING { 0.0 } else { w };
            let given = crossed.map(|w| w[axis]);
            let weights = given.map(clean);
            let dropped: f64 = given.iter().zip(weights).map(|(w, c)| (w - c).abs()).sum();
            let sign = weights.iter().sum::<f64>().signum();
            if weights.iter().any(|w| w * sign < 0.0) {
                continue;
            }
            let sum = |of: &dyn Fn(&PlaneF64) -> f64| {
                let parts = weights.iter().zip([a, b, c]);
                parts.map(|(w, plane)| w * sign * of(plane)).sum::<f64>()
            };
            let (n, d) = (sum(&|p| p.normal[axis]), sum(&|p| p.d));
            // Residues of the other axes in the normal, and rounding errors of the offset.
            let cost = (dropped + RESIDUE) * 2.0 * reach + RESIDUE * sum(&|p| p.d.abs()).abs();
            let offset = (d + cost) / n.abs();
            let sound = n.abs() > CANCELLED && dropped <= UNIT * n.abs();
            if sound && offset.is_finite() {
                let slot = &mut tightest[2 * axis + usize::from(n < 0.0)];
                *slot = Some(slot.map_or(offset, |old| old.min(offset)));
            }
        }
    }
    let directions = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
    let found = directions.zip(tightest);
    let planes = found.filter_map(|(normal, d)| Some(PlaneF64::new(normal, d?)));
    planes.collect()
}

/// Silhouettes of the volume seen along the axes: up to eighteen for a frustum.
///
/// Planes through its edges and parallel to an axis. Each is the sum of two faces whose normals
/// have opposite signs on that axis. Only sums that touch the volume are kept, the tightest ones if
/// there are more than `room`, each moved outward by the rounding errors of the sum within `reach`.
/// O(m^3) for the corners of m faces, O(m^2) sums.
fn silhouettes(faces: &[PlaneF64], room: usize, reach: f64) -> Vec<PlaneF64> {
    /// Least length of a sum of unit normals with significant digits.
    ///
    /// A shorter one has an error of more than 1e-9 of its length. Omitting it is always safe.
    const CANCELLED: f64 = 1e-7;
    /// Most distance of a sum from a corner it touches, per sum of magnitudes there.
    ///
    /// Far above rounding, far below the gap of a redundant sum.
    const TIGHT: f64 = 1e-7;
    let corners = PlaneF64::corners(faces);
    let mut found: Vec<(f64, PlaneF64)> = Vec::new();
    for [a, b] in combinations(faces.len()).map(|pair| pair.map(|face| &faces[face])) {
        for axis in 0..3 {
            let (pull, against) = (a.normal[axis], b.normal[axis]);
            if pull * against >= 0.0 {
                continue;
            }
            let mut normal = a.normal * against.abs() + b.normal * pull.abs();
            normal[axis] = 0.0;
            let length = normal.length();
            let [of_a, of_b] = [a.d * against.abs(), b.d * pull.abs()];
            let d = (of_a + of_b) / length;
            let plane = PlaneF64::new(normal / length, d);
            if length < CANCELLED {
                continue;
            }
            let gaps = corners.iter().map(|&corner| plane.share_at(corner));
            let gap = gaps.fold(f64::INFINITY, f64::min);
            let cost = RESIDUE * (2.0 * reach + of_a.abs() + of_b.abs());
            let d = d + cost / length;
            if plane.normal.is_finite() && d.is_finite() && gap <= TIGHT {
                found.push((gap, PlaneF64::new(plane.normal, d)));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(room);
    found.into_iter().map(|(_, plane)| plane).collect()
}

/// Planes of the exact test in addition to the faces: bounds and silhouettes.
pub fn extended(faces: &[PlaneF64], reach: f64) -> Vec<PlaneF64> {
    let bounds = bounds(faces, reach);
    let room = MAX_PLANES.saturating_sub(faces.len() + bounds.len());
    [bounds, silhouettes(faces, room, reach)].concat()
}

/// Largest distance of a bounded volume's corners from the origin.
pub fn farthest_corner(faces: &[PlaneF64]) -> f64 {
    let lengths = PlaneF64::corners(faces).into_iter().map(DVec3::length);
    lengths.fold(0.0, f64::max)
}
