//! The figures of a run in the Bencher Metric Format (bencher.dev), for
//! `report --bencher`.

use serde_json::{Map, Value, json};

use super::compare_table::name;
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

/// One benchmark per right cell, named for structure, scene, path and test.
pub fn format(report: &Report) -> serde_json::Result<String> {
    let cells = report.cells.iter().filter(|cell| cell.status == Status::Ok);
    let benchmarks = cells.map(|cell| {
        let measures = MEASURES.iter().filter_map(|(measure, metric)| {
            let value = of_metric(cell.metrics.get(*metric)?);
            Some(((*measure).to_owned(), value))
        });
        let key = cell.key();
        let (arithmetic, planes) = (&key.group.arithmetic, &key.group.planes);
        let name = format!("{}, {arithmetic}, {planes}", name(&key));
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
