//! Tables of `cullbench precision`: errors, the Pareto front and the sweeps.
//! Sentences about them are in `precision_conclusions`.

use super::document::Block;
use super::table::{Column, Table};
use super::text::{self, significant, some, time_plus_minus};
use crate::precision::{Names, Point, Precision, SWEEPS, Sweep, SweepRow};
use crate::report::grouped;
use crate::statistics::Estimate;

/// The Pareto front within `room` characters.
///
/// With `all` the errors of every culling and the sweeps too.
pub fn blocks(p: &Precision, all: bool, room: usize) -> Vec<Block> {
    let visible = p.points.iter().find_map(|point| point.counts);
    let visible = visible.map_or(0, |errors| errors.visible);
    let items = text::items(p.items, p.skipped_items);
    let cameras = text::counted(p.cameras, "camera");
    let rounds = text::counted(p.rounds, "round");
    let visible = text::count(visible as usize);
    let over = text::over(p.processes, p.twin.as_ref());
    let head = format!(
        "{}: {items}; {}: {cameras}, {visible} visible in all; {over}; {rounds} in each",
        p.scene, p.path
    );
    let mut blocks = vec![Block::Line(head)];
    let mut add = |title: &str, table: Table, note: &str| {
        blocks.extend(Block::section(title, table));
        blocks.extend((!note.is_empty()).then(|| Block::line(note)));
    };
    if all {
        let title = "Errors, by test, numbers and planes";
        add(title, errors_table(&p.points), ERRORS_NOTE);
    }
    let title = "Pareto front of error, memory and time, fastest first";
    let whole = front_table(p);
    let front = whole.within(room, &["tie", "B/item", "FN ppm"]);
    let heads = whole.header.iter();
    let gone = match text::joined(heads.filter(|head| !front.header.contains(head))) {
        none if none.is_empty() => none,
        gone => format!(" Columns that do not fit here: {gone}."),
    };
    add(title, front, &(FRONT_NOTE.to_owned() + &gone));
    if all && !p.sweeps.is_empty() {
        for (sweep, name, what) in SWEEPS {
            let rows = p.sweeps.iter().filter(|row| row.sweep == sweep);
            let (table, note) = swept_errors(&rows.collect::<Vec<_>>());
            let title = match sweep {
                Sweep::Size => format!("False positives (% of visible) by {name} ({what})"),
                _ => format!("Missed visible items (ppm) by {name} ({what}), nothing rebased"),
            };
            add(&title, table, &note);
        }
    }
    let failed = p.points.iter().filter_map(|point| {
        let why = format!("{}: {}", point.status.name(), point.reason.as_ref()?);
        Some((why, named(point)))
    });
    let line = |(why, names): (String, Vec<String>)| match &names[..] {
        [first, _, ..] => format!("{} points, such as {first}: {why}", names.len()),
        _ => format!("{}: {why}", names.concat()),
    };
    blocks.extend(grouped(failed).into_iter().map(line).map(Block::Line));
    blocks
}

/// Explanation of the errors.
const ERRORS_NOTE: &str = "± is the 95 % interval over the cameras; <: none observed, 95 % upper \
     bound 3/n. FP: false positives, % of the visible items; by source: storage/planes/test, of all \
     cameras. px: how deep the deepest miss reaches into a view 1080 pixels high. \
     c is the factor of the conservative epsilon. All structures have the same errors.";

/// Meaning of the front.
const FRONT_NOTE: &str = "No other point is significantly better in an error, the depth of misses, \
     memory or time and as good in the rest (intervals paired by camera and by process). c: factor \
     of the conservative epsilon. FP: false positives, % of the visible items; FN: visible items \
     missed, millionths; <: none observed, 95 % upper bound.";

pub fn named(point: &Point) -> String {
    format!("{} with {}", structure(point), culling(&point.names))
}

/// A culling in short.
pub fn culling(names: &Names) -> String {
    format!("{} {}", names.test, numbers(names))
}

/// Numbers, planes where they are not the frame's, and epsilon.
pub fn numbers(names: &Names) -> String {
    let arithmetic = names.arithmetic;
    let planes = Some(names.planes).filter(|planes| *planes != "frame");
    let planes = some(planes, |planes| format!(" {planes}"));
    let epsilon = (arithmetic != "f64").then_some(names.epsilon);
    let epsilon = some(epsilon, |c| format!(" c={c}"));
    format!("{arithmetic}{planes}{epsilon}")
}

pub fn percent(rate: Option<Estimate>) -> String {
    text::rate(rate, 100.0)
}

