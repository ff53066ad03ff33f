//! Student's t distribution, degrees of freedom of any size, whole or not.

use statrs::distribution::{ContinuousCDF, StudentsT};

/// P(T > t).
pub(super) fn upper_tail(t: f64, df: f64) -> f64 {
    match StudentsT::new(0.0, 1.0, df) {
        // By symmetry: 1 - cdf would lose what is small.
        Ok(student) if !t.is_nan() => student.cdf(-t),
        _ => f64::NAN,
    }
}

/// The t that the share `p` of the distribution lies below.
pub(super) fn quantile(p: f64, df: f64) -> f64 {
    match StudentsT::new(0.0, 1.0, df) {
        Ok(student) if (0.0..=1.0).contains(&p) => student.inverse_cdf(p),
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_and_tails_are_those_of_r() {
        // R: qt(p, df).
        for (p, df, wanted) in [
            (0.975, 1.0, 12.706_204_736),
            (0.975, 2.0, 4.302_652_730),
            (0.975, 5.0, 2.570_581_836),
            (0.95, 13.0, 1.770_933_396),
        ] {
            let found = quantile(p, df);
            assert!((found - wanted).abs() < 1e-7, "{p} {df}: {found}");
            assert!((quantile(1.0 - p, df) + wanted).abs() < 1e-7);
        }
        assert_eq!(quantile(0.5, 7.0), 0.0);
        // Two degrees of freedom have a closed form: (1 - t/sqrt(2 + t^2))/2.
        for t in [-3.0, 0.0, 2.0, 40.0] {
            let wanted = (1.0 - t / f64::sqrt(2.0 + t * t)) / 2.0;
            assert!((upper_tail(t, 2.0) - wanted).abs() < 1e-9, "{t}");
        }
        assert_eq!(upper_tail(f64::INFINITY, 3.0), 0.0);
        assert_eq!(upper_tail(f64::NEG_INFINITY, 3.0), 1.0);
    }

    #[test]
    fn degrees_of_freedom_need_not_be_whole() {
        for df in [2.5, 5.0, 12.64, 17.0, 400.5] {
            for p in [0.6, 0.95, 0.975, 0.999, 1.0 - 0.025 / 60.0] {
                let back = 1.0 - upper_tail(quantile(p, df), df);
                assert!((back - p).abs() < 1e-8, "{p} {df}: {back}");
            }
        }
        assert!(quantile(0.975, 12.0) > quantile(0.975, 12.64));
        assert!(quantile(0.975, 12.64) > quantile(0.975, 13.0));
        assert!(quantile(0.975, 0.0).is_nan() && upper_tail(1.0, f64::NAN).is_nan());
    }
}
