//! Related cells of reports.
//!
//! Groups of cells for the same queries, in the order of the run's ranks; structures over several
//! groups; cells of two reports with the same key.

use std::collections::BTreeMap;

use super::{Report, ReportCell};
use crate::measure::{CellTimes, GroupKey, Judged, Metric, Status, YARDSTICK};
use crate::shown::number;
use crate::statistics::{ALPHA, Estimate, geometric_mean, is_less, speedup};

/// Cells of one scene, path, cache state and culling test.
pub struct Comparison<'r> {
    /// Fastest first; failed ones last, without a rank.
    pub cells: Vec<&'r ReportCell>,
    /// Bounds measured in the same rounds, in the order of their table.
    pub bounds: Vec<&'r ReportCell>,
}

/// All comparisons of a report, in the order in which they were measured.
pub fn comparisons(report: &Report) -> Vec<Comparison<'_>> {
    let group = |cell: &ReportCell| cell.key().group;
    let cells = report.cells.iter().map(|cell| (group(cell), cell));
    let comparison = |(wanted, cells): (GroupKey, Vec<_>)| Comparison {
        cells: ranked(cells),
        bounds: (report.bounds.iter().filter(|b| group(b) == wanted)).collect(),
    };
    grouped(cells).into_iter().map(comparison).collect()
}

/// Removes the ranks of cells that must not be compared by their times.
///
/// Those without a time, and those of scenes without items, where nothing is found faster.
pub(super) fn without_false_ranks(cells: &mut [ReportCell]) {
    for cell in cells {
        let is_time = |ns: f64| ns.is_finite() && ns > 0.0;
        let is_timed = cell.time().is_some_and(|time| is_time(time.value));
        let is_sound = is_timed && cell.scene.total_count > 0 && cell.status == Status::Ok;
        cell.rank = cell.rank.filter(|_| is_sound);
    }
}

/// Cells in the order of their ranks, the faster first within a rank.
///
/// Those without a rank come last.
fn ranked(mut cells: Vec<&ReportCell>) -> Vec<&ReportCell> {
    let time = |cell: &ReportCell| {
        let time = cell.rank.and_then(|_| cell.time());
        time.map_or(f64::INFINITY, |time| time.value)
    };
    cells.sort_by(|a, b| time(a).total_cmp(&time(b)));
    cells.sort_by_key(|cell| cell.rank.unwrap_or(usize::MAX));
    cells
}

impl<'r> Comparison<'r> {
    /// Any of its cells: scene, path and test are common to all.
    pub fn about(&self) -> &'r ReportCell {
        self.cells[0]
    }

    /// The cells of the first rank: the fastest and its ties.
    pub fn winners(&self) -> impl Iterator<Item = &'r ReportCell> {
        self.sound().filter(|cell| cell.rank == Some(1))
    }

    /// Returns true if no camera sees an item.
    pub fn is_blind(&self) -> bool {
        self.of_any("visible_count") == Some(0.0)
    }

    /// Returns true if its ranks are informative.
    ///
    /// The fastest of empty answers is no advice.
    pub fn decides(&self) -> bool {
        !self.is_blind() && self.winners().next().is_some()
    }

    /// The cells with a rank, fastest first.
    pub fn sound(&self) -> impl Iterator<Item = &'r ReportCell> {
        let cells = self.cells.iter().copied();
        cells.filter(|cell| cell.rank.is_some())
    }

    /// The cell of a structure, if it has a rank.
    pub fn sound_cell(&self, structure: &str) -> Option<&'r ReportCell> {
        self.sound().find(|cell| cell.structure == structure)
    }

    /// The speed-up of a cell over the structure `base` of the same comparison.
    ///
    /// Process by process; the base itself has no interval.
    pub fn speedup(&self, base: &str, cell: &ReportCell) -> Option<Estimate> {
        if base == YARDSTICK {
            return cell.metrics.get("speedup").map(Metric::estimate);
        }
        let base = self.sound_cell(base)?;
        let value = times_as_fast(base, cell)?;
        let [logs, own] = [base, cell].map(|cell| cell.ln_ns(cell.ranked_by()));
        // Centred on the ratio of the two reported values.
        let found = speedup(&logs, &own).map(|found| found.per(found.value / value));
        let exact = Estimate::exact(value);
        Some(found.map_or(exact, |found| Estimate { value, ..found }))
    }

    /// The fastest structure of another crate with right answers.
    pub fn fastest_peer(&self) -> Option<&'r ReportCell> {
        let mut sound = self.sound();
        sound.find(|cell| cell.origin.as_ref().is_some_and(|origin| !origin.is_ours()))
    }

    /// A number of each cell that was timed.
    pub fn timed(&self, of: fn(&ReportCell) -> usize) -> impl Iterator<Item = usize> + Clone {
        let timed = self.cells.iter().filter(|cell| cell.times.processes > 0);
        timed.map(move |cell| of(cell))
    }

    /// Errors of the answers against the truth, common to all right ones.
    pub fn judged(&self) -> Option<&'r Judged> {
        self.cells.iter().find_map(|cell| cell.error.as_ref())
    }

    /// A metric common to all cells, from the first that has it.
    pub fn of_any(&self, metric: &str) -> Option<f64> {
        self.metric_of_any(metric).map(|metric| metric.value)
    }

    /// The metric with its interval.
    pub fn metric_of_any(&self, metric: &str) -> Option<&'r Metric> {
        self.cells.iter().find_map(|cell| cell.metrics.get(metric))
    }
}

