//! Places about which the linedefs of a map disagree. Sectors divide the plane where any
//! two neighbouring linedefs have the same sector, or none, on the sides that face each
//! other. A sector that refers to itself, a side of a foreign sector, swapped sides and a
//! missing linedef all break that somewhere. Whole numbers decide, exactly.

use std::cmp::Ordering;

/// A place between two linedefs that disagree about it.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
#[error(
    "linedefs disagree about the sector at ({}, {}), {} or {}",
    at[0], at[1], named(sectors[0]), named(sectors[1])
)]
pub struct Dispute {
    /// Between them, map units.
    pub at: [f64; 2],
    /// What each has there.
    pub sectors: [Option<u32>; 2],
}

/// Where a linedef begins and ends, and the sectors on its right and on its left.
pub type Sided = ([[i32; 2]; 2], [Option<u32>; 2]);

fn named(sector: Option<u32>) -> String {
    sector.map_or("none".to_owned(), |sector| sector.to_string())
}

/// All disputes of a map, the first between each two sectors; none where its sectors
/// divide the plane. O(linedefs * those that a line across the map meets).
pub fn disputes(lines: impl Iterator<Item = Sided> + Clone) -> Vec<Dispute> {
    let mut found: Vec<Dispute> = Vec::new();
    for axis in [0, 1] {
        between_levels(lines.clone(), axis, |dispute| {
            if found.iter().all(|known| known.sectors != dispute.sectors) {
                found.push(dispute);
            }
        });
    }
    found
}

/// A linedef across a direction: its ends from low to high in that direction, each with
/// its place across first, and the sectors on its sides of lesser and of greater places.
struct Edge {
    ends: [[i64; 2]; 2],
    sides: [Option<u32>; 2],
}

impl Edge {
    /// `None` for a linedef along the direction, which the other direction crosses.
    fn of((ends, [right, left]): Sided, axis: usize) -> Option<Edge> {
        let turned = |end: [i32; 2]| [end[axis], end[1 - axis]].map(i64::from);
        let [mut from, mut to] = ends.map(turned);
        // Upwards the left has lesser x; towards larger x the right has lesser y.
        let mut sides = if axis == 0 {
            [left, right]
        } else {
            [right, left]
        };
        if from[1] > to[1] {
            std::mem::swap(&mut from, &mut to);
            sides.reverse();
        }
        (from[1] < to[1]).then_some(Edge {
            ends: [from, to],
            sides,
        })
    }

    /// Its place across at half of a level, as a fraction: below 2^35 over below 2^18.
    fn place(&self, level: i64) -> [i64; 2] {
        let [from, to] = self.ends;
        let rise = 2 * (to[1] - from[1]);
        let run = (to[0] - from[0]) * (level - 2 * from[1]);
        [from[0] * rise + run, rise]
    }

    /// Which of two comes first at half of a level.
    fn compared(&self, other: &Edge, level: i64) -> Ordering {
        let ([a, over_a], [b, over_b]) = (self.place(level), other.place(level));
        (a * over_b).cmp(&(b * over_a))
    }
}

/// Goes through the strips between the levels of all ends, in which no edge begins or
/// ends, from edge to edge.
fn between_levels(lines: impl Iterator<Item = Sided>, axis: usize, mut found: impl FnMut(Dispute)) {
    let mut edges: Vec<Edge> = lines.filter_map(|line| Edge::of(line, axis)).collect();
    edges.sort_by_key(|edge| edge.ends[0][1]);
    let ends = edges.iter().flat_map(|edge| edge.ends);
    let mut levels: Vec<i64> = ends.map(|end| end[1]).collect();
    levels.sort_unstable();
    levels.dedup();
    let (mut waiting, mut strip) = (edges.iter().peekable(), Vec::<&Edge>::new());
    for level in levels.windows(2) {
        let [low, high] = [level[0], level[1]];
        strip.retain(|edge| edge.ends[1][1] > low);
        while let Some(edge) = waiting.next_if(|edge| edge.ends[0][1] == low) {
            strip.push(edge);
        }
        let middle = low + high;
        strip.sort_by(|a, b| a.compared(b, middle));
        for behind in 0..=strip.len() {
            let before = behind.checked_sub(1).map(|before| strip[before]);
            let pair = [before, strip.get(behind).copied()];
            if let Some(sectors) = disputed(pair, [low, high]) {
                let across = pair.into_iter().flatten().map(|edge| {
                    let [place, over] = edge.place(middle);
                    place as f64 / over as f64
                });
                let count = across.clone().count() as f64;
                let mut at = [across.sum::<f64>() / count, middle as f64 / 2.0];
                if axis == 1 {
                    at.reverse();
                }
                found(Dispute { at, sectors });
            }
        }
    }
}

/// What two neighbours of a strip, or one and the outside, disagree about: the place
/// between them, or one where they cross.
fn disputed(pair: [Option<&Edge>; 2], strip: [i64; 2]) -> Option<[Option<u32>; 2]> {
    let [before, behind] = pair.map(|edge| edge.map_or([None; 2], |edge| edge.sides));
    let crosses = || {
        let [Some(a), Some(b)] = pair else {
            return false;
        };
        strip.into_iter().any(|end| a.compared(b, 2 * end).is_gt())
    };
    let facing = [before[1], behind[0]];
    let beside = [[before[0], behind[0]], [before[1], behind[1]]];
    match facing[0] == facing[1] {
        false => Some(facing),
        true if crosses() => beside.into_iter().find(|[a, b]| a != b),
        true => None,
    }
}
