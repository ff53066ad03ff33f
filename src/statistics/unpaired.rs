//! The verdict on two stored reports, whose processes are not paired.

use std::collections::BTreeMap;

use super::judgement::judge_estimates;
use super::one_run::estimate;
use super::trimmed::{centre, difference};
use super::{Judgement, Trimmed, median};

/// Least change between two runs that counts as one: 5 %.
///
/// Single cells of one program moved by 9 % from one quiet run to the next.
const FLOOR_OF_RUNS: f64 = 0.05;

/// Fewest cells from which the scatter of runs is estimated.
///
/// Among all cells; among those of one structure or group.
const LEAST_CELLS: usize = 8;
const LEAST_OF_ONE: usize = 4;
/// Standard deviation / median absolute deviation of a normal distribution.
const SD_PER_MAD: f64 = 1.4826;

/// Judges the cells of two stored reports.
///
/// Per cell: one logarithm per process, of a time or better of a ratio within the process; the
/// numbers of processes may differ.
///
/// The estimate is the difference of two 20 % trimmed means with the standard error and degrees of
/// freedom of Yuen and Welch, or those of the plain means if these scatter more. Two runs of one
/// program differ by more than their processes do: other load, other hours. The additional variance
/// is estimated from the cells themselves, as an empirical null (Efron 2004, "Large-scale
/// simultaneous hypothesis testing"): it is the scatter beyond their standard errors of all cells,
/// of those of one structure about their own median, or of those of one group (scene and path),
/// whichever is largest.
///
/// Then the rules of [`judge`](super::judge) apply with two exceptions: slower and faster mean a
/// change proven to exceed 5 %, and no cell's variance is lowered to that of the others, since a
/// tree that fills the cache scatters ten times as much as a small one. A cell with fewer than
/// three processes on a side is inconclusive, with a ratio but no interval, and does not count as a
/// test in Holm's correction. `None` for a cell with an empty side, or a value that is not finite.
/// Cells of only one of the two reports are left out. `names` has structure and group of each cell.
pub fn judge_unpaired<S: Ord, G: Ord>(
    old: &[Vec<f64>],
    new: &[Vec<f64>],
    names: &[(S, G)],
    threshold: f64,
) -> Vec<Option<Judgement>> {
    let sides = || old.iter().zip(new);
    let changed =
        |(old, new): (&Vec<f64>, &Vec<f64>)| Some(difference(&estimate(old)?, &estimate(new)?));
    let estimates: Vec<Option<Trimmed>> = sides().map(changed).collect();
    let known = estimates.iter().zip(names);
    let known = known.filter_map(|(found, names)| Some(((*found)?, names)));
    let (own, names): (Vec<Trimmed>, Vec<&(S, G)>) = known.unzip();
    // More processes do not reduce the scatter of the runs.
    let judged = judge_estimates(estimates, [threshold, FLOOR_OF_RUNS], |cells| {
        for (cell, own) in cells.iter_mut().zip(own) {
            if own.standard_error > cell.standard_error {
                *cell = own;
            }
        }
        add_scatter_of_runs(cells, &names)
    });
    let judged = sides().zip(judged);
    let judged = judged.map(|((old, new), judged)| judged.or_else(|| without_interval(old, new)));
    judged.collect()
}

/// Adds the scatter of the runs; returns each cell's added standard deviation.
fn add_scatter_of_runs<S: Ord, G: Ord>(cells: &mut [Trimmed], names: &[&(S, G)]) -> Vec<f64> {
    // Relative to the others of its group a cell is expected not to move.
    let of_all = excess_variance(cells, 0.0, LEAST_CELLS);
    let of_structure = scatter_within(cells, names.iter().map(|names| &names.0), |cells| {
        median(&cells.iter().map(|cell| cell.mean).collect::<Vec<_>>()).unwrap_or_default()
    });
    let of_group = scatter_within(cells, names.iter().map(|names| &names.1), |_| 0.0);
    let cells = cells.iter_mut().zip(names);
    let added = cells.map(|(cell, (structure, group))| {
        let own = of_structure[structure].max(of_group[group]);
        let scatter = of_all.max(own).sqrt();
        cell.standard_error = cell.standard_error.hypot(scatter);
        scatter
    });
    added.collect()
}

/// [`excess_variance`] among the cells of each name about their `middle`.
fn scatter_within<'n, N: Ord>(
    cells: &[Trimmed],
    names: impl Iterator<Item = &'n N>,
    middle: impl Fn(&[Trimmed]) -> f64,
) -> BTreeMap<&'n N, f64> {
    let mut alike: BTreeMap<&N, Vec<Trimmed>> = BTreeMap::new();
    for (name, cell) in names.zip(cells) {
        alike.entry(name).or_default().push(*cell);
    }
    let scatter = |cells: Vec<Trimmed>| excess_variance(&cells, middle(&cells), LEAST_OF_ONE);
    let alike = alike.into_iter();
    alike.map(|(name, cells)| (name, scatter(cells))).collect()
}

