//! The statistics of a report: quantiles, bootstrap intervals, geometric
//! means, Pareto fronts. Pure functions of numbers; each names its source.

/// Quantile `q` in `[0, 1]` by linear interpolation between order statistics
/// (Hyndman and Fan 1996, type 7: what R and NumPy do). `None` for no data.
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

/// exp of the mean logarithm; `None` for no data or a value that is not
/// positive. The right mean for ratios (Fleming and Wallace 1986).
pub fn geometric_mean(values: &[f64]) -> Option<f64> {
    if values.is_empty() || values.iter().any(|v| v.is_nan() || *v <= 0.0) {
        return None;
    }
    let logs: f64 = values.iter().map(|v| v.ln()).sum();
    Some((logs / values.len() as f64).exp())
}

/// A value with its 95 % interval.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Estimate {
    pub value: f64,
    pub lower: f64,
    pub upper: f64,
}

/// Resamples that an interval is taken from.
const RESAMPLES: usize = 1000;

/// The median with its percentile bootstrap interval (Efron and Tibshirani
/// 1993, "An Introduction to the Bootstrap", ch. 13): 1000 resamples, seeded,
/// so that the same data gives the same interval. `None` for no data.
pub fn bootstrap_median(values: &[f64], seed: u64) -> Option<Estimate> {
    let value = median(values)?;
    let mut state = seed;
    let mut resample = vec![0.0; values.len()];
    let medians = (0..RESAMPLES).map(|_| {
        for slot in &mut resample {
            *slot = values[next_below(&mut state, values.len())];
        }
        resample.sort_by(f64::total_cmp);
        quantile(&resample, 0.5).unwrap_or(value)
    });
    let medians = sorted(medians.collect());
    Some(Estimate {
        value,
        lower: quantile(&medians, 0.025)?,
        upper: quantile(&medians, 0.975)?,
    })
}

/// Slope of the least-squares line through the points `(x, y)` with its 95 %
/// interval by Student's t (Draper and Smith 1998, "Applied Regression
/// Analysis", sec. 1.4). `None` for fewer than three points, or all at one x.
pub fn slope(points: &[(f64, f64)]) -> Option<Estimate> {
    // Two-sided 95 % quantiles of t for 1, 2, ... degrees of freedom; beyond
    // them the next smaller one: wider than need be, never narrower.
    const T: [f64; 10] = [
        12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228,
    ];
    let freedom = points.len().checked_sub(2).filter(|f| *f > 0)?;
    let count = points.len() as f64;
    let mean_x = points.iter().map(|p| p.0).sum::<f64>() / count;
    let mean_y = points.iter().map(|p| p.1).sum::<f64>() / count;
    let centred = || points.iter().map(|p| (p.0 - mean_x, p.1 - mean_y));
    let spread: f64 = centred().map(|(x, _)| x * x).sum();
    let value = centred().map(|(x, y)| x * y).sum::<f64>() / spread;
    let residual: f64 = centred().map(|(x, y)| (y - value * x).powi(2)).sum();
    let error = (residual / freedom as f64 / spread).sqrt();
    let margin = T[(freedom - 1).min(T.len() - 1)] * error;
    value.is_finite().then_some(Estimate {
        value,
        lower: value - margin,
        upper: value + margin,
    })
}

/// SplitMix64 (Steele, Lea and Flood 2014), reduced to `0..count`.
fn next_below(state: &mut u64, count: usize) -> usize {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    ((u128::from(z) * count as u128) >> 64) as usize
}

/// What something costs and how wrong it is; less is better in both.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Tradeoff {
    pub error: f64,
    pub time: f64,
}

impl Tradeoff {
    /// No worse in either and better in one (Pareto dominance).
    fn dominates(self, other: Tradeoff) -> bool {
        self.error <= other.error
            && self.time <= other.time
            && (self.error < other.error || self.time < other.time)
    }

    /// What cannot be told is the worst there is.
    fn known(self) -> Tradeoff {
        let known = |value: f64| if value.is_nan() { f64::INFINITY } else { value };
        Tradeoff {
            error: known(self.error),
            time: known(self.time),
        }
    }
}

