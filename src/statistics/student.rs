//! Student's t distribution, and the least-squares line.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::{Estimate, student};

/// P(T > t).
pub(super) fn upper_tail(t: f64, df: f64) -> f64 {
    let student = StudentsT::new(0.0, 1.0, df).ok().filter(|_| !t.is_nan());
    // By symmetry: 1 - cdf would cancel small tails.
    student.map_or(f64::NAN, |student| student.cdf(-t))
}

/// The t below which the share `p` of the distribution lies.
pub(super) fn quantile(p: f64, df: f64) -> f64 {
    let student = StudentsT::new(0.0, 1.0, df).ok();
    let student = student.filter(|_| (0.0..=1.0).contains(&p));
    student.map_or(f64::NAN, |student| student.inverse_cdf(p))
}

/// Slope of the least-squares line through the points `(x, y)`.
///
/// With its 95 % interval by Student's t (Draper and Smith 1998, "Applied Regression Analysis",
/// sec. 1.4). `None` for fewer than three points, or if all have the same x.
pub fn slope(points: &[(f64, f64)]) -> Option<Estimate> {
    let freedom = points.len().checked_sub(2).filter(|f| *f > 0)?;
    let count = points.len() as f64;
    let mean_x = points.iter().map(|p| p.0).sum::<f64>() / count;
    let mean_y = points.iter().map(|p| p.1).sum::<f64>() / count;
    let centred = || points.iter().map(|p| (p.0 - mean_x, p.1 - mean_y));
    let spread: f64 = centred().map(|(x, _)| x * x).sum();
    let value = centred().map(|(x, y)| x * y).sum::<f64>() / spread;
    let residual: f64 = centred().map(|(x, y)| (y - value * x).powi(2)).sum();
    let error = (residual / freedom as f64 / spread).sqrt();
    let margin = student::quantile(0.975, freedom as f64) * error;
    let ends = [value - margin, value + margin];
    value.is_finite().then(|| Estimate::within(value, ends))
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

    #[test]
    fn slopes_have_the_interval_of_students_t() {
        // R: confint(lm(c(2.1, 3.9, 6.2, 7.8) ~ c(1, 2, 3, 4))): 1.94,
        // standard error 0.0906, t(2) = 4.303.
        let points = [(1.0, 2.1), (2.0, 3.9), (3.0, 6.2), (4.0, 7.8)];
        let found = slope(&points).unwrap();
        assert!((found.value - 1.94).abs() < 1e-9, "{found:?}");
        assert!(
            (found.upper.unwrap() - found.value - 0.3897).abs() < 1e-3,
            "{found:?}"
        );
        assert!(
            (found.value - found.lower.unwrap() - 0.3897).abs() < 1e-3,
            "{found:?}"
        );
        // Twenty degrees of freedom: t(20) = 2.085963, not that of ten.
        let many: Vec<(f64, f64)> = (0..22).map(|i| (f64::from(i), f64::from(i % 2))).collect();
        let found = slope(&many).unwrap();
        let spread = (0..22).map(|i| (f64::from(i) - 10.5).powi(2)).sum::<f64>();
        let residual = 5.5 - found.value.powi(2) * spread;
        let margin = 2.085_963 * (residual / 20.0 / spread).sqrt();
        assert!(
            (found.upper.unwrap() - found.value - margin).abs() < 1e-6,
            "{found:?}"
        );
        assert_eq!(slope(&points[..2]), None);
        assert_eq!(slope(&[(1.0, 2.0), (1.0, 3.0), (1.0, 4.0)]), None);
    }
}
