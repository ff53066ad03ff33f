//! The picture of `cullbench drift --svg`: position error against time of the spring
//! arms, one panel per arm, stiffness and frame rate.

use plotters::prelude::*;

use super::chart::{Area, Axis, COLOURS, Drawn, around, is_drawn, legend, log_log, svg};
use super::text;
use crate::drift::{ArmPoint, ArmReport};

/// Size of one panel.
const SIZE: (u32, u32) = (460, 340);

/// Time and error, if the point has both.
fn place(point: &ArmPoint) -> Option<(f64, f64)> {
    // A logarithmic axis has no zero.
    let place = (point.us_per_second?, point.position_error?.max(1e-16));
    (is_drawn(place.0) && is_drawn(place.1)).then_some(place)
}

/// The diagram as SVG: a row per arm and stiffness, a column per rate.
pub fn draw(report: &ArmReport) -> anyhow::Result<String> {
    let points = &report.points;
    let settings: Vec<_> = points.chunk_by(|a, b| a.setting == b.setting).collect();
    let key = |own: &&[ArmPoint]| (own[0].setting.arm, own[0].setting.stiffness);
    let rows = settings.chunk_by(|a, b| key(a) == key(b)).count().max(1);
    let columns = settings.len().div_ceil(rows).max(1);
    let size = (SIZE.0 * columns as u32, SIZE.1 * rows as u32);
    svg("the diagram", size, |root| {
        let panels = root.split_evenly((rows, columns));
        let mut both = panels.iter().zip(settings);
        both.try_for_each(|(area, own)| panel(area, own))
    })
}

fn panel(area: &Area, points: &[ArmPoint]) -> Drawn {
    let places = || points.iter().filter_map(place);
    let setting = points[0].setting;
    let (arm, k, rate) = (setting.arm.name(), setting.stiffness, setting.rate_hz);
    let caption = format!("{arm} arm, k = {k:e}/s2, {rate} Hz");
    let times = around(places().map(|p| p.0), 1.5, 1.5);
    let errors = around(places().map(|p| p.1), 2.0, 2.0);
    let axes: [Axis; 2] = [
        ("us of CPU per simulated second", times, &text::significant),
        ("position error", errors, &|error| format!("{error:.0e}")),
    ];
    let mut chart = log_log(area, &caption, axes)?;
    for (own, colour) in points.chunk_by(|a, b| a.method == b.method).zip(COLOURS) {
        let places: Vec<(f64, f64)> = own.iter().filter_map(place).collect();
        let dots = places.iter().map(|&at| Circle::new(at, 3, colour.filled()));
        chart
            .draw_series(LineSeries::new(places.clone(), colour))?
            .label(own[0].method)
            .legend(move |(x, y)| Circle::new((x, y), 3, colour.filled()));
        chart.draw_series(dots)?;
    }
    legend(&mut chart, SeriesLabelPosition::UpperRight)
}
