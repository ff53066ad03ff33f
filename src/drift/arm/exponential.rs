//! The reference of the linear arm: the matrix exponential of arm and target
//! together, by its series with scaling and squaring, in double-double arithmetic.
//! It shares no formula with any method.

use crate::arithmetic::{two_product, two_sum};

/// A number of about 106 bits: the sum of two doubles (Dekker 1971).
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Double(f64, f64);

impl From<f64> for Double {
    fn from(value: f64) -> Double {
        Double(value, 0.0)
    }
}

impl From<Double> for f64 {
    fn from(value: Double) -> f64 {
        value.0
    }
}

impl Double {
    fn plus(self, other: Double) -> Double {
        let (sum, lost) = two_sum(self.0, other.0);
        let (sum, lost) = two_sum(sum, lost + (self.1 + other.1));
        Double(sum, lost)
    }

    fn times(self, other: Double) -> Double {
        let (product, lost) = two_product(self.0, other.0);
        let (product, lost) = two_sum(product, lost + (self.0 * other.1 + self.1 * other.0));
        Double(product, lost)
    }

    fn over(self, divisor: f64) -> Double {
        let quotient = self.0 / divisor;
        let (product, lost) = two_product(quotient, divisor);
        let rest = ((self.0 - product) - lost + self.1) / divisor;
        let (quotient, rest) = two_sum(quotient, rest);
        Double(quotient, rest)
    }
}

/// Position, velocity / omega, and the target with its two derivatives.
const SIZE: usize = 5;
type Matrix = [[Double; SIZE]; SIZE];

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let entry = |i: usize, j: usize| {
        (0..SIZE).fold(Double(0.0, 0.0), |sum, k| {
            match a[i][k].0 == 0.0 || b[k][j].0 == 0.0 {
                true => sum,
                false => sum.plus(a[i][k].times(b[k][j])),
            }
        })
    };
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

fn identity() -> Matrix {
    let entry = |i: usize, j: usize| Double(f64::from(u8::from(i == j)), 0.0);
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// How the target goes on by itself.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Law {
    /// `T'' = -T`.
    Sine,
    /// `T''' = 0`.
    Parabola,
}

/// Relative size of the first term that is left out of the series.
const NEGLIGIBLE: f64 = 1e-34;

/// A critically damped arm and its target as one linear system.
pub struct Chase {
    omega: f64,
    law: Law,
    /// Of the last step: steady frames have them all alike.
    known: Option<(f64, Matrix)>,
}

impl Chase {
    pub fn new(stiffness: f64, law: Law) -> Chase {
        Chase {
            omega: stiffness.sqrt(),
            law,
            known: None,
        }
    }

    /// The system's matrix times `h`.
    fn generator(&self, h: f64) -> Matrix {
        let mut matrix = [[Double(0.0, 0.0); SIZE]; SIZE];
        let of = |factor: f64| {
            let (product, lost) = two_product(factor, h);
            Double(product, lost)
        };
        let omega = self.omega;
        matrix[0][1] = of(omega);
        matrix[1][0] = of(-omega);
        matrix[1][1] = of(-2.0 * omega);
        matrix[1][2] = of(omega);
        matrix[2][3] = of(1.0);
        match self.law {
            Law::Sine => matrix[3][2] = of(-1.0),
            Law::Parabola => matrix[3][4] = of(1.0),
        }
        matrix
    }

    fn exponential(&self, h: f64) -> Matrix {
        // Halved until the row sums are below one half.
        let norm = (4.0 * self.omega + 1.0) * h;
        let halvings = (2.0 * norm).max(1.0).log2().ceil() as i32;
        let small = self.generator(h * 2f64.powi(-halvings));
        let (mut sum, mut term) = (identity(), identity());
        for n in 1..60 {
            term = product(&term, &small).map(|row| row.map(|entry| entry.over(f64::from(n))));
            let largest = term
                .iter()
                .flatten()
                .fold(0.0, |most: f64, e| most.max(e.0.abs()));
            let add = |i: usize, j: usize| sum[i][j].plus(term[i][j]);
            sum = std::array::from_fn(|i| std::array::from_fn(|j| add(i, j)));
            if largest < NEGLIGIBLE {
                break;
            }
        }
        for _ in 0..halvings {
            sum = product(&sum, &sum);
        }
        sum
    }

    /// Arm (position and velocity) and target (with two derivatives) `h` seconds
    /// later.
    pub fn step(&mut self, arm: [Double; 2], target: [Double; 3], h: f64) -> Stepped {
        let matrix = match &self.known {
            Some((known, matrix)) if *known == h => *matrix,
            _ => self.exponential(h),
        };
        self.known = Some((h, matrix));
        let ([x, v], [place, speed, bend]) = (arm, target);
        let before = [x, v.over(self.omega), place, speed, bend];
        let after = matrix.map(|row| {
            let terms = row.iter().zip(&before);
            terms.fold(Double(0.0, 0.0), |sum, (a, b)| sum.plus(a.times(*b)))
        });
        let [x, v, place, speed, bend] = after;
        ([x, v.times(Double(self.omega, 0.0))], [place, speed, bend])
    }
}

/// Arm and target.
type Stepped = ([Double; 2], [Double; 3]);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chase_of_a_sine_is_that_of_another_program() {
        // Position and velocity by the closed form with 50 digits, from (1, 0).
        for (stiffness, t, wanted) in [
            (
                1e2,
                0.25,
                [0.373_848_712_904_617_2, -1.346_139_945_323_537_3],
            ),
            (
                1e2,
                2.0,
                [0.964_056_336_238_460_4, -0.225_591_948_837_311_96],
            ),
            (
                1e4,
                0.25,
                [0.227_955_377_434_252_8, 0.973_568_851_059_739_9],
            ),
            (
                1e6,
                2.0,
                [0.910_126_990_946_457_1, -0.414_326_996_892_246_4],
            ),
        ] {
            for steps in [1, 64] {
                let mut chase = Chase::new(stiffness, Law::Sine);
                let mut arm = [1.0, 0.0].map(Double::from);
                let mut target = [0.0, 1.0, 0.0].map(Double::from);
                for _ in 0..steps {
                    (arm, target) = chase.step(arm, target, t / f64::from(steps));
                }
                for (found, wanted) in arm.map(f64::from).into_iter().zip(wanted) {
                    assert!((found - wanted).abs() < 4e-16, "{stiffness} {t}: {found}");
                }
                assert!((f64::from(target[0]) - t.sin()).abs() < 2e-16);
            }
        }
    }

    #[test]
    fn doubles_have_a_hundred_bits() {
        let third = Double::from(1.0).over(3.0);
        let one = third.plus(third).plus(third);
        assert!((one.0 - 1.0).abs() + one.1.abs() < 1e-31, "{one:?}");
        let square = third.times(third).over(1.0 / 9.0);
        assert!((square.0 - 1.0).abs() < 1e-15, "{square:?}");
    }
}
