//! Structures over all comparisons of a report: speed-ups over one base, their
//! geometric mean, and how often each is first.

use super::{Comparison, ReportCell};
use crate::measure::YARDSTICK;
use crate::statistics::geometric_mean;

/// A speed-up with the ends of its 95 % interval, where it has one.
pub type Speedup = (f64, Option<[f64; 2]>);

/// A structure over several comparisons.
pub struct Standing<'r> {
    /// Label of the structure.
    pub structure: &'r str,
    /// Geometric mean of the speed-ups over the base.
    pub speedup: f64,
    /// Comparisons in which it has a speed-up.
    pub cells: usize,
    /// Comparisons in which it is the fastest, or ties with it.
    pub first: usize,
    /// Longest time / time of the fastest, over those comparisons.
    pub worst: f64,
}

/// Structure that all speed-ups refer to.
///
/// It is linear where that was measured; otherwise the slowest that ranks in most
/// comparisons.
pub fn base_of<'r>(comparisons: &[Comparison<'r>]) -> Option<&'r str> {
    let sound = || comparisons.iter().flat_map(Comparison::sound);
    let linear = sound().find(|cell| cell.structure == YARDSTICK);
    if let Some(cell) = linear {
        return Some(&cell.structure);
    }
    let count = |name: &str| sound().filter(|cell| cell.structure == name).count();
    let slowest = comparisons.iter().flat_map(|c| c.sound().last());
    let base = slowest.max_by_key(|cell| count(&cell.structure));
    base.map(|cell| cell.structure.as_str())
}

impl<'r> Comparison<'r> {
    /// The speed-up of a cell over the structure `base` of the same comparison.
    pub fn speedup(&self, base: &str, cell: &ReportCell) -> Option<Speedup> {
        if base == YARDSTICK {
            let found = cell.metrics.get("speedup")?;
            return Some((found.value, found.lower.zip(found.upper).map(Into::into)));
        }
        let base = self.cell(base)?.value("query_ns")?;
        let own = cell.metrics.get("query_ns")?;
        let ends = own.upper.zip(own.lower);
        let ends = ends.map(|(most, least)| [base / most, base / least]);
        Some((base / own.value, ends))
    }

    /// The sound cell of a structure.
    pub fn cell(&self, structure: &str) -> Option<&'r ReportCell> {
        self.sound().find(|cell| cell.structure == structure)
    }
}

/// All structures that rank anywhere.
///
/// Those of most comparisons come first, then those of the highest speed-up.
pub fn standings<'r>(comparisons: &[Comparison<'r>], base: &str) -> Vec<Standing<'r>> {
    let mut names: Vec<&str> = Vec::new();
    for cell in comparisons.iter().flat_map(Comparison::sound) {
        if !names.contains(&cell.structure.as_str()) {
            names.push(&cell.structure);
        }
    }
    let standing = |structure: &'r str| {
        let (mut ratios, mut first, mut worst) = (Vec::new(), 0, 1.0f64);
        for comparison in comparisons {
            let Some(cell) = comparison.cell(structure) else {
                continue;
            };
            ratios.extend(comparison.speedup(base, cell).map(|ratio| ratio.0));
            first += usize::from(cell.rank == Some(1));
            let best = comparison.sound().next().and_then(|c| c.value("query_ns"));
            let behind = best
                .zip(cell.value("query_ns"))
                .map(|(best, own)| own / best);
            worst = worst.max(behind.unwrap_or(1.0));
        }
        Some(Standing {
            structure,
            speedup: geometric_mean(&ratios)?,
            cells: ratios.len(),
            first,
            worst,
        })
    };
    let mut all: Vec<Standing> = names.into_iter().filter_map(standing).collect();
    all.sort_by(|a, b| {
        let by_speed = || b.speedup.total_cmp(&a.speedup);
        b.cells.cmp(&a.cells).then_with(by_speed)
    });
    all
}

#[cfg(test)]
mod tests {
    use super::super::Ranked;
    use super::super::ranking::tests::cell;
    use super::*;

    /// Structures with their times, the fastest first.
    fn comparison(scene: &str, times: &[(&str, f64)]) -> Comparison<'static> {
        let cells = times.iter().zip(1..).map(|(&(name, ns), rank)| {
            let mut cell = cell(scene, 10, "p", name, ns);
            cell.rank = Some(rank);
            let cell = Box::leak(Box::new(cell));
            Ranked {
                rank: cell.rank,
                cell,
            }
        });
        Comparison {
            ranked: cells.collect(),
            bounds: Vec::new(),
        }
    }

    #[test]
    fn means_are_over_all_comparisons_and_the_base_is_in_most() {
        let all = [
            comparison("a", &[("wide", 10.0), ("bvh", 40.0), ("grid", 80.0)]),
            comparison("b", &[("bvh", 20.0), ("wide", 40.0), ("grid", 40.0)]),
            comparison("c", &[("wide", 1.0), ("slow", 1e6)]),
        ];
        let base = base_of(&all).unwrap();
        assert_eq!(base, "grid");
        let found = standings(&all[..2], base);
        let shown: Vec<_> = found
            .iter()
            .map(|s| (s.structure, s.first, s.worst))
            .collect();
        assert_eq!(shown, [("wide", 1, 2.0), ("bvh", 1, 4.0), ("grid", 0, 8.0)]);
        // 8 x and 1 x; 2 x and 2 x.
        assert!((found[0].speedup - 8f64.sqrt()).abs() < 1e-9);
        assert!((found[1].speedup - 2.0).abs() < 1e-9);
        let linear = [comparison("d", &[("linear", 1.0), ("bvh", 2.0)])];
        assert_eq!(base_of(&linear), Some("linear"));
    }
}
