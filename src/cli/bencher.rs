//! The figures of a run in the Bencher Metric Format (bencher.dev), for
//! `report --bencher`.

use serde_json::{Map, Value, json};

use super::cell_names::name;
use super::text;
use crate::measure::{Metric, Status};
use crate::report::Report;

/// Measures of Bencher with their metrics; it has `latency` in ns by itself.
const MEASURES: [(&str, &str); 9] = [
    ("latency", "query_ns"),
    ("locate-ns", "locate_ns"),
    ("build-ms", "build_ms"),
    ("nodes-tested", "nodes_tested"),
    ("items-tested", "items_tested"),
    ("planes-tested", "planes_tested"),
    ("memory-bytes-per-item", "memory_bytes_per_item"),
    ("frame-ns", "frame_ns"),
    ("worst-frame-ns", "worst_frame_ns"),
];

/// One benchmark per right cell, named for structure and question.
pub fn format(report: &Report) -> serde_json::Result<String> {
    let cells = report.cells.iter().filter(|cell| cell.status == Status::Ok);
    let benchmarks = cells.map(|cell| {
        let measures = MEASURES.iter().filter_map(|(measure, metric)| {
            let value = of_metric(cell.metrics.get(*metric)?);
            Some(((*measure).to_owned(), value))
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
