//! Reading a report: groups of cells with the same question, in the order of
//! their ranks. Ranks are the run's own; nothing here decides a tie.

use super::matching::grouped;
use super::{Report, ReportCell};
use crate::measure::{Judged, Metric, Status, YARDSTICK};

/// Cells of one scene, path, cache state and culling test.
pub struct Comparison<'r> {
    /// Fastest first; what failed comes last, unranked.
    pub ranked: Vec<Ranked<'r>>,
    /// Measured beside them, in the order of the table of bounds.
    pub bounds: Vec<&'r ReportCell>,
}

/// A cell with its rank; none if it may not be compared by its time.
pub struct Ranked<'r> {
    /// 1 is the fastest; tied cells share a rank.
    pub rank: Option<usize>,
    /// The cell as reported.
    pub cell: &'r ReportCell,
}

/// Key of a comparison.
type Key<'r> = [&'r str; 5];

fn key(cell: &ReportCell) -> Key<'_> {
    let path = &cell.path;
    let scene = &cell.scene.name;
    [scene, &path.name, &path.cache, &cell.test, &path.motion]
}

/// All comparisons of a report, in the order in which they were measured.
pub fn comparisons(report: &Report) -> Vec<Comparison<'_>> {
    let cells = report.cells.iter().map(|cell| (key(cell), cell));
    let comparison = |(wanted, cells): (Key<'_>, Vec<_>)| Comparison {
        ranked: ranked(cells),
        bounds: report.bounds.iter().filter(|b| key(b) == wanted).collect(),
    };
    grouped(cells).into_iter().map(comparison).collect()
}

/// Time by which a cell is ranked. Nothing is found faster among no items.
fn time(cell: &ReportCell) -> Option<f64> {
    let time = cell
        .time()
        .map(|time| time.value)
        .filter(|ns| ns.is_finite());
    let time = time.filter(|_| cell.scene.total_count > 0);
    time.filter(|_| cell.status == Status::Ok)
}

/// Cells in the order of the ranks from the run, the faster first within a
/// rank; those without a rank come last.
fn ranked(cells: Vec<&ReportCell>) -> Vec<Ranked<'_>> {
    let cells = cells.into_iter().map(|cell| Ranked {
        rank: cell.rank.filter(|_| time(cell).is_some()),
        cell,
    });
    let mut ranked: Vec<Ranked> = cells.collect();
    let order = |ranked: &Ranked| {
        let time = time(ranked.cell).unwrap_or(f64::INFINITY);
        (ranked.rank.unwrap_or(usize::MAX), time)
    };
    ranked.sort_by(|a, b| {
        let (a, b) = (order(a), order(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    ranked
}

/// A speed-up with the ends of its 95 % interval, where it has one.
pub type Speedup = (f64, Option<[f64; 2]>);

impl<'r> Comparison<'r> {
    /// Any of its cells: scene, path and test are the same in all.
    pub fn about(&self) -> &'r ReportCell {
        self.ranked[0].cell
    }

    /// Those of the first rank: the fastest and what ties with it.
    pub fn winners(&self) -> impl Iterator<Item = &'r ReportCell> {
        let first = self.ranked.iter().filter(|r| r.rank == Some(1));
        first.map(|r| r.cell)
    }

    /// The cells with a rank, fastest first.
    pub fn sound(&self) -> impl Iterator<Item = &'r ReportCell> {
        let ranked = self.ranked.iter().filter(|r| r.rank.is_some());
        ranked.map(|r| r.cell)
    }

    /// The cell of a structure, if it has a rank.
    pub fn sound_cell(&self, structure: &str) -> Option<&'r ReportCell> {
        self.sound().find(|cell| cell.structure == structure)
    }

    /// The speed-up of a cell over the structure `base` of the same comparison.
    pub fn speedup(&self, base: &str, cell: &ReportCell) -> Option<Speedup> {
        if base == YARDSTICK {
            let found = cell.metrics.get("speedup")?;
            return Some((found.value, found.lower.zip(found.upper).map(Into::into)));
        }
        let base = self.sound_cell(base)?.time()?.value;
        let own = cell.time()?;
        let ends = own.upper.zip(own.lower);
        let ends = ends.map(|(most, least)| [base / most, base / least]);
        Some((base / own.value, ends))
    }

    /// The fastest structure that is not this crate's own and whose answers are
    /// right.
    pub fn fastest_peer(&self) -> Option<&'r ReportCell> {
        let mut sound = self.sound();
        sound.find(|cell| cell.origin.as_ref().is_some_and(|origin| !origin.is_ours()))
    }

    /// The fewest and the most of a number, over the cells that were timed.
    pub fn range(&self, of: impl Fn(&ReportCell) -> usize) -> Option<(usize, usize)> {
        let cells = self.ranked.iter().map(|r| r.cell);
        let timed = cells.filter(|cell| cell.times.processes > 0);
        let timed = || timed.clone().map(&of);
        Some((timed().min()?, timed().max()?))
    }

    /// How the answers differ from the truth: all that are right do alike.
    pub fn judged(&self) -> Option<&'r Judged> {
        self.ranked.iter().find_map(|r| r.cell.error.as_ref())
    }

    /// A metric that is the same in all cells, from the first that has it.
    pub fn of_any(&self, metric: &str) -> Option<f64> {
        self.metric_of_any(metric).map(|metric| metric.value)
    }

    /// The same with its interval.
    pub fn metric_of_any(&self, metric: &str) -> Option<&'r Metric> {
        self.ranked.iter().find_map(|r| r.cell.metrics.get(metric))
    }
}

/// Time of `base` / time of `cell`, the ratio of the two shown values: how many
/// times as fast the cell is.
pub fn times_as_fast(base: &ReportCell, cell: &ReportCell) -> Option<f64> {
    Some(base.time()?.value / cell.time()?.value)
}

#[cfg(test)]
pub(super) mod tests;
