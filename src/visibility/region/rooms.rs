//! Which rooms of a tiling see each other: an exact search by storeys, conservative
//! between them.
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

use glam::{DVec2, DVec3};

use super::answer::RegionId;
use super::graph::RegionGraph;
use super::opening::{Opening, OpeningPlane};
use super::pvs::Pvs;
use super::stab::Stabbing;

/// Openings for which there is no exact search.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("opening {0} is not flat across an axis; expected openings of a tiling without thickness")]
pub struct NotFlat(pub usize);

/// The three looks at a line: the axes that remain when it is seen along the third.
const VIEWS: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

/// One kind of lines: the signs of their direction. Lines of sign 0 along z pass no
/// opening across z, and may be level.
#[derive(Clone, Copy, Debug)]
struct Heading([i32; 3]);

const HEADINGS: [Heading; 12] = {
    let mut all = [Heading([0; 3]); 12];
    let mut i = 0;
    while i < 12 {
        let z = (i >> 2) as i32 - 1;
        all[i] = Heading([sign_of(i, 0), sign_of(i, 1), z]);
        i += 1;
    }
    all
};

const fn sign_of(i: usize, bit: usize) -> i32 {
    if i >> bit & 1 == 1 { 1 } else { -1 }
}

/// A search from one region along one heading.
struct Search<'a> {
    graph: &'a RegionGraph,
    heading: Heading,
    /// Of a heading that is not level: the regions from which it leads on to an
    /// opening across z, all if not `layered`.
    rising: &'a [bool],
    /// Whether a level line does for all that no opening across z is passed for.
    layered: bool,
    stabbing: [Stabbing; 3],
    path: Vec<u32>,
    /// How many openings of the path lie across z.
    risen: usize,
}

impl Pvs {
    /// Which rooms of a tiling see each other. Time is proportional to the number of
    /// sequences of openings that a line passes.
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
        for heading in HEADINGS {
            let rising = match layered {
                true => rising(graph, heading),
                false => vec![true; graph.len()],
            };
            let mut search = Search {
                graph,
                heading,
                rising: &rising,
                layered,
                stabbing: Default::default(),
                path: Vec::new(),
                risen: 0,
            };
            for from in 0..graph.len() as u32 {
                search.visit(from, &mut |to| pvs.insert(from, to));
            }
        }
        Ok(pvs)
    }
}

impl Search<'_> {
    /// Calls `reached` with each region that a line of the heading reaches.
    fn visit(&mut self, at: RegionId, reached: &mut dyn FnMut(RegionId)) {
        let is_level = self.heading.0[2] == 0;
        if !is_level && self.risen == 0 && !self.rising[at as usize] {
            return;
        }
        if is_level || self.risen > 0 || !self.layered {
            reached(at);
        }
        let graph = self.graph;
        for &exit in graph.exits(at) {
            let opening = &graph.openings()[exit as usize];
            let OpeningPlane::Axis { axis, .. } = opening.plane else {
                continue;
            };
            // Towards larger coordinates from the region behind.
            let sign = if opening.sides[1] == at { 1 } else { -1 };
            if sign == self.heading.0[axis] && self.push(exit) {
                self.risen += usize::from(axis == 2);
                self.visit(opening.other(at), reached);
                self.risen -= usize::from(axis == 2);
                self.pop();
            }
        }
    }

    fn push(&mut self, exit: u32) -> bool {
        let opening = &self.graph.openings()[exit as usize];
        self.path.push(exit);
        if self.heading.0[2] == 0 && !self.heights_overlap() {
            self.path.pop();
            return false;
        }
        for (i, view) in VIEWS.into_iter().enumerate().take(self.views()) {
            let [left, right] = ends(opening, view, self.heading);
            if !self.stabbing[i].push(left, right) {
                self.stabbing[..i].iter_mut().for_each(Stabbing::pop);
                self.path.pop();
                return false;
            }
        }
        true
    }

    fn pop(&mut self) {
        self.path.pop();
        let views = self.views();
        self.stabbing[..views].iter_mut().for_each(Stabbing::pop);
    }

    /// A level line needs no look from the sides.
    fn views(&self) -> usize {
        if self.heading.0[2] == 0 { 1 } else { 3 }
    }

    /// Whether one height passes all openings.
    fn heights_overlap(&self) -> bool {
        let bounds = self.path.iter().map(|&exit| {
            let (min, max) = bounds(&self.graph.openings()[exit as usize]);
            (min.z, max.z)
        });
        let (low, high) = bounds.fold((f64::NEG_INFINITY, f64::INFINITY), |all, one| {
            (all.0.max(one.0), all.1.min(one.1))
        });
        low < high
    }
}

/// Whether all openings by which one can go about without passing one across z have
/// a height in common, storey by storey: then a level line does wherever a slanting
/// one does.
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
                    let (min, max) = bounds(opening);
                    (low, high) = (low.max(min.z), high.min(max.z));
                    open.push(opening.other(at));
                }
            }
        }
        low < high
    })
}

/// The regions from which a line of the heading can come to an opening across z, by
/// way of openings that are passed in its direction.
fn rising(graph: &RegionGraph, heading: Heading) -> Vec<bool> {
    let mut leads = vec![false; graph.len()];
    let onward = |opening: &Opening| match opening.plane {
        // From the region behind towards larger coordinates.
        OpeningPlane::Axis { axis, .. } => match heading.0[axis] {
            1 => Some((axis, opening.sides[1], opening.sides[0])),
            -1 => Some((axis, opening.sides[0], opening.sides[1])),
            _ => None,
        },
        _ => None,
    };
    let mut open = Vec::new();
    for opening in graph.openings() {
        if let Some((2, from, _)) = onward(opening)
            && !std::mem::replace(&mut leads[from as usize], true)
        {
            open.push(from);
        }
    }
    while let Some(at) = open.pop() {
        for &exit in graph.exits(at) {
            if let Some((_, from, to)) = onward(&graph.openings()[exit as usize])
                && to == at
                && !std::mem::replace(&mut leads[from as usize], true)
            {
                open.push(from);
            }
        }
    }
    leads
}

fn bounds(opening: &Opening) -> (DVec3, DVec3) {
    let corners = opening.corners.iter();
    corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), c| {
        (low.min(*c), high.max(*c))
    })
}

/// The ends of an opening on the left and on the right of lines of a heading, seen
/// against the third axis. Of a rectangle these are two opposite corners.
fn ends(opening: &Opening, [i, j]: [usize; 2], heading: Heading) -> [DVec2; 2] {
    let (min, max) = bounds(opening);
    let (di, dj) = (heading.0[i], heading.0[j]);
    let pick = |axis: usize, high: bool| if high { max[axis] } else { min[axis] };
    // Left of (di, dj) is (-dj, di).
    let left = DVec2::new(pick(i, dj < 0), pick(j, di > 0));
    let right = DVec2::new(pick(i, dj > 0), pick(j, di < 0));
    [left, right]
}
