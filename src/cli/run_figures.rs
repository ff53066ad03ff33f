//! Figures of a run: speed-ups, growth, views along the path, error against time.
//!
//! Error against time has a mark per structure and test, the Pareto front before them, and the
//! tests named at their levels of error.

use std::collections::BTreeSet;

use super::diagram::{Diagram, Joined, Point, Row, Series, rows};
use super::figure::{Axis, Figure, Look, ends, is_drawn, left_out, line};
use super::run_verdict::times;
use super::text;
use crate::report::{Comparison, Reading, ReportCell, Views, grouped};
use crate::statistics::{Estimate, quantile, sorted};

/// Fewest clock readings along a path for a line, and for quantiles.
const LEAST_READINGS: [usize; 2] = [4, 20];

/// Scene, path and motion of a comparison.
pub fn of(comparison: &Comparison) -> String {
    let about = comparison.about();
    let cache = Some(about.path.cache.as_str()).filter(|cache| *cache != "warm");
    let (scene, path) = (about.scene.name.as_str(), &about.path);
    text::joined([scene, &path.name, cache.unwrap_or_default(), &path.motion])
}

/// Speed-ups over `base`: a dot with its 95 % interval per structure.
///
/// The fastest is on top. Lines connect the dots of one rank.
pub fn speedups(comparison: &Comparison, base: &str) -> Option<Figure> {
    let sound = comparison.sound();
    let all = sound.filter_map(|cell| Some((cell, comparison.speedup(base, cell)?)));
    let all: Vec<(&ReportCell, Estimate)> = all.collect();
    let drawn: Vec<_> = all.iter().filter(|row| is_drawn(row.1.value)).collect();
    drawn.first()?;
    let values = drawn.iter();
    let values = values.flat_map(|(_, found)| found.ends().unwrap_or([found.value; 2]));
    let mut axis = Axis::log("", values.chain([1.0]), 1.2, &ratio_name);
    // Within an octave there is only one.
    let powers = Some(axis.powers(2.0)).filter(|powers| powers.len() > 1);
    axis.ticks = powers.unwrap_or_default();
    let row = |(place, &&(cell, found)): (usize, &&(&ReportCell, Estimate))| {
        let (time, name, ratio) = (cell.time(), &cell.structure, found.value);
        let takes = text::some(time, |ns| text::time_within(ns.estimate()));
        let interval = text::interval(found.ends(), 1.0);
        let next = drawn.get(place + 1);
        Row {
            name: name.clone(),
            is_scan: cell.is_scan(),
            value: ratio,
            ends: found.ends(),
            inner: None,
            label: format!("{name} {}", times(ratio)),
            note: format!("{name}: {takes}, {}{interval}", times(ratio)),
            data: format!(
                " data-rank=\"{}\" data-speedup=\"{ratio}\" data-query-ns=\"{}\"",
                text::some(cell.rank, |rank| rank.to_string()),
                text::some(time, |time| time.value.to_string()),
            ),
            is_tied: next.is_some_and(|next| next.0.rank == cell.rank),
        }
    };
    let structures: Vec<Row> = drawn.iter().enumerate().map(row).collect();
    let is_within = drawn.iter().any(|row| row.1.ends().is_some());
    let interval = ["", ", 95 % interval"][usize::from(is_within)];
    let caption = format!(
        "Speed-ups over {base}{interval}; a line joins structures of one rank{}",
        left_out(all.len() - drawn.len())
    );
    Some(rows(caption, &axis, Some(1.0), &structures))
}

/// "4 x", "1/4 x", "0.8 x".
fn ratio_name(ratio: f64) -> String {
    let is_whole = |ratio: f64| (1.0..1e5).contains(&ratio) && ratio.fract() == 0.0;
    match ratio {
        _ if is_whole(ratio) => format!("{} x", text::count(ratio as usize)),
        _ if is_whole(1.0 / ratio) => format!("1/{} x", 1.0 / ratio),
        _ => format!("{} x", text::short(ratio)),
    }
}

