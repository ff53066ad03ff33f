//! The crossover tables: which structure wins where.
//!
//! Also the number of items from which a structure beats the linear scan, and the growth of costs.
//! For the end of `run` and for `report`; evaluates a report, measures nothing.

use super::diagram::{Diagram, Joined, Point, Series};
use super::document::{Block, Column, Table};
use super::figure::{Axis, Figure, ends, is_drawn, left_out, picture};
use super::{run_figures, text};
use crate::measure::Metric;
use crate::report::{
    Crossing, Growth, Overall, Place, Report, ReportCell, Surface, comparisons, growths, surfaces,
};
use crate::statistics::sorted;

fn title(surface: &Surface) -> String {
    format!("{}, {}, {}", surface.world, surface.cache, surface.test)
}

/// The fastest structures and their speed-up vs linear.
///
/// Rows are numbers of items, columns visible shares.
fn winners(surface: &Surface) -> Table {
    let classes = surface.classes();
    let cells = surface.sizes().into_iter().flat_map(|size| {
        classes.iter().map(move |class| {
            let here = |p: &&Place| p.items == size && p.class == *class;
            let told = surface.places.iter().filter(here).map(winner);
            let told = told.collect::<Vec<_>>().join("; ");
            [text::count(size), text::short_percent(*class), told]
        })
    });
    Table::grid("items \\ visible", cells)
}

/// "wide = bvh: 12.3 (at 34.70 %)": those of the first rank, the fastest first.
fn winner(place: &Place) -> String {
    let winners: Vec<&ReportCell> = place.comparison.winners().collect();
    let names: Vec<&str> = winners.iter().map(|c| c.structure.as_str()).collect();
    let mut told = names.join(" = ");
    let ratio = winners.first().and_then(|cell| cell.value("speedup"));
    let ratio = ratio.filter(|_| !winners.iter().any(|cell| cell.is_scan()));
    told += &text::some(ratio, |ratio| format!(": {}", text::significant(ratio)));
    if place.is_off_class() {
        told += &format!(" (at {})", text::short_percent(place.share));
    }
    told
}

/// Number of items from which each structure beats the linear scan.
fn crossings(surface: &Surface) -> Option<Table> {
    let classes = surface.classes();
    let trees = surface.names(|cell| !cell.is_scan()).into_iter();
    let cells = trees.flat_map(|structure| {
        classes.iter().map(move |class| {
            let told = match surface.crossing(structure, *class) {
                None => String::new(),
                Some(Crossing::Below(items)) => format!("<= {}", text::count(items)),
                Some(Crossing::At(items)) => format!("~ {}", text::count(two_digits(items))),
                Some(Crossing::Above(items)) => format!("> {}", text::count(items)),
            };
            [structure.to_owned(), text::short_percent(*class), told]
        })
    });
    let mut table = Table::grid("faster than linear from", cells);
    let has_text = |row: &Vec<String>| row[1..].iter().any(|cell| !cell.is_empty());
    table.rows.retain(has_text);
    (!table.rows.is_empty()).then_some(table)
}

/// An interpolated number is not more precise.
fn two_digits(items: f64) -> usize {
    let unit = 10f64.powi((items.max(1.0).log10().floor() as i32 - 1).max(0));
    ((items / unit).round() * unit) as usize
}

/// Crossovers and growth of worlds in several sizes, in tables and figures.
pub fn blocks(report: &Report) -> Vec<Block> {
    let mut blocks = Vec::new();
    // A world of one size has its ranked tables.
    let is_shown = |surface: &&Surface| surface.sizes().len() > 1;
    for surface in surfaces(comparisons(report)).iter().filter(is_shown) {
        let legend = Block::line(
            "The fastest structure (= ties) and its speed-up vs linear, none if a scan wins or \
             linear has no time. Shares are rounded on a log scale to 1, 1.5, 2, 3, 5, 7, 10, ... \
             percent; (at ...) gives a share that is more than a tenth off. ~ N is interpolated \
             between two sizes, on log scales.",
        );
        let legend = Some(legend).filter(|_| blocks.is_empty());
        blocks.push(Block::heading(format!("Crossover: {}", title(surface))));
        blocks.extend(legend);
        blocks.push(Block::Table(winners(surface)));
        blocks.extend(crossings(surface).map(Block::Table));
        let figures = growth(surface).into_iter();
        blocks.extend(figures.map(|figure| Block::Figure(figure.1)));
    }
    let growths = growths(report);
    if !growths.is_empty() {
        blocks.push(Block::heading("Growth at a fixed number of visible items"));
        blocks.push(Block::Table(of_growths(&growths)));
    }
    blocks
}

