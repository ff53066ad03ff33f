//! Tests of comparing two reports.

use super::super::ranking::tests::cell;
use super::super::settings;
use super::*;
use crate::measure::Metric;
use crate::statistics::Estimate;
use serde_json::json;

const QUERY: &[&str] = &["query_ns"];
const NAMES: [&str; 5] = ["a", "b", "c", "d", "e"];
/// Far apart, so that no median over them is close to another one's value.
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

/// A cell with a time per process: a machine speed common to all cells, and noise.
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
        let found = changes(Basis::Reports, [&old.cells, &new.cells], 0.05, QUERY);
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
        // A shift common to all is reported for all.
        let shift = &found.common_shifts[0];
        assert!(shift.lower < Some(1.5) && Some(1.5) < shift.upper);
        assert_eq!(shift.cells, 5);
    }
}

/// A structure that stood still has four others, half of which have moved.
#[test]
fn two_structures_of_five_that_moved_are_found() {
    let (old, mut new) = (all(10, 1.0), all(10, 1.5));
    for moved in [1, 3] {
        new.cells[moved] = timed(NAMES[moved], LEVELS[moved] * 1.3, 10, 1.5);
    }
    let found = changes(Basis::Reports, [&old.cells, &new.cells], 0.05, QUERY);
    let counts = [Outcome::Slower, Outcome::Same].map(|outcome| found.count(outcome));
    assert_eq!(counts, [2, 3], "{:?}", outcomes(&found));
}

#[test]
fn one_process_and_few_others_are_inconclusive() {
    for (was, is) in [(1, 1), (1, 10), (10, 2)] {
        let (old, mut new) = (all(was, 1.0), all(is, 1.5));
        new.cells[1] = timed("b", 500.0, is, 1.5);
        let found = changes(Basis::Reports, [&old.cells, &new.cells], 0.05, QUERY);
        assert_eq!(found.count(Outcome::Inconclusive), 5, "{was} {is}");
        let b = found.rows.iter().find(|r| r.cell.structure == "b").unwrap();
        let judged = b.judgement.unwrap();
        assert!((judged.ratio / 5.0 - 1.0).abs() < 0.02 && judged.lower.is_none());
        assert!(b.reason.as_ref().unwrap().contains("under three processes"));
        assert!(!found.is_regression());
    }
    // Both reasons are given: more processes alone would not decide.
    let [mut old, mut new] = [all(1, 1.0), all(1, 1.0)];
    for report in [&mut old, &mut new] {
        report.cells.truncate(3);
    }
    let found = changes(Basis::Reports, [&old.cells, &new.cells], 0.05, QUERY);
    let both = format!("under three processes on a side, {FEW_OTHERS}");
    assert!(
        found
            .rows
            .iter()
            .all(|row| row.reason.as_ref() == Some(&both))
    );
    // Two of three structures: it is unknown which of them moved.
    let (mut old, mut new) = (all(10, 1.0), all(10, 1.0));
    new.cells[1] = timed("b", 500.0, 10, 1.0);
    for report in [&mut old, &mut new] {
        report.cells.truncate(3);
    }
    let found = changes(Basis::Reports, [&old.cells, &new.cells], 0.05, QUERY);
    assert_eq!(found.count(Outcome::Inconclusive), 3);
    // The ratio of the values is not a change relative to others.
    let first = &found.rows[0];
    assert_eq!((first.judgement, first.ratio()), (None, None));
    assert!(first.reason.as_ref().unwrap().contains("under three other"));
}

