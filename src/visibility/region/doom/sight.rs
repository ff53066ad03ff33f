//! Which sectors of a map see each other, seen from above, exactly and in whole
//! numbers.
//!
//! Take two sectors and a segment between them that meets nothing solid and no
//! vertex. All segments that pass the same linedefs in the same order make an open
//! set; moved to its right as far as it goes, at the latest to the end of a linedef
//! that it passes, the segment touches a vertex, and it can still turn about it. So the
//! lines through a vertex, in all directions between those to other vertices, each
//! moved by next to nothing to the left, are enough to find every pair. (The same
//! argument is behind the visibility complex, Pocchiola and Vegter 1996.)

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::DVec2;

use super::super::answer::{RegionId, decode};
use super::super::graph::RegionGraph;
use super::super::pvs::Pvs;
use super::super::witness::{ProvenPvs, Witness};
use super::ground::on_grid;
use super::map::{DoomMap, MapLine};
use super::sweep::{Sweep, Whole};

/// Where a pair was found: the line through a vertex in a direction, moved to its
/// left by next to nothing.
#[derive(Clone, Copy, Debug)]
struct Found {
    vertex: Whole,
    direction: Whole,
}

/// The exact set of a map's sectors.
#[derive(Clone, Debug)]
pub struct SectorPvs {
    map: Arc<DoomMap>,
    graph: Arc<RegionGraph>,
    pvs: Pvs,
    found: Vec<Option<Found>>,
    /// The run that was marked last: neighbouring lines mostly see the same.
    marked: Vec<u64>,
    run: Vec<u64>,
}

impl SectorPvs {
    /// Searches all pairs. O(v^2 log v + v * intervals that linedefs cover).
    pub fn of(map: Arc<DoomMap>, graph: Arc<RegionGraph>) -> SectorPvs {
        let sectors = map.sectors.len();
        let vertices: BTreeSet<Whole> = map
            .lines
            .iter()
            .flat_map(|line| line.ends.map(|end| end.map(i64::from)))
            .collect();
        let vertices: Vec<Whole> = vertices.into_iter().collect();
        // What has the same sector on both sides is no border.
        let borders = |line: &&MapLine| line.open.is_none() || line.sectors[0] != line.sectors[1];
        let lines: Vec<MapLine> = map.lines.iter().filter(borders).copied().collect();
        let mut sight = SectorPvs {
            pvs: Pvs::alone(sectors),
            found: vec![None; sectors * sectors],
            marked: Vec::new(),
            run: Vec::new(),
            map: map.clone(),
            graph,
        };
        let mut sweep = Sweep::default();
        for &vertex in &vertices {
            sweep.about(vertex, &vertices, &lines, sectors);
            // Each line in the direction that goes up.
            for interval in 0..sweep.turn() {
                sight.runs(&sweep, vertex, interval);
            }
        }
        sight
    }

    /// Marks what a line sees that passes the vertex on its right: from the ray on,
    /// counterclockwise over the linedefs at the vertex, to the opposite ray.
    fn runs(&mut self, sweep: &Sweep, vertex: Whole, interval: usize) {
        let (turn, all) = (sweep.turn(), 2 * sweep.turn());
        let found = Found {
            vertex,
            direction: sweep.between(interval),
        };
        let mut run = std::mem::take(&mut self.run);
        run.clear();
        run.extend_from_slice(sweep.set(interval));
        // The directions after the ray's interval, as far as its opposite.
        let first = sweep.spokes.partition_point(|spoke| spoke.at <= interval);
        let (before, after) = sweep.spokes.split_at(first);
        for spoke in after.iter().chain(before) {
            if (spoke.at + all - interval - 1) % all >= turn {
                break;
            }
            if !spoke.is_open {
                self.mark(&run, found);
                run.fill(0);
            }
            if let Some(sector) = spoke.behind {
                run[sector as usize / 64] |= 1 << (sector % 64);
            }
        }
        let opposite = sweep.set((interval + turn) % all);
        run.iter_mut()
            .zip(opposite)
            .for_each(|(word, more)| *word |= more);
        self.mark(&run, found);
        self.run = run;
    }

    /// All sectors of a run see each other.
    fn mark(&mut self, run: &[u64], found: Found) {
        if self.marked == run {
            return;
        }
        self.marked.clear();
        self.marked.extend_from_slice(run);
        let mut members = Vec::new();
        decode(run, &mut members);
        for &from in &members {
            let row = self.pvs.row(from);
            let fresh: Vec<u64> = run.iter().zip(row).map(|(run, row)| run & !row).collect();
            if fresh.iter().all(|word| *word == 0) {
                continue;
            }
            let mut more = Vec::new();
            decode(&fresh, &mut more);
            for to in more {
                self.found[from as usize * self.pvs.len() + to as usize] = Some(found);
            }
            self.pvs.insert_all(from, run);
        }
    }
}

impl ProvenPvs for SectorPvs {
    fn pvs(&self) -> &Pvs {
        &self.pvs
    }

    /// The line is moved aside by less and less until a segment of it is accepted.
    fn witness(&self, from: RegionId, to: RegionId) -> Option<Witness> {
        let found = self.found[from as usize * self.pvs.len() + to as usize]?;
        let [vertex, direction] =
            [found.vertex, found.direction].map(|v| DVec2::new(v[0] as f64, v[1] as f64));
        let direction = direction.normalize();
        let aside = direction.perp();
        (0..18).find_map(|halvings| {
            let start = vertex + aside * libm::exp2(f64::from(3 - halvings));
            let ends = segment(&self.map.lines, start, direction, [from, to])?;
            let witness = Witness {
                regions: [from, to],
                ends: ends.map(|end| on_grid(end, 0.0)),
            };
            self.graph.check_witness(&witness).ok().map(|()| witness)
        })
    }
}

/// The shortest segment of a line, from the middle of a part in one sector to the
/// middle of a part in the other, with nothing solid between.
fn segment(
    lines: &[MapLine],
    start: DVec2,
    direction: DVec2,
    regions: [RegionId; 2],
) -> Option<[DVec2; 2]> {
    let mut crossings: Vec<(f64, &MapLine, bool)> = Vec::new();
    for line in lines {
        let [a, b] = line
            .ends
            .map(|[x, y]| DVec2::new(x.into(), y.into()) - start);
        let (sa, sb) = (direction.perp_dot(a), direction.perp_dot(b));
        if (sa < 0.0) != (sb < 0.0) {
            let t = a.perp_dot(b - a) / direction.perp_dot(b - a);
            crossings.push((t, line, sa < 0.0));
        }
    }
    crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
    // The last part of either sector since something solid.
    let mut last: [Option<f64>; 2] = [None; 2];
    let mut best: Option<(f64, [f64; 2])> = None;
    for pair in crossings.windows(2) {
        let [(begin, line, to_right), (end, ..)] = [pair[0], pair[1]];
        if line.open.is_none() {
            last = [None; 2];
        }
        let Some(here) = line.sectors[usize::from(!to_right)] else {
            continue;
        };
        let middle = 0.5 * (begin + end);
        for k in 0..2 {
            if here != regions[k] {
                continue;
            }
            last[k] = Some(middle);
            if let Some(other) = last[1 - k] {
                let ends = if k == 0 {
                    [middle, other]
                } else {
                    [other, middle]
                };
                let length = (middle - other).abs();
                if best.is_none_or(|(least, _)| length < least) {
                    best = Some((length, ends));
                }
            }
        }
    }
    best.map(|(_, ends)| ends.map(|t| start + direction * t))
}
