//! Voxel grid over a closed surface, and a search for boxes of inner cells.
//!
//! Cells only propose boxes; every box that is used is proven.

use std::ops::Range;

use glam::{DVec3, Vec3};

use crate::geometry::Aabb;

/// Voxel grid over the bounds of one closed component of a surface.
pub struct Grid {
    cells: usize,
    low: DVec3,
    step: DVec3,
}

impl Grid {
    /// A grid of `cells` along each axis.
    pub fn of(part: &[[Vec3; 3]], cells: usize) -> Grid {
        let bounds = Aabb::of_points(part.iter().flatten().copied());
        let low = bounds.min.as_dvec3();
        let step = (bounds.max.as_dvec3() - low) / cells as f64;
        Grid { cells, low, step }
    }

    /// Lower corner of a cell, scene-local.
    pub fn corner(&self, cell: [usize; 3]) -> Vec3 {
        let [x, y, z] = cell.map(|index| index as f64);
        (self.low + self.step * DVec3::new(x, y, z)).as_vec3()
    }

    /// Cells near a triangle: in its bounds and on both sides of its plane.
    ///
    /// Slightly enlarged. Only a proposal: the proof does not use it.
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

    /// Cells inside the surface. O(t + cells³), more for long triangles.
    ///
    /// A cell is inside if every path to it from the grid's border crosses a touched cell.
    pub fn cells(&self, part: &[[Vec3; 3]]) -> Cells {
        let (n, touched) = (self.cells, self.touched(part));
        let row = u64::MAX >> (64 - n);
        let ends = 1 | 1 << (n - 1);
        let free: Vec<u64> = touched.iter().map(|touched| row & !touched).collect();
        let mut outside = vec![0u64; n * n];
        let mut has_grown = true;
        while has_grown {
            has_grown = false;
            for i in 0..n * n {
                let (z, y) = (i / n, i % n);
                // Everything beyond the grid's border is outside.
                let row_at = |is_within: bool, at: usize| if is_within { outside[at] } else { row };
                let above = row_at(z > 0, i.wrapping_sub(n)) | row_at(z + 1 < n, i + n);
                let beside = row_at(y > 0, i.wrapping_sub(1)) | row_at(y + 1 < n, i + 1);
                let mut grown = (outside[i] | above | beside | ends) & free[i];
                loop {
                    let wider = (grown | grown << 1 | grown >> 1) & free[i];
                    if wider == grown {
                        break;
                    }
                    grown = wider;
                }
                has_grown |= grown != outside[i];
                outside[i] = grown;
            }
        }
        let rows = free.iter().zip(&outside);
        let inside = rows.map(|(free, outside)| free & !outside);
        Cells::new(n, inside.collect())
    }
}

/// Cells of a cube with `n` (up to 64) per axis, with those that boxes may fill.
#[derive(Clone)]
pub struct Cells {
    n: usize,
    /// One word per row along x, y fastest; bit `x` marks an inside cell.
    inside: Vec<u64>,
    /// Inside cells that no box contains yet.
    open: Vec<u64>,
}

/// First cell and one-past-last cell of a box, on each axis.
pub type CellBox = [[usize; 3]; 2];

impl Cells {
    /// Inside cells given as rows along x, by z and y; no box yet.
    pub fn new(n: usize, inside: Vec<u64>) -> Cells {
        let open = inside.clone();
        Cells { n, inside, open }
    }

    /// Finds the box of inside cells with the most cells that are in no box yet.
    ///
    /// Returns the number of those cells and the box; among equal boxes the largest, so that boxes
    /// overlap without seams. The box's lowest z layer is one of `lows`. `None` if no cell is left.
    /// O(n⁴) in common cases.
    pub fn next_box(&mut self, lows: Range<usize>) -> Option<(u32, CellBox)> {
        let n = self.n;
        let open = self.open_below();
        let below = |x: usize, y: usize, z: usize| open[(z * (n + 1) + y) * (n + 1) + x];
        let mut best = ((0, 0), [[0; 3]; 2]);
        for low in lows {
            let mut rows = vec![u64::MAX; n];
            for high in low + 1..=n {
                let slab = &self.inside[(high - 1) * n..high * n];
                let pairs = rows.iter_mut().zip(slab);
                pairs.for_each(|(row, next)| *row &= next);
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
        if count == 0 {
            return None;
        }
        self.close(found);
        Some((count, found))
    }

    /// Prefix sums of the open cells below each corner, x fastest.
    fn open_below(&self) -> Vec<u32> {
        let n = self.n;
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

    fn close(&mut self, [low, high]: CellBox) {
        let row = (u64::MAX >> (64 - (high[0] - low[0]))) << low[0];
        for z in low[2]..high[2] {
            for y in low[1]..high[1] {
                self.open[z * self.n + y] &= !row;
            }
        }
    }
}

/// Calls `each` with the columns and rows of every rectangle of set bits.
///
/// For each range of rows: the maximal runs of columns set in all of them; column `k` is bit `k`.
/// O(rows² x runs).
fn rectangles(rows: &[u64], mut each: impl FnMut(Range<usize>, Range<usize>)) {
    for first in 0..rows.len() {
        let mut common = u64::MAX;
        for (last, row) in rows.iter().enumerate().skip(first) {
            common &= row;
            if common == 0 {
                break;
            }
            let mut left = common;
            while left != 0 {
                let at = left.trailing_zeros();
                let end = at + (left >> at).trailing_ones();
                left &= u64::MAX.checked_shl(end).unwrap_or(0);
                each(at as usize..end as usize, first..last + 1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SeededRng;

    #[test]
    fn they_are_those_of_a_plain_search() {
        let mut rng = SeededRng::new(6);
        for _ in 0..200 {
            let word =
                |rng: &mut SeededRng| (0..64).fold(0, |w, _| w << 1 | u64::from(rng.below(4) > 0));
            let rows = [0; 5].map(|_| word(&mut rng));
            let mut found = Vec::new();
            rectangles(&rows, |columns, rows| found.push((rows, columns)));
            let mut wanted = Vec::new();
            for first in 0..5 {
                for end in first + 1..=5 {
                    let is_set = |k: usize| rows[first..end].iter().all(|row| row >> k & 1 == 1);
                    let starts = (0..64).filter(|&k| is_set(k) && (k == 0 || !is_set(k - 1)));
                    let run = |k: usize| k..(k..64).find(|&k| !is_set(k)).unwrap_or(64);
                    wanted.extend(starts.map(|k| (first..end, run(k))));
                }
            }
            assert_eq!(found, wanted);
        }
        let mut found = Vec::new();
        rectangles(&[u64::MAX], |columns, rows| found.push((columns, rows)));
        assert_eq!(found, [(0..64, 0..1)]);
    }
}
