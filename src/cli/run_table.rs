//! The ranked tables of a scene at the end of its part of `cullbench run`, narrow
//! enough for a terminal of a hundred columns.

use std::io::{self, Write};

use super::table::Table;
use super::text;
use crate::report::{Comparison, Ranked, Report, ReportCell, comparisons};

/// A table for each path, cache state and culling test, then the cost of builds.
pub fn show_scene(report: &Report, scene: &str) -> io::Result<()> {
    let mut all = comparisons(report);
    all.retain(|c| c.about().scene.name == scene);
    let Some(first) = all.first() else {
        return Ok(());
    };
    let about = &first.about().scene;
    let mut out = text::terminal();
    writeln!(
        out,
        "\n{}: {}, {}{}{}",
        text::plain(scene),
        text::counted(about.total_count, "item"),
        text::counted(about.region_count, "region"),
        match about.skipped_items {
            0 => String::new(),
            bad => format!(", {} left out", text::counted(bad, "bad item")),
        },
        match about.total_count {
            0 => "; nothing is ranked",
            _ => "",
        }
    )?;
    for comparison in &all {
        for line in heads(comparison) {
            writeln!(out, "{}", text::plain(&line))?;
        }
        let bounds = comparison.bounds.iter().map(|cell| (String::new(), *cell));
        write!(out, "{}", table(QUERIES, ranked(comparison).chain(bounds)))?;
        for line in reasons(comparison) {
            writeln!(out, "{}", text::plain(&line))?;
        }
    }
    let unranked = ranked(first).map(|(_, cell)| (String::new(), cell));
    write!(out, "{}", table(BUILDS, unranked))?;
    out.flush()
}

/// Lines above a table: the queries, their errors, and the basis of the times.
fn heads(comparison: &Comparison) -> [String; 2] {
    let about = comparison.about();
    let mut head = format!("{}, {}", about.path.name, about.test);
    if about.path.cache != "warm" {
        head += &format!(" ({})", about.path.cache);
    }
    if let Some(culled) = comparison.of_any("cull_rate") {
        head += &format!(": {} culled", text::percent(culled));
    }
    let sources = text::by_source(comparison);
    let sources = sources.map(|items| format!("{items} {}", text::BY_SOURCE));
    match (text::false_positives(comparison), sources) {
        (Some(share), None) => head += &format!(", {share} false positives"),
        (Some(share), Some(items)) => head += &format!(", {share} false positives ({items})"),
        (None, Some(items)) => head += &format!(", false positives {items}"),
        (None, None) => {}
    }
    [head, text::basis(comparison)]
}

/// The cells of structures with their ranks: fastest first, and last, unranked,
/// what failed.
fn ranked<'r>(comparison: &Comparison<'r>) -> impl Iterator<Item = (String, &'r ReportCell)> {
    let ranked = comparison.ranked.iter();
    ranked.map(|Ranked { rank, cell }| (rank.map_or("-".to_owned(), |n| n.to_string()), *cell))
}

/// A column: what is over it, and its figure of a cell.
type Column = (&'static str, fn(&ReportCell) -> String);

/// Columns of the queries of a path. A status stands in place of a missing time.
const QUERIES: &[Column] = &[
    ("query [95 %]", |cell| match cell.metrics.get("query_ns") {
        None => cell.status.name().to_owned(),
        found => text::time_estimate(found),
    }),
    ("p95", |cell| of(cell, "query_ns_p95", text::time)),
    ("speed-up [95 %]", |cell| {
        text::estimate(cell.metrics.get("speedup"))
    }),
    ("/ read", |cell| of(cell, "times_read", text::significant)),
    ("locate", |cell| of(cell, "locate_ns", text::time)),
];

/// Columns of a structure on a scene.
const BUILDS: &[Column] = &[
    ("build", |cell| {
        of(cell, "build_ms", |ms| text::time(ms * 1e6))
    }),
    ("update of 1 %", |cell| {
        of(cell, "update_ms", |ms| text::time(ms * 1e6))
    }),
    ("query after 32", |cell| {
        of(cell, "refitted_over_rebuilt", |ratio| {
            format!("x {}", text::significant(ratio))
        })
    }),
    ("bytes per item", |cell| {
        of(cell, "memory_bytes_per_item", |bytes| format!("{bytes:.1}"))
    }),
];

fn of(cell: &ReportCell, metric: &str, show: fn(f64) -> String) -> String {
    cell.value(metric).map(show).unwrap_or_default()
}

/// A table of a row per cell, without empty columns; nothing if all are empty.
fn table<'r>(columns: &[Column], cells: impl Iterator<Item = (String, &'r ReportCell)>) -> String {
    let header = ["structure"].into_iter().chain(columns.iter().map(|c| c.0));
    let mut table = Table::of_numbers(header);
    for (rank, cell) in cells {
        let figures = columns.iter().map(|(_, figure)| figure(cell));
        let name = format!("{rank:>2} {}", cell.structure);
        table.add_row([name].into_iter().chain(figures));
    }
    let table = table.without_empty_columns();
    match table.header.len() {
        0 | 1 => String::new(),
        _ => format!("{table}\n"),
    }
}

/// Why cells are not ok.
fn reasons<'c>(comparison: &'c Comparison) -> impl Iterator<Item = String> + 'c {
    let ranked = comparison.ranked.iter().map(|ranked| ranked.cell);
    let cells = ranked.chain(comparison.bounds.iter().copied());
    cells.filter_map(|cell| {
        let reason = cell.reason.as_deref()?;
        let (structure, path) = (&cell.structure, &cell.path.name);
        Some(format!(
            "{structure} on {path}: {}: {reason}",
            cell.status.name()
        ))
    })
}
