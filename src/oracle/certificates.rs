//! Certificates of half-spaces: combinations of at most four that exclude a box.
//!
//! Boxes are tested against certificates in `evaluate`.
//!
//! P is the intersection of half-spaces `n_i.x + d_i >= 0`, B a box. By Farkas' lemma they have no
//! common point iff some non-negative combination `N.x + D` of the constraints (N = sum l_i n_i, D
//! = sum l_i d_i) is negative on all of B, that is, at its p-vertex. That maximum is linear in the
//! l_i wherever the signs of N do not change, so its least value over the cone of all l is reached
//! on an extreme ray of such a piece: a combination of m constraints with m - 1 components of N
//! zero. One constraint gives the planes themselves. Two with one zero component give the shadows
//! of P along an axis (in other words, the cross products of an edge with an axis). Three with two
//! zero components give the bounds of P along an axis. Four with N = 0 state that P itself is
//! empty. Only products and sums occur: no division, no vertices, and P need not be bounded.
//! (Motzkin's transposition theorem states the same of open half-spaces with "not positive" in
//! place of "negative": a least value of zero is a touch.)

use std::cell::OnceCell;

use super::evaluate::{HalfSpace, Number, Precision};
use super::rough::{RoughSpaces, may_agree};
use crate::arithmetic::combinations;

/// Extent of a volume, independent of the box.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Debug)]
pub(super) enum Extent {
    /// No point satisfies all constraints.
    #[default]
    Empty,
    /// Some points satisfy all constraints, but none strictly.
    ///
    /// A box can at most touch the volume.
    Flat,
    /// The volume has an interior.
    Solid,
}

/// Certificates of a volume: its faces, and its bounds and shadows.
///
/// These are all certificates that can be the tightest for some box. O(m^4) steps in f64 for m
/// half-spaces; exact sums only for those that are kept and where rounding could matter.
pub(super) fn certificates(given: Vec<HalfSpace>, p: Precision) -> (Extent, [Vec<HalfSpace>; 2]) {
    // A zero normal is no constraint, or one that no point satisfies.
    let mut constraints = Vec::with_capacity(given.len());
    for constraint in given {
        let is_zero = constraint.normal.iter().all(|n| p.sign(n) == 0);
        match (is_zero, p.sign(&constraint.d)) {
            (true, -1) => return Default::default(),
            (true, _) => {}
            (false, _) => constraints.push(constraint),
        }
    }
    let mut search = Search {
        precision: p,
        rough: RoughSpaces::new(&constraints),
        minors: vec![Default::default(); constraints.len() * constraints.len()],
        constraints,
        extent: Extent::Solid,
        found: Vec::new(),
    };
    search.quadruples();
    search.triples();
    keep_tightest(&mut search.found);
    let bounds = search.found.len();
    search.pairs(true);
    if search.extent == Extent::Flat {
        // Edges are not defined without an interior: keep all.
        search.found.truncate(bounds);
        search.pairs(false);
    }
    if search.extent == Extent::Empty {
        return Default::default();
    }
    (search.extent, [search.constraints, search.found])
}

/// The two other axes, in the order of the determinant's sign.
const OTHERS: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];

struct Search {
    precision: Precision,
    constraints: Vec<HalfSpace>,
    rough: RoughSpaces,
    /// Minors computed so far, indexed by both constraints and the omitted axis.
    minors: Vec<[OnceCell<Number>; 3]>,
    extent: Extent,
    found: Vec<HalfSpace>,
}

impl Search {
    /// The 2 x 2 minor `n_i[a] n_j[b] - n_i[b] n_j[a]` that omits `axis`.
    fn minor(&self, i: usize, j: usize, axis: usize) -> &Number {
        self.minors[i * self.constraints.len() + j][axis].get_or_init(|| {
            let [a, b] = OTHERS[axis];
            let [n, m] = [i, j].map(|c| &self.constraints[c].normal);
            self.precision.determinant([&n[a], &n[b], &m[a], &m[b]])
        })
    }

    fn determinant(&self, i: usize, j: usize, l: usize) -> Number {
        let first = &self.constraints[i].normal;
        self.precision
            .combined((0..3).map(|k| (&first[k], self.minor(j, l, k))))
    }

    /// Adds a combination of constraints as a certificate.
    ///
    /// If its normal is zero, it is a verdict about the volume itself.
    fn take<const N: usize>(
        &mut self,
        weights: &[Number; N],
        parts: [usize; N],
        zero_axes: [bool; 3],
    ) {
        let p = self.precision;
        let parts = parts.map(|c| &self.constraints[c]);
        let sum = |of: &dyn Fn(&HalfSpace) -> Number| {
            let values = parts.map(of);
            p.cleaned(p.combined(weights.iter().zip(&values)))
        };
        let normal = [0, 1, 2].map(|k| match zero_axes[k] {
            true => Number::default(),
            false => sum(&|c| c.normal[k].clone()),
        });
        let d = sum(&|c| c.d.clone());
        if normal.iter().any(|n| p.sign(n) != 0) {
            self.found.push(HalfSpace { normal, d });
            return;
        }
        let verdict = match p.sign(&d) {
            -1 => Extent::Empty,
            0 => Extent::Flat,
            _ => Extent::Solid,
        };
        self.extent = self.extent.min(verdict);
    }