/// Time of `base` / time of `cell`: how many times as fast the cell is.
///
/// The ratio of the two reported values.
pub fn times_as_fast(base: &ReportCell, cell: &ReportCell) -> Option<f64> {
    Some(base.time()?.value / cell.time()?.value)
}

/// Values by their key, both in the order of occurrence.
pub fn grouped<K: PartialEq, V>(pairs: impl Iterator<Item = (K, V)>) -> Vec<(K, Vec<V>)> {
    let mut groups: Vec<(K, Vec<V>)> = Vec::new();
    for (key, value) in pairs {
        match groups.iter_mut().find(|group| group.0 == key) {
            Some(group) => group.1.push(value),
            None => groups.push((key, vec![value])),
        }
    }
    groups
}

/// Every value once, in the order of occurrence.
pub fn unique<T: PartialEq>(all: impl Iterator<Item = T>) -> Vec<T> {
    let groups = grouped(all.map(|value| (value, ())));
    groups.into_iter().map(|(value, _)| value).collect()
}

/// Group and structure, a unique key in a report.
fn named(cell: &ReportCell) -> (String, &str) {
    (cell.key().group.id(), &cell.structure)
}

/// A cell in both reports.
pub type Pair<'r> = (&'r ReportCell, &'r ReportCell);

/// Cells of the same name, and those of only one side, in their order.
pub(super) type Matched<'r> = (Vec<Pair<'r>>, [Vec<&'r ReportCell>; 2]);

pub(super) fn matched<'r>(old: &'r [ReportCell], new: &'r [ReportCell]) -> Matched<'r> {
    let [in_old, in_new] = [old, new].map(|cells| -> BTreeMap<_, &ReportCell> {
        cells.iter().map(|cell| (named(cell), cell)).collect()
    });
    let pair = |cell| Some((cell, *in_new.get(&named(cell))?));
    let lacks = |other: &BTreeMap<_, _>, cell| !other.contains_key(&named(cell));
    let only_old = old.iter().filter(|cell| lacks(&in_new, cell));
    let only_new = new.iter().filter(|cell| lacks(&in_old, cell));
    let alone = [only_old.collect(), only_new.collect()];
    (old.iter().filter_map(pair).collect(), alone)
}

/// The reason why two cells are not the same query; `None` if they are.
///
/// A process that ended before its scene was loaded has no numbers of items and cameras.
pub fn query_difference((old, new): Pair) -> Option<String> {
    if old.scene.digest.is_empty() || new.scene.digest.is_empty() {
        return None;
    }
    let digests = |what: &str, old: &str, new: &str| {
        (old != new).then(|| format!("{what}: digest {old:.8} and {new:.8}"))
    };
    let items = digests("other items", &old.scene.digest, &new.scene.digest);
    let (was, is) = (old.path.camera_count, new.path.camera_count);
    let count = (was != is).then(|| format!("{was} cameras and {is}"));
    // A report may lack the digest of its cameras.
    let both = old.path.digest.as_ref().zip(new.path.digest.as_ref());
    let cameras = both.and_then(|(was, is)| digests("other cameras or motions", was, is));
    items.or(count).or(cameras)
}

/// The reason why two right answers are not the same sets; `None` if they are.
pub fn answer_difference((old, new): Pair) -> Option<String> {
    let counts = old.value("visible_count").zip(new.value("visible_count"));
    if let Some((was, is)) = counts.filter(|(was, is)| was != is) {
        return Some(format!("visible_count {} and {}", number(was), number(is)));
    }
    let (was, is) = old.answers.as_ref().zip(new.answers.as_ref())?;
    (was != is).then(|| "other ids, as many as before".to_owned())
}

/// The reason why two times are not of the same work; `None` if they are.
///
/// The mean over other cameras, or of shorter batches, is another figure.
pub fn work_difference((old, new): Pair) -> Option<String> {
    let (was, is) = (&old.times, &new.times);
    if was.cameras_timed != is.cameras_timed {
        let (was, is) = (was.cameras_timed, is.cameras_timed);
        return Some(format!("{was} cameras timed and {is}"));
    }
    let has_views = |times: &CellTimes| times.by_process.contains_key("views_ns");
    let by = |times| ["one thread", "threads that share views"][usize::from(has_views(times))];
    if by(was) != by(is) {
        return Some(format!("{}, and {}", by(was), by(is)));
    }
    (was.batch != is.batch).then(|| format!("batches of {} and {} queries", was.batch, is.batch))
}

/// The structures of several comparisons.
pub struct Overall<'r> {
    /// Structure that speed-ups refer to.
    ///
    /// `linear`; if it has no times, the slowest of those with times everywhere.
    pub base: Option<&'r str>,
    /// Structures with times everywhere, fastest first; then the others.
    pub standings: Vec<Mean<'r>>,
}

