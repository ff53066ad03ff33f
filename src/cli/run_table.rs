//! The end of `cullbench run` on the terminal: tables, then the conclusion.
//!
//! One scene and path is a row per structure, several are a row each.

use std::collections::BTreeSet;
use std::io::{self, Write};
use std::path::Path;

use super::table::Table;
use super::{inputs, run_verdict, surface_tables, text};
use crate::measure::Status;
use crate::report::{Comparison, Overall, Ranked, Report, ReportCell, comparisons, times_as_fast};
use crate::shown::shortened;
use crate::spec::parse_number;

/// Shows the tables and conclusions of each cache state and culling test.
pub fn show(report: &Report, all_columns: bool) -> io::Result<()> {
    let mut out = text::terminal();
    write(&mut out, report, all_columns, text::width())?;
    out.flush()
}

fn write(out: &mut impl Write, report: &Report, all_columns: bool, width: usize) -> io::Result<()> {
    let all = comparisons(report);
    for group in groups(&all) {
        let overall = Overall::of(&group);
        writeln!(out)?;
        match &group[..] {
            [one] => write!(out, "{}", of_one(one, overall.base, all_columns, width))?,
            _ => {
                let rows: Vec<_> = labels(&group).into_iter().zip(group.clone()).collect();
                write!(out, "{}", of_many(&rows, &overall, all_columns, width))?;
                for one in group.iter().filter(|_| all_columns) {
                    write!(out, "\n{}", of_one(one, overall.base, true, width))?;
                }
            }
        }
        for line in reasons(&group)
            .into_iter()
            .chain([conclusion(&group, &overall)])
        {
            writeln!(out, "{}", text::wrapped(&line, width))?;
        }
    }
    surface_tables::show(out, report, width)
}

/// Comparisons of one cache state and culling test each.
pub fn groups<'a, 'r>(all: &'a [Comparison<'r>]) -> Vec<Vec<&'a Comparison<'r>>> {
    let mut groups: Vec<Vec<&Comparison>> = Vec::new();
    for comparison in all {
        match groups
            .iter_mut()
            .find(|group| key(group[0]) == key(comparison))
        {
            Some(group) => group.push(comparison),
            None => groups.push(vec![comparison]),
        }
    }
    groups
}

/// Conclusion of a group in sentences.
pub fn conclusion(group: &[&Comparison], overall: &Overall) -> String {
    match group {
        [one] => run_verdict::of_one(one, overall.base),
        _ => {
            let rows: Vec<_> = labels(group).into_iter().zip(group.to_vec()).collect();
            run_verdict::of_many(&rows, overall)
        }
    }
}

/// Cache state, culling test and kind of time: times of others are not averaged.
fn key<'r>(comparison: &Comparison<'r>) -> [&'r str; 3] {
    let about = comparison.about();
    [&about.path.cache, &about.test, about.ranked_by()]
}

/// Lines above a table: the scene, the queries, and what they return.
fn heads(comparison: &Comparison) -> Vec<String> {
    let cell = comparison.about();
    let (scene, path) = (&cell.scene, &cell.path);
    let mut first = format!(
        "{}: {}, {}",
        scene.name,
        text::counted(scene.total_count, "item"),
        text::counted(scene.region_count, "region")
    );
    if !scene.up.is_empty() {
        first += &format!(", {}", inputs::axes(scene));
    }
    if scene.skipped_items > 0 {
        let bad = text::counted(scene.skipped_items, "bad item");
        first += &format!(", {bad} left out");
    }
    if scene.total_count == 0 {
        first += "; nothing is ranked";
    }
    let views = text::counted(path.camera_count, "view");
    let mut second = format!("{}: {views}, {}", path.name, cell.test);
    if path.cache != "warm" {
        second += &format!(", {}", path.cache);
    }
    let mut motion = String::new();
    if let Some(queries) = path.views_per_frame.checked_sub(1) {
        let checked = comparison.range(|cell| cell.times.cameras_checked);
        let frames = checked.unwrap_or_default().1 / (queries + 1);
        let (frames, queries) = (
            text::counted(frames, "frame"),
            text::counted(queries + 1, "query"),
        );
        motion = format!("{}: {frames}, {queries} each", path.motion);
    }
    let visible = comparison.of_any("cull_rate").map(|culled| 1.0 - culled);
    let visible = visible.map(|visible| format!("{} of the items are visible", share(visible)));
    let sources = text::by_source(comparison);
    let sources = sources.map(|items| format!("{items} {}", text::BY_SOURCE));
    let excess = match (text::false_positives(comparison), sources) {
        (Some(share), None) => Some(format!("{share} false positives")),
        (Some(share), Some(items)) => Some(format!("{share} false positives ({items})")),
        (None, sources) => sources.map(|items| format!("false positives {items}")),
    };
    let third: Vec<String> = visible.into_iter().chain(excess).collect();
    let lens = path.lens.as_ref().map(inputs::lens).unwrap_or_default();
    let matrix = path.lens.as_ref().and_then(|lens| lens.matrix.as_ref());
    let matrix = matrix.map(|matrix| format!("matrices: {}", inputs::matrices(matrix)));
    let matrix = matrix.unwrap_or_default();
    let lines = [first, second, motion, lens, matrix, third.join(", ")].into_iter();
    lines.filter(|line| !line.is_empty()).collect()
}

