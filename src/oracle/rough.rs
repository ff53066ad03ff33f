//! Filter of the oracle's preparation: minors and determinants in f64.
//!
//! Each has an error bound, so exact sums are only formed where rounding could matter.

use super::evaluate::HalfSpace;
use crate::arithmetic::combinations;

/// Error of an f64 result, relative to its size.
///
/// No sum below has a longer history than coefficients rounded twice, five products and six sums:
/// some 12 units of epsilon.
const ERROR: f64 = 32.0 * f64::EPSILON;

/// Upper bound of the underflow.
///
/// Never near a relevant product of at most eight f32 numbers (those of five are above 2^-745).
const UNDERFLOW: f64 = 1e-290;

/// A result with the sum of the magnitudes it came from.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Rough {
    pub value: f64,
    size: f64,
}

impl Rough {
    fn of(value: f64) -> Rough {
        Rough::new(value, value.abs())
    }

    fn new(value: f64, size: f64) -> Rough {
        Rough { value, size }
    }

    fn times(self, other: Rough) -> Rough {
        Rough::new(self.value * other.value, self.size * other.size)
    }

    fn plus(self, other: Rough) -> Rough {
        Rough::new(self.value + other.value, self.size + other.size)
    }

    fn negated(self) -> Rough {
        Rough::new(-self.value, self.size)
    }

    fn abs(self) -> Rough {
        Rough::new(self.value.abs(), self.size)
    }

    pub fn error(self) -> f64 {
        ERROR * self.size + UNDERFLOW
    }

    /// Sign, if it is certain; zero only for products with zero.
    pub fn sign(self) -> Option<i32> {
        match self.value.abs() > self.error() {
            true => Some(if self.value > 0.0 { 1 } else { -1 }),
            false => (self.size == 0.0).then_some(0),
        }
    }
}

type Vector = [Rough; 3];

fn dot(a: &Vector, b: &Vector) -> Rough {
    let [x, y, z] = [0, 1, 2].map(|k| a[k].times(b[k]));
    x.plus(y).plus(z)
}

fn cross(a: &Vector, b: &Vector) -> Vector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i].times(b[j]).plus(a[j].times(b[i]).negated()))
}

/// Returns `true` if all weights may be strictly of one sign.
pub(super) fn may_agree<const N: usize>(weights: [Rough; N]) -> bool {
    let signs = weights.map(Rough::sign);
    let certain = |sign: i32| signs.contains(&Some(sign));
    let hopeless = certain(0) || (certain(1) && certain(-1));
    !hopeless
}

/// Returns `true` if all weights are certainly strictly of one sign.
fn agree<const N: usize>(weights: [Rough; N]) -> bool {
    let sign = weights[0].sign();
    sign.is_some_and(|s| s != 0) && weights.iter().all(|w| w.sign() == sign)
}

/// Interval of a bound of the volume along an axis.
pub(super) struct RoughBound {
    /// Twice the axis, plus one for the negative direction.
    pub direction: usize,
    /// Lower end of the interval of the offset over the normal's length.
    pub low: f64,
    pub high: f64,
}

/// Half-spaces in f64, with the cross products of all pairs of normals.
pub(super) struct RoughSpaces {
    normals: Vec<Vector>,
    offsets: Vec<Rough>,
    crosses: Vec<Vector>,
    determinants: Vec<Rough>,
}

impl RoughSpaces {
    pub fn new(constraints: &[HalfSpace]) -> RoughSpaces {
        let normal = |c: &HalfSpace| [0, 1, 2].map(|k| Rough::of(c.normal[k].estimate()));
        let normals: Vec<Vector> = constraints.iter().map(normal).collect();
        let offsets = constraints.iter().map(|c| Rough::of(c.d.estimate()));
        let count = normals.len();
        let mut crosses = Vec::with_capacity(count * count);
        for a in &normals {
            crosses.extend(normals.iter().map(|b| cross(a, b)));
        }
        let mut determinants = vec![Rough::default(); count * count * count];
        for [i, j, l] in combinations(count) {
            determinants[(i * count + j) * count + l] = dot(&normals[i], &crosses[j * count + l]);
        }
        RoughSpaces {
            offsets: offsets.collect(),
            normals,
            crosses,
            determinants,
        }
    }

    fn cross(&self, i: usize, j: usize) -> &Vector {
        &self.crosses[i * self.normals.len() + j]
    }