/// Growth of cost at a fixed number of visible items.
fn of_growths(growths: &[Growth]) -> Table {
    let columns: &[Column<&Growth>] = &[
        ("world, path, cache, test", |g| {
            let (world, path, cache, test, _) = &g.key;
            text::joined([world, *path, *cache, *test])
        }),
        ("structure", |g| g.key.4.to_owned()),
        (">visible", |g| text::count(g.visible.round() as usize)),
        (">items", |g| {
            let sizes = g.sizes.first().zip(g.sizes.last());
            let sizes = sizes.map(|(least, most)| [*least, *most].map(text::count));
            text::some(sizes, |sizes| sizes.join(" - "))
        }),
        (">query time ~ N^e, e =", |g| {
            let [lower, upper] =
                [g.exponent.lower, g.exponent.upper].map(|e| e.unwrap_or(f64::NAN));
            format!("{:.2} [{lower:.2}, {upper:.2}]", g.exponent.value)
        }),
    ];
    Table::with(growths, columns)
}

/// Time against the number of items, a line per structure, named at its right end.
///
/// One figure per class of shares with at least two sizes; their axes are the same.
pub fn growth(surface: &Surface) -> Vec<(String, Figure)> {
    let curve = |class: f64, name: &str| -> (usize, Vec<Point>) {
        let here = surface.places.iter().filter(|place| place.class == class);
        let times = here.filter_map(|p| Some((p.items, p.cell(name)?.metrics.get("query_ns")?)));
        let mut times: Vec<(usize, &Metric)> = times.collect();
        times.dedup_by_key(|time| time.0);
        let is_drawn = |t: &&(usize, &Metric)| is_drawn(t.0 as f64) && is_drawn(t.1.value);
        let point = |&(items, time): &(usize, &Metric)| Point {
            at: [items as f64, time.value],
            ends: ends(time.estimate()),
            note: text::joined([name, &text::count(items)])
                + ": "
                + &text::time_within(time.estimate()),
            ..Point::default()
        };
        let drawn: Vec<Point> = times.iter().filter(is_drawn).map(point).collect();
        (times.len() - drawn.len(), drawn)
    };
    let is_scan = |name: &str| {
        let cells = surface.places.iter().filter_map(|place| place.cell(name));
        cells.take(1).any(ReportCell::is_scan)
    };
    let mut figures = Vec::new();
    for class in surface.classes() {
        let (mut series, mut beyond) = (Vec::new(), 0);
        for name in surface.names(|_| true) {
            let (left_out, points) = curve(class, name);
            beyond += left_out;
            if points.len() > 1 {
                series.push(Series::of(name, is_scan(name), points));
            }
        }
        // The fastest at the largest size keeps its colour.
        let last = |series: &Series| series.points.last().map_or(f64::INFINITY, |p| p.at[1]);
        series.sort_by(|a, b| last(a).total_cmp(&last(b)));
        if !series.is_empty() {
            figures.push((class, series, beyond));
        }
    }
    let points = || figures.iter().flat_map(|f| &f.1).flat_map(|s| &s.points);
    let values = |place: usize| points().map(move |p| p.at[place]).collect::<Vec<_>>();
    let [items, ns] = [0, 1].map(values);
    let mut sizes = sorted(items.clone());
    sizes.dedup();
    let size = |items: f64| text::count(items.round() as usize);
    let figure = |(class, series, beyond)| {
        let (shown, title) = (text::short_percent(class), title(surface));
        let measured = measured(surface, class);
        let caption = format!(
            "{title}: mean time per query against items, {shown} visible{measured}{}",
            left_out(beyond)
        );
        let mut x = Axis::log("items", items.iter().copied(), 1.05, &size);
        x.ticks.clone_from(&sizes);
        let y = Axis::log("", ns.iter().copied(), 1.1, &text::time);
        let diagram = Diagram::of(caption, [x, y], Joined::Marked, series);
        (shown, diagram.draw())
    };
    figures.into_iter().map(figure).collect()
}

