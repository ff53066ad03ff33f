//! `cullbench report`: the results of a run as Markdown, pictures or one HTML page,
//! from its report.json.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

use super::args::ReportArgs;
use super::document::{Block, to_html, to_markdown};
use super::surface_charts::{self, Picture};
use super::table::{Column, Table};
use super::{
    Ending, bencher, expect_folder, expect_places, history, program, run_figures, run_table,
    surface_tables, tell, text, write_text,
};
use crate::index::Registry;
use crate::measure::{BOUNDS, METRICS, Status};
use crate::report::{
    Comparison, Overall, Ranked, Report, ReportCell, Views, comparisons, growths, read_report,
    surfaces, times_as_fast, views,
};

pub fn report(registry: &Registry, args: &ReportArgs) -> anyhow::Result<Ending> {
    let outputs = [
        ("--markdown", args.markdown.as_deref()),
        ("--html", args.html.as_deref()),
        ("--bencher", args.bencher.as_deref()),
        ("--history", args.history.as_deref()),
    ];
    // Of a run's folder the report is read.
    let inputs = args.reports.iter();
    let inputs: Vec<PathBuf> = inputs
        .flat_map(|path| [path.clone(), path.join("report.json")])
        .collect();
    expect_places(
        &outputs,
        &inputs.iter().map(PathBuf::as_path).collect::<Vec<_>>(),
    )?;
    expect_folder("--svg", args.svg.as_deref())?;
    if let Some(path) = &args.history {
        let reports = args.reports.iter().map(|path| read_report(path));
        write_text(path, &history::page(reports.collect::<Result<_, _>>()?))?;
        return Ok(Ending::Ok);
    }
    let [path] = &args.reports[..] else {
        bail!(
            "{} reports; expected one, or --history FILE",
            args.reports.len()
        );
    };
    let mut report = read_report(path)?;
    declare(&mut report, registry);
    let pictures = match args.svg.is_some() {
        true => surface_charts::pictures(&report),
        false => Vec::new(),
    };
    if let Some(path) = &args.markdown {
        write_text(path, &to_markdown(&blocks(&report, &BTreeMap::new())))?;
    }
    if let Some(path) = &args.bencher {
        write_text(path, &bencher::format(&report)?)?;
    }
    match &args.svg {
        Some(folder) if pictures.is_empty() => tell(&format!(
            "note: no chart in {}; a chart needs a structure with times",
            folder.display()
        )),
        Some(folder) => write_charts(folder, &pictures)?,
        None => {}
    }
    if let Some(file) = &args.html {
        let folder = match path.is_dir() {
            true => Some(path.as_path()),
            false => path.parent(),
        };
        write_text(file, &page(&report, folder.unwrap_or(Path::new(""))))?;
    } else if args.markdown.is_none() && args.svg.is_none() && args.bencher.is_none() {
        io::stdout().write_all(to_markdown(&blocks(&report, &BTreeMap::new())).as_bytes())?;
    }
    Ok(Ending::Ok)
}

/// The page of a run; `folder` has its stream and samples.
pub fn page(report: &Report, folder: &Path) -> String {
    let mut blocks = blocks(report, &views(folder, report));
    blocks.extend(glossary());
    to_html(&title(report), &blocks)
}

/// Meaning of every column of figures.
fn glossary() -> [Block; 2] {
    let mut table = Table::of("column | meaning");
    for (column, meaning) in MEANINGS {
        table.add_row([*column, *meaning]);
    }
    let figures = run_table::FIGURES.iter().map(|figure| (figure.0, figure.1));
    let figures = [("speed-up vs linear", "speedup")]
        .into_iter()
        .chain(figures);
    for (column, metric) in figures {
        let info = METRICS.iter().find(|info| info.name == metric);
        table.add_row([column, info.map_or("", |info| info.summary)]);
    }
    for bound in BOUNDS {
        table.add_row([bound.name, bound.summary]);
    }
    [Block::Heading(2, "Columns".to_owned()), Block::Table(table)]
}

