//! Detection of a machine with two speeds.

use super::means::{mean, squares};
use super::sorted;

/// Fewer values show clusters by chance.
const FEWEST: usize = 40;

/// Each cluster's least share of the values.
const LEAST_SHARE: f64 = 0.2;

/// Least distance of the centres, in standard deviations within the clusters.
const SEPARATION: f64 = 5.0;

/// The centres (geometric means) of the two clusters that times of one and the
/// same work fall into, the fast one first; `None` if there is but one cluster,
/// below forty values, or for a value that is not positive.
///
/// The logarithms are split where the variance within both parts is smallest
/// (Otsu 1979, "A threshold selection method from gray-level histograms"), each
/// part at least a fifth of them. The parts are two clusters if their centres
/// are over 5 standard deviations apart, these taken within the parts: halves
/// of a normal distribution are 2.6 apart, of a uniform one 3.5.
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
        // Too rare to be a speed; not two heaps but one; too few; no times.
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
