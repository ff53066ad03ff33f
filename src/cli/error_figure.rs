//! Figure of error against run time.
//!
//! A mark per structure and test, the Pareto front before them, and each level of error
//! named by its tests.

use super::diagram::{Diagram, Joined, Point, Series};
use super::figure::{Axis, Figure, is_drawn, left_out};
use super::text;

/// A structure with a test.
pub struct Measured {
    pub structure: String,
    pub test: String,
    pub time: f64,
    pub ends: Option<[f64; 2]>,
    /// Error; zero stands at the bottom.
    pub error: f64,
    pub on_front: bool,
    /// True if it misses something that is to be found.
    pub is_cross: bool,
    pub note: String,
}

/// Error against run time.
pub struct Against<'a> {
    pub caption: String,
    /// Titles of time and error.
    pub axes: [&'a str; 2],
    /// Text of a time.
    pub shown: &'a dyn Fn(f64) -> String,
    /// Position of no error at all: a logarithmic axis has no zero.
    pub none: f64,
    /// Fastest first.
    pub points: Vec<Measured>,
}

impl Against<'_> {
    /// Position of a point, if it is on the axes.
    fn at(&self, point: &Measured) -> Option<[f64; 2]> {
        let at = [point.time, point.error.max(self.none)];
        at.iter().all(|value| is_drawn(*value)).then_some(at)
    }

    /// Those of the front that are better the longer they take: the others are on it
    /// for their memory or for what they do not miss.
    fn front(&self) -> Vec<[f64; 2]> {
        let mut least = f64::INFINITY;
        let marks = self.points.iter().filter(|point| point.on_front);
        let places = marks.filter_map(|point| self.at(point));
        let better = |at: &[f64; 2]| {
            let is_better = at[1] < least;
            least = least.min(at[1]);
            is_better
        };
        places.filter(better).collect()
    }

    /// The tests at each height, near ones together.
    fn levels(&self) -> Vec<(f64, String)> {
        let places = self
            .points
            .iter()
            .filter_map(|p| Some((self.at(p)?[1], &p.test)));
        let mut places: Vec<(f64, &String)> = places.collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        let near = |a: &(f64, &String), b: &(f64, &String)| b.0 / a.0 < 1.25;
        let level = |own: &[(f64, &String)]| {
            let mut tests: Vec<&str> = own.iter().map(|place| place.1.as_str()).collect();
            tests.sort_unstable();
            tests.dedup();
            (own[own.len() / 2].0, tests.join(", "))
        };
        places.chunk_by(near).map(level).collect()
    }

    pub fn draw(&self) -> Figure {
        let front = self.front();
        let mut series: Vec<Series> = Vec::new();
        let mut beyond = 0;
        for point in &self.points {
            let Some(at) = self.at(point) else {
                beyond += 1;
                continue;
            };
            let is_large = front.contains(&at);
            let own = Point {
                at,
                ends: None,
                wide: point.ends.filter(|_| is_large),
                note: point.note.clone(),
                is_cross: point.is_cross,
                is_large,
            };
            match series.iter_mut().find(|s| s.name == point.structure) {
                Some(series) => series.points.push(own),
                None => {
                    let is_scan = point.structure.starts_with("linear");
                    series.push(Series::of(&point.structure, is_scan, vec![own]));
                }
            }
        }
        let places = || series.iter().flat_map(|series| &series.points);
        let error = |error: f64| match error <= self.none * 1.01 {
            true => "0".to_owned(),
            false => text::significant(error),
        };
        // From nothing to a hundredth at least.
        let errors = places().map(|p| p.at[1]).chain([self.none, 1.0]);
        let mut y = Axis::log("", errors, 1.5, &error);
        // Powers above zero, whose place is no step of the axis.
        y.ticks = y.powers(10.0);
        y.ticks.retain(|tick| *tick > self.none * 5.0);
        y.ticks.push(self.none);
        let x = Axis::log(self.axes[0], places().map(|p| p.at[0]), 1.5, self.shown);
        let caption = format!(
            "{}; up: {}. Large: on the line of least error{}",
            self.caption,
            self.axes[1],
            left_out(beyond)
        );
        Diagram {
            front,
            levels: self.levels(),
            ..Diagram::of(caption, [x, y], Joined::Apart, series)
        }
        .draw()
    }
}
