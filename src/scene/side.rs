//! On which side of a bound in f32 a coordinate lies that is written in f64: exactly.

use crate::arithmetic::two_sum;

/// The sign of `(p - origin) - bound`, exactly: -1, 0 or 1.
pub(super) fn side(p: f64, origin: f64, bound: f32) -> i32 {
    let (difference, lost) = two_sum(p, -origin);
    let bound = f64::from(bound);
    // The rounded difference is on the true one's side of any double.
    if difference != bound {
        return if difference > bound { 1 } else { -1 };
    }
    match lost {
        lost if lost > 0.0 => 1,
        lost if lost < 0.0 => -1,
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dashu_int::IBig;

    /// A double as a whole number of 2^-1074.
    fn units(x: f64) -> IBig {
        let bits = x.abs().to_bits();
        let exponent = (bits >> 52) as usize;
        let mantissa = bits & ((1 << 52) - 1) | u64::from(exponent > 0) << 52;
        let size = IBig::from(mantissa) << exponent.saturating_sub(1);
        if x < 0.0 { -size } else { size }
    }

    #[test]
    fn sides_are_those_of_whole_numbers() {
        let mut state = 7u64;
        let mut next = || {
            state = state.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(1);
            state >> 33
        };
        let mut ties = 0;
        for _ in 0..20_000 {
            let origin = (next() % 4096) as f64 * libm::exp2((next() % 60) as f64 - 20.0);
            let bound = (next() % 4096) as f32 * 0.1;
            let mut p = origin + f64::from(bound);
            for _ in 0..next() % 3 {
                p = if next() % 2 == 0 {
                    p.next_up()
                } else {
                    p.next_down()
                };
            }
            let exact = units(p) - units(origin) - units(f64::from(bound));
            let wanted = i32::from(exact > IBig::ZERO) - i32::from(exact < IBig::ZERO);
            assert_eq!(side(p, origin, bound), wanted, "{p:e} {origin:e} {bound:e}");
            ties += u32::from(wanted == 0);
        }
        assert!(ties > 1000, "{ties}");
    }
}
