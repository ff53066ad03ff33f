//! Figures of rows: a value each with its interval, as marks or bars over one axis.

use super::figure::{Axis, CHARACTER, Figure, LINE, class, line, mark};
use super::palette::Look;
use super::text;
use super::text::html;

/// Width of the plot on the narrowest page, px.
const NARROWEST: f64 = 330.0;

/// A row of a figure: a value with up to two ranges around it.
#[derive(Default)]
pub struct Row {
    /// A structure's name, or what else the value belongs to.
    pub name: String,
    pub is_scan: bool,
    pub value: f64,
    /// Its interval, and a range within.
    pub ends: Option<[f64; 2]>,
    pub inner: Option<[f64; 2]>,
    /// Text beside the mark.
    pub label: String,
    /// Text on pointing at it.
    pub note: String,
    /// Further attributes of the group.
    pub data: String,
    /// True if a line joins it with the next row.
    pub is_tied: bool,
}

/// Form of the values of a figure of rows.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Form {
    Marks,
    Bars,
}

/// Rows from above to below over one axis with the line at `one`.
pub fn rows(
    [label, caption]: [String; 2],
    axis: &Axis,
    one: Option<f64>,
    form: Form,
    rows: &[Row],
) -> Figure {
    let bottom = LINE * 1.5 * rows.len() as f64 + 8.0;
    let y = |row: usize| LINE * (1.5 * row as f64 + 1.0);
    let mut parts = String::new();
    for tick in axis.all_ticks() {
        let (x, name) = (axis.percent(tick), html(&(axis.shown)(tick)));
        let class = if Some(tick) == one { "one" } else { "grid" };
        parts += &line(class, [x, x], [0.0, bottom]);
        let y = bottom + LINE;
        parts += &format!("<text class=\"tick\" x=\"{x:.2}%\" y=\"{y:.1}\">{name}</text>\n");
    }
    let mut names: Vec<&str> = Vec::new();
    for (n, row) in rows.iter().enumerate() {
        let (x, look, y0) = (axis.percent(row.value), Look::of(&row.name), y(n));
        if let Some(next) = rows.get(n + 1).filter(|_| row.is_tied) {
            parts += &line("tie", [x, axis.percent(next.value)], [y0, y(n + 1)]);
        }
        let known = names.iter().position(|name| *name == row.name);
        let place = known.unwrap_or(names.len());
        if known.is_none() && !row.is_scan {
            names.push(&row.name);
        }
        let class = match form {
            Form::Marks => class(look, row.is_scan, place),
            Form::Bars => "c0".to_owned(),
        };
        let range = |ends: Option<[f64; 2]>| ends.map(|ends| ends.map(|end| axis.percent(end)));
        let ends = range(row.ends);
        let mut shape = text::some(ends, |ends| line("interval", ends, [y0, y0]));
        shape += &text::some(range(row.inner), |ends| line("inner", ends, [y0, y0]));
        shape += &match form {
            Form::Marks => mark(look, "", [x, y0], ""),
            Form::Bars => format!(
                "<rect class=\"bar\" width=\"{x:.2}%\" height=\"{LINE}\" y=\"{:.1}\"/>",
                y0 - LINE / 2.0
            ),
        };
        // A label stands where there is room on the narrowest page, or below.
        let [low, high] = ends.unwrap_or([x, x]);
        let length = CHARACTER * row.label.chars().count() as f64 / NARROWEST * 100.0;
        let (anchor, at, by, below) = match form {
            Form::Marks if x > 50.0 && low > length => ("end", low, -10, 4.0),
            Form::Marks if high + length > 100.0 && low > length => ("end", low, -10, 4.0),
            Form::Marks if high + length > 100.0 => {
                let half = (length / 2.0).min(50.0);
                ("middle", x.clamp(half, 100.0 - half), 0, 15.0)
            }
            _ => ("start", high, 10, 4.0),
        };
        let data = match form {
            Form::Marks => format!(" data-s=\"{}\"{}", html(&row.name), row.data),
            Form::Bars => String::new(),
        };
        parts += &format!(
            "<g class=\"s {class}\"{data}><title>{}</title>{shape}<text x=\"{at:.2}%\" \
             y=\"{:.1}\" dx=\"{by}\" text-anchor=\"{anchor}\">{}</text></g>\n",
            html(&row.note),
            y0 + below,
            html(&row.label),
        );
    }
    let longest = rows.iter().map(|row| row.label.chars().count()).max();
    Figure {
        label,
        caption,
        margins: match form {
            Form::Marks => [12.0, 12.0],
            Form::Bars => [12.0, 16.0 + CHARACTER * longest.unwrap_or(0) as f64],
        },
        height: bottom + 1.5 * LINE,
        parts,
        legend: (String::new(), 0.0),
    }
}
