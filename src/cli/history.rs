//! The page of several runs: times of each structure, oldest run first.

use super::cell_names::question;
use super::diagram::{Diagram, Joined, Point, Series};
use super::document::{Block, to_html};
use super::figure::{Axis, ends, is_drawn};
use super::page::glossary;
use super::run_table::distinct;
use super::table::{Column, Table};
use super::{program, text};
use crate::measure::Metric;
use crate::report::{Report, RunInfo, asked_otherwise, grouped, settings, timed_otherwise};

/// Digits of a commit that name it.
const COMMIT: usize = 7;

/// Commit, or the day of a run without one.
fn name(report: &Report) -> String {
    let (name, digits) = match &report.source.commit {
        Some(commit) => (commit, COMMIT),
        None => (&report.run.started_at, 10),
    };
    let dirty = ["", "+"][usize::from(report.source.dirty == Some(true))];
    name.chars().take(digits).collect::<String>() + dirty
}

/// Names of the runs; with start and digits of the id where two are the same.
fn names(reports: &[Report]) -> Vec<String> {
    let started = |run: &usize| {
        let RunInfo { started_at, id, .. } = &reports[*run].run;
        let start = started_at.chars().skip(5).take(14);
        let start = start.collect::<String>().replace('T', " ");
        let digits = id.rsplit('-').next().unwrap_or_default();
        format!("{} {start} {digits}", name(&reports[*run]))
    };
    let runs = Vec::from_iter(0..reports.len());
    distinct(&runs, |run| name(&reports[*run]), started)
}

/// The page; runs are sorted by their start.
pub fn page(mut reports: Vec<Report>) -> String {
    reports.sort_by(|a, b| a.run.started_at.cmp(&b.run.started_at));
    let run_names = names(&reports);
    let cells = reports.iter().enumerate();
    let cells = cells.flat_map(|(run, report)| report.cells.iter().map(move |cell| (run, cell)));
    let cells = cells.map(|(run, cell)| (cell.key().group, (cell.structure.as_str(), (run, cell))));
    let mut blocks = Vec::new();
    let mut ratios = Vec::new();
    for (group, cells) in grouped(cells) {
        let heading = format!("{}, {}", group.scene, question(&group));
        let per = ["query", "frame"][usize::from(!group.motion.is_empty())];
        let names = run_names.iter().map(String::as_str).chain(["last / first"]);
        let mut table = Table::of_numbers(["structure"].into_iter().chain(names));
        let mut series = Vec::new();
        for (structure, cells) in grouped(cells.into_iter()) {
            let sound = cells.iter().filter(|(_, cell)| cell.rank.is_some());
            let last = sound.clone().next_back().map(|(_, cell)| *cell);
            // The same name does not make it the same question.
            let differs = |cell| {
                let pair = (cell, last?);
                asked_otherwise(pair).or_else(|| timed_otherwise(pair))
            };
            let sound = sound.filter(|(_, cell)| differs(*cell).is_none());
            let times = sound.filter_map(|&(run, cell)| Some((run, cell.time()?)));
            let times = times.filter(|(_, time)| is_drawn(time.value));
            let times: Vec<(usize, &Metric)> = times.collect();
            let mut change = String::new();
            if let [(_, first), .., (_, last)] = times[..] {
                let ratio = last.value / first.value;
                change = format!("{} x", text::significant(ratio));
                ratios.push(ratio);
            }
            let shown = (0..reports.len()).map(|run| {
                let cell = cells.iter().find(|cell| cell.0 == run);
                match times.iter().find(|time| time.0 == run) {
                    Some((_, time)) => text::time_with(time),
                    None => text::some(cell, |(_, cell)| {
                        let why = differs(*cell).filter(|_| cell.rank.is_some());
                        why.unwrap_or_else(|| cell.status.name().to_owned())
                    }),
                }
            });
            let figures = shown.chain([change]);
            table.add_row([structure.to_owned()].into_iter().chain(figures));
            let point = |&(run, time): &(usize, &Metric)| Point {
                at: [run as f64, time.value],
                ends: ends(time.estimate()),
                note: text::joined([structure, &run_names[run]]) + ": " + &text::time_with(time),
                ..Point::default()
            };
            let is_scan = cells.iter().any(|(_, cell)| cell.is_scan());
            let points = times.iter().map(point).collect();
            series.push(Series::of(structure, is_scan, points));
        }
        series.retain(|series| !series.points.is_empty());
        // The fastest of the last run keeps its colour.
        let last = |series: &Series| series.points.last().map_or([0.0; 2], |p| p.at);
        series.sort_by(|a, b| {
            let ([x, ns], [y, other]) = (last(a), last(b));
            y.total_cmp(&x).then(ns.total_cmp(&other))
        });
        blocks.push(Block::Heading(2, heading.clone()));
        if !series.is_empty() {
            // Their names would overlap.
            let number = |run: f64| (run + 1.0).to_string();
            let mut x = Axis::linear("run", 0.0..(reports.len() - 1) as f64, &number);
            x.ticks = (0..reports.len()).map(|run| run as f64).collect();
            let points = series.iter().flat_map(|s| s.points.iter());
            let values = points.flat_map(|p| p.ends.unwrap_or([p.at[1]; 2]));
            let y = Axis::log("", values.collect::<Vec<_>>().into_iter(), 1.1, &text::time);
            let caption = format!("{heading}: time per {per} in each run, 95 % interval");
            let diagram = Diagram::of(caption, [x, y], Joined::Marked, series);
            blocks.push(Block::Figure(diagram.draw()));
        }
        blocks.push(Block::Table(table));
    }
    let runs_shown = text::counted(reports.len(), "run");
    let title = format!("{} history of {runs_shown}", program::name());
    let mut all = vec![
        Block::Heading(1, title.clone()),
        Block::Line(conclusion(&reports, &ratios)),
    ];
    all.extend(blocks);
    all.extend(Block::section("Runs", runs(&reports, &run_names)));
    all.extend(glossary(&all));
    to_html(&title, &all)
}

