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
//! polyhedral environments", chapter 5); a line of sight that is found and checked
//! settles the pair, else it stays undecided and is listed as visible.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::answer::RegionId;
use super::graph::RegionGraph;
use super::opening::{Opening, OpeningPlane};
use super::pvs::Pvs;
use super::stab::Stabbing;
use super::witness::{ProvenPvs, Witness};
use crate::scene::SeededRng;

/// The exact set of a tiling.
#[derive(Clone, Debug)]
pub struct RoomsPvs {
    graph: Arc<RegionGraph>,
    pvs: Pvs,
    rising: Vec<Vec<bool>>,
    layered: bool,
}

/// Openings for which there is no exact search.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("opening {0} is not flat across an axis; expected openings of a tiling without thickness")]
pub struct NotFlat(pub usize);

/// The three looks at a line: the axes that remain when it is seen along the third.
const VIEWS: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

/// How many lines are tried for a pair that passes a stairwell.
const TRIES: usize = 64;

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

impl RoomsPvs {
    /// Searches all pairs. Time is proportional to the number of sequences of
    /// openings that a line passes.
    ///
    /// # Errors
    /// An opening with a thickness.
    pub fn of(graph: Arc<RegionGraph>) -> Result<RoomsPvs, NotFlat> {
        let flat = |o: &Opening| matches!(o.plane, OpeningPlane::Axis { .. });
        if let Some(thick) = graph.openings().iter().position(|o| !flat(o)) {
            return Err(NotFlat(thick));
        }
        let mut pvs = Pvs::alone(graph.len());
        let layered = is_layered(&graph);
        let rising = |heading: &Heading| match layered {
            true => rising(&graph, *heading),
            false => vec![true; graph.len()],
        };
        let rising: Vec<Vec<bool>> = HEADINGS.iter().map(rising).collect();
        for from in 0..graph.len() as u32 {
            for (heading, rising) in HEADINGS.into_iter().zip(&rising) {
                let mut search = Search::new(&graph, heading, rising, layered);
                search.visit(from, &mut |to, _| {
                    pvs.insert(from, to);
                    false
                });
            }
        }
        Ok(RoomsPvs {
            graph,
            pvs,
            rising,
            layered,
        })
    }
}

impl ProvenPvs for RoomsPvs {
    fn pvs(&self) -> &Pvs {
        &self.pvs
    }

    fn witness(&self, from: RegionId, to: RegionId) -> Option<Witness> {
        let mut found = None;
        for (heading, rising) in HEADINGS.into_iter().zip(&self.rising) {
            let mut search = Search::new(&self.graph, heading, rising, self.layered);
            search.visit(from, &mut |region, search| {
                if region == to && found.is_none() {
                    found = search.line_of_sight(from, to);
                }
                found.is_some()
            });
            if found.is_some() {
                break;
            }
        }
        found
    }
}