/// Time and visible items along the path, and the distribution of times.
///
/// Or per frame of a motion.
pub fn along(comparison: &Comparison, views: &Views) -> Vec<Figure> {
    let path = &comparison.about().path;
    let [view, query, course] = match path.motion.as_str() {
        "" => ["view", "query", "along the path"],
        _ => ["frame", "frame, update and queries,", "of the motion"],
    };
    // In a frame with several queries, the first.
    let visible = views.visible.iter().step_by(path.views_per_frame.max(1));
    let visible: Vec<u64> = visible.copied().collect();
    let frame = |frame: f64| text::count(frame as usize);
    let frames = 0.0..visible.len().saturating_sub(1) as f64;
    let x = || Axis::linear(view, frames.clone(), &frame);
    let (mut series, mut spread, mut queries) = (Vec::new(), Vec::new(), 1);
    let cells = comparison.sound();
    let timed = cells.filter_map(|cell| Some((cell, views.times.get(&cell.structure)?)));
    for (cell, readings) in timed {
        let readings: Vec<_> = readings.iter().filter(|r| is_drawn(r.ns)).collect();
        // Scaled to the time in the table, which has another estimator.
        let mean = readings.iter().map(|r| r.ns).sum::<f64>() / readings.len() as f64;
        let scale = cell.time().map_or(1.0, |time| time.value / mean);
        let point = |reading: &&Reading| Point {
            at: [reading.frame, reading.ns * scale],
            ..Point::default()
        };
        if readings.len() >= LEAST_READINGS[0] {
            queries = readings.iter().map(|r| r.queries).fold(queries, u32::max);
            let points = readings.iter().map(point).collect();
            series.push(Series::of(&cell.structure, cell.is_scan(), points));
        }
        if readings.len() >= LEAST_READINGS[1] {
            let ns = sorted(readings.iter().map(|r| r.ns * scale).collect());
            let quantiles =
                [0.05, 0.25, 0.5, 0.75, 0.95].map(|share| quantile(&ns, share).unwrap_or(ns[0]));
            let ([low, first, median, third, high], told) = (quantiles, quantiles.map(text::time));
            let name = cell.structure.clone();
            spread.push(Row {
                label: format!("{name} {}", told[2]),
                note: format!(
                    "{name}: median {}, half of the {view}s {} to {}, nine tenths {} to {}",
                    told[2], told[1], told[3], told[0], told[4]
                ),
                name,
                is_scan: cell.is_scan(),
                value: median,
                ends: Some([low, high]),
                inner: Some([first, third]),
                ..Row::default()
            });
        }
    }
    let mut figures = Vec::new();
    let several = Some(queries).filter(|queries| *queries > 1);
    let means = |queries| format!(", means of up to {queries} consecutive views");
    let (about, each) = (of(comparison), text::some(several, means));
    if !series.is_empty() {
        let points = series.iter().flat_map(|s| s.points.iter().map(|p| p.at[1]));
        let y = Axis::log("", points, 1.1, &text::time);
        let caption = format!("{about}: time per {query} {course}{each}");
        figures.push(Diagram::of(caption, [x(), y], Joined::Bare, series).draw());
    }
    if visible.len() >= LEAST_READINGS[0] {
        let most = visible.iter().copied().fold(1, u64::max);
        let count = |items: f64| text::count(items as usize);
        let point = |(frame, items): (usize, &u64)| Point {
            at: [frame as f64, *items as f64],
            ..Point::default()
        };
        let points = visible.iter().enumerate().map(point).collect();
        let series = Series {
            look: Look::nth(0),
            ..Series::of("visible items", true, points)
        };
        let mut y = Axis::linear("", 0.0..most as f64, &count);
        y.ticks = y.all_ticks();
        y.ticks.retain(|tick| tick.fract() == 0.0);
        let short = "; single views are too short to be timed each";
        let why = if figures.is_empty() { short } else { "" };
        let caption = format!("{about}: visible items {course}{why}");
        let mut diagram = Diagram::of(caption, [x(), y], Joined::Bare, vec![series]);
        diagram.height = 120.0;
        figures.push(diagram.draw());
    }
    if !spread.is_empty() {
        let values = spread.iter().flat_map(Row::range);
        let axis = Axis::log("", values, 1.1, &text::time);
        let caption = format!(
            "{about}: distribution over the {view}s{each}; median, middle half, and 5 to 95 % (p95 in \
             tables: over groups of views that are the same for all structures)"
        );
        figures.push(rows(caption, &axis, None, &spread));
    }
    figures
}

