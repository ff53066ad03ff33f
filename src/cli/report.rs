//! `cullbench report`: the results of a run as Markdown, pictures or one HTML page,
//! from its report.json; their summary on the terminal, at the end of `run`.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::path::Path;

use anyhow::{Context, bail};

use super::args::ReportArgs;
use super::document::{Block, to_html, to_markdown};
use super::page::{glossary, origin};
use super::surface_tables::Picture;
use super::{
    Ending, bencher, expect_folder, expect_places, history, program, run_figures, run_plan,
    run_table, surface_tables, tell, text, write_if, write_text,
};
use crate::report::{
    Comparison, Overall, Report, Views, comparisons, folder_of, grouped, read_report, save_page,
    views,
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
        run_plan::each_once("run", reports.iter().map(|report| &report.run.id))?;
        write_text(path, &history::page(reports))?;
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
            tell("note: the run was not finished; its cells have fewer processes or are missing");
        }
        write_text(path, &bencher::format(&report)?)?;
    }
    if let Some(folder) = &args.svg {
        match &surface_tables::pictures(&report)[..] {
            [] => tell(&format!(
                "note: no chart in {}; a chart needs a structure with times",
                folder.display()
            )),
            pictures => write_charts(folder, pictures)?,
        }
    }
    if let Some(file) = &args.html {
        let folder = if path.is_dir() { path } else { folder_of(path) };
        write_text(file, &page(&report, folder, Vec::new()))?;
    } else if args.markdown.is_none() && args.svg.is_none() && args.bencher.is_none() {
        io::stdout().write_all(markdown().as_bytes())?;
    }
    Ok(Ending::Ok)
}

/// The page of a run; `folder` has its stream and samples, and `why` is of `--why`.
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

/// All of them, or no folder that was not there before.
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
        blocks = details(&all, &BTreeMap::new());
    }
    for group in run_table::groups(&all) {
        let overall = Overall::of(&group);
        blocks.push(Block::line(""));
        match &group[..] {
            [_] if all_columns => {}
            [one] => {
                blocks.extend(run_table::heads(one).into_iter().map(Block::Line));
                let table = run_table::structures(one, overall.base, false);
                blocks.push(Block::Table(table.parts(width).swap_remove(0)));
            }
            _ => blocks.extend(run_table::of_many(&group, &overall, width)),
        }
        blocks.push(Block::line(""));
        let notes = run_table::reasons(&group).into_iter();
        let notes = notes.chain(run_table::choices(&group));
        blocks.extend(notes.map(Block::Line));
        blocks.push(Block::Line(run_table::conclusion(&group, &overall)));
    }
    // A world of one size has its ranked tables; that is the surface.
    blocks.extend(surface_tables::blocks(report, 2));
    blocks
}

fn title(report: &Report) -> String {
    format!("{} run {}", program::name(), report.run.id)
}

fn blocks(report: &Report, views: &BTreeMap<String, Views>) -> Vec<Block> {
    let mut blocks = vec![Block::Heading(1, title(report))];
    let all = comparisons(report);
    let groups = run_table::groups(&all);
    for (group, of) in groups.iter().zip(run_table::settings(&groups)) {
        let overall = Overall::of(group);
        let conclusion = run_table::conclusion(group, &overall);
        blocks.push(Block::Line(text::labelled(&of, &conclusion)));
        if let Some(base) = overall.base.filter(|_| group.len() > 1) {
            let names = group.iter().map(|comparison| run_figures::of(comparison));
            let table = run_table::matrix(names.collect(), group, &overall);
            let heading = text::joined([&format!("Speed-up over {base}"), &of]);
            let heading = Block::Heading(2, heading);
            let legend = Block::Line(run_table::legend(group, &overall));
            blocks.extend([heading, Block::Heat(table), legend]);
        }
    }
    blocks.extend(details(&all, views));
    let every: Vec<&Comparison> = all.iter().collect();
    blocks.extend(run_table::choices(&every).into_iter().map(Block::Line));
    blocks.extend(surface_tables::blocks(report, 1));
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
fn details(all: &[Comparison], views: &BTreeMap<String, Views>) -> Vec<Block> {
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
        }
        blocks.extend(run_figures::errors(tests).map(Block::Figure));
    }
    blocks
}

fn of_comparison(comparison: &Comparison, base: Option<&str>, views: Option<&Views>) -> Vec<Block> {
    let about = comparison.about();
    let path = &about.path;
    let heading = text::joined([&path.name, &path.cache, &about.test, &path.motion]);
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
    lines.extend(report.noise.warnings.iter().cloned());
    lines.extend(report.input_warnings().into_iter().map(str::to_owned));
    lines
}

/// Shows the basis of a run, further lines, its files and another file.
pub fn close(
    basis: &str,
    lines: impl IntoIterator<Item = String>,
    folder: &Path,
    other: Option<String>,
) -> io::Result<()> {
    let mut told = vec![String::new(), text::wrapped(basis, text::width())];
    told.extend(lines);
    told.push(format!("report  {}", folder.join("report.html").display()));
    let others = "report.json, summary.csv, samples.csv, stream.jsonl, *.svg";
    let others = text::wrapped(others, text::width().saturating_sub(8)) + "\n";
    let others = others + &other.unwrap_or_default();
    told.extend(others.lines().map(|line| format!("        {line}")));
    text::print(&told)
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
        // Basis, warnings, files and the next command are below.
        assert!((20..=48).contains(&told.lines().count()), "{told}");
        assert!(
            told.lines().all(|line| line.chars().count() <= 80),
            "{told}"
        );
    }
}
