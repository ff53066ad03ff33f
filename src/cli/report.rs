//! `cullbench report`: the results of a run as Markdown, pictures or one HTML page,
//! from its report.json.

use std::fs;
use std::io::{self, Write};
use std::path::Path;

use anyhow::Context;

use super::args::ReportArgs;
use super::document::{Block, to_html, to_markdown};
use super::surface_charts::{self, Picture};
use super::table::Table;
use super::{
    Ending, bencher, expect_folder, expect_places, surface_tables, tell, text, write_text,
};
use crate::index::Registry;
use crate::measure::Status;
use crate::report::{
    Comparison, Ranked, Report, ReportCell, comparisons, growths, read_report, surfaces,
    times_as_fast,
};

pub fn report(registry: &Registry, args: &ReportArgs) -> anyhow::Result<Ending> {
    let outputs = [
        ("--markdown", args.markdown.as_deref()),
        ("--html", args.html.as_deref()),
        ("--bencher", args.bencher.as_deref()),
    ];
    // Of a run's folder the report is read.
    expect_places(&outputs, &[&args.report, &args.report.join("report.json")])?;
    expect_folder("--svg", args.svg.as_deref())?;
    let mut report = read_report(&args.report)?;
    declare(&mut report, registry);
    let pictures = match args.svg.is_some() || args.html.is_some() {
        true => surface_charts::pictures(&surfaces(comparisons(&report)))?,
        false => Vec::new(),
    };
    let mut blocks = blocks(&report);
    if let Some(path) = &args.markdown {
        write_text(path, &to_markdown(&blocks))?;
    }
    if let Some(path) = &args.bencher {
        write_text(path, &bencher::format(&report)?)?;
    }
    match &args.svg {
        Some(folder) if pictures.is_empty() => tell(&format!(
            "note: no chart in {}; a chart needs a structure that was measured on two sizes of a \
             scene",
            folder.display()
        )),
        Some(folder) => write_charts(folder, &pictures)?,
        None => {}
    }
    if let Some(path) = &args.html {
        blocks.extend(pictures.into_iter().map(|p| Block::Picture(p.svg)));
        write_text(path, &to_html(&title(&report), &blocks))?;
    } else if args.markdown.is_none() && args.svg.is_none() && args.bencher.is_none() {
        io::stdout().write_all(to_markdown(&blocks).as_bytes())?;
    }
    Ok(Ending::Ok)
}

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
    format!("cullbench run {}", report.run.id)
}

fn blocks(report: &Report) -> Vec<Block> {
    let mut blocks = vec![Block::Heading(1, title(report))];
    blocks.extend(about(report).into_iter().map(Block::Line));
    let all = comparisons(report);
    let mut scene = "";
    for comparison in &all {
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
        blocks.extend(of_comparison(comparison));
    }
    for surface in surfaces(all).iter().filter(|surface| surface.spans()) {
        let heading = format!("Crossover: {}", surface_tables::title(surface));
        blocks.push(Block::Heading(2, heading));
        blocks.extend(surface_tables::of_surface(surface));
    }
    let growths = growths(report);
    if !growths.is_empty() {
        let heading = "Growth at a fixed number of visible items".to_owned();
        blocks.push(Block::Heading(2, heading));
        blocks.push(Block::Table(surface_tables::of_growths(&growths)));
    }
    blocks
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
    lines
}

fn of_comparison(comparison: &Comparison) -> Vec<Block> {
    let about = comparison.about();
    let share = |metric: &str, what: &str| {
        let value = comparison.of_any(metric)?;
        Some(format!(", {} {what}", text::percent(value)))
    };
    let heading = format!(
        "{}, {}, {}{}",
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
    let figures = FIGURES.map(|(head, ..)| head);
    let header = header.into_iter().chain(of_peer).chain(figures);
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
    blocks.push(Block::Table(table.without_empty_columns()));
    if !comparison.bounds.is_empty() {
        let meaning = "/ read, / copy, / build: time / time of that lower bound.";
        blocks.push(Block::Line(meaning.to_owned()));
    }
    for cell in comparison.ranked.iter().map(|ranked| ranked.cell) {
        if let Some(reason) = &cell.reason {
            let (structure, status) = (&cell.structure, cell.status.name());
            blocks.push(Block::Line(format!("{structure}: {status}: {reason}")));
        }
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

/// Columns of single figures: head, metric and form.
const FIGURES: [(&str, &str, fn(f64) -> String); 6] = [
    ("/ read", "times_read", text::significant),
    ("/ copy", "times_memcpy", text::significant),
    ("/ build", "build_ms", |ms| text::time(ms * 1e6)),
    ("bytes per item", "memory_bytes_per_item", |b| {
        format!("{b:.1}")
    }),
    ("break-even queries", "break_even_queries", |n| {
        text::count(n as usize)
    }),
    ("locate", "locate_ns", text::time),
];

fn row(cell: &ReportCell, rank: String, peer: Option<&ReportCell>) -> Vec<String> {
    let mut row = vec![
        cell.structure.clone(),
        rank,
        text::time_estimate(cell.metrics.get("query_ns")),
        text::some(cell.value("query_ns_p95"), text::time),
        text::estimate(cell.metrics.get("speedup")),
    ];
    row.extend(peer.map(|peer| {
        let is_sound = cell.status == Status::Ok;
        let ratio = times_as_fast(peer, cell).filter(|_| is_sound);
        text::some(ratio, text::significant)
    }));
    row.extend(FIGURES.map(|(_, metric, show)| text::some(cell.value(metric), show)));
    row.push(cell.status.name().to_owned());
    row
}
