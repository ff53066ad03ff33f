//! Means: plain, geometric, interquartile.

use super::sorted;

/// The plain mean.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Sum of the squared distances from the mean.
pub(super) fn squares(values: &[f64]) -> f64 {
    let mean = mean(values);
    values.iter().map(|value| (value - mean).powi(2)).sum()
}

/// exp of the mean logarithm; `None` for no data or a value that is not
/// positive. The right mean for ratios (Fleming and Wallace 1986).
pub fn geometric_mean(values: &[f64]) -> Option<f64> {
    if values.is_empty() || values.iter().any(|v| v.is_nan() || *v <= 0.0) {
        return None;
    }
    let logs: f64 = values.iter().map(|v| v.ln()).sum();
    Some((logs / values.len() as f64).exp())
}

/// The mean of the middle half of the values; `None` for no data or a NaN.
///
/// A value that a quartile falls into counts by the share of it that lies
/// inside, so that the mean is continuous in the number of values (Tukey's
/// midmean: Rosenberger and Gasko 1983, in Hoaglin, Mosteller and Tukey,
/// "Understanding Robust and Exploratory Data Analysis", ch. 10, sec. C).
///
/// ```
/// use cullbench::statistics::interquartile_mean;
/// // Of five values the middle three, the outer two of them by 3/4.
/// let found = interquartile_mean(&[9.0, 1.0, 2.0, 3.0, 5.0]).unwrap();
/// assert!((found - (0.75 * 2.0 + 3.0 + 0.75 * 5.0) / 2.5).abs() < 1e-12);
/// ```
pub fn interquartile_mean(values: &[f64]) -> Option<f64> {
    if values.is_empty() || values.iter().any(|value| value.is_nan()) {
        return None;
    }
    let sorted = sorted(values.to_vec());
    let count = sorted.len() as f64;
    let (low, high) = (count / 4.0, count * 3.0 / 4.0);
    // Value i takes the room from i to i + 1.
    let (first, end) = (low.floor() as usize, high.ceil() as usize);
    let share = |i: usize| high.min((i + 1) as f64) - low.max(i as f64);
    let sum: f64 = (first..end).map(|i| sorted[i] * share(i)).sum();
    // Rounding can carry the mean of equal values past them.
    Some((sum / (count / 2.0)).clamp(sorted[first], sorted[end - 1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn geometric_means_refuse_what_has_none() {
        assert!((geometric_mean(&[2.0, 8.0]).unwrap() - 4.0).abs() < 1e-12);
        assert_eq!(geometric_mean(&[]), None);
        assert_eq!(geometric_mean(&[1.0, 0.0]), None);
    }

    #[test]
    fn interquartile_means_weigh_the_quartiles_by_their_share() {
        let near = |values: &[f64], wanted: f64| {
            let found = interquartile_mean(values).unwrap();
            assert!((found - wanted).abs() < 1e-12, "{values:?}: {found}");
        };
        near(&[7.0], 7.0);
        near(&[1.0, 3.0], 2.0);
        near(&[0.0, 1.0, 100.0], (0.25 * 0.0 + 1.0 + 0.25 * 100.0) / 1.5);
        near(&[100.0, 1.0, 0.0, 3.0], 2.0);
        near(
            &[0.0, 1.0, 2.0, 4.0, 90.0, -9.0],
            (0.5 * 0.0 + 1.0 + 2.0 + 0.5 * 4.0) / 3.0,
        );
        assert_eq!(interquartile_mean(&[0.1; 7]), Some(0.1));
        assert_eq!(interquartile_mean(&[]), None);
        assert_eq!(interquartile_mean(&[1.0, f64::NAN]), None);
    }
}
