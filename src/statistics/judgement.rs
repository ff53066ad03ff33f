//! The verdict of a comparison: slower, faster, same or inconclusive.

use serde::{Deserialize, Serialize};

use super::trimmed::{kept, moderate};
use super::{Trimmed, student, trimmed_mean};

/// Rejected hypotheses, with a familywise error rate of at most `alpha` (Holm).
///
/// Holm 1979, "A simple sequentially rejective multiple test procedure", sec. 2. A NaN is never
/// rejected, but counts as a test.
fn holm(p: &[f64], alpha: f64) -> Vec<bool> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut rejected = vec![false; p.len()];
    let steps = order.iter().enumerate();
    let small_enough = |(step, i): &(usize, &usize)| p[**i] <= alpha / (p.len() - step) as f64;
    steps
        .take_while(small_enough)
        .for_each(|(_, &i)| rejected[i] = true);
    rejected
}

/// Familywise error rate of each direction over all cells of a comparison.
///
/// Half of the promised 5 %, as a reserve for what the model does not cover.
const ALPHA: f64 = 0.025;

/// Least change that counts as one: 1 %; a verdict proves a larger one.
///
/// Two builds of the same code differ that much by the linker's placement (Mytkowicz et al. 2009),
/// and two processes by their memory layout.
const FLOOR: f64 = 0.01;

/// Quantile for the ends of the 95 % interval.
const INTERVAL: f64 = 0.975;

/// Quantile for the ends of the 90 % interval: a one-sided 5 % test at each end.
const EQUIVALENCE: f64 = 0.95;

/// 95 % quantile of the normal distribution: the power of a resolution.
const POWER: f64 = 1.645;

/// Most pairs for which the number of missing pairs is computed.
///
/// If this many would not decide, none would.
const MOST_PAIRS: usize = 10_000;

named! {
    /// Change of the new times against the old ones.
    #[derive(Clone, Copy, Default, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub enum Change {
        /// Longer: proven to exceed the floor.
        Slower = "slower",
        /// Shorter: proven to exceed the floor.
        Faster = "faster",
        /// A change of the threshold's size is ruled out.
        Same = "same",
        /// Neither a change nor its absence is proven.
        #[default]
        Inconclusive = "inconclusive",
    }
}

/// The verdict on one cell, with its figures.
#[derive(Clone, Copy, Default, PartialEq, Debug, Serialize, Deserialize)]
pub struct Judgement {
    /// Slower, faster, same or inconclusive.
    pub change: Change,
    /// New time / old time: above 1 is slower.
    pub ratio: f64,
    /// Lower end of the 95 % interval of the ratio; `None` below three pairs.
    ///
    /// The interval always contains the ratio.
    pub lower: Option<f64>,
    /// Upper end of the interval.
    pub upper: Option<f64>,
    /// The smallest change (0.05 is 5 %) that about 85 % of such comparisons detect.
    pub resolution: Option<f64>,
    /// For an inconclusive cell: approximate number of further pairs that would decide.
    pub more_pairs: Option<usize>,
    /// Pairs of processes; for two reports, processes of the smaller one.
    pub pairs: usize,
}

impl Judgement {
    /// A ratio without a verdict.
    pub(crate) fn without_interval(ratio: f64, pairs: usize) -> Judgement {
        Judgement {
            ratio,
            pairs,
            ..Judgement::default()
        }
    }
}

/// Judges the cells of a comparison of two binaries.
///
/// Per cell: ln(new / old) of each pair of processes; `threshold` 0.05 is 5 %. `None` for a cell
/// with fewer than three pairs, or with a value that is not finite.
///
/// The estimate of a cell is the 20 % trimmed mean of its differences; its standard error is
/// moderated over the cells. In this order a cell is
///
/// 1. slower or faster, if its change exceeds 1 %, significant in one-sided tests of 2.5 % with
///    Holm's correction over the judged cells (each direction by itself);
/// 2. same, if the 90 % interval lies within ± ln(1 + threshold): two one-sided tests (Schuirmann
///    1987);
/// 3. inconclusive.
///
/// A change that is proven but within the threshold (+3 % with a threshold of 5 %) is therefore
/// slower. The threshold is the precision required for "same", and so determines the number of
/// pairs; it does not excuse a proven loss, since a series of 2 % steps would add up to any loss.
/// To tolerate some loss, compare `lower` with a tolerance.
pub fn judge(differences: &[Vec<f64>], threshold: f64) -> Vec<Option<Judgement>> {
    let estimates = differences.iter().map(|d| trimmed_mean(d));
    judge_estimates(estimates.collect(), [threshold, FLOOR], |cells| {
        vec![0.0; cells.len()]
    })
}

/// Returns true if the resolution of every judged cell is at most the threshold.
///
/// The stopping rule of a comparison: precision, never significance. Stopping at the first
/// significant difference would find one where there is none.
pub fn resolved(judged: &[Option<Judgement>], threshold: f64) -> bool {
    let mut resolutions = judged.iter().map(|j| j.as_ref().and_then(|j| j.resolution));
    resolutions.all(|found| found.is_some_and(|resolution| resolution <= threshold))
}

