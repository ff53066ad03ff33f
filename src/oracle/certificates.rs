//! From half-spaces to certificates: every way in which at most four of them
//! together can shut out a box. Testing boxes against certificates is the next
//! file's business.
//!
//! P is the intersection of half-spaces `n_i.x + d_i >= 0`, B a box. By
//! Farkas' lemma they have no common point iff some non-negative combination
//! `N.x + D` of the constraints (N = sum l_i n_i, D = sum l_i d_i) is negative
//! on all of B, that is, at its p-vertex. That maximum is linear in the l_i
//! wherever the signs of N do not change, so its least value over the cone of
//! all l is reached on an extreme ray of such a piece: a combination of m
//! constraints with m - 1 components of N zero. One constraint gives the
//! planes themselves; two with one zero component the shadows of P along an
//! axis (the cross products of an edge with an axis, in other words); three
//! with two the bounds of P along an axis; four with N = 0 say that P itself
//! is empty. Only products and sums occur: no division, no vertices, nothing
//! that asks P to be bounded. (Motzkin's transposition theorem says the same
//! of open half-spaces with "not positive" in place of "negative": a least
//! value of zero is a touch.)

use super::number::{Number, Precision};

/// One constraint `normal . x + d >= 0`.
#[derive(Clone, Debug)]
pub(super) struct HalfSpace {
    pub normal: [Number; 3],
    pub d: Number,
}

/// What a volume is before any box is looked at.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Extent {
    /// No point satisfies all constraints.
    Empty,
    /// Points, but none that satisfies them all strictly: nothing is more than
    /// touched.
    Flat,
    /// An interior.
    Solid,
}

/// The certificates of a volume, faces first, then bounds, then shadows.
pub(super) struct Certificates {
    pub extent: Extent,
    pub faces: usize,
    pub all: Vec<HalfSpace>,
}

/// All certificates of the half-spaces. O(m^4) for m of them; a few hundred
/// exact sums for the six of a frustum.
pub(super) fn certificates(given: &[HalfSpace], precision: Precision) -> Certificates {
    let mut search = Search {
        precision,
        extent: Extent::Solid,
        found: Vec::new(),
    };
    // A zero normal is no constraint, or one that nothing satisfies.
    let mut constraints = Vec::with_capacity(given.len());
    for constraint in given {
        let is_zero = constraint.normal.iter().all(|n| precision.sign(n) == 0);
        match (is_zero, precision.sign(&constraint.d)) {
            (true, -1) => search.extent = Extent::Empty,
            (true, _) => {}
            (false, _) => constraints.push(constraint.clone()),
        }
    }
    let minors = Minors::new(&constraints, precision);
    search.quadruples(&constraints, &minors);
    if search.extent == Extent::Empty {
        return Certificates {
            extent: Extent::Empty,
            faces: 0,
            all: Vec::new(),
        };
    }
    search.triples(&constraints, &minors);
    keep_tightest(&mut search.found);
    let mut all = constraints.clone();
    all.append(&mut search.found);
    search.pairs(&constraints);
    all.append(&mut search.found);
    Certificates {
        extent: search.extent,
        faces: constraints.len(),
        all,
    }
}

/// The two other axes, in the order that makes a determinant of them.
const OTHERS: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];

/// The 2 x 2 minors `n_i[a] n_j[b] - n_i[b] n_j[a]` of every pair, by the axis
/// that is left out.
struct Minors {
    count: usize,
    minors: Vec<[Number; 3]>,
}

impl Minors {
    fn new(constraints: &[HalfSpace], precision: Precision) -> Minors {
        let count = constraints.len();
        let mut minors = Vec::with_capacity(count * count);
        for i in constraints {
            for j in constraints {
                minors.push(OTHERS.map(|[a, b]| {
                    let [n, m] = [&i.normal, &j.normal];
                    precision.determinant([&n[a], &n[b], &m[a], &m[b]])
                }));
            }
        }
        Minors { count, minors }
    }

    fn of(&self, i: usize, j: usize) -> &[Number; 3] {
        &self.minors[i * self.count + j]
    }
}

struct Search {
    precision: Precision,
    extent: Extent,
    found: Vec<HalfSpace>,
}

