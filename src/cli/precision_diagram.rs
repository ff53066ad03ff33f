//! The picture of `cullbench precision`: excess against time, one mark for each
//! point, the Pareto front as a line. It draws what was measured and decides
//! nothing.

use std::collections::BTreeMap;

use anyhow::anyhow;
use plotters::prelude::*;

use super::log_axis::{around, is_drawn, left_out};
use super::text;
use crate::precision::{Point, Precision};

const SIZE: (u32, u32) = (1000, 640);
/// Percent that stand for no excess at all: a logarithmic axis has no zero.
const NONE: f64 = 1e-4;

/// Told apart also without colours of their own names: dark to light.
pub const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(0, 0, 0),
    RGBColor(120, 120, 120),
];

/// Time in microseconds and excess in percent, if the point has both.
fn place(point: &Point) -> Option<(f64, f64)> {
    let excess = point.excess?.value * 100.0;
    let place = (point.times.query_ns? / 1e3, excess.max(NONE));
    (is_drawn(place.0) && is_drawn(place.1)).then_some(place)
}

/// The diagram as SVG.
pub fn draw(precision: &Precision) -> anyhow::Result<String> {
    let mut svg = String::new();
    let drawn = draw_on(&mut svg, precision);
    drawn.map_err(|error| anyhow!("the diagram cannot be drawn: {error}"))?;
    Ok(text::lines(&svg))
}

fn draw_on(svg: &mut String, precision: &Precision) -> Result<(), Box<dyn std::error::Error>> {
    let places: Vec<(f64, f64)> = precision.points.iter().filter_map(place).collect();
    let measured = precision.points.iter();
    let measured =
        measured.filter(|point| point.times.query_ns.is_some() && point.excess.is_some());
    let beyond = left_out(measured.count() - places.len());
    let times = around(places.iter().map(|p| p.0), 1.5, 2.0).log_scale();
    // From nothing to a hundredth at least.
    let excesses = places.iter().map(|p| p.1).chain([NONE, 1.0]);
    let excesses = around(excesses, 1.5, 2.0).log_scale();
    let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let caption = format!(
        "{}, {}: error against run time{beyond}",
        precision.scene, precision.path
    );
    let mut chart = ChartBuilder::on(&root)
        .caption(caption, ("sans-serif", 18))
        .margin(14)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(times, excesses)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE.mix(0.0))
        .x_desc("time per query, us (thread CPU; left is better)")
        .y_desc("false positives, % of visible (lower is better)")
        .x_label_formatter(&|x| text::significant(*x))
        .y_label_formatter(&|y| {
            if *y <= NONE {
                "0".to_owned()
            } else {
                text::significant(*y)
            }
        })
        .draw()?;
    let front: Vec<(f64, f64)> = precision
        .front
        .iter()
        .filter_map(|&i| place(&precision.points[i]))
        .collect();
    chart
        .draw_series(LineSeries::new(front, BLACK.mix(0.5)))?
        .label("Pareto front")
        .legend(|(x, y)| PathElement::new([(x, y), (x + 16, y)], BLACK.mix(0.5)));
    let mut series: BTreeMap<&str, Vec<&Point>> = BTreeMap::new();
    for point in &precision.points {
        series.entry(&point.structure).or_default().push(point);
    }
    for (i, (structure, points)) in series.into_iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        let (safe, unsafe_): (Vec<&Point>, Vec<&Point>) = points
            .into_iter()
            .partition(|p| p.errors.false_negatives == 0);
        let marks = safe.into_iter().filter_map(|point| {
            let size = if point.on_front { 6 } else { 4 };
            Some(Circle::new(place(point)?, size, colour.filled()))
        });
        chart
            .draw_series(marks)?
            .label(structure)
            .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
        // A cross misses something that is visible.
        let crosses = unsafe_.into_iter().filter_map(place);
        chart.draw_series(crosses.map(|at| Cross::new(at, 5, colour.stroke_width(2))))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    root.present()?;
    Ok(())
}
