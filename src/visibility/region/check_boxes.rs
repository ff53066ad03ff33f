//! The check of a line of sight through boxes and openings: by a walk that shares nothing
//! with the search for such lines.

use glam::DVec3;

use super::graph::RegionGraph;
use super::opening::OpeningPlane;
use super::witness::{Rejected, Witness};
use crate::arithmetic::Expansion;

/// Checks a witness in a graph of boxes, exactly, by walking from box to box. It
/// shares nothing with what finds witnesses. O(regions passed * exits).
///
/// # Errors
/// What is wrong with it.
pub fn check_boxes(graph: &RegionGraph, witness: &Witness) -> Result<(), Rejected> {
    let [a, b] = witness.ends;
    if witness.regions.iter().any(|r| *r as usize >= graph.len()) {
        return Err(Rejected::Region);
    }
    for (end, p) in [a, b].into_iter().enumerate() {
        let room = graph.parts(witness.regions[end])[0];
        if !(p.cmpgt(room.min).all() && p.cmplt(room.max).all()) {
            return Err(Rejected::End(end));
        }
    }
    let mut region = witness.regions[0];
    for _ in 0..graph.len() {
        if region == witness.regions[1] {
            return Ok(());
        }
        let passed = |exit: &&u32| {
            let opening = &graph.openings()[**exit as usize];
            let OpeningPlane::Axis { axis, at } = opening.plane else {
                return false;
            };
            let onward = if opening.sides[0] == region {
                b[axis] < at && at < a[axis]
            } else {
                a[axis] < at && at < b[axis]
            };
            onward && passes(axis, at, &opening.corners, a, b)
        };
        match graph.exits(region).iter().find(passed) {
            Some(&exit) => region = graph.openings()[exit as usize].other(region),
            None => break,
        }
    }
    Err(Rejected::Blocked(region))
}

/// Whether the line from a to b meets the plane at `at` strictly within the corners.
fn passes(axis: usize, at: f64, corners: &[DVec3; 4], a: DVec3, b: DVec3) -> bool {
    let exact = Expansion::from;
    let minus = |x: f64, y: f64| &exact(x) - &exact(y);
    let run = minus(b[axis], a[axis]);
    (0..3).filter(|&k| k != axis).all(|k| {
        // a_k + (b_k - a_k) (at - a) / run against an edge, times run.
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
