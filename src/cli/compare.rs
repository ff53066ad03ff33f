//! `cullbench compare`: one run against an older one, as tables or JSON. Reads
//! two report.json and measures nothing; what counts as a change is decided in
//! `report`, here are the options and the words.

use std::io::{self, Write};

use anyhow::bail;
use serde::Serialize;
use serde_json::{Value, json};

use super::args::{CompareArgs, TableFormat};
use super::{Ending, text, unread_is_fine};
use cullbench::measure::METRICS;
use cullbench::report::{
    Bar, CellName, Change, Changes, Decider, Lone, Outcome, Report, Setting, TRACKED, Tracked,
    changes, read_report, settings,
};
use cullbench::spec::{SpecError, parse_number};

pub fn compare(args: &CompareArgs) -> anyhow::Result<Ending> {
    let threshold = threshold(&args.threshold)?;
    let metrics = metrics(&args.metric)?;
    let (old, new) = (read_report(&args.old)?, read_report(&args.new)?);
    let changes = changes(&old, &new, threshold, &metrics);
    if changes.cells_in_common == 0 {
        bail!("{}", nothing_in_common(&changes));
    }
    if let Some(first) = changes.why_nothing_was_judged() {
        bail!(
            "nothing can be judged: of {} cells in common, {} were not asked the same and {} lack \
             a figure ({}: {}); expected runs of the same scenes, cameras and metrics",
            changes.cells_in_common,
            changes.count(Outcome::Different),
            changes.count(Outcome::Unmeasured),
            text::plain(&name(&first.cell)),
            reason(first)
        );
    }
    let compared = Compared {
        notes: notes(&old, &new, &settings(&old, &new), &changes),
        old: &old,
        new: &new,
        changes,
    };
    unread_is_fine(match args.format {
        TableFormat::Json => compared.json(),
        TableFormat::Table => compared.table(args.all),
    })?;
    let changes = &compared.changes;
    Ok(match (changes.is_wrong(), changes.is_regression()) {
        (true, _) => Ending::WrongAnswer,
        (false, true) => Ending::Regression,
        (false, false) => Ending::Ok,
    })
}

/// "5%", "5 %" or "0.05". A bare 5 could be meant as either, and as 500 % it
/// would let everything pass.
fn threshold(typed: &str) -> Result<f64, SpecError> {
    let typed = typed.trim();
    let share = match typed.strip_suffix('%') {
        Some(percents) => parse_number(&format!("{}%", percents.trim_end())),
        None => parse_number(typed).filter(|share| *share < 1.0),
    };
    share.filter(|share| *share >= 0.0).ok_or_else(|| {
        SpecError::new(format_args!(
            "--threshold is '{typed}'; expected a percentage such as 5% or a share from 0 to 1 \
             such as 0.05"
        ))
    })
}

/// The metrics of all lists, each once.
fn metrics(lists: &[String]) -> Result<Vec<&'static Tracked>, SpecError> {
    let mut chosen: Vec<&'static Tracked> = Vec::new();
    let names = lists.iter().flat_map(|list| list.split(','));
    for name in names.map(str::trim).filter(|name| !name.is_empty()) {
        let known = TRACKED.iter().map(|metric| metric.name);
        let metric =
            Tracked::named(name).ok_or_else(|| SpecError::unknown("metric", name, known))?;
        if chosen.contains(&metric) {
            return Err(SpecError::new(format_args!(
                "metric '{name}' is named twice; expected each once"
            )));
        }
        chosen.push(metric);
    }
    if chosen.is_empty() {
        return Err(SpecError::new(
            "no metric to compare by; expected names such as query_ns,build_ms",
        ));
    }
    Ok(chosen)
}

