//! The plots of a page, as inline SVG whose horizontal places are percentages: text
//! keeps its size on every width. Marks carry their figures as `data-` attributes.

use std::ops::Range;

use super::chart::{around, is_drawn, left_out};
use super::document::html;
use super::palette::{Look, SHAPES};
use super::run_verdict::times;
use super::text;
use crate::report::{Comparison, ReportCell, Speedup, Surface};

/// Series of a plot with a colour; the others are grey.
const STRONG: usize = 8;
/// Least distance of two lines of text.
const LINE: f64 = 16.0;

/// A logarithmic axis over a range of percentages of the width.
struct Axis {
    values: Range<f64>,
    percent: Range<f64>,
}

impl Axis {
    fn at(&self, value: f64) -> f64 {
        let Range { start, end } = self.values;
        let along = (value / start).ln() / (end / start).ln();
        let width = self.percent.end - self.percent.start;
        self.percent.start + width * along.clamp(0.0, 1.0)
    }

    /// At most about seven powers of `base` within the range.
    fn ticks(&self, base: f64) -> Vec<f64> {
        let [first, last] = [self.values.start, self.values.end].map(|v| v.log(base));
        let step = ((last - first) / 7.0).ceil().max(1.0);
        let mut power = (first / step).ceil() * step;
        let mut ticks = Vec::new();
        while power <= last {
            ticks.push(base.powf(power));
            power += step;
        }
        ticks
    }
}

/// The mark of a structure, around a place: `x` in percent, `y` in pixels.
fn mark(look: Look, x: f64, y: f64) -> String {
    let class = if look.hollow { "mark hollow" } else { "mark" };
    let corners = SHAPES[look.shape].iter().map(|(x, y)| format!("{x},{y} "));
    format!(
        "<svg x=\"{x:.2}%\" y=\"{y:.1}\" overflow=\"visible\"><polygon class=\"{class}\" \
         points=\"{}\"/></svg>",
        corners.collect::<String>()
    )
}

/// Class of a series: its colour, or grey beyond the strong ones.
fn class(look: Look, place: usize) -> String {
    match place < STRONG {
        true => format!("c{}", look.colour),
        false => "c7 weak".to_owned(),
    }
}

fn line(class: &str, [x1, x2]: [f64; 2], [y1, y2]: [f64; 2]) -> String {
    format!(
        "<line class=\"{class}\" x1=\"{x1:.2}%\" x2=\"{x2:.2}%\" y1=\"{y1:.1}\" y2=\"{y2:.1}\"/>"
    )
}

/// A figure with its caption; `label` describes it to screen readers.
fn figure(label: &str, caption: &str, height: f64, parts: &str) -> String {
    format!(
        "<svg class=\"plot\" role=\"img\" width=\"100%\" height=\"{height:.0}\" \
         aria-label=\"{}\">\n{parts}</svg><figcaption>{}</figcaption>",
        html(label),
        html(caption)
    )
}

