//! `cullbench compare`: one run compared with an older one.
//!
//! Reads two report.json and measures nothing; the verdicts come from `report`, the table from
//! `compare_table`.

use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use serde_json::json;

use super::command_args::{CompareArgs, Gate};
use super::compare_table::{CompareTable, Side, change_of, counted, reason};
use super::diagram::{Row, rows};
use super::figure::{Axis, Figure, LINE, is_drawn, line};
use super::page::to_page;
use super::run_resume::newest_run;
use super::run_table::{name, place, short};
use super::shared_args::each_once;
use super::{Ending, expect_places, text, unread_is_fine, write_if};
use crate::index::Registry;
use crate::measure::Status;
use crate::report::{
    Basis, Changes, JUDGED_METRICS, JudgedRow, Outcome, Report, ReportCell, Setting, WORK, changes,
    read_report, settings, unique, write_atomically,
};

/// Characters of a metric's name and of a change in a chart.
const METRIC: usize = 12;

pub fn compare(registry: &Registry, args: &CompareArgs) -> anyhow::Result<Ending> {
    let page = [("--html", &args.html)];
    ensure!(
        args.gate == Gate::Time || !args.fail_inconclusive,
        "--fail-inconclusive is of times; expected none with --gate work"
    );
    if let Some(binary) = &args.against {
        expect_places(&page, &[binary])?;
        let table = super::against::compare_against(registry, args, binary)?;
        return show(&table);
    }
    super::against::expect_none_of_a_run()?;
    let mut metrics = match (args.gate, args.metric.is_empty()) {
        (Gate::Time, true) => vec![JUDGED_METRICS[0]],
        (Gate::Time, false) => args.metric.clone(),
        (Gate::Work, true) => WORK.to_vec(),
        (Gate::Work, false) => bail!("--metric names times; expected none with --gate work"),
    };
    each_once("metric", &metrics)?;
    let files = match (&args.baseline, &args.old, &args.new) {
        // A single named run is NEW.
        (Some(name), new, _) => baseline_and(name, new.clone())?,
        (None, Some(old), Some(new)) => [old.clone(), new.clone()],
        _ => bail!("two reports, or --against BINARY: expected one of them"),
    };
    expect_places(&page, &files)?;
    let [old, new] = [read_report(&files[0])?, read_report(&files[1])?];
    if let Some(name) = &args.baseline {
        ensure!(
            old.run.id != new.run.id,
            "{} is the baseline '{name}' itself; expected another run to compare with it",
            text::plain(&new.run.id)
        );
    }
    let moving = new.cells.iter().find(|cell| !cell.path.motion.is_empty());
    if args.gate == Gate::Time && args.metric.is_empty() {
        metrics.extend(moving.map(ReportCell::ranked_by));
    }
    let of_frames = |name: &&&str| ["frame_ns", "update_ns"].contains(*name);
    if let (Some(name), None) = (metrics.iter().find(of_frames), moving) {
        bail!("--metric {name}: nothing moves in NEW; expected a run with --motion");
    }
    let cells = [&old.cells[..], &new.cells];
    let changes = changes(Basis::Reports, cells, args.threshold, &metrics);
    let settings = settings(&old, &new);
    let table = CompareTable {
        args,
        old: side(&old),
        new: side(&new),
        basis: Basis::Reports,
        head: format!("{} vs {}", processes(&old), processes(&new)),
        notes: notes(&old, &new, &settings, args.gate),
        settings,
        changes,
    };
    show(&table)
}

/// Lines before the figures.
fn notes(old: &Report, new: &Report, settings: &[Setting], gate: Gate) -> Vec<String> {
    let mut notes: Vec<String> = settings.iter().map(Setting::to_string).collect();
    if gate == Gate::Time && settings.iter().any(|setting| setting.is_machine) {
        notes.push(
            "different machines: a verdict says how a structure stands among the others there, \
             not how fast the program became"
                .to_owned(),
        );
    }
    for (side, report) in [("OLD", old), ("NEW", new)] {
        if report.source.dirty == Some(true) {
            notes.push(format!("{side} was built from a dirty working tree"));
        }
        if report.run.finished_at.is_none() {
            notes.push(format!("{side} is a run that was not finished"));
        }
    }
    notes
}

/// "10 processes", or the fewest and the most if cells differ.
fn processes(report: &Report) -> String {
    let cells = report.cells.iter().filter(|cell| cell.status == Status::Ok);
    let counts = cells.map(|cell| cell.times.processes);
    text::range(counts, |most| text::counted(most, "process"))
}

fn side(report: &Report) -> Side {
    let (run, source) = (&report.run, &report.source);
    let commit = source.commit.as_deref().unwrap_or("unknown");
    let cells = text::counted(report.cells.len(), "cell");
    let (id, version) = (&run.id, &source.version);
    Side {
        line: format!("{id}, version {version}, commit {commit:.12}, {cells}"),
        json: json!({
            "id": run.id,
            "started_at": run.started_at,
            "finished_at": run.finished_at,
            "command": run.command,
            "version": source.version,
            "commit": source.commit,
            "dirty": source.dirty,
            "cells": report.cells.len(),
        }),
    }
}

/// Most rows of the figure.
const DRAWN: usize = 40;

