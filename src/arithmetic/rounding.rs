//! Directed rounding: differences and sums as guaranteed bounds.

use super::two_sum;

/// The smallest f32 that is not below `x` (towards +infinity).
///
/// Returns `+inf` above [`f32::MAX`] and NaN for NaN.
pub fn round_up(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) < x {
        nearest.next_up()
    } else {
        nearest
    }
}

/// `a - b` rounded down to f32, correct for the exact difference.
///
/// The f64 subtraction may itself have rounded up onto an f32 value; Knuth's TwoSum (The Art of
/// Computer Programming 2, 4.2.2, theorem B) gives its rounding error, and one step down corrects
/// it.
pub fn difference_down(a: f64, b: f64) -> f32 {
    -difference_up(b, a)
}

/// `a - b` rounded up to f32, correct for the exact difference.
pub fn difference_up(a: f64, b: f64) -> f32 {
    let (sum, lost) = two_sum(a, -b);
    let rounded = round_up(sum);
    if lost > 0.0 && f64::from(rounded) == sum {
        rounded.next_up()
    } else {
        rounded
    }
}

/// `a + b` rounded down to f64, correct for the exact sum.
pub fn sum_down(a: f64, b: f64) -> f64 {
    // Not -sum_up(-a, -b), which would turn a zero into -0.
    let (sum, lost) = two_sum(a, b);
    if lost < 0.0 { sum.next_down() } else { sum }
}

/// `a + b` rounded up to f64, correct for the exact sum.
pub fn sum_up(a: f64, b: f64) -> f64 {
    let (sum, lost) = two_sum(a, b);
    if lost > 0.0 { sum.next_up() } else { sum }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_difference_that_f64_rounds_onto_an_f32_still_moves_outward() {
        // 2^30 + 2^-60 minus 2^30 loses the small part in f64 already.
        let (a, b) = (1.0, f64::EPSILON / 8.0);
        assert_eq!(a - b, 1.0, "the premise: f64 cannot hold the difference");
        assert!(difference_down(a, b) < 1.0);
        assert_eq!(difference_up(a, b), 1.0);
        assert!(difference_up(a, -b) > 1.0);
    }

    #[test]
    fn a_sum_moves_outward_only_where_f64_cannot_hold_it() {
        let (a, b) = (2f64.powi(30), 2f64.powi(-60));
        assert_eq!((sum_down(a, b), sum_up(a, b)), (a, a.next_up()));
        assert_eq!((sum_down(a, -b), sum_up(a, -b)), (a.next_down(), a));
        assert_eq!((sum_down(a, 0.5), sum_up(a, 0.5)), (a + 0.5, a + 0.5));
        assert!(sum_down(a, -a).is_sign_positive());
    }

    proptest! {
        #[test]
        fn rounding_brackets_the_value_within_one_ulp(x in prop::num::f64::NORMAL | prop::num::f64::ZERO) {
            let (down, up) = (-round_up(-x), round_up(x));
            prop_assert!(f64::from(down) <= x && x <= f64::from(up));
            prop_assert!(down == up || down.next_up() == up);
        }

        #[test]
        fn differences_bracket_the_nearest_f64(a in -1e9f64..1e9, b in -1e9f64..1e9) {
            let (down, up) = (difference_down(a, b), difference_up(a, b));
            prop_assert!(f64::from(down) <= a - b && a - b <= f64::from(up));
        }
    }
}
