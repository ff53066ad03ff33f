//! Exact arithmetic on doubles: numbers as sums of non-overlapping terms.
//!
//! Shewchuk 1997, "Adaptive precision floating-point arithmetic and fast robust geometric
//! predicates", Discrete & Computational Geometry 18, p. 305. Truncated to their leading terms, the
//! same sums are multiple-precision arithmetic.

use std::ops::{Add, Mul, Neg, Sub};

/// `a + b` as the rounded sum and its rounding error.
///
/// Exact unless the sum overflows: Knuth, The Art of Computer Programming 2, 4.2.2, theorem B.
#[inline(always)]
pub fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let virtual_b = sum - a;
    let virtual_a = sum - virtual_b;
    (sum, (a - virtual_a) + (b - virtual_b))
}

/// `a * b` as the rounded product and its rounding error (Dekker 1971).
///
/// Exact while the product and its parts neither overflow nor underflow: for |a|, |b| below 2^995
/// and a product of zero or above 2^-960.
#[inline]
pub fn two_product(a: f64, b: f64) -> (f64, f64) {
    // Veltkamp's splitting into 26 + 26 bits.
    let split = |x: f64| {
        let c = 134_217_729.0 * x;
        let high = c - (c - x);
        (high, x - high)
    };
    let product = a * b;
    let ((a_high, a_low), (b_high, b_low)) = (split(a), split(b));
    let rest = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low;
    (product, rest)
}

/// A real number as an exact sum of doubles.
///
/// Terms ascend, are not zero and do not overlap; the number without terms is zero. Sums and
/// products are exact as long as no term overflows or underflows (products of up to five f32 values
/// never do). [`Expansion::leading`] truncates a number to a few terms: floating-point arithmetic
/// of about 50 bits per term.
#[derive(Clone, Default, PartialEq, Debug)]
pub struct Expansion {
    terms: Vec<f64>,
}

impl From<f64> for Expansion {
    fn from(value: f64) -> Self {
        let terms = if value == 0.0 { vec![] } else { vec![value] };
        Expansion { terms }
    }
}

impl From<f32> for Expansion {
    fn from(value: f32) -> Self {
        f64::from(value).into()
    }
}

impl Expansion {
    /// The sum of no terms.
    pub const ZERO: Expansion = Expansion { terms: Vec::new() };

    /// The exact sum of some doubles.
    pub fn sum(terms: impl IntoIterator<Item = f64>) -> Expansion {
        let mut sum = Expansion::ZERO;
        terms.into_iter().for_each(|term| sum.grow(term));
        sum
    }

    /// The exact product of two doubles (bounds as [`two_product`]).
    pub fn product(a: f64, b: f64) -> Expansion {
        let (product, rest) = two_product(a, b);
        &Expansion::from(rest) + &Expansion::from(product)
    }

    /// The terms, smallest first.
    pub fn terms(&self) -> &[f64] {
        &self.terms
    }

    /// The sign, -1, 0 or 1: the largest term outweighs all others together.
    pub fn sign(&self) -> i32 {
        match self.terms.last() {
            None => 0,
            Some(&top) if top > 0.0 => 1,
            Some(_) => -1,
        }
    }

    /// The nearest double, up to an ulp.
    pub fn estimate(&self) -> f64 {
        self.terms.iter().sum()
    }

    /// Times `2^exponent`; exact, except for terms that leave the range of f64.
    pub fn scaled(&self, exponent: i32) -> Expansion {
        let scaled = self.terms.iter().map(|&term| libm::ldexp(term, exponent));
        Expansion {
            terms: scaled.filter(|&term| term != 0.0).collect(),
        }
    }

    /// Adds a double, exactly (GROW-EXPANSION with zeros omitted).
    pub fn grow(&mut self, value: f64) {
        // Terms below half an ulp of the value are unchanged.
        const TWO_54: f64 = (1u64 << 54) as f64;
        let untouched = |term: &f64| term.abs() * TWO_54 < value.abs();
        let above = self.terms.iter().rev().position(untouched);
        let start = above.map_or(0, |above| self.terms.len() - above);
        let mut carry = value;
        let mut kept = start;
        for i in start..self.terms.len() {
            let (sum, lost) = two_sum(carry, self.terms[i]);
            if lost != 0.0 {
                self.terms[kept] = lost;
                kept += 1;
            }
            carry = sum;
        }
        self.terms.truncate(kept);
        if carry != 0.0 {
            self.terms.push(carry);
        }
    }