    /// Adds certificates of two constraints whose normals differ in sign on an axis.
    ///
    /// In a volume with an interior only pairs that share an edge matter (`only_edges`): each face
    /// of the boundary of {p - b : p in P, b in B} comes from a face of one and a corner of the
    /// other, or from an edge of each. If an edge of P is involved, two planes through that edge
    /// make the certificate.
    fn pairs(&mut self, only_edges: bool) {
        for [i, j] in combinations(self.constraints.len()) {
            if only_edges && self.rough.edge_misses(i, j) {
                continue;
            }
            for k in 0..3 {
                let [a, b] = [i, j].map(|c| &self.constraints[c].normal[k]);
                if self.precision.sign(a) * self.precision.sign(b) >= 0 {
                    continue;
                }
                let weights = [b.absolute(), a.absolute()];
                self.take(&weights, [i, j], [0, 1, 2].map(|axis| axis == k));
            }
        }
    }

    /// Adds certificates of three constraints whose sum is along one axis.
    ///
    /// Only the tightest of those that bound the same direction is needed.
    fn triples(&mut self) {
        let mut candidates = Vec::new();
        let mut best = [f64::INFINITY; 6];
        for triple in combinations(self.constraints.len()) {
            for axis in 0..3 {
                if !may_agree(self.rough.weights_of_triple(triple, axis)) {
                    continue;
                }
                let bound = self.rough.bound(triple, axis);
                if let Some(bound) = &bound {
                    let best = &mut best[bound.direction];
                    if bound.low > *best {
                        continue;
                    }
                    *best = best.min(bound.high);
                }
                candidates.push((triple, axis, bound));
            }
        }
        for (triple, axis, bound) in candidates {
            if bound.is_some_and(|b| b.low > best[b.direction]) {
                continue;
            }
            let [i, j, l] = triple;
            let weights = [(j, l), (l, i), (i, j)].map(|(a, b)| self.minor(a, b, axis).clone());
            if let Some(weights) = self.of_one_sign(weights) {
                self.take(&weights, triple, [0, 1, 2].map(|k| k != axis));
            }
        }
    }

    /// Tests combinations of four constraints with a zero normal.
    fn quadruples(&mut self) {
        for quadruple in combinations(self.constraints.len()) {
            match self.rough.quadruple(quadruple) {
                Some(1) => {}
                Some(_) => self.extent = Extent::Empty,
                None => self.quadruple(quadruple),
            }
            if self.extent == Extent::Empty {
                return;
            }
        }
    }

    fn quadruple(&mut self, [i, j, l, m]: [usize; 4]) {
        let weights = [
            self.determinant(j, l, m),
            self.determinant(i, l, m).negated(),
            self.determinant(i, j, m),
            self.determinant(i, j, l).negated(),
        ];
        if let Some(weights) = self.of_one_sign(weights) {
            self.take(&weights, [i, j, l, m], [true; 3]);
        }
    }

    /// Makes the weights positive if all are strictly of one sign; else `None`.
    ///
    /// If a weight is zero, fewer constraints give the same certificate.
    fn of_one_sign<const N: usize>(&self, weights: [Number; N]) -> Option<[Number; N]> {
        let sign = self.precision.sign(&weights[0]);
        let agree = sign != 0 && weights.iter().all(|w| self.precision.sign(w) == sign);
        agree.then(|| weights.map(|w| w.absolute()))
    }
}

/// Keeps the tightest bound in each axis direction.
///
/// Also keeps those that rounding cannot distinguish from it.
fn keep_tightest(bounds: &mut Vec<HalfSpace>) {
    /// Far above the rounding of the two estimates that make a ratio.
    const DOUBT: f64 = 1e-12;
    let placed = |b: &HalfSpace| {
        let mut sizes = (0..3).map(|k| (k, b.normal[k].estimate()));
        let (axis, n) = sizes.find(|(_, n)| *n != 0.0)?;
        Some((axis * 2 + usize::from(n < 0.0), b.d.estimate() / n.abs()))
    };
    let mut best = [f64::INFINITY; 6];
    for (direction, ratio) in bounds.iter().filter_map(placed) {
        best[direction] = best[direction].min(ratio);
    }
    let most = best.map(|best| best + DOUBT * best.abs());
    bounds.retain(|b| placed(b).is_some_and(|(direction, ratio)| ratio <= most[direction]));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arithmetic::Expansion;

    #[test]
    fn of_two_bounds_that_rounding_swaps_both_are_kept() {
        let half_ulp = f64::EPSILON / 4.0;
        let bound = |n: Expansion, d: Expansion| HalfSpace {
            normal: [n.into(), Number::default(), Number::default()],
            d: d.into(),
        };
        let one = Expansion::from(1.0);
        let sum = |a: f64, b: f64| &Expansion::from(a) + &Expansion::from(b);
        // 1 / (1 + 0.9 h) is less than 1 - 0.6 h, but in f64 these are 1 and 1 - h.
        let tightest = bound(sum(1.0, 1.8 * half_ulp), one.clone());
        let other = bound(one.clone(), sum(1.0 - 2.0 * half_ulp, 0.8 * half_ulp));
        let loose = bound(one.clone(), sum(1.0, 1e-9));
        let mut bounds = vec![loose, other.clone(), tightest.clone()];
        keep_tightest(&mut bounds);
        let offsets: Vec<f64> = bounds.iter().map(|b| b.d.estimate()).collect();
        assert_eq!(offsets, [other.d.estimate(), 1.0]);
        assert!(other.d.estimate() < 1.0 && tightest.normal[0].estimate() == 1.0);
    }
}
