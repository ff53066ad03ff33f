//! A grid of cells over a closed surface.
//!
//! Its cells only propose boxes; `proof` proves those that are used.

use glam::{DVec3, Vec3};

use super::cells::{CellBox, Cells};
use crate::geometry::Aabb;

/// A grid over the bounds of a closed piece of a surface.
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

    /// The cells inside the surface. O(t + cells³), and more where triangles are long.
    pub fn cells(&self, part: &[[Vec3; 3]]) -> Cells {
        Cells::new(self.cells, self.inside(&self.touched(part)))
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

    /// Cells that no path from the sides reaches without a touched cell.
    fn inside(&self, touched: &[u64]) -> Vec<u64> {
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
        rest.collect()
    }

    /// A box of cells, scene-local.
    pub fn to_box(&self, [low, high]: CellBox) -> Aabb {
        Aabb::new(self.corner(low), self.corner(high))
    }
}
