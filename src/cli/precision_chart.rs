//! The pictures of `cullbench precision`: error against time, one mark for each
//! point, the Pareto front as a line; frustum queries above, region search below.
//! They draw what was measured and decide nothing.

use std::collections::BTreeMap;

use plotters::prelude::*;

use super::chart::{Area, Axis, Drawn, around, is_drawn, left_out, legend, log_log, svg};
use super::palette::COLOURS;
use super::precision_tables::CullingPoint;
use super::text;
use crate::precision::{Point, Precision, RegionErrors};

const SIZE: (u32, u32) = (1000, 1080);
/// Height of the picture of frustum queries.
const UPPER: u32 = 640;

/// A point of a picture.
struct Mark {
    series: String,
    /// Time and error, as the axes have them.
    at: [f64; 2],
    on_front: bool,
    /// True if the point misses something.
    is_cross: bool,
}

impl Mark {
    /// If the point has a time and an error.
    fn of(point: &CullingPoint) -> Option<Mark> {
        Some(Mark {
            series: point.structure.clone(),
            at: [
                point.times.query_ns? / 1e3,
                point.errors.excess?.value * 100.0,
            ],
            on_front: point.on_front,
            is_cross: point
                .errors
                .counts
                .is_some_and(|errors| errors.false_negatives > 0),
        })
    }

    fn of_region(point: &Point<RegionErrors>) -> Option<Mark> {
        Some(Mark {
            series: format!("{} {}", point.structure, point.errors.numbers),
            at: [point.times.query_ns?, point.errors.wrong?.value * 100.0],
            on_front: point.on_front,
            is_cross: point.errors.missed_region_count > 0,
        })
    }
}

/// One picture: what stands over it and at its axes, and its marks.
struct Picture {
    caption: String,
    axes: [&'static str; 2],
    /// Position of no error at all: a logarithmic axis has no zero.
    none: f64,
    marks: Vec<Mark>,
    /// Returns true for a series with a place in the legend.
    is_named: fn(&[Mark], &str) -> bool,
}

/// The diagrams as SVG.
pub fn draw(precision: &Precision) -> anyhow::Result<String> {
    let about = format!("{}, {}", precision.scene, precision.path);
    let queries = Picture {
        caption: format!("{about}: error against run time"),
        axes: [
            "time per query, us (thread CPU; left is better)",
            "false positives, % of visible (lower is better)",
        ],
        none: 1e-4,
        marks: precision.points.iter().filter_map(Mark::of).collect(),
        is_named: |_, _| true,
    };
    let regions = Picture {
        caption: format!("{about}: region search"),
        axes: [
            "time per point, ns (thread CPU; left is better)",
            "points with a wrong answer, % (lower is better)",
        ],
        none: 1e-2,
        marks: precision
            .region_points
            .iter()
            .filter_map(Mark::of_region)
            .collect(),
        // Two for each structure are too many to name.
        is_named: |marks, series| marks.iter().any(|m| m.on_front && m.series == series),
    };
    svg("the diagram", SIZE, |root| {
        let (top, bottom) = root.split_vertically(UPPER);
        queries.draw(&top)?;
        regions.draw(&bottom)
    })
}

impl Picture {
    /// Position of a mark, if it is on the axes.
    fn place(&self, mark: &Mark) -> Option<(f64, f64)> {
        let place = (mark.at[0], mark.at[1].max(self.none));
        (is_drawn(place.0) && is_drawn(place.1)).then_some(place)
    }

    /// Those of the front that are better the longer they take: the others are on it
    /// for their memory or for what they do not miss.
    fn front(&self) -> Vec<(f64, f64)> {
        let mut least = f64::INFINITY;
        let marks = self.marks.iter().filter(|mark| mark.on_front);
        let places = marks.filter_map(|mark| self.place(mark));
        places
            .filter(|&(_, error)| {
                let is_better = error < least;
                least = least.min(error);
                is_better
            })
            .collect()
    }

    fn draw(&self, area: &Area) -> Drawn {
        let places: Vec<(f64, f64)> = self.marks.iter().filter_map(|m| self.place(m)).collect();
        let beyond = left_out(self.marks.len() - places.len());
        let times = around(places.iter().map(|p| p.0), 1.5, 2.0);
        // From nothing to a hundredth at least.
        let errors = places.iter().map(|p| p.1).chain([self.none, 1.0]);
        let errors = around(errors, 1.5, 2.0);
        let error = |y| match y <= self.none {
            true => "0".to_owned(),
            false => text::significant(y),
        };
        let [time_title, error_title] = self.axes;
        let axes: [Axis; 2] = [
            (time_title, times, &text::significant),
            (error_title, errors, &error),
        ];
        let mut chart = log_log(area, &format!("{}{beyond}", self.caption), axes)?;
        chart
            .draw_series(LineSeries::new(self.front(), BLACK.mix(0.5)))?
            .label("Pareto front")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 16, y)], BLACK.mix(0.5)));
        let mut series: BTreeMap<&str, Vec<&Mark>> = BTreeMap::new();
        for mark in &self.marks {
            series.entry(&mark.series).or_default().push(mark);
        }
        for (i, (name, marks)) in series.into_iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let (crosses, sound): (Vec<&Mark>, Vec<&Mark>) =
                marks.into_iter().partition(|mark| mark.is_cross);
            let circles = sound.into_iter().filter_map(|mark| {
                let size = if mark.on_front { 6 } else { 4 };
                Some(Circle::new(self.place(mark)?, size, colour.filled()))
            });
            let drawn = chart.draw_series(circles)?;
            if (self.is_named)(&self.marks, name) {
                drawn
                    .label(name)
                    .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
            }
            // A cross misses something that is to be found.
            let crosses = crosses.into_iter().filter_map(|mark| self.place(mark));
            chart.draw_series(crosses.map(|at| Cross::new(at, 5, colour.stroke_width(2))))?;
        }
        legend(&mut chart, SeriesLabelPosition::UpperRight)
    }
}