/// Columns that are no metrics.
const MEANINGS: &[(&str, &str)] = &[
    (
        "structure",
        "name and parameters of the structure; bound-: a lower bound, no structure",
    ),
    (
        "rank",
        "1 is the fastest; structures that no test tells apart share a rank",
    ),
    ("[95 %]", "95 % interval over the processes"),
    (
        "speed-up vs fastest peer",
        "time of the fastest structure of another crate / time of this structure",
    ),
    (
        "break-even",
        "queries of that path after which the build is repaid against linear; empty if never",
    ),
    (
        "geometric mean",
        "mean of the speed-ups over all scenes and paths; shades are relative to the best of a row",
    ),
    (
        "status",
        "ok: the answers are right; anything else has its reason under Statuses",
    ),
];

/// Older reports do not say what their structures are: the registry does, where
/// it has one of the very same name.
fn declare(report: &mut Report, registry: &Registry) {
    for cell in &mut report.cells {
        let name = cell.structure.split(':').next().unwrap_or_default();
        if let (None, Some(row)) = (cell.kind, registry.named(name)) {
            cell.kind = Some(row.info.kind);
            cell.origin = Some(row.info.origin.owned());
        }
    }
}

/// All of them, or no folder that was not there before.
fn write_charts(folder: &Path, pictures: &[Picture]) -> anyhow::Result<()> {
    let is_new = !folder.exists();
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let file = |picture: &Picture| folder.join(format!("{}.svg", picture.name));
    let written = pictures
        .iter()
        .try_for_each(|picture| write_text(&file(picture), &picture.svg));
    if written.is_err() && is_new {
        let _ = fs::remove_dir_all(folder);
    }
    Ok(written?)
}

fn title(report: &Report) -> String {
    format!("{} run {}", program::name(), report.run.id)
}

fn blocks(report: &Report, views: &BTreeMap<String, Views>) -> Vec<Block> {
    let mut blocks = vec![Block::Heading(1, title(report))];
    let all = comparisons(report);
    for group in run_table::groups(&all) {
        let overall = Overall::of(&group);
        blocks.push(Block::Line(run_table::conclusion(&group, &overall)));
        if let Some(base) = overall.base.filter(|_| group.len() > 1) {
            blocks.push(Block::Heading(2, format!("Speed-up over {base}")));
            blocks.push(Block::Heat(matrix(&group, &overall, base)));
        }
    }
    let mut scene = "";
    for (place, comparison) in all.iter().enumerate() {
        let about = comparison.about();
        if about.scene.name != scene {
            scene = &about.scene.name;
            blocks.push(Block::Heading(2, scene.to_owned()));
            blocks.push(Block::Line(format!(
                "{}, {}{}.",
                text::counted(about.scene.total_count, "item"),
                text::counted(about.scene.region_count, "region"),
                match about.scene.total_count {
                    0 => "; nothing is ranked",
                    _ => "",
                }
            )));
        }
        let base = Overall::of(&[comparison]).base;
        let own = views.get(&about.key().group.id());
        let own = own.filter(|_| about.path.motion.is_empty());
        blocks.extend(of_comparison(comparison, base, own));
        let of_path = |c: &&Comparison| {
            let other = c.about();
            let of = |cell: &ReportCell| {
                let path = &cell.path;
                [&path.name, &path.cache, &path.motion].map(String::clone)
            };
            let [a, b] = [about, other].map(of);
            other.scene.name == scene && a == b
        };
        let tests: Vec<&Comparison> = all.iter().filter(of_path).collect();
        if tests
            .last()
            .is_some_and(|last| std::ptr::eq(*last, comparison))
        {
            blocks.extend(run_figures::errors(&tests).map(Block::Figure));
        }
        let next = all.get(place + 1).map(|next| &next.about().scene.name);
        if next != Some(&about.scene.name) {
            let of_scene = all.iter().filter(|c| c.about().scene.name == scene);
            blocks.extend(builds(&of_scene.collect::<Vec<_>>()));
        }
    }
    for surface in surfaces(all).iter().filter(|surface| surface.spans()) {
        let heading = format!("Crossover: {}", surface_tables::title(surface));
        blocks.push(Block::Heading(2, heading));
        blocks.extend(surface_tables::of_surface(surface));
        let figures = run_figures::growth(surface);
        blocks.extend(figures.into_iter().map(|figure| Block::Figure(figure.1)));
    }
    let growths = growths(report);
    if !growths.is_empty() {
        let heading = "Growth at a fixed number of visible items".to_owned();
        blocks.push(Block::Heading(2, heading));
        blocks.push(Block::Table(surface_tables::of_growths(&growths)));
    }
    blocks.extend(statuses(report));
    blocks.push(Block::Heading(2, "Machine and command".to_owned()));
    blocks.extend(about(report).into_iter().map(Block::Line));
    blocks
}

