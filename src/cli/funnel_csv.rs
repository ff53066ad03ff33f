//! `cullbench funnel --format csv`: every table of the JSON report as rows of one
//! file. A column says which table a row is of; all others are fields of the JSON.

use std::io::{self, Write};

use serde_json::Value;

use crate::funnel::FunnelReport;
use crate::shown::shown_field;

/// Tables of the report: a list of rows, or a single row.
const TABLES: [&str; 12] = [
    "level",
    "cut_outs",
    "inner_boxes",
    "ground",
    "solid_blocks",
    "mirror",
    "stages",
    "orders",
    "picks",
    "left_out",
    "bounds",
    "gains",
];

/// Fields of the rows of all tables, `/` before a field of a field. The columns are
/// the same for every report.
const FIELDS: &str = "
    stage name back_end structure question selected guarantee is_chosen does_object_stage
    unit stage_ns stage_ns_lower stage_ns_upper
    input_count output_count truth_count false_positive_count false_negative_count
    excess/value excess/lower excess/upper missing/value missing/lower missing/upper
    image_error/value image_error/lower image_error/upper
    removed_share/value removed_share/lower removed_share/upper
    worst_missing_samples longest_missing_streak ns_per_removed ns_per_decided
    fragments/asked_count fragments/kept_out_count fragments/fragment_count
    fragments/clear_count fragments/shaded_count fragments/covered_count
    fragment_count shaded_count covered_count overdraw pair_count wrong_pair_count
    wrong_sample_count cyclic_count exceptions
    ray_count wrong_count ns_per_ray ratio ratio_lower ratio_upper
    with_ns without_ns with_count without_count
    break_even_ns break_even_ns_lower break_even_ns_upper
    map_count saved_load_ns saved_load_ns_lower saved_load_ns_upper
    item axis view_count marked_count shown_count
    with_stencil/asked_count with_stencil/kept_out_count with_stencil/fragment_count
    with_stencil/clear_count with_stencil/shaded_count with_stencil/covered_count
    without_stencil/asked_count without_stencil/kept_out_count without_stencil/fragment_count
    without_stencil/clear_count without_stencil/shaded_count without_stencil/covered_count
    mask share tile seed item_count boxed_count box_limit box_count volume_share build_ns
    unclosed_sector_count section reason";

/// One row for each row of each table; numbers as they are, lists as their lengths.
pub fn write(report: &FunnelReport, out: impl Write) -> io::Result<()> {
    let mut out = csv::Writer::from_writer(out);
    let own = ["scene", "path", "table"].map(str::to_owned);
    let columns = FIELDS.split_whitespace().map(column);
    out.write_record(own.into_iter().chain(columns))?;
    let tables = serde_json::to_value(report)?;
    for table in TABLES {
        let rows = match &tables[table] {
            Value::Array(rows) => &rows[..],
            Value::Null => &[],
            row => std::slice::from_ref(row),
        };
        for row in rows {
            let own = [&report.scene, &report.path, table].map(shown_field);
            let fields = FIELDS.split_whitespace();
            let cells = fields.map(|path| cell(row.pointer(&format!("/{path}"))));
            out.write_record(own.into_iter().chain(cells))?;
        }
    }
    out.flush()
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
