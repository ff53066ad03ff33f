//! All lines through a vertex of a map, in whole numbers: how far each goes before it
//! is blocked, and which sectors it passes.
//!
//! The directions to all other vertices, and their opposites, divide the circle about
//! the vertex into open intervals. Within one of them no other vertex is met, so all
//! lines pass the same linedefs in the same order; one direction, the sum of the two
//! that bound the interval, stands for all.

use super::super::answer::RegionId;
use super::map::MapLine;

/// A vector or point of whole numbers. Differences of coordinates have 17 bits and
/// the sums that stand for intervals 18: cross products have less than 37.
pub(super) type Whole = [i64; 2];

pub(super) fn cross(a: Whole, b: Whole) -> i64 {
    a[0] * b[1] - a[1] * b[0]
}

fn minus(a: Whole, b: Whole) -> Whole {
    [a[0] - b[0], a[1] - b[1]]
}

/// A linedef that passes through or ends in the vertex: one of the directions that it
/// goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spoke {
    /// Index of its direction.
    pub at: usize,
    /// The sector just after it, counterclockwise.
    pub behind: Option<RegionId>,
    pub is_open: bool,
}

/// What is seen along the rays of each interval, and the linedefs at the vertex
/// itself.
#[derive(Default, Debug)]
pub(super) struct Sweep {
    /// The boundaries: `turn` directions in the upper half circle, counterclockwise,
    /// and as many opposites. Interval i follows boundary i.
    directions: Vec<Whole>,
    /// The direction that stands for each interval.
    middles: Vec<Whole>,
    pub spokes: Vec<Spoke>,
    /// Words of a set of sectors.
    words: usize,
    sets: Vec<u64>,
    nearest: Vec<Option<Hit>>,
}

/// Where a ray meets a linedef: at `run / over` of its direction, `over` above zero.
#[derive(Clone, Copy, Debug)]
struct Hit {
    run: i64,
    over: i64,
    facing: Option<RegionId>,
}

impl Hit {
    /// Below 2^37 each, so products fit.
    fn is_before(&self, other: &Hit) -> bool {
        i128::from(self.run) * i128::from(other.over)
            < i128::from(other.run) * i128::from(self.over)
    }
}

/// A linedef seen from the vertex: its ends, counterclockwise, the intervals that it
/// covers, its sectors on this side and on the far one.
struct Seen {
    ends: [Whole; 2],
    first: usize,
    count: usize,
    sectors: [Option<RegionId>; 2],
    is_open: bool,
}

impl Sweep {
    /// Half the number of intervals: a ray and its opposite are so far apart.
    pub fn turn(&self) -> usize {
        self.directions.len() / 2
    }

    /// The direction that stands for an interval.
    pub fn between(&self, interval: usize) -> Whole {
        self.middles[interval]
    }

    /// The sectors along the rays of an interval, up to what blocks them.
    pub fn set(&self, interval: usize) -> &[u64] {
        &self.sets[interval * self.words..][..self.words]
    }