/// Judges estimates of ln(new / old) after moderating and widening their variances.
///
/// A cell without an estimate gets no verdict. Slower or faster means a change proven to exceed the
/// floor. `widen` returns the part of each cell's standard error that more pairs do not reduce.
pub(super) fn judge_estimates(
    estimates: Vec<Option<Trimmed>>,
    [threshold, floor]: [f64; 2],
    widen: impl FnOnce(&mut [Trimmed]) -> Vec<f64>,
) -> Vec<Option<Judgement>> {
    let mut cells: Vec<Trimmed> = estimates.iter().flatten().copied().collect();
    moderate(&mut cells);
    let fixed = widen(&mut cells);
    let floor = floor.ln_1p();
    let above: Vec<f64> = cells.iter().map(|cell| cell.p_above(floor)).collect();
    let below: Vec<f64> = cells.iter().map(|cell| cell.p_below(-floor)).collect();
    let (slower, faster) = (holm(&above, ALPHA), holm(&below, ALPHA));
    let tests = cells.len();
    let mut judged = cells.iter().enumerate().map(|(i, cell)| {
        let change = match (slower[i], faster[i]) {
            (true, _) => Change::Slower,
            (_, true) => Change::Faster,
            _ if is_same(cell, threshold) => Change::Same,
            _ => Change::Inconclusive,
        };
        let margin = cell.margin(INTERVAL);
        let more = || more_pairs(cell, fixed[i], tests, [threshold, floor]);
        let is_open = change == Change::Inconclusive;
        Judgement {
            change,
            ratio: cell.mean.exp(),
            lower: Some((cell.mean - margin).exp()),
            upper: Some((cell.mean + margin).exp()),
            resolution: Some(resolution(cell, tests, floor)),
            more_pairs: is_open.then(more).flatten(),
            pairs: cell.count,
        }
    });
    let judged = |estimate: &Option<Trimmed>| estimate.and_then(|_| judged.next());
    estimates.iter().map(judged).collect()
}

/// Two one-sided 5 % tests.
fn is_same(cell: &Trimmed, threshold: f64) -> bool {
    cell.mean.abs() + cell.margin(EQUIVALENCE) <= threshold.ln_1p()
}

/// The change that is detected with 82 to 88 % power at Holm's strictest step.
///
/// With 95 % at twice its level: exp(ln 1.01 + (t(1 - 0.05/m, df) + 1.645) se) - 1.
fn resolution(cell: &Trimmed, tests: usize, floor: f64) -> f64 {
    let t = student::quantile(1.0 - 2.0 * ALPHA / tests as f64, cell.df);
    (floor + (t + POWER) * cell.standard_error).exp_m1()
}

