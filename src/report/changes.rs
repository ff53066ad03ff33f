//! One report held against an older one: every cell that both have with what
//! became of it, those that only one has, means, and how the machine itself has
//! drifted. It reads no file, prints nothing and measures nothing.

use serde::Serialize;

use super::judging::{Bar, Change, Outcome, Tracked, as_a_whole, asked_otherwise, is_sound};
use super::matching::{CellName, matched};
use super::{Report, ReportCell};
use crate::measure::Status;
use crate::statistics::geometric_mean;

/// A cell that the other report does not have.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Lone<'r> {
    #[serde(flatten)]
    pub cell: CellName<'r>,
    pub status: Status,
    pub reason: Option<&'r str>,
}

fn lone(cell: &ReportCell) -> Lone<'_> {
    Lone {
        cell: CellName::of(cell),
        status: cell.status,
        reason: cell.reason.as_deref(),
    }
}

/// The geometric mean of a structure's ratios over all cells with figures.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct MeanRatio<'r> {
    pub structure: &'r str,
    pub metric: &'static str,
    pub ratio: f64,
    pub cells: usize,
}

/// How much longer the physical limits took: the machine and not the code.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Drift {
    pub ratio: f64,
    pub bounds: usize,
}

/// Two reports held against each other.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Changes<'r> {
    pub threshold: f64,
    pub bars: Vec<Bar>,
    pub cells_in_common: usize,
    /// Worst first, ties included.
    pub changes: Vec<Change<'r>>,
    pub only_in_old: Vec<Lone<'r>>,
    pub only_in_new: Vec<Lone<'r>>,
    /// What became slower first.
    pub structures: Vec<MeanRatio<'r>>,
    pub machine_drift: Option<Drift>,
}

/// Holds a report against an older one. A difference counts from the
/// threshold on (0.05 is 5 %), or from the larger noise floor.
pub fn changes<'r>(
    old: &'r Report,
    new: &'r Report,
    threshold: f64,
    metrics: &[&'static Tracked],
) -> Changes<'r> {
    let matched = matched(&old.cells, &new.cells);
    let of_metric = |metric: &&'static Tracked| Bar::of(metric, threshold, old, new);
    let bars: Vec<Bar> = metrics.iter().map(of_metric).collect();
    let mut changes = Vec::new();
    for &pair in &matched.pairs {
        match as_a_whole(pair) {
            Some(change) => changes.push(change),
            None => changes.extend(bars.iter().map(|bar| Change::by_metric(pair, bar))),
        }
    }
    let structures = mean_ratios(&changes);
    changes.sort_by(Change::order);
    Changes {
        threshold,
        bars,
        cells_in_common: matched.pairs.len(),
        changes,
        only_in_old: matched.only_old.into_iter().map(lone).collect(),
        only_in_new: matched.only_new.into_iter().map(lone).collect(),
        structures,
        machine_drift: machine_drift(old, new),
    }
}

fn mean_ratios<'r>(changes: &[Change<'r>]) -> Vec<MeanRatio<'r>> {
    // In the order they were measured, so that equal means keep it.
    let mut rows: Vec<(&str, &'static str, Vec<f64>)> = Vec::new();
    for change in changes {
        let (Some(metric), Some(ratio)) = (change.metric, change.ratio) else {
            continue;
        };
        let structure = change.cell.structure;
        match rows.iter_mut().find(|r| (r.0, r.1) == (structure, metric)) {
            Some(row) => row.2.push(ratio),
            None => rows.push((structure, metric, vec![ratio])),
        }
    }
    let means = rows.into_iter().filter_map(|(structure, metric, ratios)| {
        Some(MeanRatio {
            structure,
            metric,
            ratio: geometric_mean(&ratios)?,
            cells: ratios.len(),
        })
    });
    let mut means: Vec<MeanRatio> = means.collect();
    means.sort_by(|a, b| b.ratio.total_cmp(&a.ratio));
    means
}

fn machine_drift(old: &Report, new: &Report) -> Option<Drift> {
    let pairs = matched(&old.bounds, &new.bounds).pairs;
    let same = pairs.into_iter().filter(|p| asked_otherwise(*p).is_none());
    let ratios: Vec<f64> = same
        .filter_map(|(old, new)| Some(new.value("query_ns")? / old.value("query_ns")?))
        .filter(|ratio| is_sound(*ratio))
        .collect();
    Some(Drift {
        ratio: geometric_mean(&ratios)?,
        bounds: ratios.len(),
    })
}

