//! A line of sight that shows that one region sees another, and what proves such
//! lines. The search for them is elsewhere; checking one is `Ground::check`.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::answer::RegionId;
use super::graph::RegionGraph;
use super::opening::OpeningPlane;
use super::pvs::Pvs;
use crate::arithmetic::Expansion;

/// A segment from within one region to within another, strictly through openings.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Witness {
    /// The regions of its two ends.
    pub regions: [RegionId; 2],
    /// World coordinates of the ends, to be taken as they are, without an error.
    pub ends: [DVec3; 2],
}

/// Why a witness is not accepted.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Rejected {
    /// A region that the graph has not.
    #[error("a region that is not there")]
    Region,
    /// An end is not strictly within its region.
    #[error("end {0} is not strictly within its region")]
    End(usize),
    /// The segment meets a border where there is no opening, or touches its edge.
    #[error("the segment leaves region {0} where there is no opening")]
    Blocked(RegionId),
}

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

/// A set of visible pairs together with what proves them.
pub trait ProvenPvs {
    /// All pairs that are proven visible or could not be decided; what it lacks is
    /// proven invisible.
    fn pvs(&self) -> &Pvs;

    /// Pairs of it, the smaller number first, of which no proof is known either way.
    fn undecided(&self) -> &[[RegionId; 2]];

    /// A line of sight between two regions; `None` where there is none, or none was
    /// found.
    fn witness(&self, from: RegionId, to: RegionId) -> Option<Witness>;
}