    /// Determinant of three normals in ascending order.
    fn determinant(&self, i: usize, j: usize, l: usize) -> Rough {
        self.determinants[(i * self.normals.len() + j) * self.normals.len() + l]
    }

    /// Sign of the offset of a combination of four with a zero normal.
    ///
    /// `None` if it is uncertain; positive also if there is no such combination.
    pub fn quadruple(&self, [i, j, l, m]: [usize; 4]) -> Option<i32> {
        let weights = [
            self.determinant(j, l, m),
            self.determinant(i, l, m).negated(),
            self.determinant(i, j, m),
            self.determinant(i, j, l).negated(),
        ];
        if !may_agree(weights) {
            return Some(1);
        }
        if !agree(weights) {
            return None;
        }
        let parts = [i, j, l, m].map(|c| self.offsets[c]);
        let offset = (0..4).fold(Rough::default(), |sum, k| {
            sum.plus(weights[k].abs().times(parts[k]))
        });
        offset.sign().filter(|&sign| sign != 0)
    }

    /// Weights of three constraints whose combination has a normal along one axis.
    pub fn weights_of_triple(&self, [i, j, l]: [usize; 3], axis: usize) -> [Rough; 3] {
        [(j, l), (l, i), (i, j)].map(|(a, b)| self.cross(a, b)[axis])
    }

    /// Bound along an axis from a combination of three.
    ///
    /// `None` if rounding hides too much of it.
    pub fn bound(&self, triple: [usize; 3], axis: usize) -> Option<RoughBound> {
        let weights = self.weights_of_triple(triple, axis);
        let [i, j, l] = triple;
        let determinant = self.determinant(i, j, l);
        let length = determinant.value.abs();
        // Twice, as the division below needs a margin too.
        if !(length > 2.0 * determinant.error() && agree(weights)) {
            return None;
        }
        let down = determinant.value < 0.0;
        let flip = weights[0].value < 0.0;
        let offset = (0..3).fold(Rough::default(), |sum, k| {
            sum.plus(weights[k].abs().times(self.offsets[triple[k]]))
        });
        let ratio = offset.value / length;
        let doubt = (offset.error() + ratio.abs() * determinant.error()) / length * 2.0
            + ratio.abs() * ERROR;
        Some(RoughBound {
            direction: axis * 2 + usize::from(down != flip),
            low: ratio - doubt,
            high: ratio + doubt,
        })
    }

