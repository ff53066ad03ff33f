//! Diagrams: series of points over two axes, with their names beside the plot.

use super::figure::{Axis, CHARACTER, Figure, LINE, Look, class, line, mark};
use super::text::{self, html, shortened};
use crate::report::unique;

/// Most characters of a name beside a plot.
const NAME: usize = 20;
/// Usual height of the plot.
const HEIGHT: f64 = 280.0;

/// A point of a diagram.
#[derive(Default)]
pub struct Point {
    pub at: [f64; 2],
    /// Intervals of the vertical and of the horizontal value.
    pub ends: Option<[f64; 2]>,
    pub wide: Option<[f64; 2]>,
    /// Tooltip; empty for none.
    pub note: String,
    /// Name of its height, if it has one.
    pub level: String,
    pub is_cross: bool,
    pub is_large: bool,
}

/// Points with the look of a structure.
pub struct Series {
    pub name: String,
    pub look: Look,
    pub is_scan: bool,
    pub points: Vec<Point>,
}

impl Series {
    /// Points of a structure.
    pub fn of(structure: &str, is_scan: bool, points: Vec<Point>) -> Series {
        Series {
            name: structure.to_owned(),
            look: Look::of(structure),
            is_scan,
            points,
        }
    }
}

/// Rendering of the points of a series.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Joined {
    /// Lines, named at their right ends, with marks.
    Marked,
    /// Lines as in `Marked`, without marks.
    Bare,
    /// Marks alone, with names in a legend.
    Apart,
}

/// Series over two axes, the most important first.
pub struct Diagram<'d> {
    pub caption: String,
    pub axes: [Axis<'d>; 2],
    pub height: f64,
    pub joined: Joined,
    pub series: Vec<Series>,
    /// Corners of a line in front of all series.
    pub front: Vec<[f64; 2]>,
    /// Named heights, beside the plot.
    pub levels: Vec<(f64, String)>,
}