/// A share in percent with three digits, never rounded up to 100.
fn share(share: f64) -> String {
    match share {
        0.99..1.0 => text::percent(share),
        _ => format!("{} %", text::significant(share * 100.0)),
    }
}

/// A column of single figures: head, metric and form.
pub type Figure = (&'static str, &'static str, fn(f64) -> String);

/// All of them, by their names for [`figures`].
pub const FIGURES: [Figure; 20] = [
    ("build", "build_ms", |ms| text::time(ms * 1e6)),
    ("bytes/item", "memory_bytes_per_item", |b| format!("{b:.1}")),
    ("p95", "query_ns_p95", text::time),
    ("/ read", "times_read", text::significant),
    ("/ copy", "times_memcpy", text::significant),
    ("/ replay", "times_replay", text::significant),
    ("locate", "locate_ns", text::time),
    ("update of 1 %", "update_ms", |ms| text::time(ms * 1e6)),
    ("query after 32", "refitted_over_rebuilt", text::significant),
    ("repaid after", "break_even_queries", |n| {
        text::count(n as usize)
    }),
    ("query", "query_ns", text::time),
    ("frame", "frame_ns", text::time),
    ("worst", "worst_frame_ns", text::time),
    ("update", "update_ns", text::time),
    ("further query", "further_query_ns", text::time),
    ("false positives", "excess", text::percent),
    ("x after 1", "ageing_1", text::significant),
    ("x after 10", "ageing_10", text::significant),
    ("x after 100", "ageing_100", text::significant),
    ("x after 1000", "ageing_1000", text::significant),
];

/// The figures of a cell, by the names of their columns.
pub fn figures(cell: &ReportCell, names: &[&str]) -> Vec<String> {
    let row = |name: &&str| FIGURES.iter().find(|figure| figure.0 == *name);
    let shown = |(_, metric, show): &Figure| text::some(cell.value(metric), show);
    names
        .iter()
        .map(|name| text::some(row(name), shown))
        .collect()
}

/// Figures of queries by priority.
///
/// All but the first two, and those that do not fit, are left to `--all-columns`.
const OF_QUERIES: &[&str] = &[
    "build",
    "bytes/item",
    "p95",
    "/ read",
    "/ copy",
    "/ replay",
    "locate",
    "update of 1 %",
    "query after 32",
    "repaid after",
];

/// Figures of a motion, likewise but for the first five.
const OF_FRAMES: &[&str] = &[
    "worst",
    "update",
    "query",
    "x after 100",
    "false positives",
    "further query",
    "x after 10",
    "x after 1000",
    "build",
    "bytes/item",
];

