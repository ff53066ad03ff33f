//! The figures of a run in the Bencher Metric Format (bencher.dev), for
//! `report --bencher`.

use serde_json::{Map, Value, json};

use super::cell_names::name;
use super::text;
use crate::measure::{Metric, Status};
use crate::report::Report;

/// Metrics that are measures of Bencher.
const METRICS: &str = "query_ns locate_ns build_ms nodes_tested items_tested planes_tested \
                       memory_bytes_per_item frame_ns worst_frame_ns";

/// One benchmark per right cell, named for structure and question.
pub fn format(report: &Report) -> serde_json::Result<String> {
    let cells = report.cells.iter().filter(|cell| cell.status == Status::Ok);
    let benchmarks = cells.map(|cell| {
        let measures = METRICS.split(' ').filter_map(|metric| {
            let value = of_metric(cell.metrics.get(metric)?);
            // Bencher has `latency` in ns by itself.
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

/// A value with its interval, if there is one.
fn of_metric(metric: &Metric) -> Value {
    let mut found = json!({ "value": metric.value });
    if let (Some(lower), Some(upper)) = (metric.lower, metric.upper) {
        found["lower_value"] = json!(lower);
        found["upper_value"] = json!(upper);
    }
    found
}
