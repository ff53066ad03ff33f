//! Common parts of SVG figures: axes, marks, and the forms on pages and in files.
//!
//! Horizontal positions are percentages of the plot, so that text keeps its size at every width;
//! margins beside the plot are in pixels. Marks carry their figures as `data-` attributes. The same
//! figure is part of a page or, with its style, a file.

use std::iter::successors;
use std::ops::Range;

use super::text::{self, html, shortened};
use crate::statistics::Estimate;

/// Number of series of a figure in full colour; the others are faint.
pub const STRONG: usize = 8;
/// Least distance of two lines of text, px.
pub const LINE: f64 = 16.0;
/// Approximate width of a character for margins, px.
pub const CHARACTER: f64 = 6.8;
/// Widths of a picture with one figure per row, and of each of several, px.
const WIDTHS: [f64; 2] = [900.0, 460.0];

/// Returns true for a value with a place on a logarithmic axis.
///
/// The limits are far beyond any measurement. Near the limits of floating point, steps along an
/// axis would never reach its end.
pub fn is_drawn(value: f64) -> bool {
    (1e-30..1e30).contains(&value)
}

/// Ends of an interval, if both have a place on a logarithmic axis.
pub fn ends(value: Estimate) -> Option<[f64; 2]> {
    (value.ends()).filter(|ends| ends.iter().all(|end| is_drawn(*end)))
}

/// Note in a caption about points that are not drawn.
pub fn left_out(count: usize) -> String {
    text::any(count, "point", |points| {
        format!(" ({points} beyond the axis left out)")
    })
}

/// One axis: its title, range, and the text of a tick.
pub struct Axis<'t> {
    pub title: &'t str,
    values: Range<f64>,
    is_log: bool,
    /// Ticks that are not powers or round numbers.
    pub ticks: Vec<f64>,
    pub shown: &'t dyn Fn(f64) -> String,
}

impl<'t> Axis<'t> {
    /// A logarithmic axis around all values with a place on it, extended by `factor`.
    pub fn log(
        title: &'t str,
        values: impl Iterator<Item = f64>,
        factor: f64,
        shown: &'t dyn Fn(f64) -> String,
    ) -> Axis<'t> {
        let values = values.filter(|value| is_drawn(*value));
        let ends = values.map(|value| [value; 2]);
        let ends = ends.reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]);
        let [least, most] = ends.unwrap_or([1.0; 2]);
        Axis {
            values: least / factor..most * factor,
            is_log: true,
            ..Axis::linear(title, 0.0..1.0, shown)
        }
    }

    /// An axis with equal steps over a range.
    pub fn linear(title: &'t str, values: Range<f64>, shown: &'t dyn Fn(f64) -> String) -> Self {
        let end = values.end.max(values.start + 1.0);
        Axis {
            title,
            values: values.start..end,
            is_log: false,
            ticks: Vec::new(),
            shown,
        }
    }

    /// The share of the axis before a value, 0 to 1.
    pub fn along(&self, value: f64) -> f64 {
        let Range { start, end } = self.values;
        let along = match self.is_log {
            true => (value / start).ln() / (end / start).ln(),
            false => (value - start) / (end - start),
        };
        along.clamp(0.0, 1.0)
    }

    pub fn percent(&self, value: f64) -> f64 {
        100.0 * self.along(value)
    }

    /// At most about seven powers of `base` within the range.
    pub fn powers(&self, base: f64) -> Vec<f64> {
        let [first, last] = [self.values.start, self.values.end].map(|v| v.log(base));
        let step = ((last - first) / 7.0).ceil().max(1.0);
        let least = (first / step).ceil() * step;
        let powers = successors(Some(least), |power| Some(power + step));
        let powers = powers.take_while(|power| *power <= last);
        powers.map(|power| base.powf(power)).collect()
    }

    /// The given ticks, or powers of ten.
    ///
    /// Within less than two decades 1, 2, 5 of each, or equal steps.
    pub fn all_ticks(&self) -> Vec<f64> {
        if !self.ticks.is_empty() {
            return self.ticks.clone();
        }
        let Range { start, end } = self.values;
        if self.is_log {
            let powers = self.powers(10.0);
            let below = powers.first().map_or(1.0, |first| first / 10.0);
            let all = [below].into_iter().chain(powers.clone());
            let finer = all.flat_map(|power| [power, 2.0 * power, 5.0 * power]);
            let finer: Vec<f64> = finer.filter(|t| (start..=end).contains(t)).collect();
            match (powers.len(), finer.len()) {
                (3.., _) => return powers,
                (_, 3..) => return finer,
                _ => {}
            }
        }
        round_values([start, end], 5.0).1
    }

    /// Grid lines down to `bottom`, and labels below that do not overlap.
    pub fn across(&self, one: Option<f64>, bottom: f64) -> String {
        let (mut parts, mut free) = (String::new(), -LINE);
        for tick in self.all_ticks() {
            let (x, name) = (self.percent(tick), (self.shown)(tick));
            let class = if Some(tick) == one { "one" } else { "grid" };
            parts += &line(class, [x, x], [0.0, bottom]);
            // Percent of the narrowest plot.
            let half = 50.0 * CHARACTER * name.chars().count() as f64 / 150.0;
            if x - half >= free {
                free = x + half;
                let (y, name) = (bottom + LINE, html(&name));
                parts +=
                    &format!("<text class=\"tick\" x=\"{x:.2}%\" y=\"{y:.1}\">{name}</text>\n");
            }
        }
        parts
    }
}

