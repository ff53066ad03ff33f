//! `cullbench report`: the results of a run, from its report.json.
//!
//! Output is Markdown, pictures, one HTML page, or the Bencher Metric Format (bencher.dev). Also
//! the summary on the terminal at the end of `run`, and the page of several runs, oldest first.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, IsTerminal, Write};
use std::path::Path;

use anyhow::{Context, bail};
use serde_json::{Map, Value, json};

use super::args::ReportArgs;
use super::diagram::{Diagram, Joined, Point, Series};
use super::document::{Block, Column, Table, show, to_html, to_markdown};
use super::figure::{Axis, ends, is_drawn};
use super::page::{glossary, origin};
use super::run_table::{self, distinct, name, question};
use super::shared_args::each_once;
use super::surface_tables::{self, Picture};
use super::{
    Ending, expect_folder, expect_places, program, run_figures, run_verdict, text, write_if,
    write_text,
};
use crate::measure::{Metric, Status};
use crate::report::{
    Comparison, Overall, Report, RunInfo, Views, answer_difference, comparisons, folder_of,
    grouped, query_difference, read_report, save_page, settings, views, work_difference,
};

pub fn report(args: &ReportArgs) -> anyhow::Result<Ending> {
    let outputs = [
        ("--markdown", &args.markdown),
        ("--html", &args.html),
        ("--bencher", &args.bencher),
        ("--history", &args.history),
    ];
    expect_places(&outputs, &args.reports)?;
    expect_folder("--svg", args.svg.as_deref())?;
    if let Some(path) = &args.history {
        let reports = args.reports.iter().map(|path| read_report(path));
        let reports = reports.collect::<Result<Vec<_>, _>>()?;
        each_once("run", reports.iter().map(|report| &report.run.id))?;
        write_text(path, &history(reports))?;
        return Ok(Ending::Ok);
    }
    let [path] = &args.reports[..] else {
        let count = args.reports.len();
        bail!("{count} reports; expected one, or --history FILE");
    };
    let report = read_report(path)?;
    let markdown = || to_markdown(&blocks(&report, &BTreeMap::new()));
    write_if(&args.markdown, markdown)?;
    if let Some(path) = &args.bencher {
        if report.run.finished_at.is_none() {
            tell!("note: the run was not finished; its cells have fewer processes or are missing");
        }
        write_text(path, &bencher(&report)?)?;
    }
    if let Some(folder) = &args.svg {
        match &surface_tables::pictures(&report)[..] {
            [] => tell!(
                "note: no chart in {}; a chart needs a structure with times",
                folder.display()
            ),
            pictures => write_charts(folder, pictures)?,
        }
    }
    if let Some(file) = &args.html {
        let folder = if path.is_dir() { path } else { folder_of(path) };
        write_text(file, &page(&report, folder, Vec::new()))?;
    } else if args.markdown.is_none() && args.svg.is_none() && args.bencher.is_none() {
        match args.all_columns || io::stdout().is_terminal() {
            true => show(&shown(&report, args.all_columns, text::width()))?,
            false => io::stdout().write_all(markdown().as_bytes())?,
        }
    }
    Ok(Ending::Ok)
}

/// The page of a run; `folder` has its stream and samples, `why` is from `--why`.
fn page(report: &Report, folder: &Path, why: Vec<Block>) -> String {
    let mut blocks = blocks(report, &views(folder, report));
    if !why.is_empty() {
        blocks.push(Block::heading(
            "Tests, and time per test, beside the best structure's",
        ));
        blocks.extend(why);
    }
    blocks.extend(glossary(&blocks));
    to_html(&title(report), &blocks)
}

/// Writes the page and the pictures of a run into its folder.
pub fn write_page(report: &Report, folder: &Path, why: Vec<Block>) -> anyhow::Result<()> {
    let pictures = surface_tables::pictures(report);
    Ok(save_page(folder, &page(report, folder, why), &pictures)?)
}

/// Writes all of them, or removes a folder it has created.
fn write_charts(folder: &Path, pictures: &[Picture]) -> anyhow::Result<()> {
    let is_new = !folder.exists();
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let file = |name: &str| folder.join(format!("{name}.svg"));
    let mut all = pictures.iter();
    let written = all.try_for_each(|(name, svg)| write_text(&file(name), svg));
    if written.is_err() && is_new {
        let _ = fs::remove_dir_all(folder);
    }
    Ok(written?)
}

