//! Numbers of the oracle: exact, or precise to a stated number of terms.
//!
//! Each has the sum of the magnitudes it came from, which separates a sign from noise.

use crate::arithmetic::Expansion;

/// How exactly to calculate.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Precision {
    /// Leading terms kept of every result.
    terms: usize,
    /// A number not above this part of its size is taken for zero.
    tolerance: f64,
}

impl Precision {
    /// No error at all: for planes that are exact objects.
    pub const EXACT: Precision = Precision {
        terms: usize::MAX,
        tolerance: 0.0,
    };

    /// About 250 bits, of which 100 are kept as a guard: for planes that only
    /// exist as real numbers (roots, tangents).
    pub const CAMERA: Precision = Precision {
        terms: 5,
        tolerance: f64::from_bits((1023 - 150) << 52),
    };

    pub fn is_exact(self) -> bool {
        self.tolerance == 0.0
    }

    /// The terms that calculations with roots and series should keep.
    pub fn terms(self) -> usize {
        self.terms
    }

    fn cut(self, value: Expansion) -> Expansion {
        match value.terms().len() > self.terms {
            true => value.leading(self.terms),
            false => value,
        }
    }

    pub fn add(self, a: &Number, b: &Number) -> Number {
        Number::new(self.cut(&a.value + &b.value), a.size + b.size)
    }

    pub fn subtract(self, a: &Number, b: &Number) -> Number {
        self.add(a, &b.negated())
    }

    pub fn multiply(self, a: &Number, b: &Number) -> Number {
        Number::new(self.cut(&a.value * &b.value), a.size * b.size)
    }

    /// The sum of products.
    pub fn combined<'a>(self, products: impl Iterator<Item = (&'a Number, &'a Number)>) -> Number {
        let products = products.map(|(a, b)| self.multiply(a, b));
        products.reduce(|a, b| self.add(&a, &b)).unwrap_or_default()
    }

    /// `a*d - b*c`.
    pub fn determinant(self, [a, b, c, d]: [&Number; 4]) -> Number {
        self.subtract(&self.multiply(a, d), &self.multiply(b, c))
    }

    /// Returns whether a value may be zero, given its size.
    pub fn is_noise(self, value: f64, size: f64) -> bool {
        value.abs() <= self.tolerance * size
    }

    /// -1, 0 or 1; 0 also for what may be nothing but noise.
    pub fn sign(self, a: &Number) -> i32 {
        match self.is_noise(a.value.estimate(), a.size) {
            true => 0,
            false => a.value.sign(),
        }
    }

    /// The number, or a clean zero if it may be nothing but noise.
    pub fn cleaned(self, a: Number) -> Number {
        match self.sign(&a) {
            0 => Number::new(Expansion::ZERO, a.size),
            _ => a,
        }
    }
}

/// One constraint `normal . x + d >= 0`.
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

impl From<Expansion> for Number {
    fn from(value: Expansion) -> Self {
        let size = value.estimate().abs();
        Number { value, size }
    }
}

impl From<f32> for Number {
    fn from(value: f32) -> Self {
        Expansion::from(value).into()
    }
}

impl From<f64> for Number {
    fn from(value: f64) -> Self {
        Expansion::from(value).into()
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
        match self.value.sign() {
            -1 => self.negated(),
            _ => self.clone(),
        }
    }

    pub fn estimate(&self) -> f64 {
        self.value.estimate()
    }
}