fn nothing_in_common(changes: &Changes) -> String {
    let side = |cells: &[Lone]| match cells.first() {
        Some(first) => format!(
            "{} cells ({}, ...)",
            cells.len(),
            text::plain(&name(&first.cell))
        ),
        None => "no cells".to_owned(),
    };
    format!(
        "no cell in common: OLD has {}, NEW has {}; expected runs of the same scenes, paths, \
         tests and structures",
        side(&changes.only_in_old),
        side(&changes.only_in_new)
    )
}

/// A cell as one says it.
fn name(cell: &CellName) -> String {
    format!("{} on {}, {}", cell.structure, cell.scene, question(cell))
}

/// All of a cell's name but scene and structure.
fn question(cell: &CellName) -> String {
    let cold = match cell.cache {
        "warm" => String::new(),
        cache => format!(" ({cache})"),
    };
    format!("{}, {}{cold}", cell.path, cell.test)
}

/// Why a row is what it is, where the figures do not say it.
fn reason(change: &Change) -> String {
    let statuses = (change.old_status, change.new_status);
    let became = match statuses.0 == statuses.1 {
        true if change.outcome == Outcome::FailedInBoth => statuses.1.name().to_owned(),
        true => String::new(),
        false => format!("{} to {}", statuses.0.name(), statuses.1.name()),
    };
    let why = change.reason.as_deref().unwrap_or_default();
    let parts = [became.as_str(), why];
    let told: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
    text::plain(&told.join(", "))
}

/// What to know before the figures, a line each.
fn notes(old: &Report, new: &Report, settings: &[Setting], changes: &Changes) -> Vec<String> {
    let mut notes = Vec::new();
    for setting in settings {
        let values = format!("'{}' and '{}'", setting.old, setting.new);
        notes.push(format!("{} differs: {values}", setting.what));
    }
    if settings.iter().any(|setting| setting.is_machine) {
        let advice = "different machines: their times do not compare; --metric times_read \
                      (times_memcpy, times_replay) compares ratios within each run";
        notes.push(advice.to_owned());
    }
    notes.push(match changes.machine_drift {
        Some(drift) => format!(
            "the machine itself: {} bounds (reading, copying) take {} times as long in NEW",
            drift.bounds,
            text::significant(drift.ratio)
        ),
        None => "the machine itself: no bounds in common, so its drift is unknown".to_owned(),
    });
    for (side, report) in [("OLD", old), ("NEW", new)] {
        if report.noise.aa_floor.is_none() {
            notes.push(format!(
                "{side} knows no noise floor: nothing was measured twice in it"
            ));
        }
        if report.run.finished_at.is_none() {
            notes.push(format!("{side} is a run that was not finished"));
        }
    }
    notes.into_iter().map(|note| text::plain(&note)).collect()
}

/// Two reports with what is to be said about them.
struct Compared<'r> {
    old: &'r Report,
    new: &'r Report,
    notes: Vec<String>,
    changes: Changes<'r>,
}

impl Compared<'_> {
    fn json(&self) -> io::Result<()> {
        #[derive(Serialize)]
        struct Document<'c> {
            old: Value,
            new: Value,
            verdict: &'static str,
            counts: Value,
            notes: &'c [String],
            settings: Vec<Setting>,
            #[serde(flatten)]
            changes: &'c Changes<'c>,
        }
        let changes = &self.changes;
        let counts = Outcome::ALL.map(|o| (o.name().to_owned(), json!(changes.count(o))));
        let document = Document {
            old: head(self.old),
            new: head(self.new),
            verdict: match (changes.is_wrong(), changes.is_regression()) {
                (true, _) => "wrong_answer",
                (false, true) => "regression",
                (false, false) => "ok",
            },
            counts: Value::Object(counts.into_iter().collect()),
            notes: &self.notes,
            settings: settings(self.old, self.new),
            changes,
        };
        let mut out = io::stdout().lock();
        writeln!(out, "{}", serde_json::to_string_pretty(&document)?)
    }

    fn table(&self, all: bool) -> io::Result<()> {
        let changes = &self.changes;
        let mut out = io::stdout().lock();
        writeln!(out, "OLD  {}", head_line(self.old))?;
        writeln!(out, "NEW  {}", head_line(self.new))?;
        for bar in &changes.bars {
            writeln!(out, "bar  {}", bar_line(bar, changes.threshold))?;
        }
        for note in &self.notes {
            writeln!(out, "note: {note}")?;
        }
        let shown = || changes.changes.iter().filter(|c| all || c.is_news());
        if shown().next().is_some() {
            writeln!(out, "\n{}", changes_table(shown()))?;
        }
        if !changes.structures.is_empty() {
            writeln!(out, "\n{}", means_table(changes))?;
        }
        for (side, cells) in [("OLD", &changes.only_in_old), ("NEW", &changes.only_in_new)] {
            lone_lines(&mut out, side, cells)?;
        }
        writeln!(out, "{}", verdict(changes))
    }
}