impl Changes<'_> {
    pub fn count(&self, outcome: Outcome) -> usize {
        let rows = self.changes.iter();
        rows.filter(|change| change.outcome == outcome).count()
    }

    /// Whether NEW holds a wrong answer, with or without a partner in OLD.
    pub fn is_wrong(&self) -> bool {
        let paired = self.changes.iter().map(|change| change.new_status);
        let alone = self.only_in_new.iter().map(|cell| cell.status);
        paired.chain(alone).any(Status::is_failure)
    }

    /// Whether a right answer takes longer or is not given any more.
    pub fn is_regression(&self) -> bool {
        self.count(Outcome::Slower) + self.count(Outcome::Lost) > 0
    }

    /// The largest ratio, and whose it is.
    pub fn worst(&self) -> Option<(f64, &Change<'_>)> {
        let judged = self.changes.iter().filter_map(|c| Some((c.ratio?, c)));
        judged.max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Why there is nothing to go by, if there is nothing.
    pub fn why_nothing_was_judged(&self) -> Option<&Change<'_>> {
        let unjudged = |c: &&Change| matches!(c.outcome, Outcome::Different | Outcome::Unmeasured);
        let first = self.changes.first().filter(unjudged)?;
        (self.changes.iter().all(|c| unjudged(&c)) && !self.is_wrong()).then_some(first)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::judging::Decider;
    use super::super::ranking::tests::cell;
    use super::super::settings;
    use super::*;
    use serde_json::json;

    /// A report of these cells, with a noise floor.
    pub fn report(floor: Option<f64>, cells: Vec<ReportCell>) -> Report {
        let report = json!({
            "schema_version": 1,
            "run": { "id": "r", "started_at": "", "finished_at": "", "command": "", "seed": 1,
                "suite": null, "generator": "" },
            "machine": { "cpu": "a", "features": [], "instruction_set": "avx2", "cores": 2,
                "caches": [], "memory_bytes": null, "os": null, "kernel": null, "load": null },
            "toolchain": { "rustc": "1", "target": null, "flags": "", "profile": null,
                "opt_level": null, "features": [], "lock_digest": "" },
            "source": { "version": "0", "commit": null, "dirty": null },
            "noise": { "harness_overhead_ns": 0.0, "aa_ratio": null, "aa_floor": floor,
                "twins": [] },
            "cells": [], "bounds": [],
        });
        let report: Report = serde_json::from_value(report).unwrap();
        Report { cells, ..report }
    }

    fn by(names: &[&str]) -> Vec<&'static Tracked> {
        names.iter().map(|n| Tracked::named(n).unwrap()).collect()
    }

    /// Cells of one scene and path with these times.
    fn timed(times: &[(&str, f64)]) -> Vec<ReportCell> {
        let cells = times.iter();
        cells
            .map(|(name, ns)| cell("s", 10, "p", name, *ns))
            .collect()
    }

    fn outcomes<'c>(changes: &'c Changes) -> Vec<(&'c str, Outcome)> {
        let rows = changes.changes.iter();
        rows.map(|c| (c.cell.structure, c.outcome)).collect()
    }

    #[test]
    fn the_worst_comes_first_and_the_bar_is_a_ratio_either_way() {
        let names = ["a", "b", "c", "d", "e", "f"];
        let old = report(None, timed(&names.map(|name| (name, 100.0))));
        // 1 / 1.25 is 0.8: a quarter more undoes a fifth less.
        let times = [110.0, 125.0, 80.0, 79.0, 126.0, 300.0];
        let pairs: Vec<_> = names.into_iter().zip(times).collect();
        let new = report(None, timed(&pairs));
        let found = changes(&old, &new, 0.25, &by(&["query_ns"]));
        let wanted = [
            ("f", Outcome::Slower),
            ("e", Outcome::Slower),
            ("d", Outcome::Faster),
            ("b", Outcome::Tie),
            ("a", Outcome::Tie),
            ("c", Outcome::Tie),
        ];
        assert_eq!(outcomes(&found), wanted);
        assert_eq!(found.worst().map(|(ratio, _)| ratio), Some(3.0));
        assert_eq!(found.structures[0].structure, "f");
        assert!(found.is_regression() && !found.is_wrong());
        let all_fine = changes(&old, &old, 0.0, &by(&["query_ns"]));
        assert_eq!(all_fine.count(Outcome::Tie), 6);
        assert!(!all_fine.is_regression());
    }

    #[test]
    fn the_bar_is_the_largest_of_three_but_for_what_is_counted() {
        let bars = |old: Option<f64>, new: Option<f64>| {
            let (old, new) = (report(old, Vec::new()), report(new, Vec::new()));
            let metrics = by(&["query_ns", "memory_bytes_per_item"]);
            let bars = changes(&old, &new, 0.05, &metrics).bars;
            assert_eq!(
                (bars[1].bar, bars[1].decided_by),
                (0.05, Decider::Threshold)
            );
            (bars[0].bar, bars[0].decided_by)
        };
        assert_eq!(bars(None, None), (0.05, Decider::Threshold));
        assert_eq!(bars(Some(0.01), Some(-3.0)), (0.05, Decider::Threshold));
        assert_eq!(bars(Some(0.2), Some(0.1)), (0.2, Decider::OldNoiseFloor));
        assert_eq!(bars(Some(0.1), Some(0.2)), (0.2, Decider::NewNoiseFloor));
    }

    #[test]
    fn statuses_and_questions_go_before_times() {
        let of = |old: Status, new: Status, asked_the_same: bool| {
            let [mut was, mut is] = [100.0, 900.0].map(|ns| cell("s", 10, "p", "a", ns));
            (was.status, is.status) = (old, new);
            if !asked_the_same {
                is.scene.digest = "other".to_owned();
            }
            let (old, new) = (report(None, vec![was]), report(None, vec![is]));
            let found = changes(&old, &new, 0.05, &by(&["query_ns", "query_ns_p95"]));
            let first = found.changes[0].outcome;
            (
                first,
                found.changes.len(),
                found.is_wrong(),
                found.is_regression(),
            )
        };
        use Status::{LeftOut, Ok, Panicked, Refused, Wrong};
        for (old, new, same, wanted) in [
            (Ok, Ok, true, (Outcome::Slower, 2, false, true)),
            (Ok, Ok, false, (Outcome::Different, 1, false, false)),
            (Ok, Wrong, true, (Outcome::Broken, 1, true, false)),
            (Ok, Panicked, false, (Outcome::Broken, 1, true, false)),
            (Ok, Refused, true, (Outcome::Lost, 1, false, true)),
            (Wrong, Ok, true, (Outcome::Gained, 1, false, false)),
            (
                LeftOut,
                Refused,
                true,
                (Outcome::FailedInBoth, 1, false, false),
            ),
            (
                Refused,
                Wrong,
                true,
                (Outcome::FailedInBoth, 1, true, false),
            ),
            (Refused, Ok, false, (Outcome::Different, 1, false, false)),
        ] {
            assert_eq!(of(old, new, same), wanted, "{old:?} to {new:?}, {same}");
        }
    }

    #[test]
    fn only_what_a_metric_is_of_is_judged_by_it() {
        let mut old = report(None, timed(&[("a", 100.0), ("b", 100.0), ("c", 100.0)]));
        old.cells[1].metrics.get_mut("query_ns").unwrap().value = f64::NAN;
        let mut new = old.clone();
        new.cells[2].metrics.clear();
        let found = changes(&old, &new, 0.05, &by(&["query_ns", "locate_ns"]));
        assert_eq!(found.count(Outcome::Unmeasured), 5);
        assert_eq!(found.count(Outcome::Tie), 1);
        // What neither side ever had is no news.
        assert_eq!(found.changes.iter().filter(|c| c.is_news()).count(), 2);
        assert!(found.why_nothing_was_judged().is_none());
        let found = changes(&old, &new, 0.05, &by(&["locate_ns"]));
        assert!(found.why_nothing_was_judged().is_some());
    }

    #[test]
    fn the_machine_is_told_from_the_code() {
        let [mut old, mut new] = [100.0, 110.0].map(|ns| {
            let mut report = report(None, timed(&[("a", ns)]));
            report.bounds = timed(&[("bound-read", 2.0 * ns), ("bound-memcpy", ns)]);
            report
        });
        new.bounds[0].scene.digest = "other".to_owned();
        let drift = changes(&old, &new, 0.05, &by(&["query_ns"])).machine_drift;
        let drift = drift.unwrap();
        assert!(drift.bounds == 1 && (drift.ratio - 1.1).abs() < 1e-12);
        assert!(settings(&old, &new).is_empty());
        new.machine.cpu = None;
        new.toolchain.flags = "-O".to_owned();
        let found = settings(&old, &new);
        let found: Vec<_> = found.iter().map(|s| (s.what, s.is_machine)).collect();
        assert_eq!(found, [("cpu", true), ("flags", false)]);
        old.bounds.clear();
        assert_eq!(changes(&old, &new, 0.0, &[]).machine_drift, None);
    }
}