impl<'a> Search<'a> {
    fn new(
        graph: &'a RegionGraph,
        heading: Heading,
        rising: &'a [bool],
        layered: bool,
    ) -> Search<'a> {
        Search {
            graph,
            heading,
            rising,
            layered,
            risen: 0,
            stabbing: Default::default(),
            path: Vec::new(),
        }
    }

    /// Calls `reached` with each region that a line of the heading reaches, until it
    /// says that it is enough.
    fn visit(&mut self, at: RegionId, reached: &mut dyn FnMut(RegionId, &Search) -> bool) -> bool {
        let is_level = self.heading.0[2] == 0;
        if !is_level && self.risen == 0 && !self.rising[at as usize] {
            return false;
        }
        if (is_level || self.risen > 0 || !self.layered) && reached(at, self) {
            return true;
        }
        let graph = self.graph;
        for &exit in graph.exits(at) {
            let opening = &graph.openings()[exit as usize];
            let OpeningPlane::Axis { axis, .. } = opening.plane else {
                continue;
            };
            // Towards larger coordinates from the region behind.
            let sign = if opening.sides[1] == at { 1 } else { -1 };
            if sign != self.heading.0[axis] {
                continue;
            }
            if self.push(exit) {
                self.risen += usize::from(axis == 2);
                let enough = self.visit(opening.other(at), reached);
                self.risen -= usize::from(axis == 2);
                self.pop();
                if enough {
                    return true;
                }
            }
        }
        false
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
        let (low, high) = self.heights();
        low < high
    }

    fn heights(&self) -> (f64, f64) {
        let bounds = self.path.iter().map(|&exit| {
            let (min, max) = bounds(&self.graph.openings()[exit as usize]);
            (min.z, max.z)
        });
        bounds.fold((f64::NEG_INFINITY, f64::INFINITY), |all, one| {
            (all.0.max(one.0), all.1.min(one.1))
        })
    }

    /// A line through all openings of the path, as a segment between the regions.
    fn line_of_sight(&self, from: RegionId, to: RegionId) -> Option<Witness> {
        if self.path.is_empty() {
            return None;
        }
        let lines = self.stabbing[0].passing_lines();
        let mut rng = SeededRng::new(1);
        (0..TRIES).find_map(|round| {
            let mut sum = [0.0; 3];
            for line in &lines {
                let weight = if round == 0 {
                    1.0
                } else {
                    libm::exp2(-16.0 * rng.unit())
                };
                (0..3).for_each(|k| sum[k] += weight * line[k]);
            }
            let witness = self.segment(sum, from, to)?;
            self.graph.check_witness(&witness).ok().map(|()| witness)
        })
    }

    /// The segment over a line of the plan, as near to level as the heights allow.
    fn segment(&self, [a, b, c]: [f64; 3], from: RegionId, to: RegionId) -> Option<Witness> {
        let length = libm::hypot(a, b);
        let direction = DVec2::new(b, -a) / length;
        let foot = -DVec2::new(a, b) * (c / (length * length));
        // Along the line, where it passes each opening, and how high.
        let mut heights = Stabbing::default();
        let along = |axis: usize, at: f64| (at - foot[axis]) / direction[axis];
        for &exit in &self.path {
            let opening = &self.graph.openings()[exit as usize];
            let (min, max) = bounds(opening);
            let OpeningPlane::Axis { axis, at } = opening.plane else {
                return None;
            };
            let (left, right) = if axis < 2 {
                let t = along(axis, at);
                (DVec2::new(t, max.z), DVec2::new(t, min.z))
            } else {
                let (x, y) = (
                    [along(0, min.x), along(0, max.x)],
                    [along(1, min.y), along(1, max.y)],
                );
                let enter = x[0].min(x[1]).max(y[0].min(y[1]));
                let leave = x[0].max(x[1]).min(y[0].max(y[1]));
                if enter >= leave {
                    return None;
                }
                let (enter, leave) = (DVec2::new(enter, at), DVec2::new(leave, at));
                if self.heading.0[2] > 0 {
                    (enter, leave)
                } else {
                    (leave, enter)
                }
            };
            if !heights.push(left, right) {
                return None;
            }
        }
        let mut sum = [0.0; 3];
        for line in heights.passing_lines() {
            (0..3).for_each(|k| sum[k] += line[k]);
        }
        // The line over that of the plan: how far along it, and how high.
        let [a, b, c] = sum.map(|v| v / libm::hypot(sum[0], sum[1]));
        let (start, onward) = (DVec2::new(-a * c, -b * c), DVec2::new(b, -a));
        let line = (
            (foot + direction * start.x).extend(start.y),
            (direction * onward.x).extend(onward.y),
        );
        // Half way between where the line enters or leaves the region and the opening.
        let passing = |exit: u32| {
            let OpeningPlane::Axis { axis, at } = self.graph.openings()[exit as usize].plane else {
                return f64::NAN;
            };
            (at - line.0[axis]) / line.1[axis]
        };
        let end = |region: RegionId, exit: u32, onward: bool| {
            let room = self.graph.parts(region)[0];
            let (p, d) = line;
            let border = (0..3).filter(|&k| d[k] != 0.0).map(|k| {
                let high = (d[k] > 0.0) == onward;
                (if high { room.max[k] } else { room.min[k] } - p[k]) / d[k]
            });
            let border = match onward {
                true => border.fold(f64::INFINITY, f64::min),
                false => border.fold(f64::NEG_INFINITY, f64::max),
            };
            let t = 0.5 * (border + passing(exit));
            p + d * t
        };
        let (first, last) = (self.path[0], self.path[self.path.len() - 1]);
        Some(Witness {
            regions: [from, to],
            ends: [end(from, first, false), end(to, last, true)],
        })
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