/// For each point the point that dominates it: of those the most precise, of
/// these the fastest. `None` for the points of the Pareto front. Equal points
/// do not dominate each other; a NaN counts as infinite, and a point that is
/// infinite in both is dominated as soon as any other is not.
///
/// ```
/// use cullbench::statistics::{Tradeoff, dominated_by};
/// let point = |error, time| Tradeoff { error, time };
/// let points = [point(1e-3, 5.0), point(1e-9, 9.0), point(1e-3, 20.0)];
/// assert_eq!(dominated_by(&points), [None, None, Some(1)]);
/// ```
pub fn dominated_by(points: &[Tradeoff]) -> Vec<Option<usize>> {
    let points: Vec<Tradeoff> = points.iter().map(|p| p.known()).collect();
    let better = |point: &Tradeoff| {
        let rivals = points.iter().enumerate();
        let dominating = rivals.filter(|(_, rival)| rival.dominates(*point));
        // Among all that dominate, the first by error and time is itself
        // dominated by none.
        dominating
            .min_by(|(_, a), (_, b)| {
                let by_time = || a.time.total_cmp(&b.time);
                a.error.total_cmp(&b.error).then_with(by_time)
            })
            .map(|(i, _)| i)
    };
    points.iter().map(better).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn points(rows: &[(f64, f64)]) -> Vec<Tradeoff> {
        let point = |&(error, time): &(f64, f64)| Tradeoff { error, time };
        rows.iter().map(point).collect()
    }

    #[test]
    fn dominated_points_name_a_point_of_the_front() {
        let rows = [(4.0, 1.0), (2.0, 2.0), (1.0, 4.0), (3.0, 3.0), (4.0, 2.0)];
        assert_eq!(
            dominated_by(&points(&rows)),
            [None, None, None, Some(1), Some(1)]
        );
        // Twins stand beside each other; equal in one needs better in the other.
        let rows = [(1.0, 1.0), (1.0, 1.0), (1.0, 2.0)];
        assert_eq!(dominated_by(&points(&rows)), [None, None, Some(0)]);
        assert_eq!(dominated_by(&[]), []);
    }

    #[test]
    fn what_is_not_known_is_never_on_the_front() {
        let rows = [(f64::NAN, 1.0), (1.0, 1.0), (f64::INFINITY, f64::NAN)];
        assert_eq!(dominated_by(&points(&rows)), [Some(1), None, Some(1)]);
        assert_eq!(dominated_by(&points(&[(f64::NAN, f64::NAN)])), [None]);
    }

    proptest! {
        #[test]
        fn a_front_dominates_all_others_and_none_of_its_own(
            rows in prop::collection::vec((0..9u8, 0..9u8), 0..20)
        ) {
            let rows: Vec<_> = rows.iter().map(|&(e, t)| (f64::from(e), f64::from(t))).collect();
            let found = dominated_by(&points(&rows));
            let beats = |a: (f64, f64), b: (f64, f64)| a != b && a.0 <= b.0 && a.1 <= b.1;
            for (i, by) in found.iter().enumerate() {
                match by {
                    Some(by) => {
                        prop_assert!(beats(rows[*by], rows[i]));
                        prop_assert_eq!(found[*by], None, "{} is not on the front", by);
                    }
                    None => prop_assert!(!rows.iter().any(|&rival| beats(rival, rows[i]))),
                }
            }
        }
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

    #[test]
    fn slopes_have_the_interval_of_students_t() {
        // R: confint(lm(c(2.1, 3.9, 6.2, 7.8) ~ c(1, 2, 3, 4))): 1.94,
        // standard error 0.0906, t(2) = 4.303.
        let points = [(1.0, 2.1), (2.0, 3.9), (3.0, 6.2), (4.0, 7.8)];
        let found = slope(&points).unwrap();
        assert!((found.value - 1.94).abs() < 1e-9, "{found:?}");
        assert!(
            (found.upper - found.value - 0.3897).abs() < 1e-3,
            "{found:?}"
        );
        assert!(
            (found.value - found.lower - 0.3897).abs() < 1e-3,
            "{found:?}"
        );
        assert_eq!(slope(&points[..2]), None);
        assert_eq!(slope(&[(1.0, 2.0), (1.0, 3.0), (1.0, 4.0)]), None);
    }

    #[test]
    fn geometric_means_refuse_what_has_none() {
        assert!((geometric_mean(&[2.0, 8.0]).unwrap() - 4.0).abs() < 1e-12);
        assert_eq!(geometric_mean(&[]), None);
        assert_eq!(geometric_mean(&[1.0, 0.0]), None);
    }

    #[test]
    fn the_interval_covers_the_median_of_the_source() {
        // Samples of 31 uniform numbers: their 95 % intervals must cover the
        // true median 50 in about 95 % of 200 repetitions.
        let mut state = 9;
        let mut covered = 0;
        for repetition in 0..200 {
            let sample: Vec<f64> = (0..31)
                .map(|_| next_below(&mut state, 1_000_001) as f64 / 10_000.0)
                .collect();
            let estimate = bootstrap_median(&sample, repetition).unwrap();
            assert!(estimate.lower <= estimate.value && estimate.value <= estimate.upper);
            covered += usize::from(estimate.lower <= 50.0 && 50.0 <= estimate.upper);
        }
        assert!((180..=199).contains(&covered), "{covered} of 200");
        assert_eq!(bootstrap_median(&[], 1), None);
    }
}