/// A row per scene and path, a column per structure, and the geometric means.
fn matrix(all: &[&Comparison], overall: &Overall, base: &str) -> Table {
    let standings = &overall.standings;
    let names = standings.iter().map(|standing| standing.structure);
    let mut table = Table::of_numbers(["scene, path"].into_iter().chain(names));
    for comparison in all {
        let ratios = standings.iter().map(|standing| {
            let cell = comparison.sound_cell(standing.structure);
            let ratio = cell.and_then(|cell| comparison.speedup(base, cell));
            text::some(ratio, |(ratio, _)| text::significant(ratio))
        });
        let name = run_figures::of(comparison);
        table.add_row([name].into_iter().chain(ratios));
    }
    let means = standings
        .iter()
        .map(|s| text::some(s.speedup, text::significant));
    table.add_row(["geometric mean".to_owned()].into_iter().chain(means));
    table
}

/// Cost of the builds on a scene, and when it is repaid on each path.
fn builds(comparisons: &[&Comparison]) -> Vec<Block> {
    let paths = comparisons.iter().map(|comparison| {
        let about = comparison.about();
        format!("break-even, {}, {}", about.path.name, about.test)
    });
    let heads = BUILDS.map(str::to_owned);
    let mut table = Table::of_numbers(
        ["structure".to_owned()]
            .into_iter()
            .chain(heads)
            .chain(paths),
    );
    for Ranked { cell, .. } in comparisons.iter().take(1).flat_map(|c| &c.ranked) {
        let figures = run_table::figures(cell, &BUILDS);
        let queries = comparisons.iter().map(|comparison| {
            let own = comparison.sound_cell(&cell.structure);
            let queries = own.and_then(|own| own.value("break_even_queries"));
            text::some(queries, |n| text::count(n as usize))
        });
        let name = [cell.structure.clone()].into_iter();
        table.add_row(name.chain(figures).chain(queries));
    }
    let heading = Block::Heading(3, "Build, memory and break-even".to_owned());
    vec![heading, Block::Table(table.without_empty_columns())]
}

/// All cells that are not ok, with their reasons.
fn statuses(report: &Report) -> Vec<Block> {
    let others = report.cells.iter().chain(&report.bounds);
    let others: Vec<&ReportCell> = others.filter(|cell| cell.status != Status::Ok).collect();
    let heading = Block::Heading(2, "Statuses".to_owned());
    if others.is_empty() {
        let told = format!("{}, all ok.", text::counted(report.cells.len(), "cell"));
        return vec![heading, Block::Line(told)];
    }
    let columns: &[Column<&ReportCell>] = &[
        ("structure", |cell| cell.structure.clone()),
        ("scene", |cell| cell.scene.name.clone()),
        ("path", |cell| cell.path.name.clone()),
        ("status", |cell| cell.status.name().to_owned()),
        ("reason", |cell| cell.reason.clone().unwrap_or_default()),
    ];
    vec![heading, Block::Table(Table::with(others, columns))]
}

fn known(text: &Option<String>) -> &str {
    text.as_deref().unwrap_or("unknown")
}

/// Origin of the figures, in lines.
fn about(report: &Report) -> Vec<String> {
    let (run, machine) = (&report.run, &report.machine);
    let suite = run.suite.as_deref().unwrap_or("chosen by hand");
    let unfinished = match run.finished_at {
        Some(_) => "",
        None => "; not finished",
    };
    let dirty = match report.source.dirty {
        Some(true) => " with a dirty working tree",
        _ => "",
    };
    let mut lines = vec![
        format!(
            "{}, suite: {suite}, seed {}{unfinished}.",
            run.started_at, run.seed
        ),
        format!("Command: {}", run.command),
        format!(
            "Machine: {}, {}, kernel {}, instruction set {}.",
            known(&machine.cpu),
            text::counted(machine.cores, "core"),
            known(&machine.kernel),
            machine.instruction_set
        ),
        format!(
            "Built with {}, profile {}, flags '{}', features '{}'; source {}{dirty}.",
            known(&report.toolchain.rustc),
            known(&report.toolchain.profile),
            report.toolchain.flags,
            report.toolchain.features.join(","),
            known(&report.source.commit)
        ),
        format!("{}.", text::conclusion(report)),
    ];
    lines.extend(report.noise.warnings.iter().cloned());
    lines.extend(report.input_warnings().into_iter().map(str::to_owned));
    lines
}

