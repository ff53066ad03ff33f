//! The list of metrics, each with the origin of its values.

use super::process_result::SubjectPart;
use super::{Judged, TaskKind};
use crate::statistics::Estimate;

/// One metric of the list; a unit in its name is that of its values.
pub struct MetricInfo {
    /// Name in reports and for `--metric`.
    pub name: &'static str,
    /// Unit of its values; empty for counts and ratios.
    pub unit: &'static str,
    /// Meaning, in one line.
    pub summary: &'static str,
    pub(super) of: Of,
}

/// Origin of the values of a metric.
pub(super) enum Of {
    /// The count pass, under the name of the metric.
    Count,
    /// Errors of the checked queries.
    Judged(fn(&Judged) -> Option<Estimate>),
    /// Mean over the processes of positive values.
    Process(fn(&SubjectPart) -> Option<f64>),
    /// Mean over the processes of logarithms of any sign.
    Log(fn(&SubjectPart) -> Option<f64>),
    /// Bytes in the first process that has them, per item.
    Bytes(fn(&SubjectPart) -> Option<u64>),
    /// CPU time of a task.
    Time(TaskKind),
    /// CPU time of a query per returned item.
    TimePerVisible,
    /// Wall time of a task.
    Wall(TaskKind),
    /// Quantile over groups of cameras.
    Tail(f64),
    /// The slowest frame.
    WorstFrame,
    /// Time of the yardstick / own time, of a task or of the one ranked by.
    Speedup(Option<TaskKind>),
    /// Own time / time of a lower bound.
    Over(&'static str),
    /// Number of queries after which the build is repaid.
    BreakEven,
    /// Derived from cells of other scenes, by the report as a whole.
    Report,
}

/// Mean of a number of errors over the checked queries.
fn per_query(judged: &Judged, errors: u64) -> Option<Estimate> {
    Some(Estimate::exact(
        errors as f64 / judged.judged_queries as f64,
    ))
}

/// False positives per visible item.
fn excess(judged: &Judged) -> Option<Estimate> {
    let ends = judged.excess_interval.unwrap_or([f64::NAN; 2]);
    Some(Estimate::within(judged.errors.excess()?, ends))
}

/// All metrics of a cell, in the order of the columns.
pub static METRICS: &[MetricInfo] = rows! { MetricInfo { name, unit, of, summary }
    "visible_count", "items", Of::Count, "items returned per query, mean over the path: the visible ones and the false positives of the test (excess)";
    "cull_rate", "1", Of::Count, "1 - returned/total, mean over the path";
    "query_ns", "ns", Of::Time(TaskKind::Query), "thread CPU time per frustum query, mean over the timed cameras: trimmed mean over the processes, each the interquartile mean over its rounds; interval over the processes";
    "query_ns_p5", "ns", Of::Tail(0.05), "as query_ns_p95, 5th percentile";
    "query_ns_p95", "ns", Of::Tail(0.95), "95th percentile over groups of cameras that are the same for all structures, of the median of each group, times query_ns / the mean over the groups; absent below 20 groups; short queries share a group, so they have few";
    "query_ns_p99", "ns", Of::Tail(0.99), "as query_ns_p95, 99th percentile";
    "query_ns_max", "ns", Of::Tail(1.0), "slowest group of cameras";
    "query_wall_ns", "ns", Of::Wall(TaskKind::Query), "as query_ns, wall time";
    "ns_per_visible", "ns", Of::TimePerVisible, "query_ns / items returned to a timed query, mean; interval scaled likewise";
    "speedup", "1", Of::Speedup(None), "time of linear / time of this structure: above 1 is faster; the ratio of the two query_ns, of motions that of the two frame_ns";
    "times_read", "1", Of::Over("bound-read"), "time of this structure / time of reading all item bounds once \
                        (bound-read); a tree can be below 1";
    "times_memcpy", "1", Of::Over("bound-memcpy"), "time of this structure / time of copying as many ids (bound-memcpy)";
    "nodes_tested", "nodes", Of::Count, "node bounds classified per query, mean";
    "planes_tested", "planes", Of::Count, "plane tests per query, of nodes and items, mean";
    "items_tested", "items", Of::Count, "item bounds tested per query, mean";
    "items_accepted_untested", "items", Of::Count, "items reported with a whole subtree, untested, per query, mean";
    "excess", "1", Of::Judged(excess), "false positives / visible items, at camera level, of the queries checked against the oracle";
    "false_positive_count", "items", Of::Judged(|j| per_query(j, j.errors.false_positives)), "returned though outside at camera level, per checked query, mean";
    "false_negative_count", "items", Of::Judged(|j| per_query(j, j.errors.false_negatives)), "inside at camera level, but not returned, per checked query, mean";
    "touch_dropped_count", "items", Of::Judged(|j| per_query(j, j.errors.touch_dropped)), "boundary contacts at camera level, but not returned, per checked query, mean";
    "worst_miss", "world units", Of::Judged(|j| Some(Estimate::exact(j.errors.worst_miss))), "how deep the deepest false negative reaches into the view";
    "undecided_count", "items", Of::Judged(|j| per_query(j, j.errors.undecided)), "too close to decide (counted as boundary contacts), per checked query, mean";
    "judged_queries", "queries", Of::Judged(|j| Some(Estimate::exact(j.judged_queries as f64))), "cameras of the path whose answers were checked against the oracle";
    "build_ms", "ms", Of::Process(|s| s.build_ms), "CPU time of one build; wall time with --threads above 1";
    "update_ms", "ms", Of::Process(|s| s.update_cpu_ms), "CPU time of an update after 1 % of the items, at least one, have moved (scenes of up to 2 million)";
    "memory_bytes_per_item", "bytes", Of::Bytes(|s| s.memory_bytes), "nodes, item bounds and ids / items";
    "break_even_queries", "queries", Of::BreakEven, "queries after which the build is repaid against linear; 0: at once; empty: never, or not shown to be faster";
    "growth_exponent", "1", Of::Report, "slope of ln query_ns over ln items: 0 does not grow, 1 as a scan does; least squares over three or more sizes of a world with about as many visible items on the same kind of path; absent below three";
    "locate_ns", "ns", Of::Time(TaskKind::Locate), "thread CPU time of a region search at the eye, mean over the timed cameras; as query_ns";
    "locate_batched_ns", "ns", Of::Time(TaskKind::LocateBatched), "thread CPU time of a region search of all points of the path in one batch, per point; as query_ns";
    "locate_speedup", "1", Of::Speedup(Some(TaskKind::Locate)), "as speedup, for region search";
    "comparisons", "bounds", Of::Count, "bounds tested per region search, of nodes and items, mean";
    "regions_found", "regions", Of::Count, "regions that hold the eye, mean over the path";
    "views_wall_ns", "ns", Of::Wall(TaskKind::Views), "wall time per view where threads share the views of all timed cameras (--threads above 1)";
    "frame_ns", "ns", Of::Time(TaskKind::Frame), "CPU time per frame of a motion (of all threads with --threads above 1), update and all queries, mean over the frames; as query_ns, which is then the first query after each update";
    "update_ns", "ns", Of::Time(TaskKind::Update), "CPU time of the update of a frame, mean over the frames; as query_ns";
    "further_query_ns", "ns", Of::Time(TaskKind::Further), "thread CPU time of a query after the first one of a frame; as query_ns";
    "worst_frame_ns", "ns", Of::WorstFrame, "slowest frame: median over processes of the median of each frame over rounds, then the maximum over the frames, times frame_ns / the mean over the frames; absent below three readings per frame, where an interruption would be the worst frame";
    "ageing_1", "1", Of::Log(|s| s.ageing_ln.get(&1).copied()), "time per query after 1 frame / time per query on a fresh build of the same boxes";
    "ageing_10", "1", Of::Log(|s| s.ageing_ln.get(&10).copied()), "time per query after 10 frames / time per query on a fresh build of the same boxes";
    "ageing_100", "1", Of::Log(|s| s.ageing_ln.get(&100).copied()), "time per query after 100 frames / time per query on a fresh build of the same boxes";
    "ageing_1000", "1", Of::Log(|s| s.ageing_ln.get(&1000).copied()), "time per query after 1,000 frames / time per query on a fresh build of the same boxes";
    "memory_after_bytes_per_item", "bytes", Of::Bytes(|s| s.memory_after_bytes), "as memory_bytes_per_item, after the last frame";
    "views_ns", "ns", Of::Time(TaskKind::Views), "CPU time of all threads per view where they share the views of all timed cameras; as query_ns";
};
