//! Structures over several comparisons: speed-ups relative to one structure, their
//! geometric means, and the number of comparisons each is first in.

use super::{Comparison, ReportCell};
use crate::measure::YARDSTICK;
use crate::statistics::geometric_mean;

/// The structures of several comparisons.
pub struct Overall<'r> {
    /// Structure that speed-ups refer to: `linear`; where it has no times, the slowest
    /// of those that have times everywhere.
    pub base: Option<&'r str>,
    /// Those with times everywhere, fastest first; the others behind them.
    pub standings: Vec<Mean<'r>>,
}

/// One structure over several comparisons.
pub struct Mean<'r> {
    /// Its label.
    pub structure: &'r str,
    /// Geometric mean of its speed-ups vs the base; `None` if a time is missing.
    pub speedup: Option<f64>,
    /// Comparisons in which it has the first rank, alone or not.
    pub first_in: usize,
    /// Half the 95 % interval of the logarithm of its mean time; 0 without intervals.
    margin: f64,
}

impl Mean<'_> {
    /// True if the geometric means are not told apart. Conservative: the times of two
    /// structures are paired, which this leaves unused.
    pub fn ties_with(&self, other: &Mean) -> bool {
        let ratio = self.speedup.zip(other.speedup).map(|(a, b)| (a / b).ln());
        ratio.is_some_and(|ratio| ratio.abs() <= self.margin.hypot(other.margin))
    }
}

impl<'r> Overall<'r> {
    /// The structures of `all`, of which those without ranks count nothing.
    pub fn of(all: &[&Comparison<'r>]) -> Overall<'r> {
        let ranked = || all.iter().filter(|c| c.winners().next().is_some());
        let mut names: Vec<&'r str> = Vec::new();
        for structure in all
            .iter()
            .flat_map(|c| &c.ranked)
            .map(|r| r.cell.structure.as_str())
        {
            if !names.contains(&structure) {
                names.push(structure);
            }
        }
        let cells = |name: &str| -> Option<Vec<&'r ReportCell>> {
            ranked().map(|c| c.sound_cell(name)).collect()
        };
        let mean = |name: &str| {
            let times = cells(name)?
                .into_iter()
                .map(|cell| Some(cell.time()?.value));
            geometric_mean(&times.collect::<Option<Vec<f64>>>()?)
        };
        let timed = || names.iter().copied().filter_map(|n| Some((n, mean(n)?)));
        let base = timed().find(|(name, _)| *name == YARDSTICK);
        let base = base.or_else(|| timed().max_by(|a, b| a.1.total_cmp(&b.1)));
        let standing = |&structure: &&'r str| Mean {
            structure,
            speedup: base.zip(mean(structure)).map(|(base, mean)| base.1 / mean),
            first_in: ranked()
                .filter(|c| c.winners().any(|cell| cell.structure == structure))
                .count(),
            margin: cells(structure).map_or(0.0, |cells| margin(&cells)),
        };
        let mut standings: Vec<Mean> = names.iter().map(standing).collect();
        let speed = |standing: &Mean| standing.speedup.unwrap_or(0.0);
        standings.sort_by(|a, b| speed(b).total_cmp(&speed(a)));
        Overall {
            base: base.map(|(name, _)| name),
            standings,
        }
    }
}

/// Half the interval of the mean logarithm of independent times.
fn margin(cells: &[&ReportCell]) -> f64 {
    let halves = cells.iter().map(|cell| {
        let time = cell.time();
        let ends = time.and_then(|time| Some((time.lower?, time.upper?)));
        ends.map_or(0.0, |(lower, upper)| (upper / lower).ln() / 2.0)
    });
    let squares: f64 = halves.map(|half| half * half).sum();
    squares.sqrt() / cells.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::super::Ranked;
    use super::super::ranking::tests::cell;
    use super::*;

    /// Two paths with times of each structure, ranked by them.
    fn cells(rows: &[(&str, [f64; 2])]) -> Vec<ReportCell> {
        let of_path = |path: usize| {
            let of_row = move |row: &(&str, [f64; 2])| {
                let mut cell = cell("s", 10, ["p", "q"][path], row.0, row.1[path]);
                let faster = rows.iter().filter(|other| other.1[path] < row.1[path]);
                cell.rank = Some(1 + faster.count());
                cell
            };
            rows.iter().map(of_row).collect::<Vec<_>>()
        };
        [of_path(0), of_path(1)].concat()
    }

    fn overall(cells: &[ReportCell], look: impl Fn(&Overall)) {
        let paths = cells.chunks(cells.len() / 2).map(|cells| Comparison {
            ranked: cells
                .iter()
                .map(|cell| Ranked {
                    rank: cell.rank,
                    cell,
                })
                .collect(),
            bounds: Vec::new(),
        });
        let paths: Vec<Comparison> = paths.collect();
        look(&Overall::of(&paths.iter().collect::<Vec<_>>()));
    }

    #[test]
    fn means_are_geometric_and_refer_to_linear_or_else_to_the_slowest() {
        let rows = [
            ("linear", [800.0, 200.0]),
            ("slow", [1600.0, 1600.0]),
            ("bvh", [100.0, 100.0]),
        ];
        let told = |overall: &Overall| {
            let standings = overall.standings.iter();
            let told = standings.map(|s| (s.structure.to_owned(), s.speedup, s.first_in));
            told.collect::<Vec<_>>()
        };
        let near = |found: Option<f64>, wanted: f64| (found.unwrap() / wanted - 1.0).abs() < 1e-12;
        overall(&cells(&rows), |overall| {
            assert_eq!(overall.base, Some("linear"));
            let [bvh, linear, slow] = &told(overall)[..] else {
                panic!("three structures");
            };
            assert_eq!((bvh.0.as_str(), bvh.2), ("bvh", 2));
            assert!(near(bvh.1, 4.0) && near(linear.1, 1.0) && near(slow.1, 0.25));
        });
        // A wrong answer of linear: it counts nowhere, and is still named.
        let mut failed = cells(&rows);
        failed[0].rank = None;
        overall(&failed, |overall| {
            assert_eq!(overall.base, Some("slow"));
            let told = told(overall);
            assert!(near(told[0].1, 16.0));
            assert_eq!((told[2].0.as_str(), told[2].1), ("linear", None));
        });
    }

    #[test]
    fn means_within_their_intervals_tie() {
        let mut cells = cells(&[("linear", [400.0; 2]), ("a", [100.0; 2]), ("b", [103.0; 2])]);
        let ties = |cells: &[ReportCell], wanted: [bool; 2]| {
            overall(cells, |overall| {
                let [a, b, linear] = &overall.standings[..] else {
                    panic!("three structures");
                };
                assert_eq!([a.ties_with(b), a.ties_with(linear)], wanted);
            });
        };
        ties(&cells, [false, false]);
        for cell in &mut cells {
            if let Some(time) = cell.metrics.get_mut("query_ns") {
                time.lower = Some(time.value / 1.05);
                time.upper = Some(time.value * 1.05);
            }
        }
        // Over two paths, 5 % of each of two structures are 5 % of the ratio.
        ties(&cells, [true, false]);
    }
}
