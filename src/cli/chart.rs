//! Parts of every picture: SVG, colours, legends, and diagrams with two logarithmic
//! axes, whose ranges always have an end.

use std::error::Error;
use std::ops::Range;

use anyhow::anyhow;
use plotters::chart::ChartContext;
use plotters::coord::combinators::LogCoord;
use plotters::coord::{CoordTranslate, Shift};
use plotters::prelude::*;

use super::text;

/// Outcome of drawing.
pub type Drawn = Result<(), Box<dyn Error>>;

/// Part of a picture.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// A diagram with two logarithmic axes.
type LogLog<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<LogCoord<f64>, LogCoord<f64>>>;

/// One axis: its title, range and text of a tick.
pub type Axis<'t> = (&'t str, Range<f64>, &'t dyn Fn(f64) -> String);

/// Draws the caption and the axes, x and y, of a diagram with two logarithmic axes.
pub fn log_log<'a, 'b: 'a>(
    area: &'a Area<'b>,
    caption: &str,
    [x, y]: [Axis; 2],
) -> Result<LogLog<'a, 'b>, Box<dyn Error>> {
    let mut chart = ChartBuilder::on(area)
        .caption(caption, ("sans-serif", 18))
        .margin(14)
        .x_label_area_size(44)
        .y_label_area_size(72)
        .build_cartesian_2d(x.1.log_scale(), y.1.log_scale())?;
    chart
        .configure_mesh()
        .light_line_style(WHITE.mix(0.0))
        .x_desc(x.0)
        .y_desc(y.0)
        .x_label_formatter(&|value| x.2(*value))
        .y_label_formatter(&|value| y.2(*value))
        .draw()?;
    Ok(chart)
}

/// Draws the legend of all labelled series.
pub fn legend<'a, 'b: 'a, C: CoordTranslate>(
    chart: &mut ChartContext<'a, SVGBackend<'b>, C>,
    position: SeriesLabelPosition,
) -> Drawn {
    let mut legend = chart.configure_series_labels();
    legend.position(position).border_style(BLACK.mix(0.3));
    Ok(legend.background_style(WHITE.mix(0.8)).draw()?)
}

/// A picture of `size` pixels on white, as lines of SVG. `what` names it in the
/// error.
pub fn svg(
    what: &str,
    size: (u32, u32),
    draw: impl FnOnce(&Area) -> Drawn,
) -> anyhow::Result<String> {
    let mut svg = String::new();
    let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
    let drawn = || -> Drawn {
        root.fill(&WHITE)?;
        draw(&root)?;
        Ok(root.present()?)
    };
    drawn().map_err(|error| anyhow!("{what} cannot be drawn: {error}"))?;
    drop(root);
    Ok(text::lines(&svg))
}

/// Values with a place on a logarithmic axis, far beyond anything measured. Near
/// the ends of floating point, steps along an axis would never come to its end.
const DRAWN: Range<f64> = 1e-30..1e30;

/// Returns true for a value with a place on a logarithmic axis.
pub fn is_drawn(value: f64) -> bool {
    DRAWN.contains(&value)
}

/// A range around all values that have a place, wider by a factor at either end;
/// around 1 if there are none.
pub fn around(values: impl Iterator<Item = f64>, below: f64, above: f64) -> Range<f64> {
    let (least, most) = values
        .filter(|value| is_drawn(*value))
        .fold((f64::INFINITY, 0.0f64), |(least, most), value| {
            (least.min(value), most.max(value))
        });
    match least <= most {
        true => least / below..most * above,
        false => 1.0 / below..above,
    }
}

/// Note in a caption on points that are not drawn.
pub fn left_out(count: usize) -> String {
    match count {
        0 => String::new(),
        _ => format!(
            " ({} beyond the axis left out)",
            text::counted(count, "point")
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_axis_has_a_beginning_and_an_end() {
        let extremes = [
            1e308,
            f64::MAX,
            f64::INFINITY,
            5e-324,
            f64::MIN_POSITIVE,
            0.0,
            -1.0,
            f64::NAN,
        ];
        for value in extremes {
            assert!(!is_drawn(value), "{value}");
            let range = around([value, 20.0, 500.0].into_iter(), 2.0, 2.0);
            assert_eq!(range, 10.0..1000.0, "{value}");
            assert_eq!(around([value].into_iter(), 2.0, 4.0), 0.5..4.0);
        }
        assert_eq!(left_out(0), "");
        assert_eq!(left_out(1), " (1 point beyond the axis left out)");
    }
}