/// About `count` round values within a range, and the step between them.
pub fn round_values([low, high]: [f64; 2], count: f64) -> (f64, Vec<f64>) {
    let rough = (high - low) / count;
    let power = 10f64.powf(rough.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power);
    let step = steps.into_iter().find(|step| *step >= rough);
    let step = step.unwrap_or(rough);
    let first = (low / step).ceil();
    let values = (0..12).map(|n| (first + f64::from(n)) * step + 0.0);
    (step, values.take_while(|value| *value <= high).collect())
}

/// Colour and mark of a structure.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Look {
    /// Index of the class `cN` in `assets/figure.css`.
    pub colour: usize,
    /// Index into [`SHAPES`].
    pub shape: usize,
    /// Outlined; structures with their own look are filled.
    pub hollow: bool,
}

/// Corners of marks around the origin: disc, square, diamond, triangle.
const SHAPES: [&str; 4] = [
    "-2,-5 2,-5 5,-2 5,2 2,5 -2,5 -5,2 -5,-2",
    "-4,-4 4,-4 4,4 -4,4",
    "0,-6 6,0 0,6 -6,0",
    "0,-6 6,4 -6,4",
];

/// Colour of scans.
const GREY: usize = 7;

/// Structures with their own look: name, colour, shape.
const OWN: [(&str, usize, usize); 9] = [
    ("wide", 0, 0),
    ("bvh", 1, 1),
    ("octree", 2, 2),
    ("bsp", 3, 3),
    ("quadtree", 4, 1),
    ("uniform-grid", 5, 2),
    ("moving", 6, 3),
    ("linear", GREY, 0),
    ("linear-scalar", GREY, 2),
];

impl Look {
    /// The look of series `n` that is not a structure.
    pub fn nth(n: usize) -> Look {
        Look {
            colour: n % GREY,
            shape: n % SHAPES.len(),
            hollow: n >= GREY,
        }
    }

    /// The look of a structure by its label.
    ///
    /// Names without their own look get a hollow mark derived from their text. With parameters or a
    /// policy a structure keeps its colour and gets another mark, hollow.
    pub fn of(label: &str) -> Look {
        // FNV-1a.
        let hash = |text: &str| {
            text.bytes().fold(0x811c_9dc5_u32, |hash, byte| {
                (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
            }) as usize
        };
        let (name, rest) = label.split_at(label.find(['@', ':']).unwrap_or(label.len()));
        let own = OWN.iter().find(|own| own.0 == name);
        let other = [1 + hash(rest) % (SHAPES.len() - 1), 0][usize::from(rest.is_empty())];
        Look {
            colour: own.map_or(hash(name) % GREY, |own| own.1),
            shape: (own.map_or(hash(name) / GREY, |own| own.2) + other) % SHAPES.len(),
            hollow: own.is_none() || other > 0,
        }
    }
}

/// The mark of a structure with its tooltip, at `x` in percent and `y` in pixels.
pub fn mark(look: Look, kind: &str, [x, y]: [f64; 2], note: &str) -> String {
    let class = if look.hollow { "mark hollow" } else { "mark" };
    let corners = SHAPES[look.shape];
    let note = Some(note).filter(|note| !note.is_empty());
    let note = text::some(note, |note| format!("<title>{}</title>", html(note)));
    format!(
        "<svg x=\"{x:.2}%\" y=\"{y:.1}\" overflow=\"visible\"><polygon class=\"{class}{kind}\" \
         points=\"{corners}\">{note}</polygon></svg>"
    )
}

pub fn line(class: &str, [x1, x2]: [f64; 2], [y1, y2]: [f64; 2]) -> String {
    format!(
        "<line class=\"{class}\" x1=\"{x1:.2}%\" x2=\"{x2:.2}%\" y1=\"{y1:.1}\" y2=\"{y2:.1}\"/>"
    )
}

/// Class of a series by its index in the order of importance; scans are grey.
pub fn class(look: Look, is_scan: bool, place: usize) -> String {
    match place < STRONG {
        _ if is_scan => "c7".to_owned(),
        true => format!("c{}", look.colour),
        false => format!("c{} weak", look.colour),
    }
}

/// A drawn figure.
pub struct Figure {
    pub caption: String,
    /// Pixels left and right of the plot.
    pub margins: [f64; 2],
    pub height: f64,
    pub parts: String,
    /// Marks with names for pictures, and their height; a page has a filter instead.
    pub legend: (String, f64),
}

impl Figure {
    /// The figure as a part of a page.
    pub fn inline(&self) -> String {
        let ([left, right], caption) = (self.margins, html(&self.caption));
        format!(
            "<svg class=\"plot\" role=\"img\" style=\"margin-left:{left:.0}px;width:calc(100% - \
             {:.0}px)\" height=\"{:.0}\" aria-label=\"{caption}\">\n{}</svg>\
             <figcaption>{caption}</figcaption>",
            left + right,
            self.height,
            self.parts,
        )
    }
}

/// A picture of several figures, `columns` in a row.
pub fn picture(figures: &[Figure], columns: usize) -> String {
    let width = WIDTHS[usize::from(columns > 1)];
    let (mut parts, mut y) = (String::new(), 12.0);
    for row in figures.chunks(columns) {
        let mut height = 0f64;
        for (column, figure) in row.iter().enumerate() {
            let x = 12.0 + width * column as f64;
            let lines = text::wrapped(&shortened(&figure.caption, 400), (width / 7.4) as usize);
            for (n, line) in lines.lines().enumerate() {
                let y = y + LINE * (n + 1) as f64;
                parts += &format!("<text x=\"{x}\" y=\"{y}\">{}</text>\n", html(line));
            }
            let caption = LINE * (lines.lines().count() + 1) as f64;
            let [left, right] = figure.margins;
            let (x, y, width) = (x + left, y + caption, width - 24.0 - left - right);
            let (below, own) = (&figure.legend.0, figure.height + figure.legend.1);
            parts += &format!(
                "<svg x=\"{x:.0}\" y=\"{y:.0}\" width=\"{width:.0}\" height=\"{own:.0}\" \
                 overflow=\"visible\">\n{}{below}</svg>\n",
                figure.parts
            );
            height = height.max(caption + own + 12.0);
        }
        y += height;
    }
    let width = width * columns.min(figures.len()).max(1) as f64;
    // Programs other than browsers do not resolve variables.
    let style = include_str!("assets/figure.css").replace("var(--bg)", "#fff");
    let style = style.replace("var(--fg)", "#1b1d21");
    let style = style.replace("var(--soft)", "#5c636e");
    let style = style.replace("var(--rule)", "#d8dbe0");
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{y:.0}\" \
         viewBox=\"0 0 {width} {y:.0}\" font-family=\"sans-serif\" color=\"#1b1d21\">\n\
         <style>{style}</style>\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n{parts}</svg>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(values: Range<f64>, is_log: bool) -> Axis<'static> {
        Axis {
            title: "",
            values,
            is_log,
            ticks: Vec::new(),
            shown: &|value| value.to_string(),
        }
    }