/// Changes from first to last times, and what else differs between these runs.
///
/// Times of two runs one after the other differ for the machine's sake alone: no change is
/// counted or named.
fn conclusion(reports: &[Report], ratios: &[f64]) -> String {
    let end = |of: fn(f64, f64) -> f64| ratios.iter().copied().reduce(of);
    let ends = end(f64::min).zip(end(f64::max));
    let ([first, .., last], Some((least, most))) = (reports, ends) else {
        return "No structure has times in two runs that can be compared.".to_owned();
    };
    let settings = settings(first, last);
    let note = text::some(settings.first(), |_| {
        let differ = text::joined(settings.iter().map(|setting| setting.what));
        format!(" They differ in the {differ}: not all of a change is the program's own.")
    });
    let runs = text::counted(reports.len(), "run");
    let cells = text::counted(ratios.len(), "cell");
    let [least, most] = [least, most].map(text::significant);
    let all = format!("{least} to {most}");
    let factor = if least == most { least } else { all };
    let take = ["takes", "take"][usize::from(ratios.len() > 1)];
    format!(
        "Over {runs} {cells} {take} {factor} x as long in the last run that has times of them as in \
         the first, by program and machine together. compare judges two runs.{note}"
    )
}

fn runs(reports: &[Report], names: &[String]) -> Table {
    let columns: &[Column<(usize, (&Report, &String))>] = &[
        ("run", |(run, _)| (run + 1).to_string()),
        ("name", |(_, (_, name))| name.to_string()),
        ("started", |(_, (report, _))| {
            let unfinished = report.run.finished_at.is_none().then_some("not finished");
            text::joined([&report.run.started_at, unfinished.unwrap_or_default()])
        }),
        ("version", |(_, (report, _))| report.source.version.clone()),
        (">cells", |(_, (report, _))| text::count(report.cells.len())),
        (">processes", |(_, (of, _))| of.run.processes.to_string()),
        ("machine", |(_, (report, _))| {
            let cpu = report.machine.cpu.as_deref().unwrap_or("unknown");
            format!("{cpu}, {}", text::counted(report.machine.cores, "core"))
        }),
        ("command", |(_, (report, _))| report.run.command.clone()),
    ];
    Table::with(reports.iter().zip(names).enumerate(), columns)
}
