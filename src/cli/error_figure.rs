//! Figure of error against run time.
//!
//! A mark per structure and test, the Pareto front before them, and the tests named
//! at their levels of error.

use std::collections::BTreeSet;

use super::diagram::{Diagram, Joined, Point, Series};
use super::figure::{Axis, Figure, is_drawn, left_out};
use super::text;
use crate::report::grouped;

/// A point of a structure with a test.
pub struct Measured {
    pub structure: String,
    pub test: String,
    /// Time and error; large if it is on the front, a cross if it misses something that
    /// is to be found.
    pub point: Point,
}

/// Points of the front that are better the longer they take.
///
/// The others are on it for their memory or for what they do not miss.
fn front(points: &[Measured]) -> Vec<[f64; 2]> {
    let mut least = f64::INFINITY;
    let points = points.iter().map(|own| &own.point);
    let places = points.filter(|point| point.is_large).map(|point| point.at);
    let better = |at: &[f64; 2]| {
        let is_better = at[1] < least;
        least = least.min(at[1]);
        is_better
    };
    places.filter(better).collect()
}

/// The tests at each height, near ones together.
fn levels(points: &[Measured]) -> Vec<(f64, String)> {
    let places = points.iter().map(|own| (own.point.at[1], &own.test));
    let mut places: Vec<(f64, &String)> = places.collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let near = |a: &(f64, &String), b: &(f64, &String)| b.0 / a.0 < 1.25;
    let levels = places.chunk_by(near).flat_map(|own| {
        let tests: BTreeSet<&String> = own.iter().map(|place| place.1).collect();
        let level = move |test: &String| (own[own.len() / 2].0, test.clone());
        tests.into_iter().map(level)
    });
    levels.collect()
}

/// Error against run time of points, the fastest first; `None` without any.
///
/// `axes` are the titles of time and error. No error at all is drawn at `none`: a
/// logarithmic axis has no zero.
pub fn against(
    caption: &str,
    axes: [&str; 2],
    none: f64,
    mut points: Vec<Measured>,
) -> Option<Figure> {
    points.first()?;
    let all = points.len();
    for own in &mut points {
        let point = &mut own.point;
        point.at[1] = point.at[1].max(none);
        point.ends = point.ends.map(|ends| ends.map(|end| end.max(none)));
    }
    points.retain(|own| own.point.at.iter().all(|value| is_drawn(*value)));
    let beyond = all - points.len();
    let (front, levels) = (front(&points), levels(&points));
    let mut series: Vec<Series> = Vec::new();
    let points = points.into_iter();
    for (structure, own) in grouped(points.map(|own| (own.structure, own.point))) {
        let points = own.into_iter().map(|mut point| {
            point.is_large = front.contains(&point.at);
            point.wide = point.wide.filter(|_| point.is_large);
            point.ends = point.ends.filter(|_| point.is_large);
            point
        });
        let is_scan = structure.starts_with("linear");
        series.push(Series::of(&structure, is_scan, points.collect()));
    }
    let places = || series.iter().flat_map(|series| &series.points);
    let error = |error: f64| match error <= none * 1.01 {
        true => "0".to_owned(),
        false => text::significant(error),
    };
    // From nothing to a hundredth at least.
    let errors = places().flat_map(|p| p.ends.unwrap_or([p.at[1]; 2]));
    let mut y = Axis::log("", errors.chain([none, 1.0]), 1.5, &error);
    // Powers above zero, whose place is half a step below the last.
    y.ticks = y.powers(10.0);
    y.ticks.retain(|tick| *tick > none * 2.0);
    y.ticks.push(none);
    let x = Axis::log(axes[0], places().map(|p| p.at[0]), 1.5, &text::time);
    let (error, rest) = (axes[1], left_out(beyond));
    let caption = format!("{caption}; up: {error}. Large: on the line of least error{rest}");
    let diagram = Diagram {
        front,
        levels,
        ..Diagram::of(caption, [x, y], Joined::Apart, series)
    };
    Some(diagram.draw())
}

#[cfg(test)]
mod tests {
    use super::super::diagram::Point;
    use super::*;

    #[test]
    fn zero_is_no_step_of_the_axis() {
        for none in [3e-5, 3e-3] {
            let point = |error: f64| Measured {
                structure: "bvh".to_owned(),
                test: error.to_string(),
                point: Point::new([100.0, error]),
            };
            let points = vec![point(0.0), point(1.0)];
            let drawn = against("", ["time", "error"], none, points).unwrap().parts;
            let lines = drawn
                .split("<line class=\"grid\" x1=\"0.00%\" x2=\"100.00%\" y1=\"")
                .skip(1);
            let heights = lines.filter_map(|line| line.split('"').next()?.parse::<f64>().ok());
            let heights: Vec<f64> = heights.collect();
            let [first, second, .., zero] = heights[..] else {
                panic!("{heights:?}")
            };
            let step = first - second;
            assert!((0.4..0.7).contains(&((zero - first) / step)), "{heights:?}");
        }
    }
}