#[test]
fn other_cameras_or_batches_are_another_measurement() {
    for change in [
        (|cell| cell.times.cameras_timed = 128) as fn(&mut ReportCell),
        |cell| cell.times.batch = 8,
        |cell| drop(cell.times.by_process.insert("views_ns".into(), vec![1.0])),
        |cell| cell.scene.digest.push('x'),
        |cell| cell.path.camera_count += 1,
    ] {
        let (old, mut new) = (all(10, 1.0), all(10, 1.0));
        new.cells[1] = timed("b", 500.0, 10, 1.0);
        change(&mut new.cells[1]);
        let found = changes(Basis::Reports, [&old.cells, &new.cells], 0.05, QUERY);
        assert_eq!(found.rows[0].outcome, Outcome::Different);
        assert_eq!(found.count(Outcome::Same), 4);
        new.cells.iter_mut().skip(2).for_each(change);
        change(&mut new.cells[0]);
        for basis in [Basis::Reports, Basis::Pairs] {
            let found = changes(basis, [&old.cells, &new.cells], 0.05, QUERY);
            assert!(found.judges_nothing());
        }
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
        let found = changes(
            Basis::Reports,
            [&was.cells, &is.cells],
            0.05,
            &["query_ns", "build_ms"],
        );
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

/// A process that ends before its scene is loaded counts no items and no cameras.
#[test]
fn an_answer_that_is_not_given_for_want_of_a_scene_is_lost() {
    for status in [Status::TimedOut, Status::OutOfMemory] {
        let (whole, mut other) = (all(10, 1.0), all(10, 1.0));
        for cell in &mut other.cells {
            let key = cell.key().group;
            cell.status = status;
            cell.scene = crate::measure::SceneInfo::unknown(&key.scene);
            cell.path = crate::measure::PathInfo::unknown(&key);
        }
        for (basis, metrics) in [
            (Basis::Reports, QUERY),
            (Basis::Reports, WORK),
            (Basis::Pairs, QUERY),
        ] {
            let lost = changes(basis, [&whole.cells, &other.cells], 0.05, metrics);
            assert_eq!(lost.count(Outcome::Lost), 5, "{:?}", outcomes(&lost));
            assert!(lost.is_regression() && !lost.judges_nothing());
            let gained = changes(basis, [&other.cells, &whole.cells], 0.05, metrics);
            assert_eq!(gained.count(Outcome::Gained), 5, "{:?}", outcomes(&gained));
            assert!(!gained.is_regression() && !gained.judges_nothing());
        }
    }
}

#[test]
fn every_metric_has_its_common_shift() {
    let (mut old, mut new) = (all(10, 1.0), all(10, 2.0));
    for (report, factor) in [(&mut old, 1.0), (&mut new, 0.5)] {
        for cell in &mut report.cells {
            cell.path.motion = "drift".to_owned();
            let times = cell.times.by_process["query_ns"].clone();
            let frames = times.iter().map(|ns| ns * factor * factor).collect();
            cell.times.by_process.insert("frame_ns".to_owned(), frames);
        }
    }
    let sides = [&old.cells[..], &new.cells];
    let both = &["query_ns", "frame_ns"];
    for metrics in [QUERY, both] {
        let found = changes(Basis::Reports, sides, 0.05, metrics);
        let shifts = found.common_shifts.iter().map(|shift| shift.metric);
        assert!(shifts.eq(metrics.iter().copied()));
        for (shift, ratio) in found.common_shifts.iter().zip([2.0, 0.5]) {
            assert!((shift.ratio / ratio - 1.0).abs() < 0.01, "{shift:?}");
        }
        assert_eq!(found.proven_shifts()[0].metric, "query_ns");
    }
    for (basis, metrics) in [(Basis::Reports, WORK), (Basis::Pairs, both)] {
        assert!(
            changes(basis, sides, 0.05, metrics)
                .common_shifts
                .is_empty()
        );
    }
}

#[test]
fn a_scene_that_moved_as_a_whole_is_named() {
    let (mut old, mut new) = (Vec::new(), Vec::new());
    for (scene, factor) in [("s", 1.0), ("t", 1.0), ("u", 2.0), ("v", 1.0)] {
        for (cells, factor) in [(&mut old, 1.0), (&mut new, factor)] {
            let mut all = all(10, factor).cells;
            all.iter_mut()
                .for_each(|cell| cell.scene.name = scene.to_owned());
            cells.extend(all);
        }
    }
    let found = changes(Basis::Reports, [&old, &new], 0.05, QUERY);
    assert_eq!(found.count(Outcome::Same), 20, "{:?}", outcomes(&found));
    let [whole, scene] = &found.common_shifts[..] else {
        panic!("{:?}", found.common_shifts);
    };
    assert!(
        whole.group.is_none() && (whole.ratio - 1.0).abs() < 0.01,
        "{whole:?}"
    );
    assert_eq!(scene.group.as_ref().unwrap().scene, "u");
    assert!(
        (scene.ratio - 2.0).abs() < 0.01 && scene.cells == 5,
        "{scene:?}"
    );
    let same = changes(Basis::Reports, [&old, &old], 0.05, QUERY);
    assert_eq!(same.common_shifts.len(), 1);
}

/// Copies of a figure would count as more evidence than there is.
#[test]
fn a_build_that_paths_share_is_one_figure() {
    let (mut old, mut new) = (all(10, 1.0), all(10, 1.0));
    new.cells[1] = timed("b", 130.0, 10, 1.0);
    for report in [&mut old, &mut new] {
        for cell in &mut report.cells {
            let times = cell.times.by_process["query_ns"].clone();
            cell.times.by_process.insert("build_ms".to_owned(), times);
            let value = cell.metrics["query_ns"].clone();
            cell.metrics.insert("build_ms".to_owned(), value);
        }
        let mut others = report.cells.clone();
        for cell in &mut others {
            cell.path.name = "q".to_owned();
        }
        report.cells.extend(others);
    }
    // The other path's build counts if this one has no answer, but has none to compare with.
    old.cells[3].status = Status::TimedOut;
    let sides = [&old.cells[..], &new.cells];
    let found = changes(Basis::Reports, sides, 0.05, &["build_ms"]);
    let (slower, same) = (found.count(Outcome::Slower), found.count(Outcome::Same));
    assert_eq!((slower, same, found.rows.len()), (1, 3, 6));
    assert_eq!(found.common_shifts[0].cells, 5);
    let twice = changes(Basis::Reports, sides, 0.05, QUERY);
    assert_eq!(twice.count(Outcome::Slower), 2);
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
    let found = changes(Basis::Reports, [&old.cells, &new.cells], 0.05, QUERY);
    let work = &found.work_changed;
    assert_eq!((work.len(), work[0].counter), (1, "planes_tested"));
    assert_eq!((work[0].old, work[0].new), (100.0, 100.001));
    assert_eq!(found.count(Outcome::Same), 5);
    // For another scene they answer another query.
    new.cells[1].scene.digest.push('x');
    assert!(
        changes(Basis::Reports, [&old.cells, &new.cells], 0.05, QUERY)
            .work_changed
            .is_empty()
    );
}

#[test]
fn only_what_has_times_is_judged() {
    let (mut old, mut new) = (all(10, 1.0), all(10, 1.0));
    old.cells[1].metrics.get_mut("query_ns").unwrap().value = f64::NAN;
    new.cells[2].metrics.clear();
    let found = changes(
        Basis::Reports,
        [&old.cells, &new.cells],
        0.05,
        &["query_ns", "locate_ns"],
    );
    assert_eq!(found.count(Outcome::Unmeasured), 7);
    // Three are left, with two others each.
    assert_eq!(found.count(Outcome::Inconclusive), 3);
    // A metric that neither side ever had is no news.
    let news = found.rows.iter().filter(|row| row.is_news());
    assert_eq!(news.count(), 5);
    assert!(!found.judges_nothing());
    let found = changes(
        Basis::Reports,
        [&old.cells, &new.cells],
        0.05,
        &["locate_ns"],
    );
    assert!(found.judges_nothing());
    // A frame time has no row for a still scene.
    let sides = [&old.cells[..], &new.cells];
    assert!(changes(Basis::Reports, sides, 0.05, &["frame_ns"]).judges_nothing());
    for cell in old.cells.iter_mut().chain(&mut new.cells) {
        cell.status = Status::TimedOut;
    }
    let found = changes(Basis::Reports, [&old.cells, &new.cells], 0.05, QUERY);
    assert!(found.judges_nothing() && found.count(Outcome::FailedInBoth) > 4);
}

#[test]
fn facts_of_machine_and_build_that_differ_are_named() {
    let (old, mut new) = (all(3, 1.0), all(3, 1.0));
    assert!(settings(&old, &new).is_empty());
    new.machine.cpu = None;
    new.toolchain.flags = "-O".to_owned();
    new.run.threads = 2;
    new.machine.instruction_set = "portable".to_owned();
    let found = settings(&old, &new);
    let found: Vec<_> = found.iter().map(|s| (s.what, s.is_machine)).collect();
    let [cpu, others @ ..] = &found[..] else {
        panic!("{found:?}");
    };
    assert_eq!(*cpu, ("cpu", true));
    assert_eq!(
        others,
        ["instruction set", "flags", "threads"].map(|what| (what, false))
    );
}

#[test]
fn another_answer_is_told_and_its_work_is_judged() {
    let with_work = |count: f64, nodes: f64, answers: &str| {
        let mut all = all(10, 1.0);
        for cell in &mut all.cells {
            let metric = |value: f64| Metric::of(Estimate::exact(value), "");
            cell.metrics
                .insert("visible_count".to_owned(), metric(count));
            cell.metrics
                .insert("nodes_tested".to_owned(), metric(nodes));
            cell.answers = Some(answers.to_owned());
        }
        all.cells
    };
    let old = with_work(9.0, 10.0, "a");
    for (count, answers) in [(9.0, "b"), (9.5, "b")] {
        let new = with_work(count, 30.0, answers);
        for basis in [Basis::Reports, Basis::Pairs] {
            let found = changes(basis, [&old, &new], 0.05, &["nodes_tested"]);
            assert_eq!(found.count(Outcome::MoreWork), 5);
            assert_eq!(found.count(Outcome::Different), 5);
            // Two programs may round planes differently; two reports are of one program.
            let found = changes(basis, [&old, &new], 0.05, QUERY);
            assert_eq!(found.count(Outcome::Different), 5);
            assert_eq!(found.judges_nothing(), basis == Basis::Reports);
        }
    }
    let found = changes(Basis::Reports, [&old, &old], 0.05, QUERY);
    assert_eq!(found.count(Outcome::Different), 0);
}

#[test]
fn a_common_shift_is_none_of_a_few_structures() {
    let restless = |slower: &[&str]| {
        let mut all = all(10, 1.0);
        for (i, cell) in all.cells.iter_mut().enumerate() {
            let by = f64::from(1 + 2 * u8::from(slower.contains(&cell.structure.as_str())));
            let times = cell.times.by_process.get_mut("query_ns").unwrap();
            for (process, ns) in times.iter_mut().enumerate() {
                *ns *= by * (0.3 * ((7 * i + 3 * process) as f64).sin()).exp();
            }
        }
        all.cells
    };
    for slower in [&["a", "e"][..], &["b"], &["c", "d"]] {
        let sides = [restless(&[]), restless(slower)];
        let found = changes(Basis::Reports, [&sides[0], &sides[1]], 0.05, QUERY);
        let ratio = found.common_shifts[0].ratio;
        assert!((ratio - 1.0).abs() < 1e-6, "{slower:?}: {ratio}");
    }
}