    /// The same number in as few terms as possible (COMPRESS).
    ///
    /// Each is the rounded sum of itself and all smaller ones.
    pub fn compressed(mut self) -> Expansion {
        let Some(mut top) = self.terms.pop() else {
            return self;
        };
        // Downwards: the largest terms absorb as much as they can.
        let mut packed = Vec::with_capacity(self.terms.len() + 1);
        for &term in self.terms.iter().rev() {
            let (sum, lost) = two_sum(top, term);
            if lost == 0.0 {
                top = sum;
            } else {
                packed.push(sum);
                top = lost;
            }
        }
        packed.push(top);
        // Upwards: merges what remains.
        let mut terms = Vec::with_capacity(packed.len());
        let mut below = packed.pop().unwrap_or(0.0);
        while let Some(term) = packed.pop() {
            let (sum, lost) = two_sum(term, below);
            if lost != 0.0 {
                terms.push(lost);
            }
            below = sum;
        }
        if below != 0.0 {
            terms.push(below);
        }
        Expansion { terms }
    }

    /// The `count` leading terms, with a relative error below 2^(-52 * count).
    pub fn leading(self, count: usize) -> Expansion {
        let mut cut = self.compressed();
        let surplus = cut.terms.len().saturating_sub(count);
        cut.terms.drain(..surplus);
        cut
    }

    /// The absolute value.
    pub fn abs(self) -> Expansion {
        if self.sign() < 0 { -&self } else { self }
    }

    /// `self / divisor` to `count` terms, by long division; `divisor` is not zero.
    pub fn over(&self, divisor: f64, count: usize) -> Expansion {
        let mut quotient = Expansion::ZERO;
        let mut rest = self.clone();
        // Every digit reduces the remainder by a factor of about 2^-50.
        for _ in 0..=count {
            let digit = rest.estimate() / divisor;
            quotient.grow(digit);
            let (product, lost) = two_product(digit, divisor);
            rest.grow(-lost);
            rest.grow(-product);
        }
        quotient.leading(count)
    }

    /// `1 / self` to `count` terms, by Newton's iteration; infinite for zero.
    pub fn reciprocal(&self, count: usize) -> Expansion {
        let two = Expansion::from(2.0);
        let mut x = Expansion::from(1.0 / self.estimate());
        // Each step doubles the number of correct bits, from 50 on.
        for _ in 0..=count.ilog2() + 1 {
            let residual = (&two - &(self * &x)).leading(count + 1);
            x = (&x * &residual).leading(count + 1);
        }
        x.leading(count)
    }

    /// The square root of a non-negative number to `count` terms.
    ///
    /// Newton's iteration for `1/sqrt`.
    pub fn sqrt(&self, count: usize) -> Expansion {
        if self.sign() == 0 {
            return Expansion::ZERO;
        }
        let (half, three) = (Expansion::from(0.5), Expansion::from(3.0));
        let mut x = Expansion::from(1.0 / self.estimate().sqrt());
        for _ in 0..=count.ilog2() + 1 {
            let square = (&x * &x).leading(count + 1);
            let residual = (&three - &(self * &square)).leading(count + 1);
            x = (&(&x * &residual) * &half).leading(count + 1);
        }
        (self * &x).leading(count)
    }
}

impl Add for &Expansion {
    type Output = Expansion;

    fn add(self, other: &Expansion) -> Expansion {
        let mut sum = self.clone();
        other.terms.iter().for_each(|&term| sum.grow(term));
        sum
    }
}

impl Neg for &Expansion {
    type Output = Expansion;

    fn neg(self) -> Expansion {
        let terms = self.terms.iter().map(|term| -term).collect();
        Expansion { terms }
    }
}

impl Sub for &Expansion {
    type Output = Expansion;

    fn sub(self, other: &Expansion) -> Expansion {
        self + &-other
    }
}

