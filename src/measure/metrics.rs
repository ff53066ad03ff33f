//! The list of metrics, a measured value, and the metrics of one cell.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::TaskKind;
use crate::statistics::Estimate;

/// One metric of the list; the unit is part of its name where it has one.
#[non_exhaustive]
pub struct MetricInfo {
    /// Name in reports and for `--metric`.
    pub name: &'static str,
    /// Unit of its values; empty for counts and ratios.
    pub unit: &'static str,
    /// Meaning, in one line.
    pub summary: &'static str,
}

/// All metrics of a cell, in the order of the columns.
pub static METRICS: &[MetricInfo] = rows! { MetricInfo { name, unit, summary }
    "visible_count", "items", "visible items per query, mean over the path";
    "cull_rate", "1", "1 - visible/total, mean over the path";
    "query_ns", "ns", "thread CPU time per frustum query, mean over the timed cameras: trimmed mean over the processes, each the interquartile mean over its rounds; interval over the processes";
    "query_ns_p5", "ns", "5th percentile over groups of cameras that are the same for all structures; absent below twenty groups";
    "query_ns_p95", "ns", "95th percentile over groups of cameras that are the same for all structures; absent below twenty groups";
    "query_ns_p99", "ns", "99th percentile over groups of cameras that are the same for all structures; absent below twenty groups";
    "query_ns_max", "ns", "slowest group of cameras";
    "query_wall_ns", "ns", "as query_ns, wall time";
    "ns_per_visible", "ns", "query_ns / visible items of a timed camera, mean; interval scaled likewise";
    "speedup", "1", "time of linear / time of this structure: above 1 is faster; the ratio of the two query_ns, of motions that of the two frame_ns";
    "times_read", "1", "time of this structure / time of reading all item bounds once \
                        (bound-read); a tree can be below 1";
    "times_memcpy", "1", "time of this structure / time of copying as many ids (bound-memcpy)";
    "times_replay", "1", "time of this structure / time of a replay of what 'wide' reads and copies; only beside wide";
    "nodes_tested", "nodes", "node bounds classified per query, mean";
    "planes_tested", "planes", "plane tests per query, of nodes and items, mean";
    "items_tested", "items", "item bounds tested per query, mean";
    "items_accepted_untested", "items", "items reported with a whole subtree, untested, per query, mean";
    "excess", "1", "false positives / visible items, at camera level, of the queries checked against the oracle";
    "false_positive_count", "items", "returned though outside at camera level, per checked query, mean";
    "false_negative_count", "items", "inside at camera level, but not returned, per checked query, mean";
    "touch_dropped_count", "items", "boundary contacts at camera level, but not returned, per checked query, mean";
    "worst_miss", "world units", "how deep the deepest false negative reaches into the view";
    "undecided_count", "items", "too close to decide (counted as boundary contacts), per checked query, mean";
    "judged_queries", "queries", "cameras of the path whose answers were checked against the oracle";
    "build_ms", "ms", "CPU time of one build; wall time with --threads above 1";
    "update_ms_0_1_percent", "ms", "as update_ms, after 0.1 % have moved";
    "update_ms", "ms", "CPU time of an update after 1 % of the items have moved (scenes of up to 2 million)";
    "update_ms_10_percent", "ms", "as update_ms, after 10 % have moved";
    "update_ms_100_percent", "ms", "as update_ms, after all have moved";
    "refitted_over_rebuilt", "1", "time per query after 32 refits, each after 1 % of the items have moved / time per query on a fresh build of the same boxes (query after 32 in tables); only structures that refit";
    "memory_bytes_per_item", "bytes", "nodes, item bounds and ids / items";
    "break_even_queries", "queries", "queries after which the build is repaid against linear; empty if never";
    "locate_ns", "ns", "thread CPU time of a region search at the eye, mean over the timed cameras; as query_ns";
    "locate_batched_ns", "ns", "thread CPU time of a region search of all points of the path in one batch, per point; as query_ns";
    "locate_speedup", "1", "as speedup, for region search";
    "comparisons", "bounds", "bounds tested per region search, of nodes and items, mean";
    "regions_found", "regions", "regions that hold the eye, mean over the path";
    "views_wall_ns", "ns", "wall time per view where threads share the views of all timed cameras (--threads above 1)";
    "frame_ns", "ns", "thread CPU time per frame of a motion, update and all queries, mean over the frames; as query_ns, which is then the first query after each update";
    "update_ns", "ns", "thread CPU time of the update of a frame, mean over the frames; as query_ns";
    "further_query_ns", "ns", "thread CPU time of a query after the first one of a frame; as query_ns";
    "worst_frame_ns", "ns", "slowest frame: median of each frame over rounds and processes, then the maximum over the frames, so that an interruption is no worst frame";
    "ageing_1", "1", "time per query after 1 frame / time per query on a fresh build of the same boxes";
    "ageing_10", "1", "as ageing_1, after 10 frames";
    "ageing_100", "1", "as ageing_1, after 100 frames";
    "ageing_1000", "1", "as ageing_1, after 1,000 frames";
    "memory_after_bytes_per_item", "bytes", "as memory_bytes_per_item, after the last frame";
    "views_ns", "ns", "CPU time of all threads per view where they share the views of all timed cameras; as query_ns";
};

/// Metrics of wall time, each with its task.
pub(super) const WALL_METRICS: [(&str, TaskKind); 2] = [
    ("query_wall_ns", TaskKind::Query),
    ("views_wall_ns", TaskKind::Views),
];

/// A value, with its 95 % interval where it was sampled.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Metric {
    /// The mean, count or ratio.
    pub value: f64,
    /// Lower end of the interval; `None` without one.
    pub lower: Option<f64>,
    /// Upper end of the interval; `None` without one.
    pub upper: Option<f64>,
    /// Unit, as in `cullbench list metrics`.
    pub unit: String,
}

impl Metric {
    /// Value and interval.
    pub fn estimate(&self) -> Estimate {
        Estimate {
            value: self.value,
            lower: self.lower,
            upper: self.upper,
        }
    }
}

/// The metrics of a cell while they are collected.
#[derive(Default)]
pub(super) struct Metrics(pub(super) BTreeMap<String, Metric>);

impl Metrics {
    /// A missing or infinite value is absent, never 0 and never NaN.
    pub(super) fn estimate(&mut self, name: &str, estimate: Option<Estimate>) {
        let info = METRICS.iter().find(|m| m.name == name);
        debug_assert!(info.is_some(), "{name} is not in the list of metrics");
        if let (Some(info), Some(found)) = (info, estimate.filter(|e| e.value.is_finite())) {
            let metric = Metric {
                value: found.value,
                lower: found.lower,
                upper: found.upper,
                unit: info.unit.to_owned(),
            };
            self.0.insert(name.to_owned(), metric);
        }
    }

    /// A value without an interval.
    pub(super) fn set(&mut self, name: &str, value: impl Into<Option<f64>>) {
        let exact = |value| Estimate {
            value,
            lower: None,
            upper: None,
        };
        self.estimate(name, value.into().map(exact));
    }
}