/// Variance of the means about `middle` beyond their standard errors.
///
/// From the median absolute deviation; zero for fewer than `least` cells.
fn excess_variance(cells: &[Trimmed], middle: f64, least: usize) -> f64 {
    if cells.len() < least {
        return 0.0;
    }
    let of = |what: &dyn Fn(&Trimmed) -> f64| {
        median(&cells.iter().map(what).collect::<Vec<_>>()).unwrap_or(0.0)
    };
    let scatter = SD_PER_MAD * of(&|cell| (cell.mean - middle).abs());
    (scatter.powi(2) - of(&|cell| cell.standard_error.powi(2))).max(0.0)
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
        let found = judge_unpaired(&[side(1.0)], &[side(1.1)], &[("a", 0)], 0.05)[0].unwrap();
        assert_eq!((found.change, found.pairs), (Change::Slower, 10));
        // se = sqrt(2) * 0.01190238, above that of plain means, df = 8: t = 2.306004.
        let margin = 2.306_004 * 0.011_902_38 * 2f64.sqrt();
        assert!((found.lower.unwrap().ln() - (0.1 - margin)).abs() < 1e-7);
        let found = judge_unpaired(&[side(1.1)], &[side(1.0)], &[("a", 0)], 0.05)[0].unwrap();
        assert_eq!(found.change, Change::Faster);
    }

    /// Ten structures in four scenes each; `of` is the change of each cell.
    fn judged(of: impl Fn(usize, usize) -> f64) -> Vec<Judgement> {
        let names: Vec<(usize, usize)> = (0..40).map(|cell| (cell / 4, cell % 4)).collect();
        let old = vec![side(0.0); 40];
        let new: Vec<Vec<f64>> = (0..40).map(|cell| side(of(cell / 4, cell % 4))).collect();
        let found = judge_unpaired(&old, &new, &names, 0.05);
        found.into_iter().map(Option::unwrap).collect()
    }

    #[test]
    fn what_two_runs_scatter_by_is_no_change() {
        let calm = judged(|structure, _| if structure == 3 { 0.12 } else { 0.0 });
        let slower = |found: &[Judgement]| {
            let slower = found.iter().filter(|found| found.change == Change::Slower);
            slower.count()
        };
        assert_eq!(slower(&calm), 4, "a structure that moved as a whole");
        // The same if every cell moves that much, up or down.
        let wild = judged(|structure, scene| match (structure + scene) % 2 {
            0 => 0.12,
            _ => -0.12,
        });
        assert_eq!(slower(&wild), 0);
        // No number of processes changes that.
        assert!(wild.iter().all(|found| found.more_pairs.is_none()));
        let unclear = judge_unpaired(&[side(0.0)], &[side(0.06)], &[("a", 0)], 0.05)[0].unwrap();
        assert!(unclear.more_pairs.is_some());
        // A single structure that scatters is found by its own cells.
        let one = judged(|structure, scene| match (structure, scene) {
            (3, 0 | 2) => 0.12,
            (3, _) => -0.12,
            _ => 0.0,
        });
        assert_eq!(slower(&one), 0);
        // Nor do the cells of a scene that was disturbed by other processes.
        let disturbed = judged(|structure, scene| match (scene, structure % 2) {
            (1, 0) => 0.3,
            (1, _) => -0.3,
            _ => 0.0,
        });
        assert_eq!(slower(&disturbed), 0);
    }

    /// Quiet cells say nothing about a noisy neighbour.
    #[test]
    fn a_noisy_cell_keeps_its_variance() {
        let noisy = |centre: f64| -> Vec<f64> {
            let scatter = |i: i32| centre + 0.1 * (f64::from(i) - 4.5);
            (0..10).map(scatter).collect()
        };
        let names: Vec<(usize, usize)> = (0..40).map(|cell| (cell, cell)).collect();
        let [mut old, mut new] = [vec![side(0.0); 40], vec![side(0.0); 40]];
        (old[0], new[0]) = (noisy(0.0), noisy(0.45));
        let alone = judge_unpaired(&old[..1], &new[..1], &names[..1], 0.05)[0].unwrap();
        let among = judge_unpaired(&old, &new, &names, 0.05)[0].unwrap();
        assert_eq!(among.lower, alone.lower);
        assert_eq!(among.change, Change::Inconclusive);
    }

    #[test]
    fn one_process_per_side_is_inconclusive() {
        let old = [vec![0.0], side(0.0), vec![]];
        let new = [vec![2f64.ln()], side(0.0), side(0.0)];
        let found = judge_unpaired(&old, &new, &[("a", 0), ("b", 0), ("c", 0)], 0.1);
        let lone = found[0].unwrap();
        assert_eq!((lone.change, lone.lower), (Change::Inconclusive, None));
        assert!((lone.ratio - 2.0).abs() < 1e-12);
        assert_eq!(found[1].unwrap().change, Change::Same);
        assert_eq!(found[2], None);
    }
}
