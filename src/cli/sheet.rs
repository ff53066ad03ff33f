//! A part of the plane on paper, with axes in the scene's units and a legend below.

use std::fmt::Write;

use super::text::html;

/// Low and high x and y.
pub type Rect = [f64; 4];

/// Longer side of the drawing in pixels.
pub const SIDE: f64 = 800.0;
/// Room for the labels of the axes, and for the caption.
const LEFT: f64 = 84.0;
const TOP: f64 = 36.0;
const LINE: f64 = 20.0;

pub fn centre([x0, y0, x1, y1]: Rect) -> [f64; 2] {
    [x0 + (x1 - x0) / 2.0, y0 + (y1 - y0) / 2.0]
}

pub fn union(a: Rect, b: Rect) -> Rect {
    [
        a[0].min(b[0]),
        a[1].min(b[1]),
        a[2].max(b[2]),
        a[3].max(b[3]),
    ]
}

pub fn united(all: impl IntoIterator<Item = Rect>) -> Option<Rect> {
    all.into_iter().reduce(union)
}

pub fn longest([x0, y0, x1, y1]: Rect) -> f64 {
    (x1 - x0).max(y1 - y0)
}

pub fn at([x, y]: [f64; 2]) -> Rect {
    [x, y, x, y]
}

/// A number of pixels with one decimal.
pub fn px(value: f64) -> f64 {
    (value * 10.0).round() / 10.0 + 0.0
}

/// The plane on paper.
pub struct Sheet {
    window: Rect,
    /// Pixels per unit.
    pub scale: f64,
    size: [f64; 2],
}

impl Sheet {
    /// A sheet for a window, with a margin.
    ///
    /// Never without extent, and at most three times as long as wide.
    pub fn over(window: Rect) -> Sheet {
        let [x, y] = centre(window);
        let length = longest(window);
        let least = x.abs().max(y.abs()) * 1e-9;
        let length = match length.is_finite() && length > least {
            true => length,
            false => least.max(1.0),
        };
        let sides = [window[2] - window[0], window[3] - window[1]];
        let [w, h] = sides.map(|side| 1.06 * side.max(length / 3.0).min(length));
        let scale = SIDE / w.max(h);
        Sheet {
            window: [x - w / 2.0, y - h / 2.0, x + w / 2.0, y + h / 2.0],
            scale,
            size: [w * scale, h * scale],
        }
    }

    /// Pixels of a point: y is up in the scene and down on the sheet.
    pub fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let place = [
            (x - self.window[0]) * self.scale,
            (self.window[3] - y) * self.scale,
        ];
        place.map(px)
    }

    /// Adds a rectangle to a path, at least one pixel wide and high, cut off beyond the
    /// sheet.
    pub fn push_rect(&self, [x0, y0, x1, y1]: Rect, path: &mut String) {
        let sides = [
            (x0 - self.window[0], x1 - self.window[0], self.size[0]),
            (self.window[3] - y1, self.window[3] - y0, self.size[1]),
        ];
        let [(x, w), (y, h)] = sides.map(|(low, high, size)| {
            let [low, high] = [low, high].map(|v| (v * self.scale).clamp(-9.0, size + 9.0));
            let thin = (1.0 - (high - low)).max(0.0) / 2.0;
            (px(low - thin), px(high - low + 2.0 * thin))
        });
        let _ = write!(path, "M{x} {y}h{w}v{h}h-{w}z");
    }

    /// The whole picture.
    pub fn finished(
        &self,
        caption: &str,
        [across, along, unit]: [&str; 3],
        body: &str,
        legend: &[(String, String)],
        notes: &[String],
    ) -> String {
        let [w, h] = self.size.map(px);
        let width = LEFT + w.max(0.6 * SIDE) + 20.0;
        let rows = legend.len().div_ceil(2);
        let below = TOP + h + 56.0;
        let height = below + LINE * (rows + notes.len()) as f64 + 6.0;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" \
             width=\"{width:.0}\" height=\"{height:.0}\" font-family=\"sans-serif\" font-size=\"13\" \
             role=\"img\" aria-label=\"{0}\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
             <text x=\"{LEFT}\" y=\"22\" font-size=\"16\">{0}</text>\n<svg x=\"{LEFT}\" y=\"{TOP}\" \
             width=\"{w}\" height=\"{h}\">\n{body}</svg>\n<rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{w}\" \
             height=\"{h}\" fill=\"none\" stroke=\"#888\"/>\n",
            html(caption),
        );
        let bottom = TOP + h;
        for (value, label) in ticks(self.window[0], self.window[2]) {
            let x = px(LEFT + self.at([value, 0.0])[0]);
            let _ = writeln!(
                svg,
                "<path stroke=\"#888\" d=\"M{x} {bottom}v5\"/><text x=\"{x}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
                bottom + 19.0
            );
        }
        for (value, label) in ticks(self.window[1], self.window[3]) {
            let y = px(TOP + self.at([0.0, value])[1]);
            let _ = writeln!(
                svg,
                "<path stroke=\"#888\" d=\"M{LEFT} {y}h-5\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
                LEFT - 8.0,
                y + 4.0
            );
        }
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{across}, in {unit}</text>\n\
             <text transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\">{along}</text>",
            LEFT + w / 2.0,
            bottom + 36.0,
            TOP + h / 2.0
        );
        for (place, (swatch, words)) in legend.iter().enumerate() {
            let x = LEFT + (place / rows) as f64 * (width - LEFT) / 2.0;
            let y = below + LINE * (place % rows) as f64;
            let _ = writeln!(
                svg,
                "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"14\" height=\"12\" {swatch}/><text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                x + 20.0,
                y + 11.0,
                html(words)
            );
        }
        for (row, note) in notes.iter().enumerate() {
            let y = below + LINE * (rows + row) as f64 + 11.0;
            let _ = writeln!(
                svg,
                "<text x=\"{LEFT}\" y=\"{y:.1}\" fill=\"#555\">{}</text>",
                html(note)
            );
        }
        svg + "</svg>\n"
    }
}

/// About six round values within a range, with their labels.
pub fn ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let rough = (high - low) / 6.0;
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power);
    let step = step
        .into_iter()
        .find(|step| *step >= rough)
        .unwrap_or(rough);
    let first = (low / step).ceil();
    let values = (0..12).map(|n| (first + f64::from(n)) * step + 0.0);
    let decimals = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
    let label = |value: f64| match value.abs().max(step) < 1e7 && step > 1e-7 {
        true => format!("{value:.decimals$}"),
        false => format!("{value:e}"),
    };
    values
        .take_while(|value| *value <= high)
        .map(|value| (value, label(value)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_few() {
        let labels = |low, high| ticks(low, high).into_iter().map(|(_, label)| label);
        assert!(labels(-3.0, 101.0).eq(["0", "20", "40", "60", "80", "100"]));
        assert!(labels(-0.011, 0.012).eq(["-0.010", "-0.005", "0.000", "0.005", "0.010"]));
        for (low, high) in [(0.0, f64::MAX), (1e300, 1e300 * 1.1), (0.0, 5e-324)] {
            assert!(ticks(low, high).len() <= 12, "{low} {high}");
        }
    }
}
