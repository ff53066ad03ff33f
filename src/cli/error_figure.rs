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

/// Error against run time.
pub struct Against {
    pub caption: String,
    /// Titles of time and error.
    pub axes: [&'static str; 2],
    /// Position of no error at all: a logarithmic axis has no zero.
    pub none: f64,
    /// Fastest first.
    pub points: Vec<Measured>,
}

impl Against {
    /// Those of the front that are better the longer they take: the others are on it
    /// for their memory or for what they do not miss.
    fn front(&self) -> Vec<[f64; 2]> {
        let mut least = f64::INFINITY;
        let points = self.points.iter().map(|own| &own.point);
        let places = points.filter(|point| point.is_large).map(|point| point.at);
        let better = |at: &[f64; 2]| {
            let is_better = at[1] < least;
            least = least.min(at[1]);
            is_better
        };
        places.filter(better).collect()
    }

    /// The tests at each height, near ones together.
    fn levels(&self) -> Vec<(f64, String)> {
        let places = self.points.iter().map(|own| (own.point.at[1], &own.test));
        let mut places: Vec<(f64, &String)> = places.collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        let near = |a: &(f64, &String), b: &(f64, &String)| b.0 / a.0 < 1.25;
        let mut levels = Vec::new();
        for own in places.chunk_by(near) {
            let tests: BTreeSet<&String> = own.iter().map(|place| place.1).collect();
            levels.extend(
                tests
                    .into_iter()
                    .map(|test| (own[own.len() / 2].0, test.clone())),
            );
        }
        levels
    }

    pub fn draw(mut self) -> Figure {
        let all = self.points.len();
        for own in &mut self.points {
            let point = &mut own.point;
            point.at[1] = point.at[1].max(self.none);
            point.ends = point.ends.map(|ends| ends.map(|end| end.max(self.none)));
        }
        let is_drawn = |own: &Measured| own.point.at.iter().all(|value| is_drawn(*value));
        self.points.retain(is_drawn);
        let beyond = all - self.points.len();
        let (front, levels) = (self.front(), self.levels());
        let mut series: Vec<Series> = Vec::new();
        let points = self.points.into_iter();
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
        let error = |error: f64| match error <= self.none * 1.01 {
            true => "0".to_owned(),
            false => text::significant(error),
        };
        // From nothing to a hundredth at least.
        let errors = places().flat_map(|p| p.ends.unwrap_or([p.at[1]; 2]));
        let errors = errors.chain([self.none, 1.0]);
        let mut y = Axis::log("", errors, 1.5, &error);
        // Powers above zero, whose place is half a step below the last.
        y.ticks = y.powers(10.0);
        y.ticks.retain(|tick| *tick > self.none * 2.0);
        y.ticks.push(self.none);
        let x = Axis::log(self.axes[0], places().map(|p| p.at[0]), 1.5, &text::time);
        let (caption, error, rest) = (&self.caption, self.axes[1], left_out(beyond));
        let caption = format!("{caption}; up: {error}. Large: on the line of least error{rest}");
        Diagram {
            front,
            levels,
            ..Diagram::of(caption, [x, y], Joined::Apart, series)
        }
        .draw()
    }
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
            let axes = ["time", "error"];
            let caption = String::new();
            let drawn = Against {
                caption,
                axes,
                none,
                points,
            }
            .draw()
            .parts;
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
