//! The crossover tables: which structure wins where, from how many items on the
//! linear scan is beaten, and how cost grows. For the end of `run` and for
//! `report`; read off a report, nothing is measured.

use std::io::{self, Write};

use super::document::Block;
use super::table::Table;
use super::text;
use crate::report::{Crossing, Growth, Place, Report, Surface, comparisons, growths, surfaces};

/// A class of shares: "0.1 %", "100 %".
pub fn class(share: f64) -> String {
    // At most two digits by its making; the rest is rounding.
    let rounded = format!("{:.6}", share * 100.0);
    let plain = rounded.trim_end_matches('0').trim_end_matches('.');
    format!("{plain} %")
}

pub fn title(surface: &Surface) -> String {
    format!("{}, {}, {}", surface.world, surface.cache, surface.test)
}

/// Rows are numbers of items, columns shares of them that are visible: who is
/// fastest, and its speed-up vs linear.
fn winners(surface: &Surface) -> Table {
    let classes = surface.classes();
    let header = ["items \\ visible".to_owned()].into_iter();
    let mut table = Table::of_numbers(header.chain(classes.iter().map(|c| class(*c))));
    for size in surface.sizes() {
        let mut row = vec![text::count(size)];
        for class in &classes {
            let here = |p: &&Place| p.items == size && p.class == *class;
            let told = surface.places.iter().filter(here).map(winner);
            row.push(told.collect::<Vec<_>>().join("; "));
        }
        table.add_row(row);
    }
    table
}

/// "wide = bvh: 12.3 (at 34.70 %)": those of one rank share the place, the fastest
/// comes first.
fn winner(place: &Place) -> String {
    let names: Vec<&str> = place
        .comparison
        .winners()
        .map(|c| c.structure.as_str())
        .collect();
    let mut told = names.join(" = ");
    let ratio = place
        .comparison
        .winners()
        .next()
        .and_then(|cell| cell.value("speedup"));
    let ratio = ratio.filter(|_| !place.scan_wins());
    told += &text::some(ratio, |ratio| format!(": {}", text::significant(ratio)));
    if place.is_off_class() {
        told += &format!(" (at {})", text::percent(place.share));
    }
    told
}

/// From how many items on each structure beats the linear scan.
fn crossings(surface: &Surface) -> Option<Table> {
    let classes = surface.classes();
    let header = ["faster than linear from".to_owned()].into_iter();
    let mut table = Table::of_numbers(header.chain(classes.iter().map(|c| class(*c))));
    for structure in surface.no_scans() {
        let told = classes
            .iter()
            .map(|class| match surface.crossing(structure, *class) {
                None => String::new(),
                Some(Crossing::Below(items)) => format!("<= {}", text::count(items)),
                Some(Crossing::At(items)) => format!("~ {}", text::count(two_digits(items))),
                Some(Crossing::Above(items)) => format!("> {}", text::count(items)),
            });
        let told: Vec<String> = told.collect();
        if told.iter().any(|cell| !cell.is_empty()) {
            let name = [structure.to_owned()].into_iter();
            table.add_row(name.chain(told));
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

/// An interpolated number is not known more finely.
fn two_digits(items: f64) -> usize {
    let unit = 10f64.powi((items.max(1.0).log10().floor() as i32 - 1).max(0));
    ((items / unit).round() * unit) as usize
}

/// After how many queries each build is repaid against the linear scan.
fn break_even(surface: &Surface) -> Option<Table> {
    let structures = surface.no_scans();
    let header = ["items, visible"]
        .into_iter()
        .chain(structures.iter().copied());
    let mut table = Table::of_numbers(header);
    for place in &surface.places {
        let told = structures.iter().map(|structure| {
            let cell = place.cell(structure);
            match cell.map(|c| (c.value("break_even_queries"), c.value("speedup"))) {
                None => String::new(),
                Some((Some(queries), _)) => text::count(queries as usize),
                // Built no more dearly than the scan's own copy of the items.
                Some((None, Some(ratio))) if ratio > 1.0 => "0".to_owned(),
                Some(_) => "never".to_owned(),
            }
        });
        let name = format!(
            "{}, {}",
            text::count(place.items),
            text::percent(place.share)
        );
        table.add_row([name].into_iter().chain(told));
    }
    (!structures.is_empty()).then_some(table)
}

/// The tables of one surface.
pub fn of_surface(surface: &Surface) -> Vec<Block> {
    let mut blocks = vec![
        Block::Line(
            "The fastest structure (= if differences are not significant) and its speed-up vs \
             linear; none if a scan wins. Shares are rounded on a log scale to 1, 1.5, 2, 3, 5, \
             7, 10, ... percent; (at ...) gives a share that is more than a tenth off. ~ N is \
             interpolated between two sizes, on log scales."
                .to_owned(),
        ),
        Block::Table(winners(surface)),
    ];
    blocks.extend(crossings(surface).map(Block::Table));
    if let Some(rows) = break_even(surface) {
        blocks.push(Block::Line(
            "Queries after which the build pays off against the linear scan:".to_owned(),
        ));
        blocks.push(Block::Table(rows));
    }
    blocks
}

/// How cost grows at a fixed number of visible items.
pub fn of_growths(growths: &[Growth]) -> Table {
    let mut table = Table::of(
        "world, path, cache, test | structure | >visible | >items | >query time ~ N^e, e =",
    );
    for growth in growths {
        let sizes = growth.sizes.first().zip(growth.sizes.last());
        let e = growth.exponent;
        table.add_row([
            format!(
                "{}, {}, {}, {}",
                growth.world, growth.path, growth.cache, growth.test
            ),
            growth.structure.to_owned(),
            text::count(growth.visible.round() as usize),
            sizes.map_or(String::new(), |(least, most)| {
                format!("{} - {}", text::count(*least), text::count(*most))
            }),
            format!(
                "{:.2} [{:.2}, {:.2}]",
                e.value,
                e.lower.unwrap_or(f64::NAN),
                e.upper.unwrap_or(f64::NAN)
            ),
        ]);
    }
    table
}

/// Shows crossovers and growth in tables of at most `width` characters.
pub fn show(out: &mut impl Write, report: &Report, width: usize) -> io::Result<()> {
    let mut tables = Vec::new();
    for surface in surfaces(comparisons(report)) {
        // A world of one size has its ranked tables; that is the surface.
        if surface.sizes().len() < 2 {
            continue;
        }
        let title = format!("\ncrossover surface: {}", title(&surface));
        tables.push((title, winners(&surface)));
        tables.extend(crossings(&surface).map(|rows| (String::new(), rows)));
    }
    let growths = growths(report);
    if !growths.is_empty() {
        let title = "\ngrowth at a fixed number of visible items [95 % interval]";
        tables.push((title.to_owned(), of_growths(&growths)));
    }
    for (title, table) in tables {
        for (n, part) in table.parts(width).iter().enumerate() {
            let title = if n == 0 { &title } else { "" };
            writeln!(out, "{}\n{}", title, part.bare().trim_end())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_and_interpolated_sizes_are_rounded() {
        let shares = [0.001, 0.02, 0.2, 1.0, 0.0005];
        assert_eq!(
            shares.map(class),
            ["0.1 %", "2 %", "20 %", "100 %", "0.05 %"]
        );
        assert_eq!([1234.0, 7.2, 98_765.0].map(two_digits), [1200, 7, 99_000]);
    }
}
