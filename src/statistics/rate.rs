//! Rates of rare events (false positives per visible item) with sampling errors.
//!
//! A camera is one observation: its items share the same planes, so their errors are correlated.

use super::means::{mean, squares};
use super::{Estimate, student};

/// Level of the reported intervals.
const LEVEL: f64 = 0.95;
/// No event in n units: below 3/n at 95 %, because 0.95 = 1 - exp(-3).
const NOTHING_SEEN: f64 = 3.0;

/// The rate of clusters by their numbers of events and units.
pub fn rate_of<T>(clusters: &[T], of: impl Fn(&T) -> [u64; 2]) -> Option<Estimate> {
    let counts = clusters.iter().map(|cluster| of(cluster).map(|n| n as f64));
    rate(&counts.collect::<Vec<_>>())
}

/// The rate of clusters, each with its events and its units; `None` without units.
///
/// The ratio of the sums, with the standard error of a ratio of cluster totals,
/// `n/(n-1) sum (y - R x)^2 / (sum x)^2`, and Student's t with n - 1 degrees of freedom (Cochran
/// 1977, "Sampling Techniques", 3rd ed., secs. 2.11 and 9A.1). Without events in `x` units the
/// upper end is 3/x (Hanley and Lippman-Hand 1983, "If nothing goes wrong, is everything all
/// right?", JAMA 249, p. 1743), and it is never closer than 3/x to the value: units count as
/// independent there, for lack of contrary evidence.
fn rate(clusters: &[[f64; 2]]) -> Option<Estimate> {
    let sum = |k: usize| clusters.iter().map(|c| c[k]).sum::<f64>();
    let (events, units) = (sum(0), sum(1));
    let value = events / units;
    if !(units > 0.0 && value.is_finite()) {
        return None;
    }
    let count = clusters.len() as f64;
    let residuals = clusters.iter().map(|[y, x]| (y - value * x).powi(2));
    let error = (count / (count - 1.0) * residuals.sum::<f64>()).sqrt() / units;
    let margin = student::quantile(0.5 + LEVEL / 2.0, count - 1.0) * error;
    let least = NOTHING_SEEN / units;
    let several = |x: f64| (clusters.len() > 1).then_some(x);
    Some(Estimate {
        value,
        lower: several((value - margin).max(0.0)),
        upper: several(value + margin.max(least)),
    })
}

/// Returns true if the mean of `a` is significantly below that of `b`.
///
/// Paired by index: Student's paired t, two-sided at `alpha`. For one cluster, or if all
/// differences are equal, the order of the means decides.
///
/// The plain mean instead of a trimmed one: rare events lie in few clusters, which trimming would
/// discard.
pub fn shows_less(a: &[f64], b: &[f64], alpha: f64) -> bool {
    let differences: Vec<f64> = b.iter().zip(a).map(|(b, a)| b - a).collect();
    let (mean, count) = (mean(&differences), differences.len() as f64);
    let error = (squares(&differences) / (count * (count - 1.0))).sqrt();
    match error > 0.0 {
        true => mean > student::quantile(1.0 - alpha / 2.0, count - 1.0) * error,
        false => mean > 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    #[test]
    fn a_rate_is_events_per_unit_and_of_no_events_has_an_upper_end() {
        let found = rate(&[[2.0, 100.0], [4.0, 100.0], [3.0, 100.0]]).unwrap();
        assert_eq!(found.value, 0.03);
        let nothing = rate(&[[0.0, 100.0], [0.0, 200.0]]).unwrap();
        assert_eq!(nothing.upper, Some(0.01));
    }

    #[test]
    fn the_standard_error_is_that_of_a_ratio_of_totals() {
        // Residuals 0, 1 and -1: sqrt(3/2 * 2) / 60, times t(2) = 4.302653.
        let found = rate(&[[1.0, 10.0], [3.0, 20.0], [2.0, 30.0]]).unwrap();
        assert!((found.value - 0.1).abs() < 1e-15);
        let margin = 4.302_652_73 * 0.028_867_513;
        assert!((found.upper.unwrap() - 0.1 - margin).abs() < 1e-8);
        assert_eq!(found.lower, Some(0.0));
    }

    #[test]
    fn one_cluster_has_no_interval_and_no_units_no_rate() {
        let one = rate(&[[1.0, 4.0]]).unwrap();
        assert_eq!((one.value, one.lower, one.upper), (0.25, None, None));
        assert_eq!(rate(&[[1.0, 0.0], [0.0, 0.0]]), None);
        assert_eq!(rate(&[]), None);
        let share = rate(&[[0.0, 4.0], [3.0, 4.0]]).unwrap().of_share();
        assert_eq!(share.upper, Some(1.0));
        // No events, and clusters that are all alike: never closer than 3/n.
        for events in [0.0, 1.0] {
            let alike = rate(&[[events, 10.0]; 30]).unwrap();
            assert_eq!(alike.upper, Some(alike.value + 3.0 / 300.0), "{events}");
        }
    }

    /// Cameras with different rates, as for frusta in different directions.
    fn sample(seed: u64, cameras: usize) -> Vec<[f64; 2]> {
        let mut random = Pcg64::seed_from_u64(seed);
        let one = |_| {
            let own = 0.2 + 0.2 * random.random::<f64>();
            let units = 40 + (random.random::<f64>() * 40.0) as usize;
            let events = (0..units).filter(|_| random.random::<f64>() < own);
            [events.count() as f64, units as f64]
        };
        (0..cameras).map(one).collect()
    }

    #[test]
    fn intervals_hold_the_truth() {
        let rates: Vec<Estimate> = (0..2000)
            .map(|seed| rate(&sample(seed, 30)).unwrap())
            .collect();
        let holds = |r: &&Estimate| r.lower.unwrap() <= 0.3 && 0.3 <= r.upper.unwrap();
        let held = rates.iter().filter(holds).count();
        assert!((1860..=1940).contains(&held), "{held} of 2000");
    }

    #[test]
    fn what_is_less_in_most_clusters_is_shown_and_chance_is_not() {
        let b = [5.0, 7.0, 6.0, 9.0, 5.0, 8.0];
        let a = b.map(|x| x - 1.0 - 0.1 * (x - 6.0));
        assert!(shows_less(&a, &b, 0.05) && !shows_less(&b, &a, 0.05));
        // One cluster of six is not significant.
        let mut one = [0.0; 6];
        one[3] = 9.0;
        assert!(!shows_less(&[0.0; 6], &one, 0.05));
        assert!(shows_less(&[0.0; 6], &[1.0; 6], 0.05) && !shows_less(&b, &b, 0.05));
        assert!(shows_less(&[1.0], &[2.0], 0.05) && !shows_less(&[], &[], 0.05));
    }
}