impl Mul for &Expansion {
    type Output = Expansion;

    fn mul(self, other: &Expansion) -> Expansion {
        let (a, b) = (&self.terms, &other.terms);
        let mut product = Expansion {
            terms: Vec::with_capacity(2 * a.len() * b.len()),
        };
        // Small to large, approximately by rank: the sums stay short.
        for rank in 0..(a.len() + b.len()).saturating_sub(1) {
            for i in (rank + 1).saturating_sub(b.len())..a.len().min(rank + 1) {
                let (high, low) = two_product(a[i], b[rank - i]);
                product.grow(low);
                product.grow(high);
            }
        }
        product
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// An i128 holds every number of these tests exactly (in units of 2^-60).
    fn as_units(x: &Expansion) -> i128 {
        let unit = (1u64 << 60) as f64;
        x.terms().iter().map(|t| (t * unit) as i128).sum()
    }

    fn number() -> impl Strategy<Value = f64> {
        (-(1i64 << 52)..1 << 52, 0..60).prop_map(|(m, shift)| m as f64 / (1u64 << shift) as f64)
    }

    /// The value of the lowest set bit.
    fn lowest_bit(x: f64) -> f64 {
        let mantissa = x.to_bits() & ((1 << 52) - 1) | 1 << 52;
        libm::ldexp(1.0, libm::ilogb(x) - 52 + mantissa.trailing_zeros() as i32)
    }

    proptest! {
        #[test]
        fn sums_are_exact_do_not_overlap_and_keep_their_sign(xs in prop::collection::vec(number(), 0..12)) {
            let mut sum = Expansion::default();
            xs.iter().for_each(|&x| sum.grow(x));
            let wanted: i128 = xs.iter().map(|&x| as_units(&x.into())).sum();
            for sum in [sum.clone(), sum.compressed()] {
                prop_assert_eq!(as_units(&sum), wanted);
                prop_assert_eq!(sum.sign() as i128, wanted.signum());
                for pair in sum.terms().windows(2) {
                    prop_assert!(pair[0].abs() < lowest_bit(pair[1]), "{:?}", pair);
                }
            }
        }

        #[test]
        fn products_are_exact(a in -1i64 << 52..1i64 << 52, b in -1i64 << 52..1i64 << 52, c in -99i64..99) {
            let product = &Expansion::product(a as f64, b as f64) * &Expansion::from(c as f64);
            let sum: i128 = product.terms().iter().map(|&t| t as i128).sum();
            prop_assert_eq!(sum, a as i128 * b as i128 * c as i128);
        }

        #[test]
        fn roots_and_reciprocals_are_true_to_their_last_terms(x in 1e-12f64..1e12, count in 2usize..6) {
            let x = Expansion::from(x);
            let one = Expansion::from(1.0);
            let tolerance = 2f64.powi(-50 * count as i32 + 4);
            let off = &(&x * &x.reciprocal(count)) - &one;
            prop_assert!(off.estimate().abs() <= tolerance, "{}", off.estimate());
            let third = x.over(3.0, count);
            let off = &(&(&third + &third) + &third) - &x;
            prop_assert!(off.estimate().abs() <= tolerance * x.estimate(), "{}", off.estimate());
            let root = x.sqrt(count);
            let off = (&(&root * &root) - &x).estimate() / x.estimate();
            prop_assert!(off.abs() <= tolerance, "{off}");
        }
    }

    #[test]
    fn what_cancels_leaves_the_exact_rest() {
        let big = Expansion::product(1e200, 3.0);
        let rest = &(&big + &Expansion::from(1e-200)) - &big;
        assert_eq!(rest.terms(), [1e-200]);
        assert_eq!((&big - &big).sign(), 0);
    }

    #[test]
    fn leading_terms_are_the_largest() {
        let mut x = Expansion::from(1.0);
        for k in 1..6 {
            x.grow(2f64.powi(-60 * k));
        }
        let cut = x.clone().leading(2);
        assert_eq!(cut.terms(), [2f64.powi(-60), 1.0]);
        assert_eq!(x.leading(9).terms().len(), 6);
    }
}
