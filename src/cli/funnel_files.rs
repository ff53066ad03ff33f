//! `cullbench funnel --csv FOLDER`: a file for each table of the JSON report.

use std::fs;
use std::path::Path;

use anyhow::Context;
use serde_json::Value;

use super::diagram::{Form, Row, rows};
use super::figure::{Axis, Figure};
use super::plan::Plan;
use super::sheet::class;
use super::{text, write_text};
use crate::funnel::{Fate, FunnelReport, NONE, StageKind};
use crate::scene::Scene;
use crate::shown::shown_field;

/// Tables of the report, each a list of rows or a single row, with their fields.
///
/// `/` stands before a field of a field. The columns are the same for every report.
const TABLES: &str = include_str!("assets/funnel_tables.txt");

/// Writes all tables; numbers as they are, lists as their lengths.
pub fn write(report: &FunnelReport, folder: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let tables = serde_json::to_value(report)?;
    for (table, fields) in TABLES.lines().filter_map(|line| line.split_once(": ")) {
        let rows = match &tables[table] {
            Value::Array(rows) => &rows[..],
            Value::Null => &[],
            row => std::slice::from_ref(row),
        };
        let mut out = csv::Writer::from_writer(Vec::new());
        let columns = fields.split_whitespace().map(column);
        out.write_record(
            ["scene", "path"]
                .map(str::to_owned)
                .into_iter()
                .chain(columns),
        )?;
        for row in rows {
            let own = [&report.scene, &report.path].map(|name| shown_field(name));
            let fields = fields.split_whitespace();
            let cells = fields.map(|path| cell(row.pointer(&format!("/{path}"))));
            out.write_record(own.into_iter().chain(cells))?;
        }
        let text = String::from_utf8(out.into_inner()?)?;
        write_text(&folder.join(format!("{table}.csv")), &text)?;
    }
    Ok(())
}

/// The name of a field's column: `excess/lower` is `excess_lower`, a value needs no
/// more.
fn column(path: &str) -> String {
    path.trim_end_matches("/value").replace('/', "_")
}

fn cell(value: Option<&Value>) -> String {
    match value {
        None | Some(Value::Null) => String::new(),
        Some(Value::String(text)) => shown_field(text),
        Some(Value::Array(list)) => list.len().to_string(),
        Some(Value::Object(list)) => list.len().to_string(),
        Some(plain) => plain.to_string(),
    }
}

/// Bars on a logarithmic axis, from all items to what the last stage passes.
pub fn chain(report: &FunnelReport) -> Figure {
    let count = |mean: f64| match mean.fract() == 0.0 || mean >= 1000.0 {
        true => text::count(mean.round() as usize),
        false => text::significant(mean),
    };
    let row = |name: &str, value: f64, unit: &str, note: String| Row {
        value,
        label: format!("{name} {} {unit}", count(value)),
        note,
        ..Row::default()
    };
    let all = row("all", report.items as f64, "items", String::new());
    let chosen = report.stages.iter().filter(|row| row.is_chosen);
    let stages = chosen.filter(|row| row.back_end.name != NONE).map(|stage| {
        let (name, errors) = (stage.back_end.stage.name(), &stage.errors);
        let by = stage.structure.as_deref().unwrap_or(stage.back_end.name);
        let given = count(errors.input_count);
        let note = format!("{name} by {by}: of {given} {}", stage.unit);
        row(name, errors.output_count, stage.unit, note)
    });
    let bars: Vec<Row> = [all].into_iter().chain(stages).collect();
    let axis = Axis::log("", bars.iter().map(|row| row.value), 3.0, &count);
    let caption = format!(
        "{}, {}: what each stage leaves per view (logarithmic)",
        report.scene, report.path
    );
    rows([caption.clone(), caption], &axis, None, Form::Bars, &bars)
}

/// Every fate, with its colour and its words.
const FATES: [(Fate, &str, &str, bool); 6] = [
    (
        Fate::Removed(StageKind::Region),
        "#e4e4e4",
        "region: not reached through portals",
        false,
    ),
    (
        Fate::Removed(StageKind::Object),
        "#c0c8d0",
        "object: outside of the frustum",
        false,
    ),
    (
        Fate::Removed(StageKind::Occlusion),
        "#ecb566",
        "occlusion: behind others",
        false,
    ),
    (Fate::Kept, "#56b4e9", "drawn, and not visible", true),
    (Fate::Visible, "#009e73", "visible", true),
    (Fate::Lost, "#d50000", "visible, and removed", true),
];

/// The picture as SVG.
pub fn draw(report: &FunnelReport, scene: &Scene) -> String {
    let view = &report.plan_view;
    let class_of = |item: usize| {
        let class = FATES
            .iter()
            .position(|(fate, ..)| view.fates.get(item) == Some(fate));
        class.unwrap_or(0)
    };
    Plan {
        caption: format!(
            "{}, {}: the first view from above",
            report.scene, report.path
        ),
        scene,
        camera: view.camera.as_ref(),
        classes: &FATES.map(|(_, colour, words, is_key)| class(colour, words, is_key)),
        class_of: &class_of,
        cells: None,
    }
    .svg()
}
