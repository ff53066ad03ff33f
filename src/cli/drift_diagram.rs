//! The picture of `cullbench drift --svg`: work against precision of the spring arms,
//! one panel per arm and stiffness at the frame rate in the middle. It draws what was
//! measured and decides nothing.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::picture::{COLOURS, Drawn, around, is_drawn, svg};
use super::text;
use crate::drift::{ArmPoint, ArmReport, FrameTimes, Information, Setting};

/// Of one panel.
const SIZE: (u32, u32) = (460, 340);
/// Height for the names of the methods.
const LEGEND: u32 = 70;
/// Names in one line of the legend.
const IN_LINE: usize = 7;

/// Time and error, if the point has both.
fn place(point: &ArmPoint) -> Option<(f64, f64)> {
    // A logarithmic axis has no zero.
    let place = (point.us_per_second?, point.position_error?.max(1e-16));
    (is_drawn(place.0) && is_drawn(place.1)).then_some(place)
}

/// The diagram as SVG.
pub fn draw(report: &ArmReport) -> anyhow::Result<String> {
    let rate = report.middle_rate_hz();
    let shown: Vec<&Setting> = report
        .choices
        .iter()
        .map(|choice| &choice.setting)
        .filter(|setting| Some(setting.rate_hz) == rate)
        .collect();
    let rows = shown.chunk_by(|a, b| a.arm == b.arm).count().max(1);
    let columns = shown.len().div_ceil(rows).max(1);
    let size = (SIZE.0 * columns as u32, SIZE.1 * rows as u32 + LEGEND);
    let grid = (rows, columns);
    svg("the diagram", size, |root| {
        let (panels, names) = root.split_vertically(size.1 - LEGEND);
        draw_panels(&panels.split_evenly(grid), &shown, report)?;
        legend(&names, &report.method_names())
    })
}

fn draw_panels(
    panels: &[DrawingArea<SVGBackend, Shift>],
    shown: &[&Setting],
    report: &ArmReport,
) -> Drawn {
    let methods = report.method_names();
    for (area, setting) in panels.iter().zip(shown.iter().copied()) {
        let points: Vec<&ArmPoint> = report
            .points
            .iter()
            .filter(|p| p.setting == *setting && p.frame_times == FrameTimes::Jittered)
            .collect();
        let told = report.information.iter().find(|told| {
            told.setting == *setting
                && told.frame_times == FrameTimes::Jittered
                && told.information == Information::FrameEnds
        });
        panel(
            area,
            setting,
            &points,
            told.map(|told| told.position_error),
            &methods,
        )?;
    }
    Ok(())
}

/// Colours come round: the second turn is thin.
fn style(method: usize) -> ShapeStyle {
    let colour = COLOURS[method % COLOURS.len()];
    colour.stroke_width(if method < COLOURS.len() { 2 } else { 1 })
}

fn panel(
    area: &DrawingArea<SVGBackend, Shift>,
    setting: &Setting,
    points: &[&ArmPoint],
    told: Option<f64>,
    methods: &[&str],
) -> Drawn {
    let places = || points.iter().filter_map(|point| place(point));
    let times = around(places().map(|p| p.0), 1.5, 1.5);
    let errors = places().map(|p| p.1).chain(told);
    let errors = around(errors, 2.0, 2.0);
    let caption = format!(
        "{} arm, k = {:e}/s2, {} Hz",
        setting.arm.name(),
        setting.stiffness,
        setting.rate_hz
    );
    let mut chart = ChartBuilder::on(area)
        .caption(caption, ("sans-serif", 14))
        .margin(8)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(times.clone().log_scale(), errors.log_scale())?;
    chart
        .configure_mesh()
        .light_line_style(WHITE.mix(0.0))
        .x_desc("us of CPU per simulated second")
        .y_desc("position error")
        .x_label_formatter(&|x| text::significant(*x))
        .y_label_formatter(&|y| format!("{y:.0e}"))
        .draw()?;
    if let Some(told) = told {
        let line = [(times.start, told), (times.end, told)];
        chart.draw_series(LineSeries::new(line, BLACK.mix(0.3)))?;
    }
    for (i, method) in methods.iter().enumerate() {
        for arithmetic in ["f64", "f32"] {
            let own = points.iter();
            let own = own.filter(|p| p.method == *method && p.arithmetic == arithmetic);
            let places: Vec<(f64, f64)> = own.filter_map(|p| place(p)).collect();
            // A ring is f32.
            let mark = match arithmetic {
                "f64" => style(i).filled(),
                _ => style(i),
            };
            chart.draw_series(LineSeries::new(places.clone(), style(i)))?;
            chart.draw_series(places.into_iter().map(|at| Circle::new(at, 3, mark)))?;
        }
    }
    Ok(())
}

fn legend(area: &DrawingArea<SVGBackend, Shift>, methods: &[&str]) -> Drawn {
    let text_style = ("sans-serif", 13).into_font();
    let width = area.dim_in_pixel().0 as i32 / IN_LINE as i32;
    for (i, method) in methods.iter().enumerate() {
        let at = (
            (i % IN_LINE) as i32 * width + 20,
            (i / IN_LINE) as i32 * 18 + 6,
        );
        area.draw(&PathElement::new(
            [(at.0, at.1 + 6), (at.0 + 18, at.1 + 6)],
            style(i),
        ))?;
        area.draw(&Text::new(
            method.to_string(),
            (at.0 + 24, at.1),
            text_style.clone(),
        ))?;
    }
    let note =
        "dots f64, rings f32; jittered frames; grey: the exact answer to the target at frame ends";
    let at = (20, methods.len().div_ceil(IN_LINE) as i32 * 18 + 8);
    area.draw(&Text::new(note.to_owned(), at, text_style))?;
    Ok(())
}