/// Number of further pairs that would prove the change, or prove it small enough.
///
/// Whichever comes first, if mean and spread stay as they are; `fixed` is the part of the standard
/// error that pairs do not reduce.
fn more_pairs(
    cell: &Trimmed,
    fixed: f64,
    tests: usize,
    [threshold, floor]: [f64; 2],
) -> Option<usize> {
    let shrinks = (cell.standard_error.powi(2) - fixed.powi(2)).max(0.0);
    let decides = |count: usize| {
        let shrunk = (shrinks * cell.count as f64 / count as f64).sqrt();
        let mut future = *cell;
        future.standard_error = shrunk.hypot(fixed);
        future.df = cell.df + kept(count) - kept(cell.count);
        future.count = count;
        let margin = future.margin(1.0 - ALPHA / tests as f64);
        margin + floor < future.mean.abs() || is_same(&future, threshold)
    };
    // More pairs never make it worse, except for a step of the cut: bisection is exact enough for
    // an approximate number.
    let (mut without, mut with) = (cell.count, MOST_PAIRS);
    if !decides(with) {
        return None;
    }
    while with - without > 1 {
        let middle = without.midpoint(with);
        match decides(middle) {
            true => with = middle,
            false => without = middle,
        }
    }
    Some(with - cell.count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_procedure_stops_at_the_first_that_fails() {
        // 0.01 <= .05/4, 0.02 > .05/3: then 0.03 <= .05/1 does not count.
        let p = [0.03, 0.02, 0.01, 0.9];
        assert_eq!(holm(&p, 0.05), [false, false, true, false]);
        // 0.01 <= 0.05 / 3, 0.02 <= 0.05 / 2, 0.06 > 0.05 / 1.
        assert_eq!(holm(&[0.02, 0.06, 0.01], 0.05), [true, false, true]);
        assert_eq!(holm(&[0.01, f64::NAN], 0.05), [true, false]);
        assert_eq!(holm(&[0.03, f64::NAN], 0.05), [false, false]);
        assert!(holm(&[], 0.05).is_empty());
    }

    proptest! {
        #[test]
        fn a_smaller_p_is_never_worse_and_bonferroni_never_better(
            p in prop::collection::vec(0.0..0.1f64, 1..20), which in 0..20usize
        ) {
            let before = holm(&p, 0.05);
            let which = which % p.len();
            let mut smaller = p.clone();
            smaller[which] /= 2.0;
            for (i, after) in holm(&smaller, 0.05).into_iter().enumerate() {
                prop_assert!(after || !before[i]);
                prop_assert!(before[i] || p[i] > 0.05 / p.len() as f64);
                prop_assert!(!before[i] || p[i] <= 0.05);
                for k in 0..p.len() {
                    prop_assert!(before[k] || !before[i] || p[i] <= p[k]);
                }
            }
        }
    }

    /// Ten pairs about `centre`, their standard error `spread` * 1.190238.
    fn cell(centre: f64, spread: f64) -> Vec<f64> {
        (0..10)
            .map(|i| centre + spread * (f64::from(i) - 4.5))
            .collect()
    }

    fn one(values: Vec<f64>, threshold: f64) -> Judgement {
        judge(&[values], threshold)[0].unwrap()
    }

    #[test]
    fn the_four_verdicts() {
        let change = |centre, spread| one(cell(centre, spread), 0.05).change;
        assert_eq!(change(0.06, 0.005), Change::Slower);
        assert_eq!(change(-0.06, 0.005), Change::Faster);
        // Proven to exceed 1 %, within the threshold: still slower.
        assert_eq!(change(0.03, 0.005), Change::Slower);
        // Proven, but possibly below 1 %.
        assert_eq!(change(0.02, 0.005), Change::Same);
        // Proven, but below 1 %.
        assert_eq!(change(0.009, 0.001), Change::Same);
        assert_eq!(change(0.0, 0.01), Change::Same);
        assert_eq!(change(0.03, 0.02), Change::Inconclusive);
        assert_eq!(judge(&[vec![0.0; 2], vec![]], 0.05), [None, None]);
        assert_eq!(Change::Inconclusive.name(), "inconclusive");
        let json = serde_json::to_string(&Change::Slower).unwrap();
        assert_eq!(json, format!("\"{}\"", Change::Slower.name()));
    }

    #[test]
    fn the_figures_are_those_of_the_formulas() {
        let found = one(cell(0.03, 0.02), 0.05);
        let se: f64 = 0.02 * 1.190_238;
        let near = |found: f64, wanted: f64| {
            assert!((found - wanted).abs() < 1e-6, "{found}, not {wanted}");
        };
        near(found.ratio, 0.03f64.exp());
        near(found.lower.unwrap(), (0.03 - 2.570_582 * se).exp());
        near(found.upper.unwrap(), (0.03 + 2.570_582 * se).exp());
        // One cell: t(0.95, 5) = 2.015048.
        near(
            found.resolution.unwrap(),
            (0.01f64.ln_1p() + (2.015_048 + 1.645) * se).exp_m1(),
        );
        assert_eq!(found.pairs, 10);
    }

    #[test]
    fn as_many_more_pairs_as_advised_decide() {
        for (centre, spread) in [(0.03, 0.02), (0.0, 0.03), (0.06, 0.05), (0.045, 0.02)] {
            let before = Trimmed {
                mean: centre,
                ..trimmed_mean(&cell(centre, spread)).unwrap()
            };
            let more = more_pairs(&before, 0.0, 1, [0.05, FLOOR.ln_1p()]).unwrap();
            // The same pairs repeated: mean and spread stay.
            let repeated = |count: usize| {
                let values: Vec<f64> = cell(centre, spread).repeat(1 + count / 10);
                one(values, 0.05).change
            };
            assert_ne!(repeated(more * 6 / 5 + 10), Change::Inconclusive, "{more}");
            assert_eq!(repeated(more * 2 / 3), Change::Inconclusive, "{more}");
        }
        // Too small for a change, too large for "same".
        assert_eq!(one(cell(0.008, 0.02), 0.005).more_pairs, None);
        assert_eq!(one(cell(0.06, 0.005), 0.05).more_pairs, None);
    }

    proptest! {
        #[test]
        fn verdicts_are_symmetric_and_hold_their_ratio(
            cells in prop::collection::vec((-0.1..0.1f64, 0.0..0.05f64), 1..9)
        ) {
            let cells: Vec<Vec<f64>> = cells.iter().map(|c| cell(c.0, c.1)).collect();
            let swapped: Vec<Vec<f64>> = cells
                .iter()
                .map(|cell| cell.iter().map(|d| -d).collect())
                .collect();
            for (a, b) in judge(&cells, 0.05).iter().zip(judge(&swapped, 0.05)) {
                let (a, b) = (a.unwrap(), b.unwrap());
                prop_assert!(a.lower.unwrap() <= a.ratio && a.ratio <= a.upper.unwrap());
                prop_assert!((a.lower.unwrap() * b.upper.unwrap() - 1.0).abs() < 1e-9);
                let mirrored = match a.change {
                    Change::Slower => Change::Faster,
                    Change::Faster => Change::Slower,
                    other => other,
                };
                prop_assert_eq!(b.change, mirrored);
            }
        }
    }
}
