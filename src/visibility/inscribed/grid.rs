//! A grid of cells over a closed surface, and the search for boxes of inside cells: it
//! only proposes; what is used of them is proven (`proof`).

use glam::{DVec3, Vec3};

use super::rectangles::rectangles;
use crate::geometry::Aabb;

/// Cells of the bounds of a piece: inside or not. Boxes of inside cells come one after
/// the other, each the one that adds most to those before it.
pub struct Grid {
    cells: usize,
    low: DVec3,
    step: DVec3,
    /// A word per row along x, bit by bit.
    inside: Vec<u64>,
    /// Those inside that are in no box yet.
    open: Vec<u64>,
}

impl Grid {
    /// Of a closed piece: O(t + cells³) and more where triangles are long.
    pub fn of(part: &[[Vec3; 3]], cells: usize) -> Grid {
        let points = part.iter().flatten();
        let low = points.clone().fold(Vec3::INFINITY, |low, p| low.min(*p));
        let high = points.fold(Vec3::NEG_INFINITY, |high, p| high.max(*p));
        let low = low.as_dvec3();
        let step = (high.as_dvec3() - low) / cells as f64;
        let mut grid = Grid {
            cells,
            low,
            step,
            inside: vec![0; cells * cells],
            open: Vec::new(),
        };
        let touched = grid.touched(part);
        grid.fill(&touched);
        grid.open = grid.inside.clone();
        grid
    }

    /// Lower corner of a cell.
    fn corner(&self, cell: [usize; 3]) -> Vec3 {
        let [x, y, z] = cell.map(|index| index as f64);
        (self.low + self.step * DVec3::new(x, y, z)).as_vec3()
    }

    /// Cells that a triangle may enter: those of its bounds on both sides of its
    /// plane, and a little more. (Only a proposal: the proof does not use it.)
    fn touched(&self, part: &[[Vec3; 3]]) -> Vec<u64> {
        let n = self.cells;
        let mut touched = vec![0u64; n * n];
        for corners in part {
            let [a, b, c] = corners.map(Vec3::as_dvec3);
            let across = (b - a).cross(c - a);
            let reach = across.abs().dot(self.step) * 0.5001;
            let cell = |p: DVec3, slack: f64| {
                let at = (p - self.low) / self.step + slack;
                at.to_array().map(|x| (x.max(0.0) as usize).min(n - 1))
            };
            let first = cell(a.min(b).min(c), -1e-6);
            let last = cell(a.max(b).max(c), 1e-6);
            for z in first[2]..=last[2] {
                for y in first[1]..=last[1] {
                    for x in first[0]..=last[0] {
                        let at = DVec3::new(x as f64, y as f64, z as f64) + 0.5;
                        let centre = self.low + self.step * at;
                        if across.dot(centre - a).abs() <= reach {
                            touched[z * n + y] |= 1 << x;
                        }
                    }
                }
            }
        }
        touched
    }

    /// What cannot be reached from the sides without a touched cell on the way.
    fn fill(&mut self, touched: &[u64]) {
        let n = self.cells;
        let row = if n == 64 { u64::MAX } else { (1 << n) - 1 };
        let mut outside = vec![0u64; n * n];
        let ends = 1 | 1 << (n - 1);
        for (i, out) in outside.iter_mut().enumerate() {
            let is_side = [i / n, i % n].iter().any(|&k| k == 0 || k == n - 1);
            *out = if is_side { row } else { ends } & !touched[i];
        }
        let mut has_grown = true;
        while has_grown {
            has_grown = false;
            for i in 0..n * n {
                let (z, y) = (i / n, i % n);
                let mut grown = outside[i];
                let mut take = |ok: bool, from: usize| {
                    if ok {
                        grown |= outside[from];
                    }
                };
                take(y > 0, i.wrapping_sub(1));
                take(y + 1 < n, i + 1);
                take(z > 0, i.wrapping_sub(n));
                take(z + 1 < n, i + n);
                grown &= !touched[i];
                loop {
                    let wider = (grown | grown << 1 | grown >> 1) & row & !touched[i];
                    if wider == grown {
                        break;
                    }
                    grown = wider;
                }
                has_grown |= grown != outside[i];
                outside[i] = grown;
            }
        }
        let rest = touched.iter().zip(&outside).map(|(t, o)| row & !t & !o);
        self.inside = rest.collect();
    }

    /// The box of inside cells that holds the most of those that no box before did; of
    /// as many the largest, so that boxes overlap and leave no seam to look through.
    /// All slabs of z, and of each all runs of rows. `None` if none is left.
    fn next_box(&mut self) -> Option<Cells> {
        let n = self.cells;
        let open = self.open_below();
        // Up to a corner of cells, how many are open below it.
        let below = |x: usize, y: usize, z: usize| open[(z * (n + 1) + y) * (n + 1) + x];
        let mut best = ((0, 0), [[0; 3]; 2]);
        for low in 0..n {
            let mut rows = self.inside[low * n..(low + 1) * n].to_vec();
            for high in low + 1..=n {
                if high > low + 1 {
                    let next = &self.inside[(high - 1) * n..high * n];
                    rows.iter_mut()
                        .zip(next)
                        .for_each(|(row, next)| *row &= next);
                }
                if rows.iter().all(|&row| row == 0) {
                    break;
                }
                rectangles(&rows, |x, y| {
                    let all = (x.len() * y.len() * (high - low)) as u32;
                    if all < best.0.0 {
                        return;
                    }
                    let flat = |z: usize| {
                        below(x.end, y.end, z) + below(x.start, y.start, z)
                            - below(x.start, y.end, z)
                            - below(x.end, y.start, z)
                    };
                    let count = (flat(high) - flat(low), all);
                    if count > best.0 {
                        best = (count, [[x.start, y.start, low], [x.end, y.end, high]]);
                    }
                });
            }
        }
        let ((count, _), found) = best;
        (count > 0).then_some(found)
    }

    /// Sums over all open cells below each corner, x fastest.
    fn open_below(&self) -> Vec<u32> {
        let n = self.cells;
        let side = n + 1;
        let mut sums = vec![0; side * side * side];
        for z in 0..n {
            for y in 0..n {
                let mut row = 0;
                for x in 0..n {
                    row += (self.open[z * n + y] >> x & 1) as u32;
                    let at = |x: usize, y: usize, z: usize| (z * side + y) * side + x;
                    sums[at(x + 1, y + 1, z + 1)] =
                        row + sums[at(x + 1, y, z + 1)] + sums[at(x + 1, y + 1, z)]
                            - sums[at(x + 1, y, z)];
                }
            }
        }
        sums
    }

    fn close(&mut self, [low, high]: Cells) {
        let row = (u64::MAX >> (64 - (high[0] - low[0]))) << low[0];
        for z in low[2]..high[2] {
            for y in low[1]..high[1] {
                self.open[z * self.cells + y] &= !row;
            }
        }
    }
}

/// First cell and the one behind the last.
type Cells = [[usize; 3]; 2];

impl Iterator for Grid {
    type Item = Aabb;

    /// The next box to try.
    fn next(&mut self) -> Option<Aabb> {
        let found = self.next_box()?;
        self.close(found);
        Some(Aabb::new(self.corner(found[0]), self.corner(found[1])))
    }
}
