//! Occluder boxes in the solid space of a map.
//!
//! They fill parts of the space enclosed by its walls, floors and ceilings, and are simple enough
//! to draw.
//!
//! A point is open if it lies above some sector, between its floor and its ceiling; everything else
//! is solid. If all sectors are closed, no ray leaves the open space without meeting a surface that
//! hides ([`DoomMap::surfaces`]), so a box in the solid space hides what is behind it for an eye in
//! the open. Corners are integers and all tests of the plan are exact.

use glam::DVec3;

use super::DoomMap;
use super::surfaces::{Point, turn};
use crate::query::distinct;
use crate::scene::WorldBox;

/// Most columns, and most rows, of the plan.
const MOST_CELLS: usize = 512;
/// Least length of a box's longer side, map units: smaller boxes hide little.
const LEAST_SIDE: f64 = 32.0;
/// Least share of a box's plan area that is new.
///
/// A cell is new if the box's height is its own and no earlier box covers the cell.
const LEAST_NEW: f64 = 0.5;
/// Most boxes per height.
const MOST_OF_HEIGHT: usize = 128;
/// Most boxes per map.
const MOST_BOXES: usize = 2048;

impl DoomMap {
    /// Boxes whose open interior is disjoint from the open space of all sectors.
    ///
    /// They extend at most from `low` to `high`: rock between rooms, below floors and above
    /// ceilings; those that fill the whole height come first. None if some sector is
    /// [unclosed](DoomMap::unclosed), as rays leave the map there.
    ///
    /// Searches large rectangles of the plan, whose grid lines are those of the map's corners.
    /// Boxes may overlap, so there are no seams between them. O(heights * boxes of each * cells).
    pub fn solid_boxes(&self, [low, high]: [f64; 2]) -> Vec<WorldBox> {
        let Some(plan) = PlanGrid::of(self) else {
            return Vec::new();
        };
        let mut found = Vec::new();
        let rock: Vec<bool> = plan.cells.iter().map(|cell| cell.is_none()).collect();
        for cells in &plan.rectangles(&rock, |_| true) {
            found.push(plan.box_of(cells, low, high));
        }
        // Below a height, cells with a floor at or above it are solid; likewise above ceilings.
        let sides = [(0, 1.0, low), (1, -1.0, high)];
        for (side, up, end) in sides {
            let all = plan.cells.iter().flatten().map(|open| open[side]);
            let mut heights: Vec<f64> = all.filter(|height| (height - end) * up > 0.0).collect();
            heights.sort_unstable_by(f64::total_cmp);
            heights.dedup();
            for height in heights {
                if found.len() >= MOST_BOXES {
                    break;
                }
                let at = |cell: usize| plan.cells[cell].map(|open| open[side] * up);
                let solid = |cell: usize| at(cell).is_none_or(|own| own >= height * up);
                let solid: Vec<bool> = (0..plan.cells.len()).map(solid).collect();
                let own = |cell: usize| at(cell) == Some(height * up);
                for cells in &plan.rectangles(&solid, own) {
                    let [from, to] = [end.min(height), end.max(height)];
                    found.push(plan.box_of(cells, from, to));
                }
            }
        }
        found.truncate(MOST_BOXES);
        found
    }
}

/// Ranges of columns and rows, ends exclusive.
type CellRect = [[usize; 2]; 2];

/// Plan view of the map, in cells between the grid lines of its corners.
struct PlanGrid {
    /// Grid lines by axis, ascending.
    lines: [Vec<i32>; 2],
    columns: usize,
    /// Lowest floor and highest ceiling of each open cell, row by row.
    ///
    /// These are of all sectors that have a part in the cell; `None` for a cell without one.
    cells: Vec<Option<[f64; 2]>>,
}

impl PlanGrid {
    /// Builds the plan; `None` if some sector of the map is not closed.
    fn of(map: &DoomMap) -> Option<PlanGrid> {
        let lines = [0, 1].map(|axis| {
            let ends = map.lines.iter().flat_map(|line| line.ends);
            let lines = distinct(ends.map(|end| end[axis]).collect());
            let step = lines.len().div_ceil(MOST_CELLS).max(1);
            lines.into_iter().step_by(step).collect::<Vec<_>>()
        });
        let [columns, rows] = [0, 1].map(|axis| lines[axis].len().saturating_sub(1));
        let mut plan = PlanGrid {
            lines,
            columns,
            cells: vec![None; columns * rows],
        };
        for (sector, heights) in (0..).zip(&map.sectors) {
            for triangle in map.triangles(sector)? {
                plan.open(triangle, *heights);
            }
        }
        Some(plan)
    }

