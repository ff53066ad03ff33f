//! The verdict by linear programming in whole numbers: the largest t such that
//! some point of the box has `n_i . x + d_i >= t` for all planes, by the primal
//! simplex method with Bland's rule and Edmonds' integer pivoting. Positive is
//! IN, zero TOUCH, negative OUT. Nothing here is rounded and nothing is shared
//! with the certificates that it judges.

use cullbench::geometry::{Aabb, Plane};
use cullbench::oracle::Verdict;
use dashu_int::IBig;

use super::wide::Dyadic;

/// The finest unit that these numbers need.
fn unit_of<'a>(numbers: impl IntoIterator<Item = &'a Dyadic>) -> i64 {
    let used = numbers.into_iter().filter(|x| !x.is_zero());
    used.map(|x| x.exponent).min().unwrap_or(0)
}

/// Normal and offset.
pub type ExactPlane = [Dyadic; 4];

pub fn exact(plane: &Plane) -> ExactPlane {
    let n = plane.normal;
    [n.x, n.y, n.z, plane.d].map(Dyadic::from)
}

/// The verdict about a box with finite bounds.
pub fn verdict(planes: &[ExactPlane], b: &Aabb) -> Verdict {
    if b.is_empty() {
        return Verdict::Out;
    }
    let mut constraints = Vec::new();
    for plane in planes {
        let no_normal = plane[..3].iter().all(Dyadic::is_zero);
        match (no_normal, plane[3].mantissa < IBig::ZERO) {
            (true, true) => return Verdict::Out,
            (true, false) => {}
            (false, _) => constraints.push(plane),
        }
    }
    if constraints.is_empty() {
        return Verdict::In;
    }
    let low = b.min.to_array().map(Dyadic::from);
    let high = b.max.to_array().map(Dyadic::from);
    let grid = unit_of(low.iter().chain(&high));
    let low = low.map(|x| x.in_units(grid));
    let extent = [0, 1, 2].map(|k| high[k].in_units(grid) - &low[k]);

    // Rows are `constant + coefficients . (x - low, t)`: every plane may have
    // a unit of its own, as only the sign of t matters.
    let mut rows = Vec::new();
    for [x, y, z, d] in constraints {
        let unit = unit_of([x, y, z]);
        let unit = if d.is_zero() {
            unit
        } else {
            unit.min(d.exponent - grid)
        };
        let normal = [x, y, z].map(|n| n.in_units(unit));
        let at_low = (0..3).fold(d.in_units(unit + grid), |sum, k| sum + &normal[k] * &low[k]);
        let [x, y, z] = normal;
        rows.push([at_low, x, y, z, IBig::NEG_ONE]);
    }
    let planes = rows.len();
    for (k, extent) in extent.into_iter().enumerate() {
        let mut row = [const { IBig::ZERO }; 5];
        row[0] = extent;
        row[k + 1] = IBig::NEG_ONE;
        rows.push(row);
    }
    Tableau::new(rows, planes).verdict()
}

/// A dictionary: each row a basic variable as `(row[0] + row[1..] . nonbasic) /
/// denominator`.
struct Tableau {
    rows: Vec<[IBig; 5]>,
    denominator: IBig,
    /// The variables of rows and columns: planes' and bounds' slacks first,
    /// then x, y, z, then t.
    basic: Vec<usize>,
    nonbasic: [usize; 4],
    /// The row that holds t.
    t: usize,
}

impl Tableau {
    fn new(rows: Vec<[IBig; 5]>, planes: usize) -> Tableau {
        let count = rows.len();
        let mut tableau = Tableau {
            basic: (0..count).collect(),
            nonbasic: [count, count + 1, count + 2, count + 3],
            rows,
            denominator: IBig::ONE,
            t: 0,
        };
        // At the low corner t is the least of the planes: a feasible start.
        let lowest = (0..planes).min_by(|&a, &b| tableau.rows[a][0].cmp(&tableau.rows[b][0]));
        tableau.t = lowest.expect("at least one plane");
        tableau.pivot(tableau.t, 4);
        tableau
    }

    fn verdict(mut self) -> Verdict {
        loop {
            let t = &self.rows[self.t];
            if t[0] > IBig::ZERO {
                return Verdict::In;
            }
            // Bland: of all variables that would raise t the first ...
            let raising = (1..5).filter(|&j| t[j] > IBig::ZERO);
            let Some(column) = raising.min_by_key(|&j| self.nonbasic[j - 1]) else {
                return if t[0] == IBig::ZERO {
                    Verdict::Touch
                } else {
                    Verdict::Out
                };
            };
            // ... and of all that stop it soonest the first.
            let stopping =
                (0..self.rows.len()).filter(|&i| i != self.t && self.rows[i][column] < IBig::ZERO);
            let row = stopping.min_by(|&a, &b| {
                let (row_a, row_b) = (&self.rows[a], &self.rows[b]);
                // a[0] / -a[column] against b[0] / -b[column].
                let (left, right) = (&row_b[0] * &row_a[column], &row_a[0] * &row_b[column]);
                left.cmp(&right).then(self.basic[a].cmp(&self.basic[b]))
            });
            self.pivot(row.expect("t is bounded in a box"), column);
        }
    }

