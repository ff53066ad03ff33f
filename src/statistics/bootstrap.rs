//! The bootstrap: intervals by drawing again from the data.

use super::{median, quantile, sorted};

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

/// SplitMix64 (Steele, Lea and Flood 2014), reduced to `0..count`.
fn next_below(state: &mut u64, count: usize) -> usize {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    ((u128::from(z) * count as u128) >> 64) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

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
