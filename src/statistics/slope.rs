//! The least-squares line.

use super::{Estimate, student};

/// Slope of the least-squares line through the points `(x, y)` with its 95 %
/// interval by Student's t (Draper and Smith 1998, "Applied Regression
/// Analysis", sec. 1.4). `None` for fewer than three points, or all at one x.
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
        // Twenty degrees of freedom: t(20) = 2.085963, no longer that of ten.
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