impl Search {
    /// A combination of constraints: a certificate, or, if nothing is left of
    /// the normal, a verdict about the volume itself.
    fn take(&mut self, parts: &[(&Number, &HalfSpace)], zero_axes: [bool; 3]) {
        let p = self.precision;
        let sum = |of: &dyn Fn(&HalfSpace) -> Number| {
            let products = parts.iter().map(|(l, c)| p.multiply(l, &of(c)));
            let total = products.reduce(|a, b| p.add(&a, &b)).unwrap_or_default();
            p.cleaned(total)
        };
        let normal = [0, 1, 2].map(|k| {
            if zero_axes[k] {
                Number::default()
            } else {
                sum(&|c| c.normal[k].clone())
            }
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

    /// Two constraints that pull an axis both ways.
    fn pairs(&mut self, constraints: &[HalfSpace]) {
        for (i, first) in constraints.iter().enumerate() {
            for second in &constraints[i + 1..] {
                for k in 0..3 {
                    let (a, b) = (&first.normal[k], &second.normal[k]);
                    if self.precision.sign(a) * self.precision.sign(b) >= 0 {
                        continue;
                    }
                    let weights = [b.absolute(), a.absolute()];
                    let mut zero = [false; 3];
                    zero[k] = true;
                    self.take(&[(&weights[0], first), (&weights[1], second)], zero);
                }
            }
        }
    }

    /// Three constraints whose normals leave one axis only.
    fn triples(&mut self, constraints: &[HalfSpace], minors: &Minors) {
        let count = constraints.len();
        for i in 0..count {
            for j in i + 1..count {
                for l in j + 1..count {
                    for axis in 0..3 {
                        let weights = [(j, l), (l, i), (i, j)].map(|(a, b)| &minors.of(a, b)[axis]);
                        let Some(weights) = self.of_one_sign(weights) else {
                            continue;
                        };
                        let mut zero = [true; 3];
                        zero[axis] = false;
                        let [a, b, c] = &weights;
                        let parts = [
                            (a, &constraints[i]),
                            (b, &constraints[j]),
                            (c, &constraints[l]),
                        ];
                        self.take(&parts, zero);
                    }
                }
            }
        }
    }

    /// Four constraints that leave no axis at all.
    fn quadruples(&mut self, constraints: &[HalfSpace], minors: &Minors) {
        let count = constraints.len();
        let p = self.precision;
        let index = |i: usize, j: usize, l: usize| (i * count + j) * count + l;
        let mut determinants = vec![Number::default(); count * count * count];
        for i in 0..count {
            for j in i + 1..count {
                for l in j + 1..count {
                    // Along the first normal.
                    let minor = minors.of(j, l);
                    let products = (0..3).map(|k| p.multiply(&constraints[i].normal[k], &minor[k]));
                    let total = products.reduce(|a, b| p.add(&a, &b)).unwrap_or_default();
                    determinants[index(i, j, l)] = total;
                }
            }
        }
        for i in 0..count {
            for j in i + 1..count {
                for l in j + 1..count {
                    for m in l + 1..count {
                        let second = determinants[index(i, l, m)].negated();
                        let fourth = determinants[index(i, j, l)].negated();
                        let weights = [
                            &determinants[index(j, l, m)],
                            &second,
                            &determinants[index(i, j, m)],
                            &fourth,
                        ];
                        let Some(weights) = self.of_one_sign(weights) else {
                            continue;
                        };
                        let [a, b, c, d] = &weights;
                        let parts = [
                            (a, &constraints[i]),
                            (b, &constraints[j]),
                            (c, &constraints[l]),
                            (d, &constraints[m]),
                        ];
                        self.take(&parts, [true; 3]);
                    }
                }
            }
        }
    }

    /// The weights made positive, if all are strictly of one sign: where one is
    /// zero, fewer constraints say the same.
    fn of_one_sign<const N: usize>(&self, weights: [&Number; N]) -> Option<[Number; N]> {
        let sign = self.precision.sign(weights[0]);
        let agree = sign != 0 && weights.iter().all(|w| self.precision.sign(w) == sign);
        agree.then(|| weights.map(Number::absolute))
    }
}

/// Of the bounds along each direction of an axis keeps the tightest, and
/// whatever rounding cannot tell from it.
fn keep_tightest(bounds: &mut Vec<HalfSpace>) {
    /// Far above the rounding of the two estimates that make a ratio.
    const DOUBT: f64 = 1e-12;
    let placed = |b: &HalfSpace| {
        let (axis, n) = (0..3)
            .map(|k| (k, b.normal[k].estimate()))
            .find(|(_, n)| *n != 0.0)?;
        Some((axis * 2 + usize::from(n < 0.0), b.d.estimate() / n.abs()))
    };
    let mut best = [f64::INFINITY; 6];
    for (direction, ratio) in bounds.iter().filter_map(placed) {
        best[direction] = best[direction].min(ratio);
    }
    bounds.retain(|b| {
        placed(b).is_some_and(|(direction, ratio)| {
            ratio <= best[direction] + DOUBT * best[direction].abs()
        })
    });
}