    /// Sweeps about a vertex. O(v log v + linedefs + intervals that they cover).
    pub fn about(&mut self, at: Whole, vertices: &[Whole], lines: &[MapLine], sectors: usize) {
        self.set_directions(at, vertices);
        let count = self.directions.len();
        self.words = sectors.div_ceil(64);
        self.sets.clear();
        self.sets.resize(self.words * count, 0);
        self.nearest.clear();
        self.nearest.resize(count, None);
        self.spokes.clear();
        let mut seen = Vec::new();
        for line in lines {
            let ends = line.ends.map(|end| minus(end.map(i64::from), at));
            let turned = cross(ends[0], ends[1]);
            let [right, left] = line.sectors;
            let is_open = line.open.is_some();
            if turned != 0 {
                // Counterclockwise as it is, its left is towards the vertex.
                let flip = turned < 0;
                let ends = if flip { [ends[1], ends[0]] } else { ends };
                let [first, last] = ends.map(|end| self.index(end));
                seen.push(Seen {
                    ends,
                    first,
                    count: (last + count - first) % count,
                    sectors: if flip { [right, left] } else { [left, right] },
                    is_open,
                });
                continue;
            }
            let along = minus(ends[1], ends[0]);
            let goes = |end: Whole| end[0] * along[0] + end[1] * along[1];
            if goes(ends[0]) > 0 || goes(ends[1]) < 0 {
                continue;
            }
            // Through the vertex: counterclockwise of a direction is left of it.
            for (end, behind) in [(ends[1], left), (ends[0], right)] {
                if end != [0, 0] {
                    let at = self.index(end);
                    self.spokes.push(Spoke {
                        at,
                        behind,
                        is_open,
                    });
                }
            }
        }
        self.spokes.sort_by_key(|spoke| spoke.at);
        for line in seen.iter().filter(|line| !line.is_open) {
            self.each(line, |sweep, interval, hit| {
                let nearest = &mut sweep.nearest[interval];
                if nearest.is_none_or(|old| hit.is_before(&old)) {
                    *nearest = Some(hit);
                }
            });
        }
        for line in seen.iter().filter(|line| line.is_open) {
            self.each(line, |sweep, interval, hit| {
                if sweep.nearest[interval].is_none_or(|wall| hit.is_before(&wall)) {
                    line.sectors.iter().for_each(|s| sweep.add(interval, *s));
                }
            });
        }
        for interval in 0..count {
            if let Some(wall) = self.nearest[interval] {
                self.add(interval, wall.facing);
            }
        }
    }

    fn add(&mut self, interval: usize, sector: Option<RegionId>) {
        if let Some(sector) = sector {
            self.sets[interval * self.words + sector as usize / 64] |= 1 << (sector % 64);
        }
    }

    fn each(&mut self, line: &Seen, mut visit: impl FnMut(&mut Sweep, usize, Hit)) {
        let along = minus(line.ends[1], line.ends[0]);
        let (count, run) = (self.directions.len(), cross(line.ends[0], along));
        let wraps = (line.first + line.count).saturating_sub(count);
        let ranges = [line.first..line.first + line.count - wraps, 0..wraps];
        for interval in ranges.into_iter().flatten() {
            let hit = Hit {
                run,
                over: cross(self.middles[interval], along),
                facing: line.sectors[0],
            };
            visit(self, interval, hit);
        }
    }

    fn set_directions(&mut self, at: Whole, vertices: &[Whole]) {
        let away = vertices.iter().map(|v| minus(*v, at));
        let mut upper: Vec<Whole> = away.filter(|d| *d != [0, 0]).map(upward).collect();
        // On a map of one line there is no other direction.
        upper.push([1, 0]);
        upper.push([0, 1]);
        upper.sort_by(|a, b| 0.cmp(&cross(*a, *b)));
        upper.dedup_by(|a, b| cross(*a, *b) == 0);
        self.directions.clear();
        self.directions.extend_from_slice(&upper);
        self.directions.extend(upper.iter().map(|d| [-d[0], -d[1]]));
        let next = self.directions.iter().cycle().skip(1);
        let pairs = self.directions.iter().zip(next);
        self.middles.clear();
        self.middles
            .extend(pairs.map(|(a, b)| [a[0] + b[0], a[1] + b[1]]));
    }

    /// The index of a direction that is one of the boundaries.
    fn index(&self, direction: Whole) -> usize {
        let turn = self.turn();
        let up = upward(direction);
        let found = self.directions[..turn].binary_search_by(|d| 0.cmp(&cross(*d, up)));
        let index = found.expect("the direction to a vertex");
        if up == direction { index } else { index + turn }
    }
}

/// The direction or its opposite: in the half circle from +x on, counterclockwise.
fn upward(d: Whole) -> Whole {
    match d[1] > 0 || (d[1] == 0 && d[0] > 0) {
        true => d,
        false => [-d[0], -d[1]],
    }
}