    /// Returns `true` if the common line of two planes certainly misses the volume.
    ///
    /// On the line, in homogeneous coordinates, every other constraint is `a + t*b >= 0`.
    pub fn edge_misses(&self, i: usize, j: usize) -> bool {
        let along = self.cross(i, j);
        let weight = dot(along, along);
        if weight.sign() != Some(1) {
            return false;
        }
        let (d, e) = (self.offsets[i], self.offsets[j]);
        let (n, m) = (&self.normals[i], &self.normals[j]);
        let lean = [0, 1, 2].map(|k| e.times(n[k]).plus(d.times(m[k]).negated()));
        let base = cross(&lean, along);
        let others = (0..self.normals.len()).filter(|&c| c != i && c != j);
        let on_line = others.map(|c| {
            let normal = &self.normals[c];
            let a = dot(normal, &base).plus(self.offsets[c].times(weight));
            (a.value + a.error(), dot(normal, along))
        });
        /// Far above the rounding of the few steps below.
        const SLACK: f64 = 1e-12;
        let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
        for (most, b) in on_line.clone() {
            let (slope, error) = (b.value.abs(), b.error());
            if !most.is_finite() || slope <= error {
                continue;
            }
            // Weakest bound of t that the errors allow.
            let error = if most >= 0.0 { -error } else { error };
            let reach = most / (slope + error);
            let reach = reach + reach.abs() * SLACK;
            if b.value > 0.0 {
                from = from.max(-reach);
            } else {
                to = to.min(reach);
            }
        }
        // A plane almost parallel to the line must hold at both ends together.
        let fails = |(most, b): (f64, Rough)| {
            [from, to].into_iter().all(|t| {
                let change = t * b.value;
                let slack = SLACK * (most.abs() + change.abs()) + t.abs() * b.error();
                most + change + slack < 0.0
            })
        };
        from > to || on_line.clone().any(fails)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arithmetic::Expansion;

    fn spaces(planes: &[[f32; 4]]) -> RoughSpaces {
        let constraints: Vec<HalfSpace> = planes
            .iter()
            .map(|&[x, y, z, d]| HalfSpace {
                normal: [x, y, z].map(Into::into),
                d: d.into(),
            })
            .collect();
        RoughSpaces::new(&constraints)
    }

    #[test]
    fn of_a_frustums_fifteen_pairs_the_twelve_edges_may_touch_it() {
        let frustum = spaces(&[
            [1.0, 0.0, -1.0, 0.0],
            [-1.0, 0.0, -1.0, 0.0],
            [0.0, 1.0, -1.0, 0.0],
            [0.0, -1.0, -1.0, 0.0],
            [0.0, 0.0, -1.0, -1.0],
            [0.0, 0.0, 1.0, 8.0],
        ]);
        for i in 0..6 {
            for j in i + 1..6 {
                // Opposite sides meet in front of the near plane. Near and far do not meet, which
                // is not for this filter to decide.
                let opposite = (i, j) == (0, 1) || (i, j) == (2, 3);
                assert_eq!(frustum.edge_misses(i, j), opposite, "{i} {j}");
            }
        }
    }

    #[test]
    fn an_edge_that_touches_in_one_point_is_kept() {
        // A pyramid; two of its faces that are not neighbours meet at its tip.
        let mut pyramid = vec![
            [1.0, 0.0, -1.0, 0.0],
            [-1.0, 0.0, -1.0, 0.0],
            [0.0, 1.0, -1.0, 0.0],
            [0.0, -1.0, -1.0, 0.0],
        ];
        assert!(!spaces(&pyramid).edge_misses(0, 1));
        // Its tip is cut off by the least amount that f64 resolves with certainty.
        pyramid.push([0.0, 0.0, -1.0, -1e-12]);
        assert!(spaces(&pyramid).edge_misses(0, 1));
    }

    /// Certain bounds contain the true ratio, however ill-conditioned.
    #[test]
    fn the_true_bound_lies_within_the_doubt() {
        let mut state = 1u64;
        let mut float = || {
            state = state.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(1);
            (state >> 40) as f32 / (1 << 23) as f32 - 1.0
        };
        let (mut bounds, mut narrow) = (0, 0);
        for case in 0..4000 {
            let mut planes = [[0.0; 4]; 3].map(|p| p.map(|_: f32| float()));
            if case % 2 == 0 {
                // Nearly parallel planes: most digits of the minors cancel.
                let tiny = float() * 1e-4;
                planes[1] = planes[0].map(|x| -x + float() * tiny);
            }
            let spaces = spaces(&planes);
            for axis in 0..3 {
                let Some(bound) = spaces.bound([0, 1, 2], axis) else {
                    continue;
                };
                let [a, b] = [(axis + 1) % 3, (axis + 2) % 3];
                let exact = |x: f32| Expansion::from(x);
                let mut n = Expansion::ZERO;
                let mut d = Expansion::ZERO;
                for (first, i, j) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
                    let [p, q] = [&planes[i], &planes[j]];
                    let weight = &Expansion::product(p[a].into(), q[b].into())
                        - &Expansion::product(p[b].into(), q[a].into());
                    let weight = weight.abs();
                    n = &n + &(&weight * &exact(planes[first][axis]));
                    d = &d + &(&weight * &exact(planes[first][3]));
                }
                assert_eq!(bound.direction, axis * 2 + usize::from(n.sign() < 0));
                let n = n.abs();
                let above = &d - &(&n * &Expansion::from(bound.low));
                let below = &(&n * &Expansion::from(bound.high)) - &d;
                assert!(above.sign() >= 0 && below.sign() >= 0, "{planes:?}");
                bounds += 1;
                narrow += u32::from(bound.high - bound.low < 1e-9);
            }
        }
        assert!(bounds > 1000 && narrow * 3 > bounds, "{bounds}, {narrow}");
    }

    #[test]
    fn signs_are_only_told_where_rounding_cannot_matter() {
        let rough = |value, size| Rough { value, size };
        assert_eq!(rough(0.0, 0.0).sign(), Some(0));
        assert_eq!(rough(1e-12, 1.0).sign(), Some(1));
        assert_eq!(rough(-1e-15, 1.0).sign(), None);
        assert_eq!(rough(0.0, 1.0).sign(), None);
        assert!(may_agree([rough(1.0, 1.0), rough(0.0, 1.0)]));
        assert!(!may_agree([rough(1.0, 1.0), rough(0.0, 0.0)]));
        assert!(!may_agree([rough(1.0, 1.0), rough(-1.0, 1.0)]));
    }
}
