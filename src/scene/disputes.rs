//! Points for which the linedefs of a map disagree about the sector.
//!
//! Sectors divide the plane if any two neighbouring linedefs have the same sector, or none, on the
//! sides that face each other. A self-referencing sector, a side with a foreign sector, swapped
//! sides and a missing linedef all break that somewhere. Decided exactly, in integer arithmetic.

use std::cmp::Ordering;

use crate::query::distinct;

/// A linedef as the file has it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Linedef {
    /// Start and end, map units.
    pub ends: [[i32; 2]; 2],
    /// Action on crossing or using it; 0 for none.
    pub action: u16,
    /// Tag of the sectors that it acts on.
    pub tag: u16,
    /// The sectors on its right (its front) and on its left.
    pub sectors: [Option<u32>; 2],
}

/// A point between two linedefs that disagree about its sector.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
#[error(
    "linedefs disagree about the sector at ({}, {}), {} or {}",
    at[0], at[1], named(sectors[0]), named(sectors[1])
)]
pub struct Dispute {
    /// A point between them, map units.
    pub at: [f64; 2],
    /// The sector that each linedef has there.
    pub sectors: [Option<u32>; 2],
}

fn named(sector: Option<u32>) -> String {
    sector.map_or("none".to_owned(), |sector| sector.to_string())
}

/// The first dispute of a map for each pair of sectors.
///
/// None if its sectors divide the plane. O(linedefs * linedefs that a line across the map meets).
pub fn disputes(lines: &[Linedef]) -> Vec<Dispute> {
    let mut found: Vec<Dispute> = Vec::new();
    for axis in [0, 1] {
        between_levels(lines, axis, |dispute| {
            if found.iter().all(|known| known.sectors != dispute.sectors) {
                found.push(dispute);
            }
        });
    }
    found
}

/// A linedef that crosses the direction of a sweep.
///
/// Its ends from low to high in that direction, each as (position across, level), and the sectors
/// on its sides of lower and of higher positions.
struct Edge {
    ends: [[i64; 2]; 2],
    sides: [Option<u32>; 2],
}

impl Edge {
    /// `None` for a linedef along a level, which the other direction crosses.
    fn of(line: &Linedef, axis: usize) -> Option<Edge> {
        let turned = |end: [i32; 2]| [end[axis], end[1 - axis]].map(i64::from);
        let (mut ends, mut sides) = (line.ends.map(turned), line.sectors);
        let [from, to] = ends.map(|end| end[1]);
        // Upwards the left side has lower x; towards larger x the right side has lower y.
        if (axis == 0) != (from > to) {
            sides.reverse();
        }
        if from > to {
            ends.reverse();
        }
        (from != to).then_some(Edge { ends, sides })
    }

    /// Its position across at `level / 2`, as a fraction: below 2^35 over below 2^18.
    fn place(&self, level: i64) -> [i64; 2] {
        let [from, to] = self.ends;
        let rise = 2 * (to[1] - from[1]);
        let run = (to[0] - from[0]) * (level - 2 * from[1]);
        [from[0] * rise + run, rise]
    }

    /// Order of two edges at `level / 2`.
    fn compared(&self, other: &Edge, level: i64) -> Ordering {
        let ([a, over_a], [b, over_b]) = (self.place(level), other.place(level));
        (a * over_b).cmp(&(b * over_a))
    }
}

