//! One report compared with an older one. Every cell is judged by its times
//! relative to the other structures of its group, process by process: what moves
//! a whole process, and most of what tells two days apart, drops out.

use std::collections::BTreeMap;

use super::judging::{Changes, CommonShift, JudgedRow, Lone, Outcome, work_changes};
use super::matching::{Pair, asked_otherwise, grouped, matched, timed_otherwise};
use super::{Report, ReportCell};
use crate::measure::{CellKey, GroupKey, Status};
use crate::shown::number;
use crate::statistics::{Judgement, judge_unpaired, median, trimmed_mean};

/// Fewer other structures cannot tell which of them moved: the median of three
/// stays where it is when one of them moves, that of two does not.
const LEAST_OTHERS: usize = 3;
/// Fewer processes have no interval.
const LEAST_PROCESSES: usize = 3;

/// Compares a report with an older one by these metrics of
/// [`JUDGED_METRICS`](super::JUDGED_METRICS). `threshold` 0.05 is 5 %.
///
/// Per process, ln(time) of a structure minus the median of the other
/// structures that both reports have in the group, each about its mean in the
/// old report; old and new by [`judge_unpaired`], with Holm's correction over the cells of a metric. What
/// moved everything at once is [`Changes::common_shift`].
pub fn changes(old: &Report, new: &Report, threshold: f64, metrics: &[&'static str]) -> Changes {
    let matched = matched(&old.cells, &new.cells);
    let mut found = Changes {
        threshold,
        cells_in_common: matched.pairs.len(),
        only_in_old: matched.only_old.into_iter().map(lone).collect(),
        only_in_new: matched.only_new.into_iter().map(lone).collect(),
        ..Changes::default()
    };
    let mut comparable = Vec::new();
    for &pair in &matched.pairs {
        let is_asked_alike = asked_otherwise(pair).is_none();
        if is_asked_alike {
            let counts = |cell: &ReportCell| -> BTreeMap<String, f64> {
                let metrics = cell.metrics.iter();
                metrics.map(|(name, m)| (name.clone(), m.value)).collect()
            };
            let (was, is) = (counts(pair.0), counts(pair.1));
            found
                .work_changed
                .extend(work_changes(&pair.0.key(), &was, &is));
        }
        match as_a_whole(pair) {
            Some(row) => found.rows.push(row),
            None => comparable.push(pair),
        }
    }
    for metric in metrics {
        found.rows.extend(by_metric(&comparable, metric, threshold));
    }
    found.common_shift = common_shift(&comparable);
    found.rows.sort_by(JudgedRow::order);
    found
}

fn lone(cell: &ReportCell) -> Lone {
    Lone {
        cell: cell.key(),
        status: cell.status,
        reason: cell.reason.clone(),
    }
}

/// Outcome of a pair by its statuses and questions alone; `None` if times decide.
fn as_a_whole(pair: Pair) -> Option<JudgedRow> {
    let (old, new) = pair;
    let by_status = JudgedRow::of_statuses(new.key(), &old.verdict(), &new.verdict());
    // Wrong is wrong, whatever the question was.
    let is_broken = by_status.as_ref().map(|row| row.outcome) == Some(Outcome::Broken);
    let different = |reason: String| JudgedRow {
        old_status: old.status,
        new_status: new.status,
        ..JudgedRow::unjudged(new.key(), Outcome::Different, Some(reason))
    };
    match asked_otherwise(pair) {
        Some(reason) if !is_broken => Some(different(reason)),
        _ if by_status.is_some() => by_status,
        _ => answered_otherwise(pair).map(different),
    }
}

/// Right answers to one question have the same length.
fn answered_otherwise((old, new): Pair) -> Option<String> {
    let counts = old.value("visible_count").zip(new.value("visible_count"));
    let (was, is) = counts.filter(|(was, is)| was != is)?;
    Some(format!("visible_count {} and {}", number(was), number(is)))
}

/// ln(time) in each process, old and new.
type Logs = [Vec<f64>; 2];

/// ln(time) about its mean in the old report: what is left is how the processes
/// differ, and how new differs from old. Medians over structures are taken of
/// this; a median of the times as they are is one structure's, and another's as
/// soon as one of them has moved past it.
fn centred(logs: &Logs) -> Logs {
    let old = &logs[0];
    let mean = trimmed_mean(old).map(|found| found.mean);
    let mean = mean.or_else(|| median(old)).unwrap_or_default();
    [0, 1].map(|side| logs[side].iter().map(|ln| ln - mean).collect())
}

/// Only what is above zero is a time.
fn is_sound(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

fn logs((old, new): Pair, metric: &str) -> Option<Logs> {
    let of = |cell: &ReportCell| {
        // Nothing is slower or faster among no items.
        let has_items = cell.scene.total_count > 0;
        let times = cell.times.by_process.get(metric).filter(|_| has_items)?;
        let sound = !times.is_empty() && times.iter().all(|time| is_sound(*time));
        sound.then(|| times.iter().map(|time| time.ln()).collect::<Vec<f64>>())
    };
    Some([of(old)?, of(new)?])
}

/// A cell on its way to a verdict.
struct Candidate {
    key: CellKey,
    logs: Logs,
    centred: Logs,
}

/// The rows of one metric, in the order of the pairs.
fn by_metric(pairs: &[Pair], metric: &'static str, threshold: f64) -> Vec<JudgedRow> {
    let mut rows = Vec::new();
    let mut candidates: Vec<(usize, Candidate)> = Vec::new();
    for &pair in pairs {
        let value = |cell: &ReportCell| cell.value(metric);
        let values = (value(pair.0), value(pair.1));
        let sound = |value: Option<f64>| value.is_some_and(is_sound);
        let key = pair.1.key();
        let mut row = JudgedRow::by_times(key.clone(), metric, values, None, [0; 2]);
        match logs(pair, metric).filter(|_| sound(values.0) && sound(values.1)) {
            None => row.reason = Some(why_unmeasured(values)),
            Some(logs) => {
                row.processes = [logs[0].len(), logs[1].len()];
                // A build is not of cameras.
                match timed_otherwise(pair).filter(|_| metric != "build_ms") {
                    Some(reason) => {
                        (row.outcome, row.reason) = (Outcome::Different, Some(reason));
                    }
                    None => {
                        let centred = centred(&logs);
                        candidates.push((rows.len(), Candidate { key, logs, centred }));
                    }
                }
            }
        }
        rows.push(row);
    }
    let relative: Vec<Option<Logs>> = candidates
        .iter()
        .map(|(_, own)| relative(own, candidates.iter().map(|(_, other)| other)))
        .collect();
    let [was, is] = [0, 1].map(|side| -> Vec<Vec<f64>> {
        let known = relative.iter().flatten();
        known.map(|logs| logs[side].clone()).collect()
    });
    let with_others = candidates.iter().zip(&relative);
    let structures: Vec<&str> = with_others
        .filter(|(_, relative)| relative.is_some())
        .map(|((_, own), _)| own.key.structure.as_str())
        .collect();
    let mut judged = judge_unpaired(&was, &is, &structures, threshold).into_iter();
    for ((at, _), relative) in candidates.iter().zip(&relative) {
        let row = &mut rows[*at];
        let judgement = relative.as_ref().and_then(|_| judged.next().flatten());
        row.reason = why_inconclusive(relative.is_some(), row.processes);
        row.judgement = judgement.or_else(|| by_values(row));
        row.outcome = row
            .judgement
            .map_or(Outcome::Unmeasured, |j| j.change.into());
    }
    rows
}

/// ln(time) less what moved the median of the others, process by process;
/// `None` with too few others.
fn relative<'c>(own: &Candidate, all: impl Iterator<Item = &'c Candidate>) -> Option<Logs> {
    let others = all.filter(|other| {
        let same = |side: usize| other.logs[side].len() == own.logs[side].len();
        let (key, own) = (&other.key, &own.key);
        key.group == own.group && key.structure != own.structure && same(0) && same(1)
    });
    let others: Vec<&Candidate> = others.collect();
    if others.len() < LEAST_OTHERS {
        return None;
    }
    let side = |side: usize| -> Vec<f64> {
        let own = own.logs[side].iter().enumerate();
        own.filter_map(|(process, ln)| {
            let others: Vec<f64> = others.iter().map(|o| o.centred[side][process]).collect();
            Some(ln - median(&others)?)
        })
        .collect()
    };
    Some([side(0), side(1)])
}

/// The quotient of the two values, which decides nothing.
fn by_values(row: &JudgedRow) -> Option<Judgement> {
    let ratio = Some(row.new? / row.old?).filter(|ratio| is_sound(*ratio))?;
    let pairs = row.processes[0].min(row.processes[1]);
    Some(Judgement::without_interval(ratio, pairs))
}

fn why_unmeasured(values: (Option<f64>, Option<f64>)) -> String {
    match values {
        (None, None) => "in neither report".to_owned(),
        (Some(_), None) => "only in OLD".to_owned(),
        (None, Some(_)) => "only in NEW".to_owned(),
        (Some(old), Some(new)) if is_sound(old) && is_sound(new) => {
            "no time of each process".to_owned()
        }
        (Some(old), Some(new)) => format!("{old} and {new} have no ratio"),
    }
}

fn why_inconclusive(has_others: bool, processes: [usize; 2]) -> Option<String> {
    if processes[0].min(processes[1]) < LEAST_PROCESSES {
        return Some("under three processes on a side".to_owned());
    }
    let reason = "under three other structures in both reports to compare with";
    (!has_others).then(|| reason.to_owned())
}

/// Per process, the mean over the groups of the median over the structures, by
/// the first metric; `None` without a cell that both have timed.
fn common_shift(pairs: &[Pair]) -> Option<CommonShift> {
    let timed = pairs.iter().filter_map(|&pair| {
        let is_ok = pair.0.status == Status::Ok && timed_otherwise(pair).is_none();
        let logs = logs(pair, super::JUDGED_METRICS[0]).filter(|_| is_ok)?;
        Some((pair.1.key().group, centred(&logs)))
    });
    let groups: Vec<(GroupKey, Vec<Logs>)> = grouped(timed);
    // What is not there in every process is paired with nothing.
    let all = || groups.iter().flat_map(|group| &group.1);
    let counts = [0, 1].map(|side| all().map(|logs| logs[side].len()).max().unwrap_or(0));
    let is_whole = |logs: &&Logs| [0, 1].iter().all(|&s| logs[s].len() == counts[s]);
    let whole: Vec<Vec<&Logs>> = groups
        .iter()
        .map(|group| group.1.iter().filter(is_whole).collect::<Vec<_>>())
        .filter(|cells| !cells.is_empty())
        .collect();
    let of = |side: usize| -> Vec<f64> {
        let process = |process: usize| -> f64 {
            let medians = whole.iter().filter_map(|cells| {
                let logs = cells.iter().map(|logs| logs[side][process]);
                median(&logs.collect::<Vec<f64>>())
            });
            medians.sum::<f64>() / whole.len() as f64
        };
        (0..counts[side]).map(process).collect()
    };
    let found = judge_unpaired(&[of(0)], &[of(1)], &["all"], 0.0)[0]?;
    Some(CommonShift {
        ratio: found.ratio,
        lower: found.lower,
        upper: found.upper,
        cells: whole.iter().map(Vec::len).sum(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::ranking::tests::cell;
    use super::super::settings;
    use super::*;
    use serde_json::json;

    const QUERY: &[&str] = &["query_ns"];
    const NAMES: [&str; 5] = ["a", "b", "c", "d", "e"];
    /// Far apart, so that no median over them is one of its neighbours'.
    const LEVELS: [f64; 5] = [50.0, 100.0, 130.0, 150.0, 900.0];

    /// A report of these cells.
    fn report(cells: Vec<ReportCell>) -> Report {
        let report = json!({
            "schema_version": 2,
            "run": { "id": "r", "started_at": "", "finished_at": "", "command": "", "seed": 1,
                "suite": null, "generator": "" },
            "machine": { "cpu": "a", "features": [], "instruction_set": "avx2", "cores": 2,
                "caches": [], "memory_bytes": null, "os": null, "kernel": null, "load": null },
            "toolchain": { "rustc": "1", "target": null, "flags": "", "profile": null,
                "opt_level": null, "features": [], "lock_digest": "" },
            "source": { "version": "0", "commit": null, "dirty": null },
            "noise": { "aa_ratio": null, "twins": [] },
            "cells": [], "bounds": [],
        });
        let report: Report = serde_json::from_value(report).unwrap();
        Report { cells, ..report }
    }

    /// A cell with a time in each process: the machine's speed, common to all
    /// cells, and a little of its own.
    fn timed(name: &str, ns: f64, processes: usize, day: f64) -> ReportCell {
        let mut timed = cell("s", 10, "p", name, ns);
        let own = name.bytes().map(usize::from).sum::<usize>();
        let times = (0..processes).map(|process| {
            let machine = 1.0 + 0.2 * ((process * 7 % 5) as f64 / 4.0 - 0.5);
            let noise = 1.0 + 0.01 * (((process + own) * 3 % 7) as f64 / 6.0 - 0.5);
            ns * machine * noise * day
        });
        timed
            .times
            .by_process
            .insert("query_ns".to_owned(), times.collect());
        timed.times.processes = processes;
        timed.times.cameras_timed = 8;
        timed.times.batch = 4;
        timed
    }

    fn all(processes: usize, day: f64) -> Report {
        let cells = NAMES.iter().zip(LEVELS);
        report(
            cells
                .map(|(name, ns)| timed(name, ns, processes, day))
                .collect(),
        )
    }

    fn outcomes(changes: &Changes) -> Vec<(&str, Outcome)> {
        let rows = changes.rows.iter();
        rows.map(|row| (row.cell.structure.as_str(), row.outcome))
            .collect()
    }

    #[test]
    fn one_structure_that_moved_is_found_whatever_the_day_was_like() {
        for (factor, wanted) in [(1.3, Outcome::Slower), (0.7, Outcome::Faster)] {
            let (old, mut new) = (all(10, 1.0), all(12, 1.5));
            new.cells[1] = timed("b", 100.0 * factor, 12, 1.5);
            let found = changes(&old, &new, 0.05, QUERY);
            let row = found
                .rows
                .iter()
                .find(|row| row.cell.structure == "b")
                .unwrap();
            assert_eq!((row.outcome, row.processes), (wanted, [10, 12]));
            let judged = row.judgement.unwrap();
            assert!((judged.ratio / factor - 1.0).abs() < 0.01, "{judged:?}");
            assert_eq!(found.count(Outcome::Same), 4, "{:?}", outcomes(&found));
            assert_eq!(found.is_regression(), wanted == Outcome::Slower);
            // What moved all of them is said of all of them.
            let shift = found.common_shift.unwrap();
            assert!(shift.lower < Some(1.5) && Some(1.5) < shift.upper);
            assert_eq!(shift.cells, 5);
        }
    }

    #[test]
    fn one_process_and_few_others_are_inconclusive() {
        for (was, is) in [(1, 1), (1, 10), (10, 2)] {
            let (old, mut new) = (all(was, 1.0), all(is, 1.0));
            new.cells[1] = timed("b", 500.0, is, 1.0);
            let found = changes(&old, &new, 0.05, QUERY);
            assert_eq!(found.count(Outcome::Inconclusive), 5, "{was} {is}");
            let b = found.rows.iter().find(|r| r.cell.structure == "b").unwrap();
            assert!(b.reason.as_ref().unwrap().contains("under three processes"));
            assert!(!found.is_regression());
        }
        // Two of three structures: which of them moved is not known.
        let (mut old, mut new) = (all(10, 1.0), all(10, 1.0));
        new.cells[1] = timed("b", 500.0, 10, 1.0);
        for report in [&mut old, &mut new] {
            report.cells.truncate(3);
        }
        let found = changes(&old, &new, 0.05, QUERY);
        assert_eq!(found.count(Outcome::Inconclusive), 3);
        // Worst first, by the quotient of the values.
        let first = &found.rows[0];
        assert_eq!(first.judgement.unwrap().ratio, 5.0);
        assert!(first.reason.as_ref().unwrap().contains("under three other"));
    }

    #[test]
    fn other_cameras_or_batches_are_another_measurement() {
        for change in [
            (|cell| cell.times.cameras_timed = 128) as fn(&mut ReportCell),
            |cell| cell.times.batch = 8,
            |cell| cell.scene.digest.push('x'),
            |cell| cell.path.camera_count += 1,
        ] {
            let (old, mut new) = (all(10, 1.0), all(10, 1.0));
            new.cells[1] = timed("b", 500.0, 10, 1.0);
            change(&mut new.cells[1]);
            let found = changes(&old, &new, 0.05, QUERY);
            assert_eq!(found.rows[0].outcome, Outcome::Different);
            assert_eq!(found.count(Outcome::Same), 4);
            new.cells.iter_mut().skip(2).for_each(change);
            change(&mut new.cells[0]);
            let found = changes(&old, &new, 0.05, QUERY);
            assert!(found.why_nothing_was_judged().is_some());
        }
    }

    #[test]
    fn statuses_and_questions_go_before_times() {
        let of = |old: Status, new: Status, asked_the_same: bool| {
            let (mut was, mut is) = (all(10, 1.0), all(10, 1.0));
            is.cells[1] = timed("b", 900.0, 10, 1.0);
            (was.cells[1].status, is.cells[1].status) = (old, new);
            if !asked_the_same {
                is.cells[1].scene.digest = "other".to_owned();
            }
            let found = changes(&was, &is, 0.05, &["query_ns", "build_ms"]);
            let rows: Vec<_> = found
                .rows
                .iter()
                .filter(|r| r.cell.structure == "b")
                .collect();
            let row = (rows[0].outcome, rows.len());
            (row.0, row.1, found.is_wrong(), found.is_regression())
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
    fn counters_are_compared_exactly_and_judge_nothing() {
        let (mut old, mut new) = (all(10, 1.0), all(10, 1.0));
        for (report, planes) in [(&mut old, 100.0), (&mut new, 100.001)] {
            for (name, value) in [("planes_tested", planes), ("items_tested", 7.0)] {
                let mut metric = report.cells[1].metrics["query_ns"].clone();
                metric.value = value;
                report.cells[1].metrics.insert(name.to_owned(), metric);
            }
        }
        let found = changes(&old, &new, 0.05, QUERY);
        let work = &found.work_changed;
        assert_eq!((work.len(), work[0].counter), (1, "planes_tested"));
        assert_eq!((work[0].old, work[0].new), (100.0, 100.001));
        assert_eq!(found.count(Outcome::Same), 5);
        // Of another scene they are another question's.
        new.cells[1].scene.digest.push('x');
        assert!(changes(&old, &new, 0.05, QUERY).work_changed.is_empty());
    }

    #[test]
    fn only_what_has_times_is_judged() {
        let (mut old, mut new) = (all(10, 1.0), all(10, 1.0));
        old.cells[1].metrics.get_mut("query_ns").unwrap().value = f64::NAN;
        new.cells[2].metrics.clear();
        let found = changes(&old, &new, 0.05, &["query_ns", "locate_ns"]);
        assert_eq!(found.count(Outcome::Unmeasured), 7);
        // Three are left, with two others each.
        assert_eq!(found.count(Outcome::Inconclusive), 3);
        // What neither side ever had is no news.
        let news = found.rows.iter().filter(|row| row.is_news());
        assert_eq!(news.count(), 5);
        assert!(found.why_nothing_was_judged().is_none());
        let found = changes(&old, &new, 0.05, &["locate_ns"]);
        assert!(found.why_nothing_was_judged().is_some());
    }

    #[test]
    fn facts_of_machine_and_build_that_differ_are_named() {
        let (old, mut new) = (all(3, 1.0), all(3, 1.0));
        assert!(settings(&old, &new).is_empty());
        new.machine.cpu = None;
        new.toolchain.flags = "-O".to_owned();
        let found = settings(&old, &new);
        let found: Vec<_> = found.iter().map(|s| (s.what, s.is_machine)).collect();
        assert_eq!(found, [("cpu", true), ("flags", false)]);
    }
}