impl<'d> Diagram<'d> {
    /// A diagram of the usual height without front and levels.
    pub fn of(caption: String, axes: [Axis<'d>; 2], joined: Joined, series: Vec<Series>) -> Self {
        Diagram {
            caption,
            axes,
            height: HEIGHT,
            joined,
            series,
            front: Vec::new(),
            levels: Vec::new(),
        }
    }

    /// Height of a value, px.
    pub fn y(&self, value: f64) -> f64 {
        10.0 + (self.height - 20.0) * (1.0 - self.axes[1].along(value))
    }

    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.axes[0].percent(x), self.y(y)]
    }

    pub fn draw(&self) -> Figure {
        let [x_axis, y_axis] = &self.axes;
        let names = self.names();
        let bottom = self.height.max(LINE * (names.len() + 1) as f64);
        let (mut parts, mut left) = (String::new(), 0);
        for tick in y_axis.all_ticks() {
            let (name, y) = ((y_axis.shown)(tick), self.y(tick));
            left = left.max(name.chars().count());
            parts += &line("grid", [0.0, 100.0], [y, y]);
            let (y, name) = (y + 4.0, html(&name));
            parts += &format!("<text class=\"y\" x=\"0\" dx=\"-8\" y=\"{y:.1}\">{name}</text>\n");
        }
        parts += &x_axis.across(None, bottom);
        let mut coloured = 0;
        let classes = self.series.iter().map(|series| {
            let own = class(series.look, series.is_scan, coloured);
            coloured += usize::from(!series.is_scan);
            own
        });
        let classes: Vec<String> = classes.collect();
        // A name beside the plot, with a line to its curve.
        let named = names.iter().map(|(name, [x, y], at)| {
            let (lead, name) = (line("lead", [*x, 100.0], [*y, at - 4.0]), html(name));
            format!("{lead}<text x=\"100%\" dx=\"8\" y=\"{at:.1}\">{name}</text>")
        });
        let named: Vec<String> = named.collect();
        let is_apart = self.joined == Joined::Apart;
        // The most important are drawn last, in front of the others.
        for (n, series) in self.series.iter().enumerate().rev() {
            let name = if is_apart { "" } else { &named[n] };
            parts += &self.group(series, &classes[n], name);
        }
        if !self.front.is_empty() {
            let places = self.front.iter().map(|at| self.place(*at));
            parts += &self.curve("front", &places.collect::<Vec<_>>());
        }
        let height = bottom + 2.5 * LINE;
        let mut legend = (String::new(), 0.0);
        if is_apart {
            let level = |name| format!("<g class=\"level\">{name}</g>\n");
            parts.extend(named.iter().map(level));
            legend = self.legend(&classes, height);
        }
        parts += &format!(
            "<text class=\"title\" x=\"100%\" y=\"{:.1}\" text-anchor=\"end\">{}</text>\n",
            bottom + 2.0 * LINE,
            html(x_axis.title)
        );
        let right = names.iter().map(|name| name.0.chars().count()).max();
        Figure {
            caption: self.caption.clone(),
            margins: [
                14.0 + CHARACTER * left as f64,
                right.map_or(12.0, |most| 22.0 + CHARACTER * most as f64),
            ],
            height,
            parts,
            legend,
        }
    }

    /// A polyline through points, as one shape that is stretched to the width.
    fn curve(&self, class: &str, places: &[[f64; 2]]) -> String {
        let point = |[x, y]: &[f64; 2]| format!("{:.0},{y:.0} ", 10.0 * x);
        let (points, height) = (places.iter().map(point), self.height);
        format!(
            "<svg viewBox=\"0 0 1000 {height}\" preserveAspectRatio=\"none\" width=\"100%\" \
             height=\"{height}\"><polyline class=\"{class}\" points=\"{}\"/></svg>",
            points.collect::<String>().trim_end()
        )
    }

    fn group(&self, series: &Series, class: &str, name: &str) -> String {
        let places: Vec<[f64; 2]> = series.points.iter().map(|p| self.place(p.at)).collect();
        let mut shapes = match self.joined {
            Joined::Apart => String::new(),
            // Without marks, dashes distinguish two curves of one colour.
            Joined::Bare if series.look.hollow => {
                self.curve(&format!("curve d{}", series.look.shape), &places)
            }
            _ => self.curve("curve", &places),
        };
        for (point, place) in series.points.iter().zip(&places) {
            shapes += &text::some(point.ends, |ends| {
                line("interval", [place[0]; 2], ends.map(|end| self.y(end)))
            });
            shapes += &text::some(point.wide, |ends| {
                let ends = ends.map(|end| self.axes[0].percent(end));
                line("interval", ends, [place[1]; 2])
            });
        }
        for (point, place) in series.points.iter().zip(&places) {
            if self.joined != Joined::Bare {
                let kind = match (point.is_cross, point.is_large) {
                    (true, _) => " cross",
                    (_, true) => " large",
                    _ => "",
                };
                shapes += &mark(series.look, kind, *place, &point.note);
            }
        }
        let of = html(&series.name);
        format!("<g class=\"s {class}\" data-s=\"{of}\"><title>{of}</title>{shapes}{name}</g>\n")
    }

    /// Names beside the plot, the ends of their lines, and heights one line apart.
    fn names(&self) -> Vec<(String, [f64; 2], f64)> {
        let named = |name: &str, end| (shortened(name, NAME), end, 0.0);
        let end = |series: &Series| {
            let last = series.points.last().map(|point| self.place(point.at));
            named(&series.name, last.unwrap_or([100.0, self.height]))
        };
        let level = |(at, name): &(f64, String)| named(name, [100.0, self.y(*at)]);
        let mut ends: Vec<(String, [f64; 2], f64)> = match self.joined {
            Joined::Apart => self.levels.iter().map(level).collect(),
            _ => self.series.iter().map(end).collect(),
        };
        let mut order: Vec<usize> = (0..ends.len()).collect();
        order.sort_by(|a, b| ends[*b].1[1].total_cmp(&ends[*a].1[1]));
        let mut free = self.height.max(LINE * (ends.len() + 1) as f64);
        for (n, &i) in order.iter().enumerate() {
            let above = LINE * (order.len() - 1 - n) as f64 + 10.0;
            ends[i].2 = (ends[i].1[1] + 4.0).min(free).max(above);
            free = ends[i].2 - LINE;
        }
        ends
    }

    /// Marks with names below the plot, for pictures; a page has a filter instead.
    fn legend(&self, classes: &[String], below: f64) -> (String, f64) {
        let mut parts = String::new();
        for (n, (series, class)) in self.series.iter().zip(classes).enumerate() {
            let (x, y) = (25.0 * (n % 4) as f64, below + LINE * (n / 4) as f64);
            let (mark, y) = (mark(series.look, "", [x, y], ""), y + 4.0);
            let text = html(&shortened(&series.name, NAME));
            let text = format!("<text x=\"{x}%\" dx=\"10\" y=\"{y:.1}\">{text}</text>");
            parts += &format!("<g class=\"s {class}\">{mark}{text}</g>\n");
        }
        (parts, LINE * self.series.len().div_ceil(4) as f64)
    }
}

/// Width of the plot on the narrowest page, px.
const NARROWEST: f64 = 330.0;

/// A row of a figure: a value with up to two ranges around it.
#[derive(Default)]
pub struct Row {
    /// Name of the structure, or of the value's owner.
    pub name: String,
    pub is_scan: bool,
    pub value: f64,
    /// Its interval, and a narrower range.
    pub ends: Option<[f64; 2]>,
    pub inner: Option<[f64; 2]>,
    /// Text beside the mark.
    pub label: String,
    /// Tooltip.
    pub note: String,
    /// Further attributes of the group.
    pub data: String,
    /// True if a line connects it with the next row.
    pub is_tied: bool,
}

impl Row {
    /// The interval, or the value alone.
    pub fn range(&self) -> [f64; 2] {
        self.ends.unwrap_or([self.value; 2])
    }
}

