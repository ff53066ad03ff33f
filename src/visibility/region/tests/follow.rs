//! Regions that a ray passes before it meets an opaque border, one by one.
//!
//! Plain f64, by searches that share nothing with the back ends.

use glam::{DVec2, DVec3};

use super::super::doom::DoomMap;
use super::super::{IdSet, Opening, OpeningPlane, RegionGraph, RegionId};
use crate::scene::{BspChild, LeafNode, QuakeMap, WorldBox};
use crate::visibility::Ray;

/// Adds the box regions that a ray passes between near and far.
///
/// Ends at a border without an opening.
pub fn boxes(graph: &RegionGraph, ray: &Ray, seen: &mut IdSet) {
    let start = ray.at(ray.near);
    let start = WorldBox::new(start, start);
    for home in (0..graph.len() as u32).filter(|&id| graph.parts[id as usize][0].meets(&start)) {
        boxes_from(graph, home, ray, seen);
    }
}

fn boxes_from(graph: &RegionGraph, home: RegionId, ray: &Ray, seen: &mut IdSet) {
    let (mut region, mut depth) = (home, ray.near);
    // A ray passes each region once.
    for _ in 0..graph.len() {
        seen.insert(region);
        let b = graph.parts[region as usize][0];
        let Some((axis, at, t)) = way_out(&b, ray) else {
            return;
        };
        depth = t.max(depth);
        if depth > ray.far {
            return;
        }
        let p = ray.at(depth);
        let through = |exit: &&u32| {
            let opening = &graph.openings[**exit as usize];
            let same = OpeningPlane::Axis { axis, at } == opening.plane;
            let [low, high] = bounds(opening);
            same && (0..3).all(|k| k == axis || low[k] < p[k] && p[k] < high[k])
        };
        match graph.exits[region as usize].iter().find(through) {
            Some(&exit) => region = graph.openings[exit as usize].other(region),
            None => return,
        }
    }
}

impl Opening {
    /// The other of the opening's two regions.
    pub(super) fn other(&self, region: RegionId) -> RegionId {
        let [front, behind] = self.sides;
        if region == front { behind } else { front }
    }
}

/// Lower and upper corner of an opening's bounds.
fn bounds(opening: &Opening) -> [DVec3; 2] {
    let corners = opening.corners.into_iter();
    let [low, high] = [
        corners.clone().reduce(DVec3::min),
        corners.reduce(DVec3::max),
    ];
    [low, high].map(|corner| corner.expect("four corners"))
}

/// Face through which a ray leaves a box: axis, coordinate and depth.
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

/// Adds the sectors of a map that a ray passes, from linedef to linedef.
pub fn sectors(map: &DoomMap, graph: &RegionGraph, ray: &Ray, seen: &mut IdSet) {
    let (start, mut met) = (ray.at(ray.near), Vec::new());
    // The sector of the point itself follows those of linedefs near it.
    graph
        .locator
        .regions_at(&WorldBox::new(start, start), &mut met);
    let Some(mut sector) = met.pop() else {
        return;
    };
    let (o, d) = (ray.origin.truncate(), ray.direction.truncate());
    let mut crossings = Vec::new();
    for line in &map.lines {
        let [a, b] = line.ends.map(|[x, y]| DVec2::new(x.into(), y.into()));
        let (sa, sb) = (d.perp_dot(a - o), d.perp_dot(b - o));
        if (sa < 0.0) == (sb < 0.0) {
            continue;
        }
        let t = (a - o).perp_dot(b - a) / d.perp_dot(b - a);
        if t >= ray.near && t <= ray.far {
            // The line starts right of the ray: it is crossed from its left to its right.
            crossings.push((t, line, sa < 0.0));
        }
    }
    crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
    seen.insert(sector);
    for (t, line, to_right) in crossings {
        let z = ray.origin.z + ray.direction.z * t;
        let [floor, ceiling] = map.sectors[sector as usize];
        let passes = |[low, high]: [f64; 2]| low < z && z < high;
        let is_inside = floor <= z && z <= ceiling;
        if !is_inside || !map.opening(line).is_some_and(passes) {
            return;
        }
        if let Some(next) = line.sectors[usize::from(!to_right)] {
            sector = next;
            seen.insert(sector);
        }
    }
}

/// Farthest depth to which rays are followed: beyond every map.
const FARTHEST: f64 = 1e10;

/// Adds the clusters of a map whose open leaves a ray passes.
pub fn leaves(map: &QuakeMap, ray: &Ray, seen: &mut IdSet) {
    let value = |node: &LeafNode, depth: f64| {
        node.normal.as_dvec3().dot(ray.at(depth)) - f64::from(node.distance)
    };
    let far = ray.far.min(FARTHEST);
    let mut open = vec![(BspChild::Node(0), ray.near, far)];
    while let Some((at, near, far)) = open.pop() {
        match at {
            BspChild::Solid => return,
            BspChild::Leaf(leaf) => {
                seen.insert(map.tree.clusters[leaf as usize]);
            }
            BspChild::Node(node) => {
                let node = &map.tree.nodes[node as usize];
                let [a, b] = [near, far].map(|depth| value(node, depth));
                let first = usize::from(a < 0.0);
                let (here, beyond) = (node.children[first], node.children[1 - first]);
                if (a < 0.0) == (b < 0.0) {
                    open.push((here, near, far));
                } else {
                    let at = (near + (far - near) * (a / (a - b))).clamp(near, far);
                    open.extend([(beyond, at, far), (here, near, at)]);
                }
            }
        }
    }
}
