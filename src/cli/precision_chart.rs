//! The figures of `cullbench precision`: error against time.
//!
//! Frustum queries, then region search. They draw what was measured and decide nothing.

use super::error_figure::{Against, Measured};
use super::figure::{Figure, is_drawn};
use super::precision_tables::{CullingPoint, named, percent};
use super::text;
use crate::precision::{Point, Precision, RegionErrors};
use crate::statistics::Estimate;

/// Ends of the interval of a time.
fn ends(time: Option<Estimate>) -> Option<[f64; 2]> {
    let ends = time?.lower.zip(time?.upper)?;
    (is_drawn(ends.0) && is_drawn(ends.1)).then_some(ends.into())
}

/// If the point has a time and an error.
fn of(point: &CullingPoint) -> Option<Measured> {
    let missed = point
        .errors
        .counts
        .map_or(0, |errors| errors.false_negatives);
    Some(Measured {
        structure: point.structure.clone(),
        test: point.errors.names.test.to_owned(),
        time: point.query_ns()?,
        ends: ends(point.time),
        error: point.errors.excess?.value * 100.0,
        on_front: point.on_front,
        is_cross: missed > 0,
        note: format!(
            "{}: {}, false positives {} %, {missed} missed",
            named(point),
            text::some(point.query_ns(), text::time),
            percent(point.errors.excess)
        ),
    })
}

fn of_region(point: &Point<RegionErrors>) -> Option<Measured> {
    Some(Measured {
        structure: point.structure.clone(),
        test: point.errors.numbers.to_owned(),
        time: point.query_ns()?,
        ends: ends(point.time),
        error: point.errors.wrong?.value * 100.0,
        on_front: point.on_front,
        is_cross: point.errors.missed_region_count > 0,
        note: format!("{} {}", point.structure, point.errors.numbers),
    })
}

/// Frustum queries, then region search where it was measured.
pub fn figures(precision: &Precision) -> Vec<Figure> {
    let about = format!("{}, {}", precision.scene, precision.path);
    let queries = Against {
        caption: format!("{about}: error against run time; dashed: misses visible items"),
        axes: ["time per query", "false positives, % of visible"],
        shown: &text::time,
        none: 1e-4,
        points: precision.points.iter().filter_map(of).collect(),
    };
    let regions = Against {
        caption: format!("{about}: region search; dashed: misses regions"),
        axes: ["time per point", "points with a wrong answer, %"],
        shown: &text::time,
        none: 1e-2,
        points: (precision.region_points.iter())
            .filter_map(of_region)
            .collect(),
    };
    let all = [queries, regions];
    let drawn = all.iter().filter(|one| !one.points.is_empty());
    drawn.map(Against::draw).collect()
}
