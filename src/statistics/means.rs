//! Means, quantiles and clusters of values.

/// The plain mean.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Sum of the squared distances from the mean.
pub(super) fn squares(values: &[f64]) -> f64 {
    let mean = mean(values);
    values.iter().map(|value| (value - mean).powi(2)).sum()
}

/// exp of the mean logarithm, the right mean for ratios.
///
/// Fleming and Wallace 1986. `None` for no data or a value that is not positive.
pub fn geometric_mean(values: &[f64]) -> Option<f64> {
    if values.is_empty() || values.iter().any(|v| v.is_nan() || *v <= 0.0) {
        return None;
    }
    let logs: f64 = values.iter().map(|v| v.ln()).sum();
    Some((logs / values.len() as f64).exp())
}

/// The mean of the middle half of the values; `None` for no data or a NaN.
///
/// A value cut by a quartile is weighted with its share inside, so that the mean is continuous in
/// the number of values (Tukey's midmean: Rosenberger and Gasko 1983, in Hoaglin, Mosteller and
/// Tukey, "Understanding Robust and Exploratory Data Analysis", ch. 10, sec. C).
pub fn interquartile_mean(values: &[f64]) -> Option<f64> {
    if values.is_empty() || values.iter().any(|value| value.is_nan()) {
        return None;
    }
    let sorted = sorted(values.to_vec());
    let count = sorted.len() as f64;
    let (low, high) = (count / 4.0, count * 3.0 / 4.0);
    // Value i occupies the range from i to i + 1.
    let (first, end) = (low.floor() as usize, high.ceil() as usize);
    let share = |i: usize| high.min((i + 1) as f64) - low.max(i as f64);
    let sum: f64 = (first..end).map(|i| sorted[i] * share(i)).sum();
    // Rounding may move the mean of equal values beyond them.
    Some((sum / (count / 2.0)).clamp(sorted[first], sorted[end - 1]))
}

/// Quantile `q` in `[0, 1]`; `None` for no data.
///
/// Linear interpolation between order statistics (Hyndman and Fan 1996, type 7, as in R and NumPy).
pub fn quantile(sorted: &[f64], q: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let at = q.clamp(0.0, 1.0) * last as f64;
    let (low, share) = (at.floor() as usize, at.fract());
    let high = (low + 1).min(last);
    Some(sorted[low] + (sorted[high] - sorted[low]) * share)
}

/// The values in ascending order.
pub fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values
}

/// The median; `None` for no data.
pub fn median(values: &[f64]) -> Option<f64> {
    quantile(&sorted(values.to_vec()), 0.5)
}

/// Least number of values: fewer show clusters by chance.
const FEWEST: usize = 40;

/// Each cluster's least share of the values.
const LEAST_SHARE: f64 = 0.2;

/// Least distance of the centres, in standard deviations within the clusters.
const SEPARATION: f64 = 5.0;

/// The centres of the two clusters of times of the same work, the fast one first.
///
/// Geometric means; `None` for a single cluster, fewer than forty values, or a value that is not
/// positive.
///
/// The logarithms are split where the variance within both parts is smallest (Otsu 1979, "A
/// threshold selection method from gray-level histograms"), each part at least a fifth of them. The
/// parts are two clusters if their centres are more than 5 within-part standard deviations apart:
/// halves of a normal distribution are 2.6 apart, of a uniform one 3.5.
pub fn two_speeds(times: &[f64]) -> Option<(f64, f64)> {
    let usable = |time: &f64| *time > 0.0 && time.is_finite();
    if times.len() < FEWEST || !times.iter().all(usable) {
        return None;
    }
    let logs = sorted(times.iter().map(|time| time.ln()).collect());
    let least = (LEAST_SHARE * logs.len() as f64).ceil() as usize;
    let (low, high) = (least..=logs.len() - least)
        .map(|at| logs.split_at(at))
        .min_by(|a, b| within(*a).total_cmp(&within(*b)))?;
    let deviation = (within((low, high)) / logs.len() as f64).sqrt();
    let (low, high) = (mean(low), mean(high));
    (high - low > SEPARATION * deviation).then(|| (low.exp(), high.exp()))
}

/// Sum of squares within both parts.
fn within((low, high): (&[f64], &[f64])) -> f64 {
    squares(low) + squares(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interquartile_mean_weighs_the_values_at_its_ends() {
        // Of five values the middle three, the outer two of these weighted by 3/4.
        let found = interquartile_mean(&[9.0, 1.0, 2.0, 3.0, 5.0]).unwrap();
        assert!((found - (0.75 * 2.0 + 3.0 + 0.75 * 5.0) / 2.5).abs() < 1e-12);
    }

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

    #[test]
    fn quantiles_interpolate_as_numpy_does() {
        let values = [1.0, 2.0, 4.0, 8.0];
        // numpy.quantile([1, 2, 4, 8], [0, .25, .5, .95, 1])
        for (q, wanted) in [
            (0.0, 1.0),
            (0.25, 1.75),
            (0.5, 3.0),
            (0.95, 7.4),
            (1.0, 8.0),
        ] {
            let found = quantile(&values, q).unwrap();
            assert!((found - wanted).abs() < 1e-12, "{q}: {found}");
        }
        assert_eq!(quantile(&[], 0.5), None);
        assert_eq!(quantile(&[3.0], 0.99), Some(3.0));
    }

    fn spread(count: usize, low: f64, high: f64) -> impl Iterator<Item = f64> {
        (0..count).map(move |i| low + (high - low) * i as f64 / count as f64)
    }

    #[test]
    fn two_speeds_are_found_and_named() {
        let rounds: Vec<f64> = spread(30, 1.75, 2.0)
            .chain(spread(70, 1.13, 1.17))
            .collect();
        let (fast, slow) = two_speeds(&rounds).unwrap();
        assert!((fast - 1.15).abs() < 0.01 && (slow - 1.87).abs() < 0.02);
        // Too rare to be a speed; one heap; too few; no times.
        let rare: Vec<f64> = spread(10, 1.75, 2.0)
            .chain(spread(90, 1.13, 1.17))
            .collect();
        assert_eq!(two_speeds(&rare), None);
        assert_eq!(two_speeds(&spread(100, 1.1, 2.0).collect::<Vec<_>>()), None);
        assert_eq!(two_speeds(&[1.0; 100]), None);
        assert_eq!(two_speeds(&[1.0, 2.0].repeat(19)), None);
        assert!(two_speeds(&[1.0, 2.0].repeat(20)).is_some());
        assert_eq!(two_speeds(&[0.0, 2.0].repeat(20)), None);
    }
}