/// Tables and conclusions of each cache state and culling test.
pub fn shown(report: &Report, all_columns: bool, width: usize) -> Vec<Block> {
    let all = comparisons(report);
    let mut blocks = Vec::new();
    if all_columns {
        blocks = details(report, &all, &BTreeMap::new());
    }
    for (_, group) in run_table::groups(&all) {
        let overall = Overall::of(&group);
        blocks.push(Block::line(""));
        match &group[..] {
            [_] if all_columns => {}
            [one] => {
                blocks.extend(run_table::heads(one).into_iter().map(Block::Line));
                let table = run_table::structures(one, overall.base, false);
                blocks.push(Block::Table(table.parts(width).swap_remove(0)));
                blocks.extend(sharing(report, one).into_iter().flatten());
            }
            _ => blocks.extend(run_table::of_many(&group, &overall, width)),
        }
        blocks.push(Block::line(""));
        let notes = run_table::reasons(&group).into_iter();
        let notes = notes.chain(run_table::choices(&group));
        blocks.extend(notes.map(Block::Line));
        blocks.push(Block::Line(run_verdict::conclusion(&group, &overall)));
    }
    blocks.extend(surface_tables::blocks(report));
    blocks
}

fn title(report: &Report) -> String {
    format!("{} run {}", program::name(), report.run.id)
}

fn blocks(report: &Report, views: &BTreeMap<String, Views>) -> Vec<Block> {
    let mut blocks = vec![Block::Heading(1, title(report))];
    let all = comparisons(report);
    for (of, group) in run_table::groups(&all) {
        let overall = Overall::of(&group);
        let conclusion = run_verdict::conclusion(&group, &overall);
        blocks.push(Block::Line(text::labelled(&of, &conclusion)));
        if let Some(base) = overall.base.filter(|_| group.len() > 1) {
            let names = group.iter().map(|comparison| run_figures::of(comparison));
            let table = run_table::matrix(names.collect(), &group, &overall);
            let heading = text::joined([&format!("Speed-up over {base}"), &of]);
            let heading = Block::Heading(2, heading);
            let legend = Block::Line(run_table::legend(&group, &overall));
            blocks.extend([heading, Block::Heat(table), legend]);
        }
    }
    let warnings = report.input_warnings().into_iter();
    let warnings = warnings.chain(&report.noise.warnings);
    let warnings = warnings.chain(&report.run.left_out);
    blocks.extend(Block::warnings(warnings));
    blocks.extend(details(report, &all, views));
    let every: Vec<&Comparison> = all.iter().collect();
    blocks.extend(run_table::choices(&every).into_iter().map(Block::Line));
    blocks.extend(surface_tables::blocks(report));
    blocks.push(Block::Heading(2, "Statuses".to_owned()));
    let cells = text::counted(report.cells.len(), "cell");
    let reasons = run_table::reasons(&every);
    let all_ok = format!("{cells}, all ok{}.", text::missing(report));
    let all_ok = reasons.is_empty().then_some(all_ok);
    blocks.extend(reasons.into_iter().chain(all_ok).map(Block::Line));
    blocks.push(Block::Heading(2, "Machine and command".to_owned()));
    blocks.extend(about(report).into_iter().map(Block::Line));
    blocks
}

/// Every scene and path with all its figures.
fn details(report: &Report, all: &[Comparison], views: &BTreeMap<String, Views>) -> Vec<Block> {
    let path = |comparison: &Comparison| {
        let (scene, path) = (&comparison.about().scene, &comparison.about().path);
        [&scene.name, &path.name, &path.cache, &path.motion].map(String::clone)
    };
    let paths = grouped(all.iter().map(|comparison| (path(comparison), comparison)));
    let (mut blocks, mut scene) = (Vec::new(), "");
    for (names, tests) in &paths {
        if names[0] != scene {
            scene = &names[0];
            blocks.push(Block::Heading(2, scene.to_owned()));
        }
        for comparison in tests {
            let about = comparison.about();
            let base = Overall::of(&[comparison]).base;
            let own = views.get(&about.key().group.id());
            blocks.extend(of_comparison(comparison, base, own));
            blocks.extend(sharing(report, comparison).into_iter().flatten());
        }
        blocks.extend(run_figures::errors(tests).map(Block::Figure));
    }
    blocks
}

fn sharing(report: &Report, comparison: &Comparison) -> Option<[Block; 3]> {
    let threads = report.run.threads as usize;
    run_verdict::sharing(comparison.sound(), threads, &report.machine)
}

fn of_comparison(comparison: &Comparison, base: Option<&str>, views: Option<&Views>) -> Vec<Block> {
    let about = comparison.about();
    let path = &about.path;
    let heading = [&path.name, &path.cache, &about.test, &path.motion].map(String::clone);
    let group = about.key().group;
    let heading = text::joined(heading.into_iter().chain(run_table::unusual(&group)));
    let mut blocks = vec![Block::Heading(3, heading)];
    blocks.extend(run_table::heads(comparison).into_iter().map(Block::Line));
    blocks.push(Block::Line(text::basis(comparison)));
    let plot = base.and_then(|base| run_figures::speedups(comparison, base));
    let along = views.map(|views| run_figures::along(comparison, views));
    let figures = plot.into_iter().chain(along.into_iter().flatten());
    blocks.extend(figures.map(Block::Figure));
    blocks.push(Block::Table(run_table::structures(comparison, base, true)));
    blocks
}