/// Head and table of one scene and path.
fn of_one(comparison: &Comparison, base: Option<&str>, all: bool, width: usize) -> String {
    let base = base.and_then(|base| comparison.sound_cell(base));
    let (time, names, shown) = match comparison.about().path.motion.is_empty() {
        true => ("time per query", OF_QUERIES, 2),
        false => ("time per frame", OF_FRAMES, 5),
    };
    let names = if all { names } else { &names[..shown] };
    let of_base = text::some(base, |base| format!("vs {}", cell_name(base)));
    let head = ["structure", time, &of_base].into_iter();
    let head = head.chain(names.iter().copied()).chain(["speed-up [95 %]"]);
    let mut table = Table::of_numbers(head);
    let mut add = |rank: String, cell: &ReportCell| {
        let time = match cell.time() {
            None => cell.status.name().to_owned(),
            Some(time) => text::time_with(time),
        };
        let ratio = base.and_then(|base| times_as_fast(base, cell));
        let ratio = ratio.filter(|_| cell.status == Status::Ok);
        let row = [
            format!("{rank:>2} {}", shortened(&cell_name(cell), width / 2)),
            time,
            text::some(ratio, |ratio| format!("{} x", text::significant(ratio))),
        ];
        let speedup = cell.metrics.get("speedup").filter(|_| all);
        let row = row.into_iter().chain(figures(cell, names));
        let speedup = text::some(speedup, |found| text::within(found.estimate()));
        table.add_row(row.chain([speedup]));
    };
    for Ranked { rank, cell } in &comparison.ranked {
        add(rank.map_or("-".to_owned(), |rank| rank.to_string()), cell);
    }
    for cell in comparison.bounds.iter().filter(|_| all) {
        add(String::new(), cell);
    }
    let mut lines = heads(comparison);
    if all {
        lines.push(text::basis(comparison));
    }
    let lines = lines
        .iter()
        .map(|line| text::wrapped(&text::plain(line), width) + "\n");
    let parts = table.without_empty_columns().parts(width);
    let shown = if all { parts.len() } else { 1 };
    let parts = parts
        .iter()
        .take(shown)
        .map(|part| format!("\n{}", part.bare()));
    lines.chain(parts).chain(["\n".to_owned()]).collect()
}

fn cell_name(cell: &ReportCell) -> String {
    text::plain(&cell.structure)
}

/// Speed-ups: a row per scene and path, a column per structure, the base's time.
fn of_many(rows: &[(String, &Comparison)], overall: &Overall, all: bool, width: usize) -> String {
    let of_base = |name: &str| overall.base == Some(name);
    let mut columns: Vec<_> = overall.standings.iter().collect();
    columns.sort_by_key(|standing| !of_base(standing.structure));
    let names = columns.iter().map(|standing| standing.structure.to_owned());
    let mut table = Table::of_numbers([String::new()].into_iter().chain(names));
    for (label, comparison) in rows {
        let base = overall.base.and_then(|base| comparison.sound_cell(base));
        let figure = |structure: &str| {
            let mut cells = comparison.ranked.iter();
            let Some(found) = cells.find(|ranked| ranked.cell.structure == structure) else {
                return String::new();
            };
            let is_first = if found.rank == Some(1) { "*" } else { " " };
            let time = text::some(found.cell.time(), |time| text::time(time.value));
            let shown = match (found.rank, base) {
                (None, _) => found.cell.status.name().to_owned(),
                (_, Some(base)) if !of_base(structure) => {
                    text::some(times_as_fast(base, found.cell), text::significant)
                }
                _ => time,
            };
            shown + is_first
        };
        let figures = columns.iter().map(|standing| figure(standing.structure));
        table.add_row([shortened(label, width / 2)].into_iter().chain(figures));
    }
    if let Some(base) = overall.base {
        let mean = |speedup: Option<f64>| text::some(speedup, |x| text::significant(x) + " ");
        let means = columns.iter().map(|standing| mean(standing.speedup));
        let label = format!("geometric mean, x {base}");
        table.add_row([label].into_iter().chain(means));
    }
    let parts = table.parts(width);
    let shown = if all { parts.len() } else { 1 };
    let hidden = parts[shown..].iter().map(|part| part.header.len() - 1);
    let more = match hidden.sum() {
        0 => String::new(),
        hidden => format!(
            "{}: --all-columns\n",
            text::counted(hidden, "further structure")
        ),
    };
    let parts: Vec<String> = parts[..shown].iter().map(Table::bare).collect();
    let about = || rows.iter().map(|(_, comparison)| comparison.about());
    let up: BTreeSet<&str> = about().map(|cell| cell.scene.up.as_str()).collect();
    let up: Vec<&str> = up.into_iter().collect();
    let lens = inputs::lenses(about().map(|cell| &cell.path));
    let head = lens.map(|lens| format!("{} up; {lens}\n\n", up.join(" or ")));
    let head = text::wrapped(&head.unwrap_or_default(), width);
    let unit = text::some(overall.base, |base| {
        let moves = about().any(|cell| !cell.path.motion.is_empty());
        let per = if moves { "frame" } else { "query" };
        format!("; {base}: time per {per}, others: x {base}")
    });
    format!(
        "{head}{}\n* fastest or tied{unit}\n{more}\n",
        parts.join("\n")
    )
}

