//! The verdict on two stored reports, whose processes are not paired.

use super::judgement::judge_estimates;
use super::trimmed::{centre, difference};
use super::{Judgement, trimmed_mean};

/// Judges the cells of two stored reports. Per cell: one logarithm per process,
/// of a time or better of a ratio within the process; the numbers of processes
/// may differ.
///
/// The estimate is the difference of two 20 % trimmed means with the standard
/// error and degrees of freedom of Yuen and Welch; then the rules of
/// [`judge`](super::judge). A cell with under three processes on a side is
/// inconclusive, with a ratio but without interval, and is no test that Holm's
/// correction counts. `None` for a cell with an empty side, or a value that is
/// not finite. Cells that only one of the two reports has are left out.
pub fn judge_unpaired(
    old: &[Vec<f64>],
    new: &[Vec<f64>],
    threshold: f64,
) -> Vec<Option<Judgement>> {
    let sides = || old.iter().zip(new);
    let estimate = |(old, new): (&Vec<f64>, &Vec<f64>)| {
        Some(difference(&trimmed_mean(old)?, &trimmed_mean(new)?))
    };
    let judged = judge_estimates(sides().map(estimate).collect(), threshold);
    sides()
        .zip(judged)
        .map(|((old, new), judged)| judged.or_else(|| without_interval(old, new)))
        .collect()
}

fn without_interval(old: &[f64], new: &[f64]) -> Option<Judgement> {
    let ratio = (centre(new)? - centre(old)?).exp();
    let pairs = old.len().min(new.len());
    Some(Judgement::without_interval(ratio, pairs))
}

#[cfg(test)]
mod tests {
    use super::super::Change;
    use super::*;

    fn side(centre: f64) -> Vec<f64> {
        (0..10)
            .map(|i| centre + 0.01 * (f64::from(i) - 4.5))
            .collect()
    }

    #[test]
    fn reports_are_judged_by_welch() {
        let found = judge_unpaired(&[side(1.0)], &[side(1.1)], 0.05)[0].unwrap();
        assert_eq!((found.change, found.pairs), (Change::Slower, 10));
        // se = sqrt(2) * 0.01190238, df = 10: t = 2.228139.
        let margin = 2.228_139 * 0.011_902_38 * 2f64.sqrt();
        assert!((found.lower.unwrap().ln() - (0.1 - margin)).abs() < 1e-7);
        let found = judge_unpaired(&[side(1.1)], &[side(1.0)], 0.05)[0].unwrap();
        assert_eq!(found.change, Change::Faster);
    }

    #[test]
    fn one_process_per_side_is_inconclusive() {
        let old = [vec![0.0], side(0.0), vec![]];
        let new = [vec![2f64.ln()], side(0.0), side(0.0)];
        let found = judge_unpaired(&old, &new, 0.1);
        let lone = found[0].unwrap();
        assert_eq!((lone.change, lone.lower), (Change::Inconclusive, None));
        assert!((lone.ratio - 2.0).abs() < 1e-12);
        assert_eq!(found[1].unwrap().change, Change::Same);
        assert_eq!(found[2], None);
    }
}