    /// Opens the cells that have a point inside a triangle.
    fn open(&mut self, triangle: [Point; 3], [floor, ceiling]: [f64; 2]) {
        let [columns, rows] = [0, 1].map(|axis| {
            let [a, b, c] = triangle.map(|corner| corner[axis]);
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let lines = &self.lines[axis];
            let first = lines.partition_point(|&line| line <= low).saturating_sub(1);
            let end = lines.partition_point(|&line| line < high);
            first..end.min(lines.len().saturating_sub(1))
        });
        for row in rows {
            for column in columns.clone() {
                if self.meets(triangle, column, row) {
                    let cell = &mut self.cells[row * self.columns + column];
                    let [low, high] = cell.unwrap_or([floor, ceiling]);
                    *cell = Some([low.min(floor), high.max(ceiling)]);
                }
            }
        }
    }

    /// Tests whether the interiors of a triangle and of a cell meet.
    ///
    /// The triangle turns right and the cell overlaps its bounds: the interiors meet unless a side
    /// of the triangle separates them.
    fn meets(&self, [a, b, c]: [Point; 3], column: usize, row: usize) -> bool {
        let corner = |end: usize| [self.lines[0][column + end], self.lines[1][row + end]];
        let [[x, y], [u, v]] = [corner(0), corner(1)];
        let corners = [[x, y], [u, y], [x, v], [u, v]];
        let separates = |from, to| corners.iter().all(|&p| turn(from, to, p) >= 0);
        !(separates(a, b) || separates(b, c) || separates(c, a))
    }

    /// Width and depth of a rectangle, map units.
    fn size(&self, cells: &CellRect) -> [f64; 2] {
        [0, 1].map(|axis| {
            let [first, end] = cells[axis].map(|line| self.lines[axis][line]);
            f64::from(end - first)
        })
    }

    fn box_of(&self, cells: &CellRect, low: f64, high: f64) -> WorldBox {
        let corner = |end: usize, z| {
            let [x, y] = [0, 1].map(|axis| self.lines[axis][cells[axis][end]]);
            DVec3::new(x.into(), y.into(), z)
        };
        WorldBox::new(corner(0, low), corner(1, high))
    }

    /// Chooses maximal rectangles of solid cells, the longest first.
    ///
    /// Each must add enough area of `own` cells that no earlier one covers ([`LEAST_NEW`]).
    fn rectangles(&self, solid: &[bool], own: impl Fn(usize) -> bool) -> Vec<CellRect> {
        let mut all: Vec<([f64; 2], CellRect)> = Vec::new();
        for_each_maximal(solid, self.columns, |cells| {
            let [width, depth] = self.size(&cells);
            if width.max(depth) >= LEAST_SIDE {
                all.push(([width.max(depth), width.min(depth)], cells));
            }
        });
        let key = |sides: &[f64; 2]| sides.map(|side| side as i64);
        all.sort_by_key(|(sides, cells)| (std::cmp::Reverse(key(sides)), *cells));
        let mut free: Vec<bool> = (0..solid.len()).map(own).collect();
        let area = |column: usize, row: usize| {
            let [width, depth] = self.size(&[[column, column + 1], [row, row + 1]]);
            width * depth
        };
        let whole = (0..free.len()).filter(|&cell| free[cell]);
        let areas = whole.map(|cell| area(cell % self.columns, cell / self.columns));
        let mut left: f64 = areas.sum();
        let mut found = Vec::new();
        for ([long, short], cells) in all {
            let least = long * short * LEAST_NEW;
            if left < least {
                continue;
            }
            let [columns, rows] = cells.map(|[first, end]| first..end);
            let places = rows.flat_map(|row| columns.clone().map(move |column| (column, row)));
            let is_free = |place: &(usize, usize)| free[place.1 * self.columns + place.0];
            let new = places.clone().filter(is_free);
            let new: f64 = new.map(|(column, row)| area(column, row)).sum();
            if new >= least {
                left -= new;
                places.for_each(|(column, row)| free[row * self.columns + column] = false);
                found.push(cells);
            }
            if found.len() == MOST_OF_HEIGHT {
                break;
            }
        }
        found
    }
}