/// Origin of the figures, in lines.
fn about(report: &Report) -> Vec<String> {
    let (run, machine, source) = (&report.run, &report.machine, &report.source);
    let suite = run.suite.as_deref().unwrap_or("chosen by hand");
    let (start, seed) = (&run.started_at, run.seed);
    let unfinished = ["", "; not finished"][usize::from(run.finished_at.is_none())];
    let mut lines = vec![format!("{start}, suite: {suite}, seed {seed}{unfinished}.")];
    lines.extend(origin(&run.command, machine, &report.toolchain, source));
    lines.push(format!("{}.", text::conclusion(report)));
    lines
}

/// Shows the basis of a run, warnings, the next command, and the files written.
///
/// `how` follows the number of cells: how long they took, or their source.
pub fn close(
    report: &Report,
    how: &str,
    next: Option<String>,
    folder: &Path,
    other: Option<String>,
) -> io::Result<()> {
    let failed = report.cells.iter().filter(|cell| cell.status.is_failure());
    let is_wrong = failed.clone().all(|cell| cell.status == Status::Wrong);
    let cells = text::counted(report.cells.len(), "cell");
    let (failed, what) = (failed.count(), ["failed", "wrong"][usize::from(is_wrong)]);
    let conclusion = text::conclusion(report);
    let basis = format!("{cells}{how}, {failed} {what}; {conclusion}");
    let warnings = report.noise.warnings.iter().chain(&report.run.left_out);
    let warnings = warnings.map(|said| format!("warning: {said}"));
    let lines = [String::new(), basis].into_iter().chain(warnings);
    let lines = lines.map(|line| text::wrapped(&line, text::width()));
    let mut told: Vec<String> = lines.collect();
    told.extend(next);
    told.push(format!("report  {}", folder.join("report.html").display()));
    let others = "report.json, summary.csv, samples.csv, stream.jsonl, *.svg";
    let others = text::wrapped(others, text::width().saturating_sub(8)) + "\n";
    let others = others + &other.unwrap_or_default();
    told.extend(others.lines().map(|line| format!("        {line}")));
    text::print(&told)
}

/// Metrics that are measures of Bencher.
const METRICS: &str = "query_ns locate_ns build_ms nodes_tested items_tested planes_tested \
                       memory_bytes_per_item frame_ns worst_frame_ns";

/// One benchmark per right cell, named after structure and query.
fn bencher(report: &Report) -> serde_json::Result<String> {
    let cells = report.cells.iter().filter(|cell| cell.status == Status::Ok);
    let benchmarks = cells.map(|cell| {
        let measures = METRICS.split(' ').filter_map(|metric| {
            let found = cell.metrics.get(metric)?;
            let mut value = json!({ "value": found.value });
            if let Some([lower, upper]) = found.estimate().ends() {
                value["lower_value"] = json!(lower);
                value["upper_value"] = json!(upper);
            }
            // Bencher has a built-in `latency` in ns.
            let name = metric.replace("query_ns", "latency").replace('_', "-");
            Some((name, value))
        });
        let views = Some(cell.path.views_per_frame).filter(|views| *views > 1);
        let views = text::some(views, |views| format!(", {views} views"));
        let name = name(&cell.key()) + &views;
        (name, Value::Object(measures.collect()))
    });
    serde_json::to_string_pretty(&benchmarks.collect::<Map<_, _>>()).map(|text| text + "\n")
}

/// Digits of a commit's short name.
const COMMIT: usize = 7;

/// Commit, or the day of a run without one.
fn run_name(report: &Report) -> String {
    let (name, digits) = match &report.source.commit {
        Some(commit) => (commit, COMMIT),
        None => (&report.run.started_at, 10),
    };
    let dirty = ["", "+"][usize::from(report.source.dirty == Some(true))];
    name.chars().take(digits).collect::<String>() + dirty
}

/// Names of the runs; with start and digits of the id if two are equal.
fn names(reports: &[Report]) -> Vec<String> {
    let started = |run: &usize| {
        let RunInfo { started_at, id, .. } = &reports[*run].run;
        let start = started_at.chars().skip(5).take(14);
        let start = start.collect::<String>().replace('T', " ");
        let digits = id.rsplit('-').next().unwrap_or_default();
        format!("{} {start} {digits}", run_name(&reports[*run]))
    };
    let runs = Vec::from_iter(0..reports.len());
    distinct(&runs, |run| run_name(&reports[*run]), started)
}