/// Rows from top to bottom over one axis, with a line at `one`.
pub fn rows(caption: String, axis: &Axis, one: Option<f64>, rows: &[Row]) -> Figure {
    let bottom = LINE * 1.5 * rows.len() as f64 + 8.0;
    let y = |row: usize| LINE * (1.5 * row as f64 + 1.0);
    let mut parts = axis.across(one, bottom);
    let names = unique(rows.iter().filter(|row| !row.is_scan).map(|row| &row.name));
    for (n, row) in rows.iter().enumerate() {
        let (x, look, y0) = (axis.percent(row.value), Look::of(&row.name), y(n));
        if let Some(next) = rows.get(n + 1).filter(|_| row.is_tied) {
            parts += &line("tie", [x, axis.percent(next.value)], [y0, y(n + 1)]);
        }
        let place = names.iter().position(|name| **name == row.name);
        let class = class(look, row.is_scan, place.unwrap_or(0));
        let range = |ends: Option<[f64; 2]>| ends.map(|ends| ends.map(|end| axis.percent(end)));
        let ends = range(row.ends);
        let mut shape = text::some(ends, |ends| line("interval", ends, [y0, y0]));
        shape += &text::some(range(row.inner), |ends| line("inner", ends, [y0, y0]));
        shape += &mark(look, "", [x, y0], "");
        // A label is placed where there is room on the narrowest page, or below.
        let [low, high] = ends.unwrap_or([x, x]);
        let length = CHARACTER * row.label.chars().count() as f64 / NARROWEST * 100.0;
        let is_beyond = high + length > 100.0;
        let (anchor, at, by, below) = if (x > 50.0 || is_beyond) && low > length {
            ("end", low, -10, 4.0)
        } else if is_beyond {
            let half = (length / 2.0).min(50.0);
            ("middle", x.clamp(half, 100.0 - half), 0, 15.0)
        } else {
            ("start", high, 10, 4.0)
        };
        parts += &format!(
            "<g class=\"s {class}\" data-s=\"{}\"{}><title>{}</title>{shape}<text x=\"{at:.2}%\" \
             y=\"{:.1}\" dx=\"{by}\" text-anchor=\"{anchor}\">{}</text></g>\n",
            html(&row.name),
            row.data,
            html(&row.note),
            y0 + below,
            html(&row.label),
        );
    }
    Figure {
        caption,
        margins: [12.0, 12.0],
        height: bottom + 1.5 * LINE,
        parts,
        legend: (String::new(), 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::super::figure::{STRONG, picture};
    use super::*;

    #[test]
    fn every_structure_is_in_the_legend_with_a_mark_of_its_own() {
        let registry = crate::index::Registry::builtin();
        let names: Vec<&str> = registry.rows().iter().map(|row| row.info.name).collect();
        let series = names
            .iter()
            .map(|name| Series::of(name, name.starts_with("linear"), vec![]));
        let axis = || Axis::linear("", 0.0..1.0, &|value| value.to_string());
        let axes = [axis(), axis()];
        let diagram = Diagram::of(String::new(), axes, Joined::Apart, series.collect());
        let (legend, height) = diagram.draw().legend;
        assert_eq!(height, LINE * names.len().div_ceil(4) as f64);
        let mut marks = std::collections::BTreeSet::new();
        for (name, entry) in names.iter().zip(legend.lines()) {
            assert!(
                entry.contains(&format!(">{}</text>", shortened(name, NAME))),
                "{entry}"
            );
            let colour = entry.split(['"', ' ']).nth(3);
            let mark = entry
                .split("<polygon class=")
                .nth(1)
                .and_then(|mark| mark.split('>').next());
            assert!(mark.is_some() && marks.insert((colour, mark)), "{entry}");
        }
    }

    #[test]
    fn names_beside_a_plot_keep_a_line_between_them() {
        let shown = |value: f64| value.to_string();
        let point = |y: f64| Point {
            at: [1.0, y],
            ..Point::default()
        };
        let series = |n: usize| Series {
            name: format!("s{n}"),
            look: Look::nth(n),
            is_scan: false,
            points: vec![point(5.0), point(5.0 + 0.01 * n as f64)],
        };
        let axes = [
            Axis::linear("x", 0.0..1.0, &shown),
            Axis::log("y", [1.0, 10.0].into_iter(), 1.0, &shown),
        ];
        let series = (0..25).map(series).collect();
        let diagram = Diagram::of("<c>".to_owned(), axes, Joined::Marked, series);
        let mut heights: Vec<f64> = diagram.names().into_iter().map(|name| name.2).collect();
        heights.sort_by(f64::total_cmp);
        assert!(heights.windows(2).all(|pair| pair[1] - pair[0] >= LINE));
        let figure = diagram.draw();
        let page = figure.inline();
        assert_eq!(page.matches(" weak\"").count(), 25 - STRONG);
        assert!(page.contains("&lt;c&gt;") && !page.contains("xmlns"));
        let picture = picture(&[figure], 1);
        assert!(picture.starts_with("<svg xmlns") && !picture.contains("var("));
    }
}