/// Short names of scenes and paths: "city 100k flythrough 2 %".
///
/// The full ones where two would be the same.
pub fn labels(all: &[&Comparison]) -> Vec<String> {
    let of = |comparison: &Comparison, show: fn(&str) -> String| {
        let about = comparison.about();
        let motion = Some(show(&about.path.motion)).filter(|motion| !motion.is_empty());
        let motion = motion
            .map(|motion| format!(" {motion}"))
            .unwrap_or_default();
        format!(
            "{} {}{motion}",
            show(&about.scene.name),
            show(&about.path.name)
        )
    };
    let short: Vec<String> = all.iter().map(|c| of(c, short)).collect();
    let is_unique = |label: &String| short.iter().filter(|other| *other == label).count() == 1;
    match short.iter().all(is_unique) {
        true => short,
        false => all.iter().map(|c| of(c, str::to_owned)).collect(),
    }
}

/// A file without its folder, a spec without keys and frames: "city 100k".
pub fn short(source: &str) -> String {
    let Some((name, parameters)) = source.rsplit_once(':').filter(|(_, p)| p.contains('=')) else {
        let file = source.rsplit(['/', '\\']).next();
        return shortened(file.unwrap_or(source), 24);
    };
    let values = parameters
        .split(',')
        .filter_map(|pair| match pair.split_once('=')? {
            ("frames", _) => None,
            ("n", count) => Some(format!(" {}", short_count(count))),
            ("visible", share) => Some(format!(" {}", share.replace('%', " %"))),
            _ => Some(format!(" {pair}")),
        });
    shortened(&format!("{name}{}", values.collect::<String>()), 36)
}

/// "100000" as "100k".
fn short_count(typed: &str) -> String {
    let count = parse_number(typed).unwrap_or(f64::NAN);
    match (count % 1e6 == 0.0, count % 1e3 == 0.0) {
        (true, _) => format!("{}M", count / 1e6),
        (_, true) => format!("{}k", count / 1e3),
        _ => typed.to_owned(),
    }
}

/// Reasons why cells are not ok, each once with the number of its paths.
fn reasons(group: &[&Comparison]) -> Vec<String> {
    let mut found: Vec<(String, usize)> = Vec::new();
    let ranked = group
        .iter()
        .flat_map(|c| c.ranked.iter().map(|ranked| ranked.cell));
    let bounds = group.iter().flat_map(|c| c.bounds.iter().copied());
    for cell in ranked.chain(bounds) {
        let Some(reason) = &cell.reason else {
            continue;
        };
        let line = format!("{}: {}: {reason}", cell.structure, cell.status.name());
        match found.iter_mut().find(|(known, _)| *known == line) {
            Some((_, count)) => *count += 1,
            None => found.push((line, 1)),
        }
    }
    let of = |count: usize| match group.len() {
        1 => String::new(),
        all => format!(" ({count} of {all} paths)"),
    };
    let lines = found
        .into_iter()
        .map(|(line, count)| text::plain(&line) + &of(count));
    lines.collect()
}

/// Shows the files of a run.
pub fn show_written(out: &mut impl Write, folder: &Path) -> io::Result<()> {
    writeln!(out, "report  {}", folder.join("report.html").display())?;
    writeln!(
        out,
        "        report.json, summary.csv, samples.csv, stream.jsonl"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::read_report;

    #[test]
    fn the_quick_suite_fits_sixty_lines() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/results/reference/report.json");
        let mut told = Vec::new();
        let report = read_report(file.as_ref()).unwrap();
        write(&mut told, &report, false, 80).unwrap();
        let told = String::from_utf8(told).unwrap();
        // Basis, warnings, files and the next command are below.
        assert!((20..=48).contains(&told.lines().count()), "{told}");
        assert!(
            told.lines().all(|line| line.chars().count() <= 80),
            "{told}"
        );
    }
}
