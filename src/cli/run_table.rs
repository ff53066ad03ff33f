//! The ranked table of a scene that `cullbench run` shows when it is done with
//! it. Reads a report; measures nothing.

use std::io::{self, Write};

use comfy_table::Table;

use super::text;
use cullbench::measure::Status;
use cullbench::report::{Report, ReportCell};

/// One block of rows for each path, cache state and culling test.
pub fn show_scene(report: &Report, scene: &str) -> io::Result<()> {
    let cells: Vec<&ReportCell> = report
        .cells
        .iter()
        .filter(|c| c.scene.name == scene)
        .collect();
    let Some(first) = cells.first() else {
        return Ok(());
    };
    let mut table = text::table(
        &[
            "path / structure",
            "cull rate",
            "excess",
            "query median",
            "p95",
            "times linear [95 % interval]",
            "build",
            "B/item",
            "locate",
            "status",
        ],
        &[1, 2, 3, 4, 5, 6, 7, 8],
    );
    let mut groups: Vec<&PathOf> = Vec::new();
    let keys: Vec<PathOf> = cells.iter().map(|c| path_of(c)).collect();
    for key in &keys {
        if !groups.contains(&key) {
            groups.push(key);
        }
    }
    for group in groups {
        let of_path = cells
            .iter()
            .filter(|c| path_of(c) == *group)
            .copied()
            .collect();
        add_path(&mut table, of_path, report.noise.aa_floor.unwrap_or(0.0));
    }
    let mut out = io::stdout().lock();
    writeln!(
        out,
        "\n{scene}: {} items, {} regions{}",
        text::count(first.scene.total_count),
        text::count(first.scene.region_count),
        match first.scene.skipped_items {
            0 => String::new(),
            bad => format!(", {} bad items left out", text::count(bad)),
        }
    )?;
    writeln!(out, "{table}")?;
    for cell in cells.iter().filter(|c| c.reason.is_some()) {
        let reason = cell.reason.as_deref().unwrap_or_default();
        writeln!(
            out,
            "{} on {}: {}: {reason}",
            cell.structure,
            cell.path.name,
            cell.status.name()
        )?;
    }
    out.flush()
}

type PathOf = (String, String, String);

fn path_of(cell: &ReportCell) -> PathOf {
    let path = &cell.path;
    (path.name.clone(), path.cache.clone(), cell.test.clone())
}

/// The rows of one path, fastest first; what failed comes last, unranked.
fn add_path(table: &mut Table, mut cells: Vec<&ReportCell>, floor: f64) {
    let key = |c: &ReportCell| match c.status {
        Status::Ok => c.value("query_ns").unwrap_or(f64::MAX),
        _ => f64::INFINITY,
    };
    cells.sort_by(|a, b| key(a).total_cmp(&key(b)));
    let Some(first) = cells.first() else { return };
    let head = match first.path.cache.as_str() {
        "warm" => format!("{}, {}", first.path.name, first.test),
        cache => format!("{}, {} ({cache})", first.path.name, first.test),
    };
    let of_any = |name: &str| cells.iter().find_map(|c| c.value(name));
    let culled = of_any("cull_rate").map(text::percent);
    let excess = of_any("excess").map(|share| format!("{:.3} %", share * 100.0));
    table.add_row([head, culled.unwrap_or_default(), excess.unwrap_or_default()]);
    let (mut rank, mut leader) = (0, 0.0);
    for (place, cell) in cells.iter().enumerate() {
        let value =
            |name: &str, show: fn(f64) -> String| cell.value(name).map(show).unwrap_or_default();
        // Within the noise floor of the leader of its rank: a tie.
        if rank == 0 || key(cell) > leader * (1.0 + floor) {
            (rank, leader) = (place + 1, key(cell));
        }
        let number = if key(cell).is_finite() {
            rank.to_string()
        } else {
            "-".to_owned()
        };
        let ratio = cell.metrics.get("ratio_to_linear").map(|m| {
            let interval = m.lower.zip(m.upper).map(|(lower, upper)| {
                format!(
                    " [{}, {}]",
                    text::significant(lower),
                    text::significant(upper)
                )
            });
            format!(
                "{}{}",
                text::significant(m.value),
                interval.unwrap_or_default()
            )
        });
        table.add_row([
            format!("  {number} {}", cell.structure),
            String::new(),
            String::new(),
            value("query_ns", text::time),
            value("query_ns_p95", text::time),
            ratio.unwrap_or_default(),
            value("build_ms", |ms| text::time(ms * 1e6)),
            value("memory_bytes_per_item", |b| format!("{b:.1}")),
            value("locate_ns", text::time),
            cell.status.name().to_owned(),
        ]);
    }
}