fn head(report: &Report) -> Value {
    let (run, source) = (&report.run, &report.source);
    json!({
        "id": run.id,
        "started_at": run.started_at,
        "command": run.command,
        "version": source.version,
        "commit": source.commit,
        "dirty": source.dirty,
        "noise_floor": report.noise.aa_floor,
        "cells": report.cells.len(),
    })
}

fn head_line(report: &Report) -> String {
    let source = &report.source;
    let commit = match source.commit.as_deref() {
        Some(commit) => format!("commit {}", commit.chars().take(12).collect::<String>()),
        None => "commit unknown".to_owned(),
    };
    let dirty = match source.dirty {
        Some(true) => " with changes of its own",
        _ => "",
    };
    let floor = match report.noise.aa_floor {
        Some(floor) => text::percent(floor),
        None => "unknown".to_owned(),
    };
    text::plain(&format!(
        "{}, version {}, {commit}{dirty}, {} cells, noise floor {floor}",
        report.run.id,
        source.version,
        text::count(report.cells.len())
    ))
}

/// Which of the threshold and the noise floors it was.
fn bar_line(bar: &Bar, threshold: f64) -> String {
    let decided = match bar.decided_by {
        Decider::Threshold => "the threshold".to_owned(),
        Decider::OldNoiseFloor => {
            format!("noise floor of OLD; threshold {}", text::percent(threshold))
        }
        Decider::NewNoiseFloor => {
            format!("noise floor of NEW; threshold {}", text::percent(threshold))
        }
    };
    format!("{}: {} ({decided})", bar.metric, text::percent(bar.bar))
}

fn changes_table<'c>(changes: impl Iterator<Item = &'c Change<'c>>) -> comfy_table::Table {
    let header = [
        "",
        "scene",
        "path, test",
        "structure",
        "metric",
        "old",
        "new",
        "new / old",
        "why",
    ];
    let mut table = text::table(&header, &[5, 6, 7]);
    for change in changes {
        let (cell, metric) = (&change.cell, change.metric.unwrap_or_default());
        let figure = |figure: Option<cullbench::report::Figure>| {
            figure.map_or(String::new(), |f| shown(metric, f.value))
        };
        table.add_row([
            change.outcome.name().replace('_', " "),
            text::plain(cell.scene),
            text::plain(&question(cell)),
            text::plain(cell.structure),
            metric.to_owned(),
            figure(change.old),
            figure(change.new),
            change.ratio.map(text::significant).unwrap_or_default(),
            reason(change),
        ]);
    }
    table
}

/// A figure with the unit of its metric.
fn shown(metric: &str, value: f64) -> String {
    let info = METRICS.iter().find(|info| info.name == metric);
    match info.map(|info| info.unit) {
        Some("ns") => text::time(value),
        Some("ms") => text::time(value * 1e6),
        Some("bytes") => format!("{value:.1} B"),
        _ => text::significant(value),
    }
}

fn means_table(changes: &Changes) -> comfy_table::Table {
    let header = ["structure", "metric", "cells", "mean of new / old"];
    let mut table = text::table(&header, &[2, 3]);
    for mean in &changes.structures {
        table.add_row([
            text::plain(mean.structure),
            mean.metric.to_owned(),
            text::count(mean.cells),
            text::significant(mean.ratio),
        ]);
    }
    table
}

