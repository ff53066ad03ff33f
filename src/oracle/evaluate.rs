//! Numbers of the oracle, and the value of a certificate at a box.
//!
//! Numbers are exact, or precise to a stated number of terms; each has the sum of the magnitudes it
//! came from, which separates a sign from noise. Values are in f64 with a bound of their error, or
//! exact.

use glam::DVec3;

use crate::arithmetic::{Expansion, two_product, two_sum};
use crate::geometry::PlaneF64;

/// Precision of the calculations.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Precision {
    /// Leading terms kept of every result, also in calculations with roots and series.
    pub terms: usize,
    /// Relative size up to which a number counts as zero.
    tolerance: f64,
}

impl Precision {
    /// Exact arithmetic, for planes that are exact objects.
    pub const EXACT: Precision = Precision {
        terms: usize::MAX,
        tolerance: 0.0,
    };

    /// About 250 bits, 100 of which are a guard.
    ///
    /// For planes that only exist as real numbers (roots, tangents).
    pub const CAMERA: Precision = Precision {
        terms: 5,
        tolerance: f64::from_bits((1023 - 150) << 52),
    };

    pub fn is_exact(self) -> bool {
        self.tolerance == 0.0
    }

    fn truncate(self, value: Expansion) -> Expansion {
        match value.terms().len() > self.terms {
            true => value.leading(self.terms),
            false => value,
        }
    }

    pub fn add(self, a: &Number, b: &Number) -> Number {
        Number::new(self.truncate(&a.value + &b.value), a.size + b.size)
    }

    pub fn subtract(self, a: &Number, b: &Number) -> Number {
        self.add(a, &b.negated())
    }

    pub fn multiply(self, a: &Number, b: &Number) -> Number {
        Number::new(self.truncate(&a.value * &b.value), a.size * b.size)
    }

    /// Sum of products.
    pub fn combined<'a>(self, products: impl Iterator<Item = (&'a Number, &'a Number)>) -> Number {
        let products = products.map(|(a, b)| self.multiply(a, b));
        products.reduce(|a, b| self.add(&a, &b)).unwrap_or_default()
    }

    /// Computes `a*d - b*c`.
    pub fn determinant(self, [a, b, c, d]: [&Number; 4]) -> Number {
        self.subtract(&self.multiply(a, d), &self.multiply(b, c))
    }

    /// Returns `true` if a value may be zero, given its size.
    pub fn is_noise(self, value: f64, size: f64) -> bool {
        value.abs() <= self.tolerance * size
    }

    /// Sign -1, 0 or 1; 0 also if the number may be only noise.
    pub fn sign(self, a: &Number) -> i32 {
        match self.is_noise(a.value.estimate(), a.size) {
            true => 0,
            false => a.value.sign(),
        }
    }

    /// The number, or an exact zero if it may be only noise.
    pub fn cleaned(self, a: Number) -> Number {
        match self.sign(&a) {
            0 => Number::new(Expansion::ZERO, a.size),
            _ => a,
        }
    }
}

/// Half-space `normal . x + d >= 0`.
#[derive(Clone, Debug)]
pub(super) struct HalfSpace {
    pub normal: [Number; 3],
    pub d: Number,
}

/// A value with its size: the sum of the magnitudes it came from.
#[derive(Clone, Default, Debug)]
pub(super) struct Number {
    pub value: Expansion,
    pub size: f64,
}

impl<T: Into<Expansion>> From<T> for Number {
    fn from(value: T) -> Self {
        let value = value.into();
        let size = value.estimate().abs();
        Number { value, size }
    }
}

impl Number {
    fn new(value: Expansion, size: f64) -> Number {
        Number { value, size }
    }

    pub fn negated(&self) -> Number {
        Number::new(-&self.value, self.size)
    }

    pub fn absolute(&self) -> Number {
        Number::new(self.value.clone().abs(), self.size)
    }

    pub fn estimate(&self) -> f64 {
        self.value.estimate()
    }
}

/// Certificate in full precision.
#[derive(Clone, Debug)]
pub(super) struct Exact {
    /// Axis and value of each term of the coefficients, smallest first.
    terms: Vec<(usize, f64)>,
    d: Vec<f64>,
    /// Magnitudes before cancellation, per axis.
    size: DVec3,
    size_of_d: f64,
}

/// Bound of the filter's error relative to its magnitude.
///
/// Three coefficients and an offset rounded once (2^-53 each), three products and three sums.
const FILTER_ERROR: f64 = 16.0 * f64::EPSILON;

/// Bounds of a box in f64.
pub(super) struct Corners {
    pub min: DVec3,
    pub max: DVec3,
}

impl Corners {
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }
}

impl HalfSpace {
    /// Filter of a certificate: f64, each coefficient rounded once.
    pub fn rounded(&self) -> PlaneF64 {
        let normal = self.normal.each_ref().map(Number::estimate);
        PlaneF64::new(normal.into(), self.d.estimate())
    }
}

/// Value of a filter at the p-vertex and a bound of its error.
#[inline(always)]
pub(super) fn at_p_vertex(filter: &PlaneF64, b: &Corners) -> (f64, f64) {
    let looks_up = filter.normal.cmpge(DVec3::ZERO);
    at(filter, DVec3::select(looks_up, b.max, b.min))
}

/// Value of a filter at a point and a bound of its error.
#[inline(always)]
pub(super) fn at(filter: &PlaneF64, point: DVec3) -> (f64, f64) {
    let error = FILTER_ERROR * filter.size_at(point);
    (filter.value_at(point), error)
}

impl Exact {
    pub fn new(certificate: &HalfSpace) -> Exact {
        let mut terms = Vec::new();
        for (axis, n) in certificate.normal.iter().enumerate() {
            terms.extend(n.value.terms().iter().map(|&term| (axis, term)));
        }
        Exact {
            terms,
            d: certificate.d.value.terms().to_vec(),
            size: certificate.normal.each_ref().map(|n| n.size).into(),
            size_of_d: certificate.d.size,
        }
    }

    /// Value at the p-vertex, rounded; its sign is exact. Noise gives zero.
    pub fn at_p_vertex(&self, b: &Corners, precision: Precision) -> f64 {
        // The sign of a coefficient is that of its largest, last term.
        let mut corner = b.max;
        for &(k, term) in &self.terms {
            corner[k] = if term >= 0.0 { b.max[k] } else { b.min[k] };
        }
        let products = self.terms.iter().flat_map(|&(k, term)| {
            let (product, rest) = two_product(term, corner[k]);
            [rest, product]
        });
        let parts = products.chain(self.d.iter().copied());
        // Most ties are between short numbers, which sum without loss.
        let (mut value, mut lost) = (0.0_f64, 0.0);
        for part in parts.clone() {
            let (sum, error) = two_sum(value, part);
            value = sum;
            lost += error.abs();
        }
        if lost != 0.0 {
            value = Expansion::sum(parts).estimate();
        }
        if !precision.is_exact() {
            let size = self.size.dot(corner.abs()) + self.size_of_d;
            if precision.is_noise(value, size) {
                return 0.0;
            }
        }
        value
    }
}

/// Point inside all faces: the mean of the corners.
///
/// `None` with fewer than four corners. Only a hint, so f64 is enough.
pub(super) fn inner_point(faces: &[PlaneF64]) -> Option<DVec3> {
    let corners = PlaneF64::corners(faces);
    let sum: DVec3 = corners.iter().sum();
    (corners.len() >= 4).then(|| sum / corners.len() as f64)
}