fn of_comparison(comparison: &Comparison, base: Option<&str>, views: Option<&Views>) -> Vec<Block> {
    let about = comparison.about();
    let share = |metric: &str, what: &str| {
        let value = comparison.of_any(metric)?;
        Some(format!(", {} {what}", text::percent(value)))
    };
    let motion = match about.path.motion.as_str() {
        "" => String::new(),
        motion => format!(", {motion}"),
    };
    let heading = format!(
        "{}, {}, {}{motion}{}",
        about.path.name,
        about.path.cache,
        about.test,
        share("cull_rate", "culled").unwrap_or_default()
    );
    let peer = comparison.fastest_peer();
    let header = [
        "structure",
        "rank",
        "query [95 %]",
        "p95",
        "speed-up vs linear [95 %]",
    ];
    let of_peer = peer.map(|_| "speed-up vs fastest peer");
    let header = header.into_iter().chain(of_peer).chain(OF_PATH);
    let mut table = Table::of_numbers(header.chain(["status"]));
    for Ranked { rank, cell } in &comparison.ranked {
        let rank = rank.map_or("-".to_owned(), |rank| rank.to_string());
        table.rows.push(row(cell, rank, peer));
    }
    for bound in &comparison.bounds {
        table.rows.push(row(bound, "lower bound".to_owned(), peer));
    }
    let basis = format!("{}.", text::basis(comparison));
    let mut blocks = vec![Block::Heading(3, heading), Block::Line(basis)];
    blocks.extend(false_positives(comparison).map(Block::Line));
    let plot = base.and_then(|base| run_figures::speedups(comparison, base));
    let along = views.map(|views| run_figures::along(comparison, views));
    let figures = plot.into_iter().chain(along.into_iter().flatten());
    blocks.extend(figures.map(Block::Figure));
    blocks.push(Block::Table(table.without_empty_columns()));
    if !comparison.bounds.is_empty() {
        let meaning = "/ read, / copy: time / time of that lower bound.";
        blocks.push(Block::Line(meaning.to_owned()));
    }
    blocks
}

/// Share of false positives, and their sources if not all are the culling test's.
fn false_positives(comparison: &Comparison) -> Option<String> {
    let share = text::false_positives(comparison);
    let sources = text::by_source(comparison);
    let sources = sources.map(|items| format!("{items} items {}", text::BY_SOURCE));
    let told = match (share, sources) {
        (None, None) => return None,
        (None, Some(sources)) => format!("{sources}; nothing is visible"),
        (Some(share), None) => format!("{share} of the visible items"),
        (Some(share), Some(sources)) => format!("{share} of the visible items; {sources}"),
    };
    Some(format!("False positives: {told}."))
}

/// Figures of the queries or the motion of a path.
const OF_PATH: [&str; 11] = [
    "/ read",
    "/ copy",
    "locate",
    "frame",
    "worst",
    "update",
    "further query",
    "x after 1",
    "x after 10",
    "x after 100",
    "x after 1000",
];

/// Figures of a structure on a scene.
const BUILDS: [&str; 4] = ["build", "update of 1 %", "query after 32", "bytes/item"];

fn row(cell: &ReportCell, rank: String, peer: Option<&ReportCell>) -> Vec<String> {
    let mut row = vec![
        cell.structure.clone(),
        rank,
        text::some(cell.metrics.get("query_ns"), |ns| {
            text::time_within(ns.estimate())
        }),
        text::some(cell.value("query_ns_p95"), text::time),
        text::some(cell.metrics.get("speedup"), |found| {
            text::within(found.estimate())
        }),
    ];
    row.extend(peer.map(|peer| {
        let is_sound = cell.status == Status::Ok;
        let ratio = times_as_fast(peer, cell).filter(|_| is_sound);
        text::some(ratio, text::significant)
    }));
    row.extend(run_table::figures(cell, &OF_PATH));
    row.push(cell.status.name().to_owned());
    row
}
