//! The ranked table of a scene that `cullbench run` shows when it is done with
//! it. Reads a report; measures nothing.

use std::io::{self, Write};

use super::text;
use crate::report::{Comparison, Ranked, Report, ReportCell, comparisons};

/// One block of rows for each path, cache state and culling test.
pub fn show_scene(report: &Report, scene: &str) -> io::Result<()> {
    let mut all = comparisons(report);
    all.retain(|c| c.about().scene.name == scene);
    let Some(first) = all.first().map(Comparison::about) else {
        return Ok(());
    };
    let sources = all.iter().any(|c| text::by_source(c).is_some());
    let mut header = vec!["path / structure", "culled", "false positives"];
    header.extend(sources.then_some(text::BY_SOURCE));
    header.extend(OF_STRUCTURES);
    let right: Vec<usize> = (1..header.len() - 1).collect();
    let mut table = text::table(&header, &right);
    for comparison in &all {
        add_path(&mut table, comparison, header.len());
    }
    let mut out = text::terminal();
    writeln!(
        out,
        "\n{}: {}, {}{}{}",
        text::plain(scene),
        text::counted(first.scene.total_count, "item"),
        text::counted(first.scene.region_count, "region"),
        match first.scene.skipped_items {
            0 => String::new(),
            bad => format!(", {} left out", text::counted(bad, "bad item")),
        },
        match first.scene.total_count {
            0 => "; nothing is ranked",
            _ => "",
        }
    )?;
    for line in heads(&all) {
        writeln!(out, "{}", text::plain(&line))?;
    }
    writeln!(out, "{table}")?;
    let shown = all.iter().flat_map(|c| {
        let cells = c.ranked.iter().map(|r| r.cell);
        cells.chain(c.bounds.iter().copied())
    });
    for cell in shown.filter(|c| c.reason.is_some()) {
        let reason = cell.reason.as_deref().unwrap_or_default();
        writeln!(
            out,
            "{}",
            text::plain(&format!(
                "{} on {}: {}: {reason}",
                cell.structure,
                cell.path.name,
                cell.status.name()
            ))
        )?;
    }
    out.flush()
}

/// What the times rest on: one line where it is the same for all paths.
fn heads(all: &[Comparison]) -> Vec<String> {
    let lines: Vec<String> = all.iter().map(text::basis).collect();
    if lines.windows(2).all(|two| two[0] == two[1]) {
        return lines.into_iter().take(1).collect();
    }
    let named = all.iter().zip(lines);
    named
        .map(|(one, line)| format!("{}: {line}", path(one)))
        .collect()
}

fn path(comparison: &Comparison) -> String {
    let about = comparison.about();
    match about.path.cache.as_str() {
        "warm" => format!("{}, {}", about.path.name, about.test),
        cache => format!("{}, {} ({cache})", about.path.name, about.test),
    }
}

/// The rows of one path, fastest first; what failed comes last, unranked, and
/// then the lower bounds.
fn add_path(table: &mut text::Table, comparison: &Comparison, columns: usize) {
    let culled = comparison.of_any("cull_rate").map(text::percent);
    let of_path = [
        Some(path(comparison)),
        culled,
        text::false_positives(comparison),
        text::by_source(comparison),
    ];
    table.add_row(of_path.map(Option::unwrap_or_default));
    for Ranked { rank, cell } in &comparison.ranked {
        let rank = rank.map_or("-".to_owned(), |rank| rank.to_string());
        table.add_row(row(format!("  {rank} {}", cell.structure), cell, columns));
    }
    for bound in &comparison.bounds {
        table.add_row(row(format!("    {}", bound.structure), bound, columns));
    }
}

/// What a structure has a figure for; the columns before it are its path's.
const OF_STRUCTURES: [&str; 9] = [
    "query [95 %]",
    "p95",
    "speed-up vs linear [95 %]",
    "of lower bound: read",
    "copy",
    "build",
    "bytes per item",
    "locate",
    "status",
];

fn row(name: String, cell: &ReportCell, columns: usize) -> Vec<String> {
    let value =
        |name: &str, show: fn(f64) -> String| cell.value(name).map(show).unwrap_or_default();
    let figures = [
        text::time_estimate(cell.metrics.get("query_ns")),
        value("query_ns_p95", text::time),
        text::estimate(cell.metrics.get("speedup")),
        value("times_read", text::significant),
        value("times_memcpy", text::significant),
        value("build_ms", |ms| text::time(ms * 1e6)),
        value("memory_bytes_per_item", |b| format!("{b:.1}")),
        value("locate_ns", text::time),
        cell.status.name().to_owned(),
    ];
    let mut row = vec![name];
    row.resize(columns - figures.len(), String::new());
    row.extend(figures);
    row
}
