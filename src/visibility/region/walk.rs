//! Rays followed from region to region in plain f64: the regions that samples see.
//! Kept simple: it is the reference that back ends are tested with.

use super::graph::RegionGraph;
use super::id_set::{IdSet, RegionId};
use super::opening::OpeningPlane;
use crate::scene::WorldBox;
use crate::visibility::{Ray, Rays, SampleGrid};

/// Adds the regions, boxes each, that a ray passes from its near to its far end,
/// until it meets a border where there is no opening. `home` holds its beginning.
pub fn follow_boxes(graph: &RegionGraph, home: RegionId, ray: &Ray, seen: &mut IdSet) {
    let (mut region, mut depth) = (home, ray.near);
    // A ray passes each region once.
    for _ in 0..graph.len() {
        seen.insert(region);
        let b = graph.parts(region)[0];
        let Some((axis, at, t)) = way_out(&b, ray) else {
            return;
        };
        depth = t.max(depth);
        if depth > ray.far {
            return;
        }
        let p = ray.at(depth);
        let through = |exit: &&u32| {
            let opening = &graph.openings()[**exit as usize];
            let same = OpeningPlane::Axis { axis, at } == opening.plane;
            let [low, high] = opening.bounds();
            same && (0..3).all(|k| k == axis || low[k] < p[k] && p[k] < high[k])
        };
        match graph.exits(region).iter().find(through) {
            Some(&exit) => region = graph.openings()[exit as usize].other(region),
            None => return,
        }
    }
}

/// The face by which a ray leaves a box: axis, coordinate and depth.
fn way_out(b: &WorldBox, ray: &Ray) -> Option<(usize, f64, f64)> {
    let mut first: Option<(usize, f64, f64)> = None;
    for axis in 0..3 {
        let d = ray.direction[axis];
        let at = if d > 0.0 { b.max[axis] } else { b.min[axis] };
        let t = (at - ray.origin[axis]) / d;
        if d != 0.0 && first.is_none_or(|(_, _, least)| t < least) {
            first = Some((axis, at, t));
        }
    }
    first
}

/// Replaces `out` by the regions that the rays of an image pass, ascending: a truth
/// by samples, to which no row may answer with less.
pub fn seen_by_samples(
    graph: &RegionGraph,
    rays: &Rays,
    grid: SampleGrid,
    out: &mut Vec<RegionId>,
) {
    let mut seen = IdSet::default();
    seen.clear(graph.len());
    for row in 0..grid.height {
        for column in 0..grid.width {
            graph
                .ground()
                .follow(graph, &rays.sample(grid, column, row), &mut seen);
        }
    }
    seen.list(out);
}