    /// Exchanges the variables of a row and a column. All numbers stay whole:
    /// each is a minor of the first tableau (Edmonds 1967).
    fn pivot(&mut self, row: usize, column: usize) {
        let pivot = self.rows[row][column].clone();
        let pivot_row = self.rows[row].clone();
        for (i, target) in self.rows.iter_mut().enumerate() {
            if i == row {
                for (j, value) in target.iter_mut().enumerate() {
                    *value = if j == column {
                        self.denominator.clone()
                    } else {
                        -&pivot_row[j]
                    };
                }
                continue;
            }
            let factor = target[column].clone();
            for (j, value) in target.iter_mut().enumerate() {
                if j != column {
                    let cross = &*value * &pivot - &factor * &pivot_row[j];
                    *value = cross / &self.denominator;
                }
            }
        }
        self.denominator = pivot;
        if self.denominator < IBig::ZERO {
            self.denominator = -&self.denominator;
            for value in self.rows.iter_mut().flatten() {
                *value = -&*value;
            }
        }
        std::mem::swap(&mut self.basic[row], &mut self.nonbasic[column - 1]);
    }
}

/// The verdict once more, for small whole numbers only and by brute force: the
/// corners of box and planes together are found one by one. No corner, no
/// common point; their mean lies strictly inside every plane that any common
/// point lies strictly inside of.
fn by_corners(planes: &[[i128; 4]], low: [i128; 3], high: [i128; 3]) -> Verdict {
    let mut all = planes.to_vec();
    for k in 0..3 {
        for (sign, bound) in [(1, low[k]), (-1, high[k])] {
            let mut face = [0; 4];
            face[k] = sign;
            face[3] = -sign * bound;
            all.push(face);
        }
    }
    let value =
        |p: &[i128; 4], x: &[i128; 3], w: i128| p[0] * x[0] + p[1] * x[1] + p[2] * x[2] + p[3] * w;
    let mut corners: Vec<([i128; 3], i128)> = Vec::new();
    for (i, a) in all.iter().enumerate() {
        for (j, b) in all.iter().enumerate().skip(i + 1) {
            for c in &all[j + 1..] {
                let minor = |p: usize, q: usize, r: usize| {
                    a[p] * (b[q] * c[r] - b[r] * c[q]) - a[q] * (b[p] * c[r] - b[r] * c[p])
                        + a[r] * (b[p] * c[q] - b[q] * c[p])
                };
                // Cramer: the common point in homogeneous coordinates.
                let mut x = [-minor(3, 1, 2), -minor(0, 3, 2), -minor(0, 1, 3)];
                let mut w = minor(0, 1, 2);
                if w < 0 {
                    (x, w) = (x.map(|x| -x), -w);
                }
                if w > 0 && all.iter().all(|p| value(p, &x, w) >= 0) {
                    corners.push((x, w));
                }
            }
        }
    }
    if corners.is_empty() {
        return Verdict::Out;
    }
    let inside = |p: &[i128; 4]| corners.iter().any(|(x, w)| value(p, x, *w) > 0);
    if planes.iter().all(inside) {
        Verdict::In
    } else {
        Verdict::Touch
    }
}

#[test]
fn the_linear_program_agrees_with_corners_found_by_brute_force() {
    let mut rng = super::draw::SeededRng::new(1);
    let mut seen = [0; 3];
    for case in 0..3000 {
        let count = 1 + rng.below(6);
        let planes: Vec<[i128; 4]> = (0..count)
            .map(|_| {
                loop {
                    let p = [1, 1, 2, 2].map(|reach| i128::from(rng.whole(reach)));
                    if p[..3] != [0; 3] {
                        break p;
                    }
                }
            })
            .collect();
        let low = [0; 3].map(|_| i128::from(rng.whole(3)));
        let high = low.map(|x| x + rng.below(3) as i128);
        let exact: Vec<ExactPlane> = planes
            .iter()
            .map(|p| p.map(|x| Dyadic::from(x as f32)))
            .collect();
        let vec = |x: [i128; 3]| glam::Vec3::from_array(x.map(|x| x as f32));
        let found = verdict(&exact, &Aabb::new(vec(low), vec(high)));
        let wanted = by_corners(&planes, low, high);
        assert_eq!(found, wanted, "case {case}: {planes:?} {low:?} {high:?}");
        seen[wanted as usize] += 1;
    }
    assert!(seen.iter().all(|&n| n > 200), "{seen:?}");
}

#[test]
fn the_linear_program_on_cases_worked_by_hand() {
    use glam::Vec3;
    let wedge = [1.0, -1.0].map(|x| exact(&Plane::new(Vec3::new(x, 0.0, -1.0), 0.0)));
    let at = |z: f32| {
        let (low, high) = (Vec3::new(-2.0, 0.0, z), Vec3::new(2.0, 1.0, z + 1.0));
        verdict(&wedge, &Aabb::new(low, high))
    };
    let tiny = f32::from_bits(1);
    assert_eq!(at(tiny), Verdict::Out, "beyond the edge by the least f32");
    assert_eq!(at(0.0), Verdict::Touch);
    assert_eq!(at(-tiny), Verdict::In);
    let plane = |d: f32| [exact(&Plane::new(Vec3::ZERO, d))];
    let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
    assert_eq!(verdict(&plane(0.0), &unit), Verdict::In);
    assert_eq!(verdict(&plane(-tiny), &unit), Verdict::Out);
    assert_eq!(verdict(&[], &unit), Verdict::In);
    let inverted = Aabb::new(Vec3::ONE, Vec3::ZERO);
    assert_eq!(verdict(&[], &inverted), Verdict::Out);
}
