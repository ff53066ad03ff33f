//! What the pictures share: how one becomes a file, their colours, and logarithmic
//! axes, from the values to a range that always has an end, and which values have a
//! place on it.

use std::error::Error;
use std::ops::Range;

use anyhow::anyhow;
use plotters::coord::Shift;
use plotters::prelude::*;

use super::text;

/// What drawing ends with.
pub type Drawn = Result<(), Box<dyn Error>>;

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

/// A picture of that size on white, as lines of SVG; `what` it is, if it cannot be
/// drawn.
pub fn svg(
    what: &str,
    size: (u32, u32),
    draw: impl FnOnce(&DrawingArea<SVGBackend, Shift>) -> Drawn,
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

/// What a figure can be and mean something: from far below a nanosecond to the
/// age of the universe in nanoseconds, and then some. Beyond the range of
/// floating point, steps along an axis would never come to its end.
const DRAWN: Range<f64> = 1e-30..1e30;

/// Whether a value has a place on a logarithmic axis.
pub fn is_drawn(value: f64) -> bool {
    DRAWN.contains(&value)
}

/// A range around all values that have a place, wider by a factor at either
/// end; around 1 if none has.
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

/// What a picture says of values that it leaves out.
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