    #[test]
    fn ticks_are_few_and_within_the_axis() {
        assert_eq!(axis(0.4..9.0, true).powers(2.0), [0.5, 1.0, 2.0, 4.0, 8.0]);
        assert!(axis(1e-30..1e30, true).powers(2.0).len() <= 8);
        assert_eq!(axis(1.0..100.0, true).percent(10.0), 50.0);
        assert_eq!(axis(0.5..2e3, true).all_ticks(), [1.0, 10.0, 100.0, 1000.0]);
        assert_eq!(axis(1.5..30.0, true).all_ticks(), [2.0, 5.0, 10.0, 20.0]);
        let fifths = axis(1.1..1.9, true).all_ticks();
        let near = |(found, wanted): (&f64, f64)| (found - wanted).abs() < 1e-9;
        assert!(fifths.len() == 4 && fifths.iter().zip([1.2, 1.4, 1.6, 1.8]).all(near));
        assert_eq!(axis(0.0..31.0, false).all_ticks(), [0.0, 10.0, 20.0, 30.0]);
    }

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
        let range = |values: &[f64]| {
            let shown = |value: f64| value.to_string();
            Axis::log("", values.iter().copied(), 2.0, &shown).values
        };
        for value in extremes {
            assert!(!is_drawn(value), "{value}");
            assert_eq!(range(&[value, 20.0, 500.0]), 10.0..1000.0, "{value}");
            assert_eq!(range(&[value]), 0.5..2.0);
        }
        assert_eq!(left_out(0), "");
        assert_eq!(left_out(1), " (1 point beyond the axis left out)");
    }

    #[test]
    fn looks_of_their_own_differ_and_others_are_hollow() {
        let own = OWN.map(|(name, ..)| Look::of(name));
        for (n, look) in own.iter().enumerate() {
            assert!(!own[..n].contains(look), "{look:?}");
        }
        let other = Look::of("peer-bvh");
        assert!(other.hollow && other.colour < GREY && other == Look::of("peer-bvh"));
        let names = ["wide", "bvh", "moving", "bsp-textbook", "peer-bvh"].map(Look::of);
        for (n, look) in names.iter().enumerate() {
            assert!(!names[..n].contains(look), "{look:?}");
        }
        // Parameters and policies keep the colour, and have their own marks.
        for name in ["wide", "bvh", "peer-bvh"] {
            let looks =
                ["", "@rebuild", "@every=10"].map(|rest| Look::of(&format!("{name}{rest}")));
            assert!(looks.iter().all(|look| look.colour == looks[0].colour));
            assert!(looks[1].hollow && looks[2].hollow);
            let shapes = looks.map(|look| look.shape);
            assert!(shapes[0] != shapes[1] && shapes[0] != shapes[2] && shapes[1] != shapes[2]);
        }
    }
}
