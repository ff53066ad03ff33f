//! Pairs of rooms of a tiling that see each other: an exact search by storeys,
//! conservative between them.
//!
//! A line of sight passes a sequence of openings, all of them rectangles across axes.
//! Seen along an axis, each opening has an end on the left of the line and an end on
//! its right, by the line's direction alone; so a line that passes all openings gives
//! three lines in the plane that separate lefts from rights, which is decided in exact
//! arithmetic ([`Stabbing`]). If no opening lies across z and all have a height in
//! common, the line from above is enough, as a level line does: the answer is exact.
//! Otherwise (through stairwells, or where heights differ) the three together are
//! necessary, not sufficient (Teller 1992, "Visibility computations in densely occluded
//! polyhedral environments", chapter 5), and the pair is listed as visible.

use glam::DVec2;

use super::graph::RegionGraph;
use super::id_set::RegionId;
use super::opening::{Opening, OpeningPlane};
use super::pvs::Pvs;
use super::stabbing_line::Stabbing;

/// Openings for which there is no exact search.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("opening {0} is not flat across an axis; expected openings of a tiling without thickness")]
pub struct NotFlat(pub usize);

/// The three projections of a line: the axes that remain when it is seen along the
/// third.
const VIEWS: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

/// The signs of the direction of lines.
///
/// Lines of sign 0 along z pass no opening across z, and may be level.
type Heading = [i32; 3];

/// A search from one region along one heading.
struct Search<'a> {
    graph: &'a RegionGraph,
    heading: Heading,
    /// Regions from which the heading leads on to an opening across z: all if it is
    /// level or the graph is not `layered`.
    rising: Vec<bool>,
    /// A level line does for all that no opening across z is passed for.
    layered: bool,
    stabbing: [Stabbing; 3],
}

impl Pvs {
    /// Pairs of rooms of a tiling that see each other.
    ///
    /// Time is proportional to the number of sequences of openings that a line passes.
    ///
    /// # Errors
    /// An opening with a thickness.
    pub fn of_rooms(graph: &RegionGraph) -> Result<Pvs, NotFlat> {
        let flat = |o: &Opening| matches!(o.plane, OpeningPlane::Axis { .. });
        if let Some(thick) = graph.openings().iter().position(|o| !flat(o)) {
            return Err(NotFlat(thick));
        }
        let mut pvs = Pvs::alone(graph.len());
        let layered = is_layered(graph);
        let plane = [[-1, -1], [1, -1], [-1, 1], [1, 1]];
        for heading in [-1, 0, 1]
            .iter()
            .flat_map(|&z| plane.map(|[x, y]| [x, y, z]))
        {
            let mut search = Search {
                graph,
                heading,
                rising: match layered && heading[2] != 0 {
                    true => rising(graph, heading),
                    false => vec![true; graph.len()],
                },
                layered,
                stabbing: Default::default(),
            };
            for from in 0..graph.len() as u32 {
                let mut reached = |to| pvs.insert(from, to);
                search.visit(
                    from,
                    false,
                    [f64::NEG_INFINITY, f64::INFINITY],
                    &mut reached,
                );
            }
        }
        Ok(pvs)
    }
}

impl Search<'_> {
    /// Calls `reached` with each region that a line of the heading reaches through the
    /// openings so far: one of them across z if `risen`, all about the `heights`.
    fn visit(
        &mut self,
        at: RegionId,
        risen: bool,
        heights: [f64; 2],
        reached: &mut dyn FnMut(RegionId),
    ) {
        if !risen && !self.rising[at as usize] {
            return;
        }
        let (graph, is_level) = (self.graph, self.heading[2] == 0);
        if is_level || risen || !self.layered {
            reached(at);
        }
        for &exit in graph.exits(at) {
            let opening = &graph.openings()[exit as usize];
            let Some((axis, from, to)) = onward(opening, self.heading) else {
                continue;
            };
            let [min, max] = opening.bounds();
            let common = [heights[0].max(min.z), heights[1].min(max.z)];
            let passes_level = !is_level || common[0] < common[1];
            if from == at && passes_level && self.push(opening) {
                self.visit(to, risen || axis == 2, common, reached);
                let views = self.views();
                self.stabbing[..views].iter_mut().for_each(Stabbing::pop);
            }
        }
    }

    /// Adds an opening; `false`, and nothing is added, if no line passes all.
    fn push(&mut self, opening: &Opening) -> bool {
        for (i, view) in VIEWS.into_iter().enumerate().take(self.views()) {
            let [left, right] = ends(opening, view, self.heading);
            if !self.stabbing[i].push(left, right) {
                self.stabbing[..i].iter_mut().for_each(Stabbing::pop);
                return false;
            }
        }
        true
    }

    /// Number of projections: a level line needs none from the sides.
    fn views(&self) -> usize {
        if self.heading[2] == 0 { 1 } else { 3 }
    }
}

/// Axis of an opening that a heading passes, and the regions it leaves and enters.
fn onward(opening: &Opening, heading: Heading) -> Option<(usize, RegionId, RegionId)> {
    let OpeningPlane::Axis { axis, .. } = opening.plane else {
        return None;
    };
    let [front, behind] = opening.sides;
    // From the region behind towards larger coordinates.
    match heading[axis] {
        1 => Some((axis, behind, front)),
        -1 => Some((axis, front, behind)),
        _ => None,
    }
}

/// Tests whether all openings that are joined without one across z have a height in
/// common, storey by storey: then a level line does wherever a slanting one does.
fn is_layered(graph: &RegionGraph) -> bool {
    let mut seen = vec![false; graph.len()];
    (0..graph.len() as u32).all(|start| {
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut open = vec![start];
        while let Some(at) = open.pop() {
            if std::mem::replace(&mut seen[at as usize], true) {
                continue;
            }
            for &exit in graph.exits(at) {
                let opening = &graph.openings()[exit as usize];
                if !matches!(opening.plane, OpeningPlane::Axis { axis: 2, .. }) {
                    let [min, max] = opening.bounds();
                    (low, high) = (low.max(min.z), high.min(max.z));
                    open.push(opening.other(at));
                }
            }
        }
        low < high
    })
}

/// The regions from which a line of the heading can come to an opening across z.
///
/// It passes all openings in its direction.
fn rising(graph: &RegionGraph, heading: Heading) -> Vec<bool> {
    let mut leads = vec![false; graph.len()];
    let across_z = graph
        .openings()
        .iter()
        .filter_map(|opening| onward(opening, heading));
    let mut open: Vec<RegionId> = across_z
        .filter_map(|(axis, from, _)| (axis == 2).then_some(from))
        .collect();
    while let Some(at) = open.pop() {
        if !std::mem::replace(&mut leads[at as usize], true) {
            let openings = graph
                .exits(at)
                .iter()
                .map(|&exit| &graph.openings()[exit as usize]);
            let passed = openings.filter_map(|opening| onward(opening, heading));
            open.extend(passed.filter_map(|(_, from, to)| (to == at).then_some(from)));
        }
    }
    leads
}

/// The ends of an opening on the left and on the right of lines of a heading, seen
/// against the third axis: two opposite corners of a rectangle.
fn ends(opening: &Opening, [i, j]: [usize; 2], heading: Heading) -> [DVec2; 2] {
    let (bounds, di, dj) = (opening.bounds(), heading[i], heading[j]);
    let end = |high_i: bool, high_j: bool| {
        DVec2::new(
            bounds[usize::from(high_i)][i],
            bounds[usize::from(high_j)][j],
        )
    };
    // Left of (di, dj) is (-dj, di).
    [end(dj < 0, di > 0), end(dj > 0, di < 0)]
}