/// Errors of each culling, the same on every structure.
fn errors_table(points: &[Point]) -> Table {
    let all = grouped(points.iter().map(|p| (&p.names, p)));
    let mut points: Vec<&Point> = all.iter().map(|(_, own)| own[0]).collect();
    points.sort_by_key(|p| (p.names.test, culling(&p.names)));
    let columns: &[Column<&Point>] = &[
        ("culling", |p| culling(&p.names)),
        (">FP %", |p| match p.counts {
            None => p.status.name().to_owned(),
            Some(_) => percent(p.excess),
        }),
        (">by source", |p| some(p.counts, text::sources)),
        (">FN ppm", |p| text::rate(p.false_negative_ppm, 1.0)),
        (">px", |p| some(p.worst_miss_px, significant)),
    ];
    Table::with(points, columns)
}

fn front_table(p: &Precision) -> Table {
    let columns: &[Column<&Point>] = &[
        ("structure", |p| structure(p)),
        ("culling", |p| culling(&p.names)),
        (">query", |p| time_plus_minus(p.time)),
        (">FP %", |p| percent(p.excess)),
        (">FN ppm", |p| text::rate(p.false_negative_ppm, 1.0)),
        (">B/item", |p| text::tenths(p.memory_bytes_per_item)),
        ("tie", |p| if p.is_tie { "tie" } else { "" }.to_owned()),
    ];
    let points = p.front.iter().map(|&i| &p.points[i]);
    Table::with(points, columns).without_empty_columns()
}

/// The structure without its parameters.
fn structure(point: &Point) -> String {
    let name = point.structure.split(':').next();
    name.unwrap_or_default().to_owned()
}

/// A value of a sweep: as a power of two where it is a large one.
pub fn swept(value: f64) -> String {
    match value {
        power if power >= 1024.0 && power.log2().fract() == 0.0 => format!("2^{}", power.log2()),
        plain if plain == 0.0 || (1e-3..1e3).contains(&plain) => plain.to_string(),
        _ => format!("{value:e}"),
    }
}

/// Table of the cullings that have any error, and a line on the others.
fn swept_errors(rows: &[&SweepRow]) -> (Table, String) {
    type Named = fn(&Names) -> String;
    let ([header, nothing, unit], name): (_, Named) = match rows[0].sweep {
        Sweep::Size => (["culling", "No false positives", "%"], culling),
        // All are of one test.
        _ => (["six-plane", "Nothing missed", "ppm"], numbers),
    };
    let all = grouped(rows.iter().map(|row| (&row.names, *row)));
    let head = all[0].1.iter().map(|row| swept(row.value));
    let mut table = Table::of_numbers([header.to_owned()].into_iter().chain(head));
    let is_sound = |row: &&SweepRow| row.error().is_some_and(|rate| rate.value == 0.0);
    let all = all.into_iter();
    let (sound, others): (Vec<_>, Vec<_>) = all.partition(|(_, own)| own.iter().all(is_sound));
    for (names, own) in others {
        let errors = own.iter().map(|row| match &row.refused {
            Some(_) => "refused".to_owned(),
            None => text::rate(row.error(), 1.0),
        });
        let label = name(names);
        let short = label.strip_prefix("f32 ");
        let short = short.filter(|_| names.planes != "frame");
        let label = short.unwrap_or(&label).to_owned();
        table.add_row([label].into_iter().chain(errors));
    }
    let uppers = sound.iter().flat_map(|(_, own)| own);
    let bound = uppers.filter_map(|row| row.error()?.upper);
    let bound = bound.fold(0.0, f64::max);
    let sound: Vec<String> = sound.iter().map(|(names, _)| name(names)).collect();
    let sound = some(sound.first(), |_| {
        let (bound, sound) = (significant(bound), sound.join(", "));
        format!("{nothing} (below {bound} {unit}): {sound}.")
    });
    (table, sound)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::precision::sweep;

    #[test]
    fn what_nothing_missed_means_is_the_largest_bound() {
        let mut rows = sweep(Sweep::Offset, 1, 1);
        let (first, last) = (rows[0].names, rows.last().expect("a row").names);
        assert_ne!(first, last);
        for (row, bound) in rows.iter_mut().zip([2.0, 1.0].into_iter().cycle()) {
            let misses = u64::from(row.names == last);
            row.errors = Some(crate::verify::ErrorCount {
                false_negatives: misses,
                ..Default::default()
            });
            row.false_negative_ppm = Some(crate::statistics::Estimate {
                value: misses as f64,
                lower: None,
                upper: Some(bound + 9.0 * misses as f64),
            });
        }
        let (_, told) = swept_errors(&rows.iter().collect::<Vec<_>>());
        assert!(
            told.starts_with("Nothing missed (below 2.00 ppm): "),
            "{told}"
        );
    }
}