/// Finds disputes in the strips between the levels of all ends.
///
/// No edge begins or ends within a strip, so edges are compared in order.
fn between_levels(lines: &[Linedef], axis: usize, mut found: impl FnMut(Dispute)) {
    let edges = lines.iter().filter_map(|line| Edge::of(line, axis));
    let mut edges: Vec<Edge> = edges.collect();
    edges.sort_by_key(|edge| edge.ends[0][1]);
    let ends = edges.iter().flat_map(|edge| edge.ends);
    let levels: Vec<i64> = distinct(ends.map(|end| end[1]).collect());
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

/// The sectors that two neighbours in a strip disagree about.
///
/// Between them, or where they cross; one of them may be the outside.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SeededRng;

    fn line(ends: [[i32; 2]; 2], sectors: [Option<u32>; 2]) -> Linedef {
        Linedef {
            ends,
            sectors,
            action: 0,
            tag: 0,
        }
    }

    /// A ring whose interior is on the right of each line.
    fn ring([x0, y0, x1, y1]: [i32; 4], sectors: [Option<u32>; 2]) -> Vec<Linedef> {
        let corners = [[x0, y0], [x0, y1], [x1, y1], [x1, y0]];
        let sides = (0..4).map(|k| line([corners[k], corners[(k + 1) % 4]], sectors));
        sides.collect()
    }

    #[test]
    fn sectors_that_do_not_divide_the_plane_are_told() {
        let room = ring([0, 0, 512, 512], [Some(0), None]);
        let with = |sectors| [room.clone(), ring([192, 192, 320, 320], sectors)].concat();
        let proper = with([Some(1), Some(0)]);
        assert_eq!(disputes(&proper), []);
        // Lines within a sector divide nothing, even where they cross.
        let within = |ends| line(ends, [Some(0); 2]);
        let mut marked = proper.clone();
        marked.extend([[[8, 8], [40, 40]], [[8, 41], [40, 9]]].map(within));
        assert_eq!(disputes(&marked), []);

        let told = |lines: &[Linedef]| {
            let first = disputes(lines).first().map(ToString::to_string);
            first.unwrap_or_default()
        };
        let between = "linedefs disagree about the sector at (96, 256), 0 or 1";
        // A self-referencing sector, and one whose lines are reversed.
        assert_eq!(told(&with([Some(1), Some(1)])), between);
        assert_eq!(told(&with([Some(0), Some(1)])), between);
        for at in 0..proper.len() {
            let changed = |change: &dyn Fn(&mut Linedef)| {
                let mut lines = proper.clone();
                change(&mut lines[at]);
                !disputes(&lines).is_empty()
            };
            assert!(changed(&|line| line.sectors.swap(0, 1)), "swapped");
            assert!(changed(&|line| line.sectors[0] = Some(7)), "foreign");
            assert!(changed(&|line| line.sectors[1] = line.sectors[0]), "itself");
            let mut lines = proper.clone();
            lines.remove(at);
            assert!(!disputes(&lines).is_empty(), "without {at}");
        }
        // Rooms that cross without a common corner.
        let other = ring([256, 100, 700, 180], [Some(2), None]);
        assert!(!disputes(&[room, other].concat()).is_empty());
        let none = told(&ring([0, 0, 8, 8], [None, Some(3)]));
        assert_eq!(
            none,
            "linedefs disagree about the sector at (0, 4), none or 3"
        );
    }

    /// The sector in front of the nearest line, in four directions from a point.
    fn looks(lines: &[Linedef], p: [f64; 2]) -> Vec<Option<u32>> {
        let look = |(axis, sign): (usize, f64)| {
            let mut nearest = (f64::INFINITY, None);
            for line in lines {
                let [right, left] = line.sectors;
                let [a, b] = line
                    .ends
                    .map(|end| [0, 1].map(|k| f64::from(end[k]) - p[k]));
                let (up_a, up_b) = (a[1 - axis], b[1 - axis]);
                if (up_a < 0.0) == (up_b < 0.0) {
                    continue;
                }
                let at = (a[axis] - (b[axis] - a[axis]) * up_a / (up_b - up_a)) * sign;
                if at > 0.0 && at < nearest.0 {
                    let turn = a[0] * b[1] - a[1] * b[0];
                    nearest = (at, if turn > 0.0 { left } else { right });
                }
            }
            nearest.1
        };
        [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)].map(look).into()
    }

    #[test]
    fn without_disputes_every_look_from_a_place_finds_the_same_sector() {
        let mut rng = SeededRng::new(41);
        let mut counts = [0; 2];
        for _ in 0..400 {
            // A distorted grid of cells, some with a common sector, some without any.
            let side = 2 + rng.below(3);
            let corner: Vec<[i32; 2]> = (0..(side + 1) * (side + 1))
                .map(|k| [k % (side + 1), k / (side + 1)].map(|v| 64 * v as i32))
                .map(|at| at.map(|v| v + rng.below(20) as i32))
                .collect();
            let cell: Vec<Option<u32>> = (0..side * side)
                .map(|_| (rng.below(6) > 0).then(|| rng.below(4) as u32))
                .collect();
            let of = |x: usize, y: usize| match x < side && y < side {
                true => cell[y * side + x],
                false => None,
            };
            let mut lines: Vec<Linedef> = Vec::new();
            for (x, y) in (0..=side).flat_map(|x| (0..=side).map(move |y| (x, y))) {
                let at = |x: usize, y: usize| corner[y * (side + 1) + x];
                if y < side {
                    let left = x.checked_sub(1).and_then(|x| of(x, y));
                    lines.push(line([at(x, y), at(x, y + 1)], [of(x, y), left]));
                }
                if x < side {
                    let below = y.checked_sub(1).and_then(|y| of(x, y));
                    lines.push(line([at(x, y), at(x + 1, y)], [below, of(x, y)]));
                }
            }
            lines.retain(|line| line.sectors != [None; 2]);
            assert_eq!(disputes(&lines), []);
            if lines.is_empty() {
                continue;
            }
            let at = rng.below(lines.len());
            match rng.below(4) {
                0 => lines[at].sectors.swap(0, 1),
                1 => drop(lines.remove(at)),
                2 => lines[at].sectors[rng.below(2)] = Some(rng.below(4) as u32),
                _ => lines[at].ends[1] = lines[(at + 1) % lines.len()].ends[0],
            }
            let agree = disputes(&lines).is_empty();
            let inside = || [0, 1].map(|_| 64.0 * side as f64 * rng.unit() + 7.3);
            let differ = std::iter::repeat_with(inside).take(300).any(|p| {
                let looks = looks(&lines, p);
                looks.iter().any(|look| *look != looks[0])
            });
            assert!(!(agree && differ), "{lines:?}");
            counts[usize::from(agree)] += 1;
        }
        assert!(counts.iter().all(|&count| count > 10), "{counts:?}");
    }
}