/// The measured shares of a class, unless its name shows them.
fn measured(surface: &Surface, class: f64) -> String {
    let here = || surface.places.iter().filter(|place| place.class == class);
    if !here().any(Place::is_off_class) {
        return String::new();
    }
    let shares = || here().map(|place| place.share);
    let least = text::percent(shares().fold(f64::INFINITY, f64::min));
    let most = text::percent(shares().fold(0.0, f64::max));
    format!(" (measured: {least} to {most})")
}

/// A name that fits a file, and a picture as SVG.
pub type Picture = (String, String);

/// Pictures of each class of shares with at least two sizes.
///
/// And one for each scene and path with ranks.
pub fn pictures(report: &Report) -> Vec<Picture> {
    let mut pictures: Vec<Picture> = Vec::new();
    let mut add = |words: [&str; 4], figure| {
        pictures.push((file_name(words, &pictures), picture(&[figure], 1)));
    };
    for surface in surfaces(comparisons(report)) {
        for (shown, figure) in growth(&surface) {
            add(
                [&surface.world, surface.cache, surface.test, &shown],
                figure,
            );
        }
    }
    for comparison in &comparisons(report) {
        let about = comparison.about();
        let base = Overall::of(&[comparison]).base;
        if let Some(mut figure) = base.and_then(|base| run_figures::speedups(comparison, base)) {
            let scene = &about.scene.name;
            let path = &text::joined([&about.path.name, &about.path.motion]);
            let of = run_figures::of(comparison);
            figure.caption = format!("{of}, {}: {}", about.test, figure.caption);
            add([scene, path, &about.path.cache, &about.test], figure);
        }
    }
    pictures
}

/// A unique name of less than the 255 bytes that file systems allow.
fn file_name(words: [&str; 4], taken: &[Picture]) -> String {
    let words = words.map(|word| word.chars().take(70).collect::<String>());
    let name: String = slug(&words.join("-")).chars().take(200).collect();
    let is_free = |name: &String| taken.iter().all(|picture| picture.0 != *name);
    // The names of two worlds may be equal to a file system.
    let others = (2..).map(|n| format!("{name}-{n}"));
    let mut names = [name.clone()].into_iter().chain(others);
    names.find(is_free).unwrap_or_default()
}

/// Letters, digits and points; a dash for anything else.
fn slug(words: &str) -> String {
    let is_odd = |c: char| !c.is_ascii_alphanumeric() && c != '.';
    let name = words.replace(is_odd, "-").replace("--", "-");
    name.trim_matches(['-', '.']).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_and_interpolated_sizes_are_rounded() {
        let shares = [0.001, 0.02, 0.2, 1.0, 0.0005];
        assert_eq!(
            shares.map(text::short_percent),
            ["0.1 %", "2 %", "20 %", "100 %", "0.05 %"]
        );
        assert_eq!([1234.0, 7.2, 98_765.0].map(two_digits), [1200, 7, 99_000]);
    }

    #[test]
    fn names_fit_a_file() {
        assert_eq!(
            slug("city:seed=7-warm-six-plane-0.1 %"),
            "city-seed-7-warm-six-plane-0.1"
        );
        assert_eq!(slug("../a/b.csv"), "a-b.csv");
        let world = "x".repeat(3000);
        let mut pictures: Vec<Picture> = Vec::new();
        for world in [&world, &format!("{world}y"), "a", "a-warm-t-2 %-2", "a"] {
            let name = file_name([world, "warm", "t", "2 %"], &pictures);
            assert!(
                name.len() < 250 && pictures.iter().all(|p| p.0 != name),
                "{name}"
            );
            let svg = String::new();
            pictures.push((name, svg));
        }
    }
}