/// Error against time of comparisons that differ in their tests.
///
/// `None` for a single test.
pub fn errors(comparisons: &[&Comparison]) -> Option<Figure> {
    let first = comparisons.first()?;
    comparisons.get(1)?;
    let measured = |cell: &ReportCell| {
        let (time, error) = (cell.metrics.get("query_ns")?, cell.value("excess")?);
        let (structure, test) = (&cell.structure, &cell.test);
        let (within, extra) = (text::time_within(time.estimate()), error * 100.0);
        let percent = text::significant(extra);
        let point = Point {
            at: [time.value, extra],
            wide: ends(time.estimate()),
            note: format!("{structure} {test}: {within}, {percent} % false positives"),
            is_large: true,
            level: test.clone(),
            ..Point::default()
        };
        Some((structure.clone(), point))
    };
    let cells = comparisons.iter().flat_map(|comparison| comparison.sound());
    let mut points: Vec<Measured> = cells.filter_map(measured).collect();
    points.sort_by(|(_, a), (_, b)| a.at[0].total_cmp(&b.at[0]));
    let caption = format!("{}: error against run time, by test", of(first));
    against(&caption, points)
}

/// A structure, and its time and error at the level of a test.
///
/// Large if it is on the front, a cross if it misses a visible item.
pub type Measured = (String, Point);

/// Points of the front with the least error so far in order of time.
///
/// The others are on it for their memory or for missing less.
fn front(points: &[Measured]) -> Vec<[f64; 2]> {
    let mut least = f64::INFINITY;
    let points = points.iter().map(|own| &own.1);
    let places = points.filter(|point| point.is_large).map(|point| point.at);
    let better = |at: &[f64; 2]| {
        let is_better = at[1] < least;
        least = least.min(at[1]);
        is_better
    };
    places.filter(better).collect()
}

/// The tests at each height, near ones together.
fn levels(points: &[Measured]) -> Vec<(f64, String)> {
    let places = points.iter().map(|(_, point)| (point.at[1], &point.level));
    let mut places: Vec<(f64, &String)> = places.collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let near = |a: &(f64, &String), b: &(f64, &String)| b.0 / a.0 < 1.25;
    let levels = places.chunk_by(near).flat_map(|own| {
        let tests: BTreeSet<&String> = own.iter().map(|place| place.1).collect();
        let level = move |test: &String| (own[own.len() / 2].0, test.clone());
        tests.into_iter().map(level)
    });
    levels.collect()
}