/// The page; runs are sorted by their start.
pub fn history(mut reports: Vec<Report>) -> String {
    reports.sort_by(|a, b| a.run.started_at.cmp(&b.run.started_at));
    let run_names = names(&reports);
    let cells = reports.iter().enumerate();
    let cells = cells.flat_map(|(run, report)| report.cells.iter().map(move |cell| (run, cell)));
    let cells = cells.map(|(run, cell)| (cell.key().group, (cell.structure.as_str(), (run, cell))));
    let mut blocks = Vec::new();
    let (mut ratios, mut others) = (Vec::new(), 0);
    for (group, cells) in grouped(cells) {
        let heading = format!("{}, {}", group.scene, question(&group));
        let per = ["query", "frame"][usize::from(!group.motion.is_empty())];
        let names = run_names.iter().map(String::as_str).chain(["last / first"]);
        let mut table = Table::of_numbers(["structure"].into_iter().chain(names));
        let mut series = Vec::new();
        for (structure, cells) in grouped(cells.into_iter()) {
            let sound = cells.iter().filter(|(_, cell)| cell.rank.is_some());
            let last = sound.clone().next_back().map(|(_, cell)| *cell);
            // The same name does not imply the same query.
            let differs = |cell| {
                let pair = (cell, last?);
                let all = [query_difference, answer_difference, work_difference];
                all.iter().find_map(|why| why(pair))
            };
            others += usize::from(sound.clone().any(|(_, cell)| differs(*cell).is_some()));
            let sound = sound.filter(|(_, cell)| differs(*cell).is_none());
            let times = sound.filter_map(|&(run, cell)| Some((run, cell.time()?)));
            let times = times.filter(|(_, time)| is_drawn(time.value));
            let times: Vec<(usize, &Metric)> = times.collect();
            let mut change = String::new();
            if let [(_, first), .., (run, last)] = times[..]
                && cells.last().is_some_and(|newest| newest.0 == run)
            {
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
            let is_within = points.clone().any(|point| point.ends.is_some());
            let interval = ["", ", 95 % interval"][usize::from(is_within)];
            let values = points.flat_map(|p| p.ends.unwrap_or([p.at[1]; 2]));
            let y = Axis::log("", values.collect::<Vec<_>>().into_iter(), 1.1, &text::time);
            let caption = format!("{heading}: time per {per} in each run{interval}");
            let diagram = Diagram::of(caption, [x, y], Joined::Marked, series);
            blocks.push(Block::Figure(diagram.draw()));
        }
        blocks.push(Block::Table(table));
    }
    let runs_shown = text::counted(reports.len(), "run");
    let title = format!("{} history of {runs_shown}", program::name());
    let mut all = vec![
        Block::Heading(1, title.clone()),
        Block::Line(conclusion(&reports, &ratios, others)),
    ];
    all.extend(blocks);
    all.extend(Block::section("Runs", runs(&reports, &run_names)));
    all.extend(glossary(&all));
    to_html(&title, &all)
}

/// Changes from first to last times, and other differences between these runs.
///
/// Runs one after the other differ by their machines alone: no change is counted or named.
fn conclusion(reports: &[Report], ratios: &[f64], others: usize) -> String {
    let end = |of: fn(f64, f64) -> f64| ratios.iter().copied().reduce(of);
    let ends = end(f64::min).zip(end(f64::max));
    let newest = reports.last().map_or(&[][..], |last| &last.cells);
    let failed = newest.iter().filter(|cell| cell.status.is_failure());
    let failed = text::any(failed.count(), "wrong answer", |failed| {
        format!("The last run has {failed}. ")
    });
    let others = text::any(others, "cell", |cells| {
        format!(" Of {cells} questions or answers differ between the runs.")
    });
    let ([first, .., last], Some((least, most))) = (reports, ends) else {
        return format!("{failed}No structure has times in two runs that can be compared.{others}");
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
        "{failed}Over {runs} {cells} {take} {factor} x as long in their last run as in their first, by \
         program and machine together. compare judges two runs.{others}{note}"
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

#[cfg(test)]
mod tests {
    use super::super::document::to_terminal;
    use super::*;

    #[test]
    fn the_quick_suite_fits_sixty_lines() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/results/reference/report.json");
        let report = read_report(file.as_ref()).unwrap();
        let told = to_terminal(&shown(&report, false, 80), 80);
        // Basis, warnings, files and the next command follow below.
        assert!((20..=48).contains(&told.lines().count()), "{told}");
        assert!(
            told.lines().all(|line| line.chars().count() <= 80),
            "{told}"
        );
        // Builds and updates are the least precise figures.
        let full = to_terminal(&shown(&report, true, 80), 80);
        for time in ["5.55 ms ± 10 %", "146 us [68.0, 313]"] {
            assert!(full.contains(time) && !told.contains(time), "{full}");
        }
    }
}
