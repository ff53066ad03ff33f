//! Vectors and elementary functions of expansions.

use glam::DVec3;

use super::Expansion;

/// A vector whose components have no error, or that of their leading terms.
pub type ExactVector = [Expansion; 3];

/// The components of `v`, exactly.
pub fn vector(v: DVec3) -> ExactVector {
    v.to_array().map(Expansion::from)
}

/// `a - b`, exactly.
pub fn difference(a: DVec3, b: DVec3) -> ExactVector {
    [0, 1, 2].map(|k| &Expansion::from(a[k]) - &Expansion::from(b[k]))
}

/// Each component rounded to f64, up to an ulp.
pub fn estimate(v: &ExactVector) -> DVec3 {
    DVec3::new(v[0].estimate(), v[1].estimate(), v[2].estimate())
}

/// `a . b`, exactly.
pub fn dot(a: &ExactVector, b: &ExactVector) -> Expansion {
    &(&(&a[0] * &b[0]) + &(&a[1] * &b[1])) + &(&a[2] * &b[2])
}

/// `a x b`, exactly.
pub fn cross(a: &ExactVector, b: &ExactVector) -> ExactVector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &(&a[i] * &b[j]) - &(&a[j] * &b[i]))
}

/// The binary exponent of the largest component; `None` for the zero vector.
pub fn exponent(v: &ExactVector) -> Option<i32> {
    let largest = estimate(v).abs().max_element();
    (largest > 0.0).then(|| libm::ilogb(largest))
}

/// The vector times the power of two that brings its largest component near 1.
///
/// Products of such vectors do not overflow. `None` for the zero vector.
pub fn near_unit(v: ExactVector) -> Option<ExactVector> {
    let exponent = exponent(&v)?;
    Some(v.map(|component| component.scaled(-exponent)))
}

/// Pi, true to 2^-329.
///
/// The first four terms are those of Hida, Li and Bailey 2001, "Algorithms for quad-double
/// precision floating point arithmetic".
pub fn pi() -> Expansion {
    const TERMS: [f64; 6] = [
        1.7449862161352486e-83,
        5.672231979640316e-66,
        1.1124542208633653e-49,
        -2.9947698097183397e-33,
        1.2246467991473532e-16,
        std::f64::consts::PI,
    ];
    Expansion::sum(TERMS)
}

/// Sum of `first factor^n / (d(1) d(2) ... d(n))` over n >= 0, to `count` terms.
pub fn series(
    first: Expansion,
    factor: &Expansion,
    divisor: impl Fn(f64) -> f64,
    count: usize,
) -> Expansion {
    // Below the last digit of 1.
    let negligible = libm::exp2(-58.0 * count as f64);
    let (mut sum, mut term, mut n) = (first.clone(), first, 0.0);
    while term.estimate().abs() > negligible {
        n += 1.0;
        term = (&term * factor).leading(count).over(divisor(n), count);
        sum = (&sum + &term).leading(count);
    }
    sum
}

/// Sine and cosine to `count` terms, of an angle of at most a few turns.
pub fn sin_cos(radians: &Expansion, count: usize) -> (Expansion, Expansion) {
    let square = -&(radians * radians).leading(count);
    let of =
        |first: Expansion, odd: f64| series(first, &square, |n| 2.0 * n * (2.0 * n + odd), count);
    (of(radians.clone(), 1.0), of(1.0.into(), -1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_of_known_angles_are_true_to_250_bits() {
        for (divisor, sine_squared) in [(6.0, 0.25), (4.0, 0.5), (3.0, 0.75), (2.0, 1.0)] {
            let (sine, cosine) = sin_cos(&pi().over(divisor, 6), 6);
            for (value, square) in [(sine, sine_squared), (cosine, 1.0 - sine_squared)] {
                let off = (&(&value * &value) - &Expansion::from(square)).estimate();
                assert!(off.abs() < libm::exp2(-250.0), "{divisor}: {off:e}");
            }
        }
    }
}