/// Error against run time of points, the fastest first; `None` without any.
///
/// Zero error is drawn in a gutter: a logarithmic axis has no zero.
pub fn against(caption: &str, mut points: Vec<Measured>) -> Option<Figure> {
    points.first()?;
    let all = points.len();
    let errors = points.iter().map(|(_, point)| point.at[1]);
    let least = errors.filter(|error| is_drawn(*error)).fold(1.0, f64::min);
    // Half a power of ten below the axis, which begins a power below the least error.
    let none = 10f64.powf(least.log10().floor() - 1.5);
    let gutter = none * 2.0;
    let placed = |error: f64| error.max(if error > 0.0 { gutter } else { none });
    for (_, point) in &mut points {
        point.at[1] = placed(point.at[1]);
        point.ends = point.ends.map(|ends| ends.map(placed));
    }
    points.retain(|(_, point)| point.at.iter().all(|value| is_drawn(*value)));
    let beyond = all - points.len();
    let (front, levels) = (front(&points), levels(&points));
    let mut series: Vec<Series> = Vec::new();
    for (structure, own) in grouped(points.into_iter()) {
        let points = own.into_iter().map(|mut point| {
            point.is_large = front.contains(&point.at);
            point.wide = point.wide.filter(|_| point.is_large);
            point.ends = point.ends.filter(|_| point.is_large);
            point
        });
        let is_scan = structure.starts_with("linear");
        series.push(Series::of(&structure, is_scan, points.collect()));
    }
    let places = || series.iter().flat_map(|series| &series.points);
    let error = |error: f64| match error < gutter {
        true => "none".to_owned(),
        false => text::significant(error),
    };
    // From zero to at least a hundredth.
    let errors = places().flat_map(|p| p.ends.unwrap_or([p.at[1]; 2]));
    let mut y = Axis::log("", errors.chain([none, 1.0]), 1.5, &error);
    y.ticks = y.powers(10.0);
    y.ticks.push(none);
    let times = places().map(|p| p.at[0]);
    let x = Axis::log("time per query", times, 1.5, &text::time);
    let large = "Large: on the line of least error";
    let large = large.to_owned() + &left_out(beyond);
    let caption = format!("{caption}; up: false positives, % of visible. {large}");
    let diagram = Diagram {
        front,
        levels,
        ..Diagram::of(caption, [x, y], Joined::Apart, series)
    };
    let (y, mut figure) = (diagram.y(none), diagram.draw());
    figure
        .parts
        .insert_str(0, &line("gutter", [0.0, 100.0], [y, y]));
    Some(figure)
}

#[cfg(test)]
mod tests {
    use super::super::diagram::Point;
    use super::*;

    #[test]
    fn ratios_are_named_briefly() {
        let names = [0.25, 1.0, 1024.0, 1.2, 0.85, 2f64.powi(40), 2f64.powi(-40)].map(ratio_name);
        assert_eq!(names[..5], ["1/4 x", "1 x", "1,024 x", "1.2 x", "0.85 x"]);
        assert!(names.iter().all(|name| name.len() < 22), "{names:?}");
    }

    #[test]
    fn no_error_stands_in_a_gutter_below_every_error() {
        for least in [3e-7, 3e-3, 1.0] {
            let point = |error: f64| {
                let point = Point {
                    at: [100.0, error],
                    ends: Some([0.0, 2.0]),
                    is_large: true,
                    ..Point::default()
                };
                ("bvh".to_owned(), point)
            };
            let points = [0.0, least, 2.0].map(point);
            let drawn = against("", points.into()).unwrap().parts;
            let heights = |before: &str| {
                let parts = drawn.split(before).skip(1);
                let heights = parts.filter_map(|part| part.split(" y").nth(1)?.split('"').nth(1));
                heights.map(|y| y.parse().unwrap()).collect::<Vec<f64>>()
            };
            let gutter = heights("<line class=\"gutter\"")[0];
            let marks = heights("<svg x=");
            let [none, least, most] = marks[..] else {
                panic!("{drawn}")
            };
            assert!(
                none == gutter && gutter > least + 12.0 && least > most,
                "{marks:?} {gutter}"
            );
            assert!(drawn.contains(">none</text>") && !drawn.contains(">0</text>"));
            // The interval ends there too.
            let lines = drawn.split("<line class=\"interval\"").skip(1);
            let ends = lines.filter(|line| line.contains(&format!("y1=\"{none:.1}\"")));
            assert!(ends.count() > 0, "{drawn}");
        }
    }
}