/// Calls `found` with each maximal rectangle of true cells.
///
/// O(cells), with a stack of column depths per row (the largest rectangle in a histogram).
fn for_each_maximal(cells: &[bool], columns: usize, mut found: impl FnMut(CellRect)) {
    let mut deep = vec![0; columns];
    let mut open: Vec<(usize, usize)> = Vec::new();
    let mut rows = cells.chunks_exact(columns.max(1)).enumerate().peekable();
    while let Some((row, own)) = rows.next() {
        for (deep, own) in deep.iter_mut().zip(own) {
            *deep = if *own { *deep + 1 } else { 0 };
        }
        let below = rows.peek().map(|(_, below)| *below);
        for column in 0..=columns {
            let depth = deep.get(column).copied().unwrap_or(0);
            let mut start = column;
            while let Some((first, high)) = open.pop_if(|(_, high)| *high > depth) {
                let continues = below.is_some_and(|below| below[first..column].iter().all(|&b| b));
                if !continues {
                    found([[first, column], [row + 1 - high, row + 1]]);
                }
                start = first;
            }
            if depth > 0 && open.last().is_none_or(|(_, high)| *high < depth) {
                open.push((start, depth));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::scene::{Linedef, SeededRng, WadMap, load};

    fn map_of(lines: Vec<Linedef>, heights: Vec<[f64; 2]>) -> DoomMap {
        DoomMap::of(Arc::new(WadMap::at_rest(lines, heights)))
    }

    fn line(ends: [[i32; 2]; 2], sectors: [Option<u32>; 2]) -> Linedef {
        Linedef {
            ends,
            sectors,
            action: 0,
            tag: 0,
        }
    }

    /// Map of nested rectangular sectors with their heights.
    ///
    /// A rectangle without heights is rock. The first one is the outline.
    fn nested(sectors: &[([i32; 4], Option<[f64; 2]>)]) -> DoomMap {
        let numbers: Vec<Option<u32>> = sectors
            .iter()
            .scan(0, |next, (_, heights)| {
                Some(heights.map(|_| std::mem::replace(next, *next + 1)))
            })
            .collect();
        let mut lines = Vec::new();
        for (place, ([x0, y0, x1, y1], _)) in sectors.iter().enumerate() {
            // Clockwise: the interior is on the right.
            let corners = [[*x0, *y0], [*x0, *y1], [*x1, *y1], [*x1, *y0]];
            let around = (place > 0).then(|| numbers[0]).flatten();
            for (from, to) in (0..4).map(|k| (corners[k], corners[(k + 1) % 4])) {
                let (ends, sides) = match numbers[place] {
                    // A linedef always has a sector on its right.
                    None => ([to, from], [around, None]),
                    own => ([from, to], [own, around]),
                };
                lines.push(line(ends, sides));
            }
        }
        map_of(lines, sectors.iter().filter_map(|(_, own)| *own).collect())
    }

    fn sorted(boxes: Vec<WorldBox>) -> Vec<[[f64; 3]; 2]> {
        let corners = boxes.iter().map(|b| [b.min.to_array(), b.max.to_array()]);
        let mut all: Vec<_> = corners.collect();
        all.sort_by(|a, b| a.partial_cmp(b).unwrap());
        all
    }

    #[test]
    fn a_pillar_a_step_and_a_low_ceiling_are_found_whole() {
        let hall = ([0, 0, 400, 300], Some([0.0, 100.0]));
        let pillar = ([50, 50, 90, 110], None);
        let step = ([200, 50, 260, 120], Some([40.0, 100.0]));
        let beam = ([300, 100, 340, 200], Some([0.0, 60.0]));
        let map = nested(&[hall, pillar, step, beam]);
        let found = sorted(map.solid_boxes([-8.0, 120.0]));
        for wanted in [
            [[50.0, 50.0, -8.0], [90.0, 110.0, 120.0]],
            // Under the step up to its floor, over the beam down to its ceiling.
            [[200.0, 50.0, -8.0], [260.0, 120.0, 40.0]],
            [[300.0, 100.0, 60.0], [340.0, 200.0, 120.0]],
            // The whole plan below the lowest floor and above the highest ceiling.
            [[0.0, 0.0, -8.0], [400.0, 300.0, 0.0]],
            [[0.0, 0.0, 100.0], [400.0, 300.0, 120.0]],
        ] {
            assert!(found.contains(&wanted), "{wanted:?} of {found:?}");
        }
        assert_eq!(found.len(), 5, "{found:?}");
    }

    #[test]
    fn a_map_that_does_not_close_has_none() {
        let mut map = nested(&[([0, 0, 64, 64], Some([0.0, 64.0]))]);
        assert!(!map.solid_boxes([-64.0, 64.0]).is_empty());
        map.lines.pop();
        let map = map_of(map.lines, map.sectors);
        assert!(map.solid_boxes([-64.0, 64.0]).is_empty());
    }

    #[test]
    fn a_corner_on_a_wall_between_its_ends_leaves_no_gap() {
        let mut map = nested(&[([0, 0, 400, 300], Some([0.0, 100.0]))]);
        let pillar = [[0, 150], [50, 100], [100, 150], [50, 200]];
        let sides = (0..4).map(|k| line([pillar[k], pillar[(k + 1) % 4]], [Some(0), None]));
        map.lines.extend(sides);
        let map = map_of(map.lines, map.sectors);
        assert!(map.file.disputes().is_empty() && map.unclosed().is_empty());
        assert!(!map.solid_boxes([-8.0, 120.0]).is_empty());
    }

    #[test]
    fn no_point_of_a_box_is_in_a_sector() {
        for (name, least) in [("freedm-map12", 30), ("freedm-map20", 100)] {
            let scene = load(name, &Default::default()).unwrap();
            let map = DoomMap::of_scene(&scene).unwrap();
            let graph = map.graph().unwrap();
            let boxes = map.solid_boxes([-512.0, 512.0]);
            assert!(boxes.len() >= least, "{name}: {}", boxes.len());
            let mut rng = SeededRng::new(3);
            let is_open = |at| {
                graph
                    .locator
                    .regions_at(&WorldBox::new(at, at), &mut Vec::new())
            };
            let mut open = 0;
            for b in &boxes {
                for _ in 0..200 {
                    let at = b.min + (b.max - b.min) * (rng.point() * 0.9998 + 0.0001);
                    assert!(!is_open(at), "{name}: {at} of {b:?}");
                    // Usually there is something open beside the box.
                    let beside = b.min + (b.max - b.min) * (rng.point() * 1.4 - 0.2);
                    open += u32::from(is_open(beside));
                }
            }
            assert!(open > 100, "{name}: {open}");
        }
    }

    #[test]
    fn maximal_rectangles_are_those_of_brute_force() {
        let mut rng = SeededRng::new(8);
        for _ in 0..300 {
            let (columns, rows) = (1 + rng.below(6), 1 + rng.below(6));
            let cells: Vec<bool> = (0..columns * rows).map(|_| rng.below(4) > 0).collect();
            let is_whole = |[[x0, x1], [y0, y1]]: CellRect| {
                x1 <= columns
                    && y1 <= rows
                    && (y0..y1).all(|y| (x0..x1).all(|x| cells[y * columns + x]))
            };
            let mut wanted = Vec::new();
            for (x0, y0) in (0..columns).flat_map(|x| (0..rows).map(move |y| (x, y))) {
                for (x1, y1) in
                    (x0 + 1..=columns).flat_map(|x| (y0 + 1..=rows).map(move |y| (x, y)))
                {
                    let larger = [
                        [[x0.wrapping_sub(1), x1], [y0, y1]],
                        [[x0, x1 + 1], [y0, y1]],
                        [[x0, x1], [y0.wrapping_sub(1), y1]],
                        [[x0, x1], [y0, y1 + 1]],
                    ];
                    let grows = larger.into_iter().any(|cells| {
                        cells[0][0] < columns && cells[1][0] < rows && is_whole(cells)
                    });
                    if is_whole([[x0, x1], [y0, y1]]) && !grows {
                        wanted.push([[x0, x1], [y0, y1]]);
                    }
                }
            }
            let mut found = Vec::new();
            for_each_maximal(&cells, columns, |cells| found.push(cells));
            found.sort_unstable();
            wanted.sort_unstable();
            assert_eq!(found, wanted);
        }
    }
}