/// One structure over several comparisons.
pub struct Mean<'r> {
    /// Its label.
    pub structure: &'r str,
    /// Geometric mean of its speed-ups vs the base; `None` if a time is missing.
    pub speedup: Option<f64>,
    /// Comparisons in which it has the first rank, alone or shared.
    pub first_in: usize,
    /// Logarithm of its mean time minus the base's, in each process.
    logs: Vec<f64>,
}

impl Mean<'_> {
    /// True if no paired test over the processes finds the means different.
    ///
    /// Without a test, if they differ by less than 1.5 %.
    pub fn ties_with(&self, other: &Mean) -> bool {
        let (own, other) = (&self.logs, &other.logs);
        let apart = own.iter().sum::<f64>() - other.iter().sum::<f64>();
        match own.len() {
            0..3 => apart.abs() < 0.015 * own.len() as f64,
            _ => !is_less(own, other, ALPHA) && !is_less(other, own, ALPHA),
        }
    }
}

impl<'r> Overall<'r> {
    /// The structures of `all`; among several, uninformative ones do not count.
    pub fn of(all: &[&Comparison<'r>]) -> Overall<'r> {
        let ranked = || all.iter().filter(|c| all.len() == 1 || c.decides());
        let cells = all.iter().flat_map(|comparison| &comparison.cells);
        let names: Vec<&'r str> = unique(cells.map(|cell| cell.structure.as_str()));
        let cells = |name: &str| -> Option<Vec<&'r ReportCell>> {
            ranked().map(|c| c.sound_cell(name)).collect()
        };
        let mean = |name: &str| {
            let cells = cells(name)?.into_iter();
            let times = cells.map(|cell| Some(cell.time()?.value));
            geometric_mean(&times.collect::<Option<Vec<f64>>>()?)
        };
        let logs = |name: &str| -> Option<Vec<f64>> {
            let cells = cells(name)?.into_iter();
            let times = cells.map(|cell| cell.times.by_process.get(cell.ranked_by()));
            let times: Vec<&Vec<f64>> = times.collect::<Option<_>>()?;
            let processes = 0..times.iter().map(|own| own.len()).min()?;
            let of_process = |process: usize| {
                let own: Vec<f64> = times.iter().map(|own| own[process]).collect();
                geometric_mean(&own).map(f64::ln)
            };
            processes.map(of_process).collect()
        };
        let timed = || names.iter().copied().filter_map(|n| Some((n, mean(n)?)));
        let base = timed().find(|(name, _)| *name == YARDSTICK);
        let base = base.or_else(|| timed().max_by(|a, b| a.1.total_cmp(&b.1)));
        let of_base = base.and_then(|(name, _)| logs(name)).unwrap_or_default();
        let less = |own: &[f64], base: &[f64]| own.iter().zip(base).map(|(a, b)| a - b).collect();
        let wins = |c: &Comparison, name: &str| c.winners().any(|cell| cell.structure == name);
        let standing = |&structure: &&'r str| Mean {
            structure,
            speedup: base.zip(mean(structure)).map(|(base, mean)| base.1 / mean),
            first_in: ranked().filter(|c| wins(c, structure)).count(),
            logs: match logs(structure) {
                Some(own) if !of_base.is_empty() => less(&own, &of_base),
                _ => mean(structure).map(f64::ln).into_iter().collect(),
            },
        };
        let mut standings: Vec<Mean> = names.iter().map(standing).collect();
        let speed = |standing: &Mean| standing.speedup.unwrap_or(0.0);
        standings.sort_by(|a, b| speed(b).total_cmp(&speed(a)));
        let base = base.map(|(name, _)| name);
        Overall { base, standings }
    }
}

#[cfg(test)]
pub(super) mod tests;