/// Refuses a comparison that judges nothing.
fn expect_judged(changes: &Changes) -> anyhow::Result<()> {
    if changes.cells_in_common == 0 {
        let (old, new) = (counted(&changes.only_in_old), counted(&changes.only_in_new));
        let expected = "expected runs of the same scenes, paths, tests and structures";
        bail!("no cell in common: OLD has {old}, NEW has {new}; {expected}");
    }
    let cells = changes.cells_in_common;
    // A cell has a row per metric.
    let different = changes.count(Outcome::Different).min(cells);
    let of_first = |row: &JudgedRow| format!(" ({}: {})", name(&row.cell), reason(row));
    ensure!(
        !changes.judges_nothing(),
        "nothing can be judged: of {} in common, {different} with another question or answer, {} without \
         a figure{}; expected runs of the same scenes, cameras and metrics",
        text::counted(cells, "cell"),
        cells - different,
        text::plain(&text::some(changes.rows.first(), of_first))
    );
    Ok(())
}

/// Prints a comparison in the chosen format, and writes its page.
fn show(table: &CompareTable) -> anyhow::Result<Ending> {
    expect_judged(&table.changes)?;
    let shown = unread_is_fine(table.print());
    write_if(&table.args.html, || {
        let mut blocks = table.blocks(true, Some(usize::MAX));
        to_page("compare", blocks.pop(), figure(table), blocks)
    })?;
    shown?;
    Ok(table.verdict().0)
}

/// The changes with intervals, the worst first.
fn figure(table: &CompareTable) -> Option<Figure> {
    let changes = &table.changes;
    let groups = unique(changes.rows.iter().map(|row| &row.cell.group));
    let metrics = unique(changes.rows.iter().filter_map(|row| row.metric));
    let all = changes.rows.iter().filter_map(|row| {
        let (group, structure) = (&row.cell.group, &row.cell.structure);
        let structure = &text::shortened(structure, 24);
        // As much as the narrowest page shows.
        let used = structure.chars().count() + metrics.get(1).map_or(0, |_| METRIC);
        let room = 48_usize.saturating_sub(used).min(36);
        let at = text::some(groups.get(1), |_| format!(" {}", place(group, room, short)));
        let metric = row.metric.filter(|_| metrics.len() > 1);
        let metric = text::some(metric, |metric| format!(" {metric}"));
        let ratio = row.ratio().filter(|ratio| is_drawn(*ratio))?;
        let judged = row.judgement.as_ref();
        let ends = judged.and_then(|judged| judged.lower.zip(judged.upper));
        Some(Row {
            name: structure.clone(),
            value: ratio,
            ends: ends.map(<[f64; 2]>::from),
            label: format!("{structure}{at}{metric} {}", change_of(ratio, None)),
            note: format!("{}{metric}: {}", name(&row.cell), change_of(ratio, ends)),
            ..Row::default()
        })
    });
    let mut shown: Vec<Row> = all.collect();
    shown.first()?;
    let worst = ["", "the worst "][usize::from(shown.len() > DRAWN)];
    shown.truncate(DRAWN);
    let has_intervals = shown.iter().any(|row| row.ends.is_some());
    let interval = ["", " with its 95 % interval"][usize::from(has_intervals)];
    let change = |ratio: f64| format!("{:+} %", ((ratio - 1.0) * 1e3).round() / 10.0 + 0.0);
    let most = 1.0 + changes.threshold;
    let limits = [1.0 / most, 1.0, most];
    let values = shown.iter().flat_map(Row::range);
    let axis = Axis::log("", values.chain(limits), 1.05, &change);
    let (count, all) = (shown.len(), text::counted(changes.rows.len(), "figure"));
    let caption = format!(
        "{}{interval}, {worst}{count} of {all}; strong line: no change, \
         dotted: the threshold",
        table.measure()
    );
    let mut figure = rows(caption, &axis, Some(1.0), &shown);
    let height = [0.0, figure.height - 1.5 * LINE];
    let threshold = |limit: f64| line("tie", [axis.percent(limit); 2], height);
    figure.parts += &[limits[0], limits[2]].map(threshold).concat();
    Some(figure)
}

/// Folder of the baselines, beside the runs.
pub const BASELINES: &str = "results/baselines";

/// File of a baseline.
pub fn baseline_file(name: &str) -> PathBuf {
    Path::new(BASELINES).join(format!("{name}.json"))
}

/// Saves a report under a name, replacing an older one.
pub fn save_baseline(name: &str, report: &Report) -> anyhow::Result<()> {
    fs::create_dir_all(BASELINES).context(BASELINES)?;
    let write = |out: &mut dyn Write| Ok(serde_json::to_writer_pretty(out, report)?);
    Ok(write_atomically(&baseline_file(name), write)?)
}

/// Files of a baseline and of the run to compare with it.
///
/// If none is named, the run is the newest of the others under results/.
fn baseline_and(name: &str, new: Option<PathBuf>) -> anyhow::Result<[PathBuf; 2]> {
    let file = baseline_file(name);
    // The folder may be missing.
    let listing = fs::read_dir(BASELINES).into_iter().flatten().flatten();
    let known = listing.filter_map(|entry| entry.file_name().into_string().ok());
    let known = known.filter_map(|name| Some(name.strip_suffix(".json")?.to_owned()));
    let expected = match known.collect::<BTreeSet<String>>() {
        none if none.is_empty() => "expected one that `run --save NAME` kept".to_owned(),
        known => format!("available: {}", Vec::from_iter(known).join(", ")),
    };
    ensure!(
        file.is_file(),
        "no baseline '{name}' in {BASELINES}; {expected}"
    );
    if let Some(new) = new {
        return Ok([file, new]);
    }
    let old = read_report(&file)?.run;
    let newest = newest_run(|path| {
        let run = read_report(path).ok()?.run;
        // A baseline may be named `report`.
        let is_run = path != Path::new(BASELINES);
        Some(run).filter(|run| is_run && run.id != old.id && run.started_at >= old.started_at)
    });
    let newest = newest.context(
        "no run in results since the baseline; expected one to compare with it, or its folder",
    )?;
    Ok([file, newest])
}
