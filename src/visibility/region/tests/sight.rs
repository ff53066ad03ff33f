//! Lines of sight through boxes and openings, followed in exact arithmetic.

use glam::DVec3;

use super::super::{OpeningPlane, RegionGraph, RegionId};
use crate::arithmetic::Expansion;

/// Tests whether a segment between two regions crosses openings only.
///
/// Both ends must be inside their regions, and the segment must touch no edge. For graphs of boxes;
/// O(regions passed * exits).
pub fn leads_through(graph: &RegionGraph, regions: [RegionId; 2], [a, b]: [DVec3; 2]) -> bool {
    for (region, p) in regions.into_iter().zip([a, b]) {
        let room = graph.parts[region as usize][0];
        if !(p.cmpgt(room.min).all() && p.cmplt(room.max).all()) {
            return false;
        }
    }
    let [mut region, last] = regions;
    for _ in 0..graph.len() {
        if region == last {
            return true;
        }
        let passed = |exit: &&u32| {
            let opening = &graph.openings[**exit as usize];
            let OpeningPlane::Axis { axis, at } = opening.plane else {
                return false;
            };
            let onward = match opening.sides[0] == region {
                true => b[axis] < at && at < a[axis],
                false => a[axis] < at && at < b[axis],
            };
            onward && passes(axis, at, &opening.corners, a, b)
        };
        match graph.exits[region as usize].iter().find(passed) {
            Some(&exit) => region = graph.openings[exit as usize].other(region),
            None => return false,
        }
    }
    false
}

/// Tests whether a line from a to b crosses the plane `at` within the corners.
fn passes(axis: usize, at: f64, corners: &[DVec3; 4], a: DVec3, b: DVec3) -> bool {
    let exact = Expansion::from;
    let minus = |x: f64, y: f64| &exact(x) - &exact(y);
    let run = minus(b[axis], a[axis]);
    (0..3).filter(|&k| k != axis).all(|k| {
        // Compares a_k + (b_k - a_k) (at - a) / run with an edge, both multiplied by run.
        let side = |edge: f64| {
            let there = &minus(b[k], a[k]) * &minus(at, a[axis]);
            let wanted = &minus(edge, a[k]) * &run;
            (&there - &wanted).sign() * run.sign()
        };
        let values = corners.map(|c| c[k]);
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        side(low) > 0 && side(high) < 0
    })
}