/// Speed-ups over `base`: a dot with its 95 % interval per structure.
///
/// The fastest is on top. Lines join the dots of one rank.
pub fn speedups(comparison: &Comparison, base: &str) -> Option<String> {
    let sound = comparison.sound();
    let rows: Vec<(&ReportCell, Speedup)> = sound
        .filter_map(|cell| Some((cell, comparison.speedup(base, cell)?)))
        .collect();
    let all = rows.len();
    let rows: Vec<_> = (rows.into_iter())
        .filter(|(_, (ratio, _))| is_drawn(*ratio))
        .collect();
    rows.first()?;
    let ends =
        |&(_, (ratio, ends)): &(_, Speedup)| [&[ratio][..], &ends.unwrap_or_default()].concat();
    let axis = Axis {
        values: around(rows.iter().flat_map(ends).chain([1.0]), 1.2, 1.2),
        percent: 3.0..97.0,
    };
    let bottom = LINE * 1.5 * rows.len() as f64 + 8.0;
    let mut parts = String::new();
    for tick in axis.ticks(2.0) {
        let (x, name) = (axis.at(tick), ratio_name(tick));
        parts += &line(
            if tick == 1.0 { "one" } else { "grid" },
            [x, x],
            [0.0, bottom],
        );
        parts += &format!(
            "<text class=\"tick\" x=\"{x:.2}%\" y=\"{:.1}\">{name}</text>\n",
            bottom + LINE
        );
    }
    let y = |row: usize| LINE * (1.5 * row as f64 + 1.0);
    let mut coloured = 0;
    for (row, (cell, (ratio, ends))) in rows.iter().enumerate() {
        let (x, look) = (axis.at(*ratio), Look::of(&cell.structure));
        if let Some((next, (other, _))) = rows.get(row + 1).filter(|next| next.0.rank == cell.rank)
        {
            debug_assert!(next.rank.is_some());
            parts += &line("tie", [x, axis.at(*other)], [y(row), y(row + 1)]);
        }
        let class = if cell.is_scan() {
            "c7".to_owned()
        } else {
            class(look, coloured)
        };
        coloured += usize::from(!cell.is_scan());
        let interval = ends.map(|ends| ends.map(|end| axis.at(end)));
        let time = cell.metrics.get("query_ns");
        // A label stands where there is more room.
        let [low, high] = interval.unwrap_or([x, x]);
        let (anchor, at, by) = match x > 50.0 {
            true => ("end", low, -10),
            false => ("start", high, 10),
        };
        parts += &format!(
            "<g class=\"s {class}\" data-s=\"{name}\" data-rank=\"{}\" data-speedup=\"{ratio}\" \
             data-query-ns=\"{}\"><title>{name}: {}, {}</title>{}{}<text x=\"{at:.2}%\" \
             y=\"{:.1}\" dx=\"{by}\" text-anchor=\"{anchor}\">{name} {}</text></g>\n",
            text::some(cell.rank, |rank| rank.to_string()),
            text::some(time, |time| time.value.to_string()),
            text::time_estimate(time),
            text::some(*ends, |[low, high]| format!(
                "{} [{}, {}]",
                times(*ratio),
                text::significant(low),
                text::significant(high)
            )),
            text::some(interval, |ends| line("interval", ends, [y(row), y(row)])),
            mark(look, x, y(row)),
            y(row) + 4.0,
            times(*ratio),
            name = html(&cell.structure),
        );
    }
    let about = comparison.about();
    let label = format!(
        "Speed-ups over {base} of {} on {}, {}",
        text::counted(rows.len(), "structure"),
        about.scene.name,
        about.path.name
    );
    let caption = format!(
        "Speed-up over {base}, 95 % interval; a line joins structures of one rank{}",
        left_out(all - rows.len())
    );
    Some(figure(&label, &caption, bottom + 1.5 * LINE, &parts))
}

/// "4 x", "1/4 x".
fn ratio_name(ratio: f64) -> String {
    match ratio < 1.0 && ratio > 1e-4 {
        true => format!("1/{} x", (1.0 / ratio).round()),
        false if (1.0..1e5).contains(&ratio) => {
            format!("{} x", text::count(ratio.round() as usize))
        }
        false => times(ratio),
    }
}

/// Time against the number of items, a line per structure, named at its right end.
/// One figure per class of shares that has at least two sizes.
pub fn growth(surface: &Surface, class_name: &dyn Fn(f64) -> String) -> Vec<String> {
    let figure = |share| growth_at(surface, share, &class_name(share));
    surface.classes().into_iter().filter_map(figure).collect()
}