/// How many cells only one side has; each that is wrong by its name.
fn lone_lines(out: &mut impl Write, side: &str, cells: &[Lone]) -> io::Result<()> {
    let Some(first) = cells.first() else {
        return Ok(());
    };
    let more = match cells.len() {
        1 => "",
        _ => ", ...",
    };
    writeln!(
        out,
        "only in {side}: {} cells ({}{more})",
        text::count(cells.len()),
        text::plain(&name(&first.cell))
    )?;
    for cell in cells.iter().filter(|cell| cell.status.is_failure()) {
        let why = cell.reason.map(|reason| format!(": {reason}"));
        writeln!(
            out,
            "only in {side}: {}",
            text::plain(&format!(
                "{}: {}{}",
                name(&cell.cell),
                cell.status.name(),
                why.unwrap_or_default()
            ))
        )?;
    }
    Ok(())
}

/// "2 slower, 1 faster, 95 ties of 98 cells; worst 1.42 (bvh on ...)".
fn verdict(changes: &Changes) -> String {
    let mut parts = Vec::new();
    for outcome in Outcome::ALL {
        let count = changes.count(outcome);
        // The three that a figure can have are said in any case.
        if count > 0 || outcome.is_judged() {
            let name = match (outcome, count) {
                (Outcome::Tie, 1) => "tie",
                (Outcome::Tie, _) => "ties",
                _ => &outcome.name().replace('_', " "),
            };
            parts.push(format!("{} {name}", text::count(count)));
        }
    }
    let rows = match (changes.changes.len(), changes.cells_in_common) {
        (rows, cells) if rows == cells => format!("{} cells", text::count(cells)),
        (rows, cells) => format!(
            "{} figures of {} cells",
            text::count(rows),
            text::count(cells)
        ),
    };
    let worst = match changes.worst() {
        Some((ratio, change)) => text::plain(&format!(
            "; worst {} ({}, {})",
            text::significant(ratio),
            name(&change.cell),
            change.metric.unwrap_or_default()
        )),
        None => String::new(),
    };
    format!("{} of {rows}{worst}", parts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_are_shares_and_nothing_else() {
        for (typed, share) in [
            ("5%", 0.05),
            ("5 %", 0.05),
            (" 0.05 ", 0.05),
            ("0", 0.0),
            ("0%", 0.0),
            ("150%", 1.5),
        ] {
            assert_eq!(threshold(typed), Ok(share), "{typed}");
        }
        let bad = "nan NaN% -5% -0.1 inf inf% 1e999 5 1.5 5k five % 5%% - --all";
        for typed in bad.split(' ').chain(["", "5 5%"]) {
            let error = threshold(typed).expect_err(typed).to_string();
            assert!(
                error.contains("expected") && error.contains(typed),
                "{error}"
            );
        }
    }

    #[test]
    fn metrics_are_named_once_and_only_those_that_less_is_better_of() {
        let chosen = |lists: &[&str]| {
            let lists: Vec<String> = lists.iter().map(|list| (*list).to_owned()).collect();
            let metrics = metrics(&lists).map_err(|error| error.to_string())?;
            Ok::<Vec<&str>, String>(metrics.iter().map(|metric| metric.name).collect())
        };
        let two = chosen(&["query_ns, build_ms", "locate_ns,"]);
        assert_eq!(two, Ok(vec!["query_ns", "build_ms", "locate_ns"]));
        for (list, wanted) in [
            ("qery_ns", "did you mean 'query_ns'"),
            ("excess", "unknown metric 'excess'"),
            ("query_ns,query_ns", "named twice"),
            (" , ", "no metric"),
        ] {
            let error = chosen(&[list]).expect_err(list);
            assert!(error.contains(wanted), "{error}");
        }
    }
}