fn growth_at(surface: &Surface, share: f64, visible: &str) -> Option<String> {
    let mut beyond = 0;
    let curves = surface.structures().into_iter().map(|name| {
        let mut points = surface.curve(name, share, "query_ns");
        let all = points.len();
        points.retain(|&(items, ns)| is_drawn(items as f64) && is_drawn(ns));
        beyond += all - points.len();
        (name, points)
    });
    let mut curves: Vec<(&str, Vec<(usize, f64)>)> =
        curves.filter(|(_, points)| points.len() > 1).collect();
    // The fastest at the largest size first: it keeps its colour.
    let last = |points: &[(usize, f64)]| points.last().map_or(f64::INFINITY, |p| p.1);
    curves.sort_by(|a, b| last(&a.1).total_cmp(&last(&b.1)));
    curves.first()?;
    let points = || curves.iter().flat_map(|(_, points)| points);
    let items = Axis {
        values: around(points().map(|p| p.0 as f64), 1.05, 1.05),
        percent: 12.0..70.0,
    };
    let bottom = (LINE * curves.len() as f64).max(300.0);
    // Percent of the height, from below.
    let ns = Axis {
        values: around(points().map(|p| p.1), 1.1, 1.1),
        percent: 0.0..1.0,
    };
    let y = |value: f64| 10.0 + (bottom - 20.0) * (1.0 - ns.at(value));
    let mut parts = String::new();
    for tick in ns.ticks(10.0) {
        parts += &line("grid", [0.0, 70.0], [y(tick), y(tick)]);
        let (y, name) = (y(tick) - 4.0, text::time(tick));
        parts += &format!("<text x=\"0\" y=\"{y:.1}\">{name}</text>\n");
    }
    let mut sizes: Vec<usize> = points().map(|p| p.0).collect();
    sizes.sort_unstable();
    sizes.dedup();
    for size in sizes {
        let x = items.at(size as f64);
        parts += &line("grid", [x, x], [0.0, bottom]);
        let name = text::count(size);
        let y = bottom + LINE;
        parts += &format!("<text class=\"tick\" x=\"{x:.2}%\" y=\"{y:.1}\">{name}</text>\n");
    }
    let is_scan = |name: &str| {
        let cells = surface.places.iter().filter_map(|place| place.cell(name));
        cells.take(1).any(ReportCell::is_scan)
    };
    // Names from below to above, each at least a line from the one before.
    let mut free = bottom;
    let mut names = vec![0.0; curves.len()];
    for (place, (_, points)) in curves.iter().enumerate() {
        let above = LINE * (curves.len() - 1 - place) as f64 + 10.0;
        names[place] = (y(last(points)) + 4.0).min(free).max(above);
        free = names[place] - LINE;
    }
    for (place, (name, points)) in curves.iter().enumerate() {
        let look = Look::of(name);
        let class = if is_scan(name) {
            "c7".to_owned()
        } else {
            class(look, place)
        };
        let at = |&(n, ns): &(usize, f64)| (items.at(n as f64), y(ns));
        let lines = points.iter().zip(&points[1..]).map(|(a, b)| {
            let (a, b) = (at(a), at(b));
            line("curve", [a.0, b.0], [a.1, b.1])
        });
        let marks = points.iter().map(|point| {
            let (x, y) = at(point);
            mark(look, x, y)
        });
        let (end, y) = (at(&points[points.len() - 1]), names[place]);
        parts += &format!(
            "<g class=\"s {class}\" data-s=\"{name}\"><title>{name}: {} to {}</title>{}{}{}<text \
             x=\"74%\" y=\"{y:.1}\">{name}</text></g>\n",
            text::time(points[0].1),
            text::time(last(points)),
            lines.collect::<String>(),
            line("lead", [end.0, 73.5], [end.1, y - 4.0]),
            marks.collect::<String>(),
            name = html(name),
        );
    }
    let caption = format!(
        "Mean time per query against items, {visible} visible{}",
        left_out(beyond)
    );
    Some(figure(&caption, &caption, bottom + 1.5 * LINE, &parts))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_few_powers_within_the_axis() {
        let axis = |values| Axis {
            values,
            percent: 0.0..100.0,
        };
        assert_eq!(axis(0.4..9.0).ticks(2.0), [0.5, 1.0, 2.0, 4.0, 8.0]);
        assert!(axis(1e-30..1e30).ticks(2.0).len() <= 8);
        assert_eq!(axis(1.0..100.0).at(10.0), 50.0);
        let names = [0.25, 1.0, 1024.0, 2f64.powi(40), 2f64.powi(-40)].map(ratio_name);
        assert_eq!(names[..3], ["1/4 x", "1 x", "1,024 x"]);
        assert!(names.iter().all(|name| name.len() < 22), "{names:?}");
    }
}
