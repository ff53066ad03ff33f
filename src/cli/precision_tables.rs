//! What `cullbench precision` prints: tables of errors and times, the Pareto
//! fronts and the sweeps. What follows from them is in `precision_conclusions`.

use std::io::{self, Write};

use serde::Serialize;

use super::table::Table;
use super::text;
use crate::precision::{
    CullingErrors, Names, Point, Precision, RegionErrors, SIZE_RATIOS, SWEEPS, SizeRow, SweepRow,
};
use crate::statistics::Rate;
use crate::verify::ErrorCount;

/// A structure with a culling.
pub type CullingPoint = Point<CullingErrors>;

/// Everything that is printed.
#[derive(Serialize)]
pub struct Outcome {
    #[serde(flatten)]
    pub precision: Precision,
    pub seed: u64,
    pub size_sweep: Vec<SizeRow>,
    pub sweeps: Vec<SweepRow>,
}

/// Lines and tables are no wider.
pub const WIDTH: usize = 100;

pub fn show(outcome: &Outcome) -> io::Result<()> {
    let mut out = text::terminal();
    let p = &outcome.precision;
    let mut say = |sentence: &str| writeln!(out, "{}", text::wrapped(sentence, WIDTH));
    let visible = p.points.iter().find_map(|point| point.errors.counts);
    let visible = visible.map_or(0, |errors| errors.visible);
    say(&format!(
        "{}: {}; {}: {}, {} visible in all; {}; {} in each",
        text::plain(&p.scene),
        text::counted(p.items, "item"),
        text::plain(&p.path),
        text::counted(p.cameras, "camera"),
        text::count(visible as usize),
        text::over(p.processes, p.twin.as_ref()),
        text::counted(p.rounds, "round")
    ))?;
    let fastest = fastest(&p.points);
    say(&format!(
        "\nErrors, by test, numbers and planes:\n{}",
        errors_table(&fastest)
    ))?;
    say(
        "± is the 95 % interval over the cameras, < what nothing seen leaves open (3/n). By source: items \
         too many by storage/planes/test, of all cameras. px: how deep \
         the deepest miss reaches into a view 1080 pixels high. Flicker: items that change from a \
         camera to the next of the path while their truth does not, of the visible. c is the factor \
         of the conservative epsilon. Structures have the same errors.",
    )?;
    say(&format!(
        "\nTimes, the fastest structure for each:\n{}",
        times_table(&fastest)
    ))?;
    for point in p.points.iter().filter(|p| p.reason.is_some()) {
        let reason = point.reason.as_deref().unwrap_or_default();
        say(&format!(
            "{}: {}: {reason}",
            named(point),
            point.status.name()
        ))?;
    }
    say(&format!(
        "\nPareto front, fastest first:\n{}",
        front_lines(p)
    ))?;
    say(
        "* On the front: no other point as good in every error, in the depth of its misses, in memory \
         and in time is shown to be better in one. A tie shares it: what is better by the values is \
         not told apart by intervals paired by camera and by process.",
    )?;
    say(&format!(
        "\nRegion search, the fastest structure for each:\n{}",
        regions_table(p)
    ))?;
    say(&format!(
        "\nHow many cameras until the order of the points by time stands:\n{}",
        stability_table(p)
    ))?;
    if !outcome.size_sweep.is_empty() {
        say(&format!(
            "\nExcess (false positives / visible, %) by cube edge s / depth D of the frustum, fov 60, 16:9:\n{}",
            sizes_table(&outcome.size_sweep)
        ))?;
        say(&sizes_note(&outcome.size_sweep))?;
        for (sweep, name, what) in SWEEPS {
            let rows = outcome.sweeps.iter().filter(|row| row.sweep == sweep);
            say(&sweep_shown(name, what, &rows.collect::<Vec<_>>()))?;
        }
    }
    out.flush()
}

pub fn named(point: &CullingPoint) -> String {
    let Names {
        test,
        arithmetic,
        planes,
        epsilon,
    } = point.errors.names;
    format!(
        "{} {test} {arithmetic} {planes} eps {epsilon}",
        point.structure
    )
}

/// A culling in short.
fn culling(point: &CullingPoint) -> String {
    let names = &point.errors.names;
    format!("{} {}", names.test, numbers(names))
}

/// Numbers, planes where they are not the frame's, and epsilon.
pub fn numbers(names: &Names) -> String {
    let planes = match names.planes {
        "frame" => String::new(),
        planes => format!(" {planes}"),
    };
    let epsilon = match names.arithmetic {
        "f64" => String::new(),
        _ => format!(" c={}", names.epsilon),
    };
    format!("{}{planes}{epsilon}", names.arithmetic)
}

/// The first point of each culling, in their order by test; points come fastest
/// first.
fn fastest(points: &[CullingPoint]) -> Vec<&CullingPoint> {
    let mut found: Vec<&CullingPoint> = Vec::new();
    for point in points {
        let is_same = |other: &&CullingPoint| other.errors.names == point.errors.names;
        if !found.iter().any(is_same) {
            found.push(point);
        }
    }
    found.sort_by_key(|p| (p.errors.names.test, culling(p)));
    found
}

pub fn percent(rate: Option<Rate>) -> String {
    text::rate(rate, 100.0)
}

/// What is returned too much: items by storage, by planes and by the test.
fn by_source(errors: &ErrorCount) -> String {
    format!(
        "{}/{}/{}",
        errors.by_storage,
        errors.by_planes,
        errors.by_test()
    )
}

fn errors_table(points: &[&CullingPoint]) -> Table {
    let mut table = Table::of("culling | >excess % | >by source | >missed ppm | >px | >flicker %");
    for point in points {
        let errors = &point.errors;
        table.add_row([
            culling(point),
            percent(errors.excess),
            errors.counts.as_ref().map(by_source).unwrap_or_default(),
            text::rate(errors.false_negative_ppm, 1.0),
            errors
                .worst_miss_px
                .map(text::significant)
                .unwrap_or_default(),
            percent(errors.flicker),
        ]);
    }
    table
}

fn times_table(points: &[&CullingPoint]) -> Table {
    let mut table = Table::of(" | culling | structure | >query [95 % interval] | >B/item | status");
    for point in points {
        let structure = point.structure.split(':').next().unwrap_or_default();
        table.add_row([
            mark(point.on_front, point.is_tie).to_owned(),
            culling(point),
            structure.to_owned(),
            time(&point.times),
            format!("{:.1}", point.errors.memory_bytes_per_item),
            point.status.name().to_owned(),
        ]);
    }
    table
}

fn mark(on_front: bool, is_tie: bool) -> &'static str {
    match (on_front, is_tie) {
        (_, true) => "* tie",
        (true, _) => "*",
        _ => "",
    }
}

pub fn time(times: &crate::precision::Times) -> String {
    text::time_within(times.query_ns, [times.query_ns_lower, times.query_ns_upper])
}

fn front_lines(p: &Precision) -> String {
    let line = |&i: &usize| {
        let point = &p.points[i];
        format!(
            "* {}: {}, {} B/item, excess {} %, missed {} ppm{}",
            named(point),
            point.times.query_ns.map(text::time).unwrap_or_default(),
            text::significant(point.errors.memory_bytes_per_item),
            percent(point.errors.excess),
            text::rate(point.errors.false_negative_ppm, 1.0),
            if point.is_tie { "; tie" } else { "" }
        )
    };
    p.front.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// The fastest point of each kind of numbers.
fn region_rows(p: &Precision) -> Vec<&Point<RegionErrors>> {
    let mut rows: Vec<&Point<RegionErrors>> = Vec::new();
    for point in &p.region_points {
        if !rows
            .iter()
            .any(|row| row.errors.numbers == point.errors.numbers)
        {
            rows.push(point);
        }
    }
    rows
}

fn regions_table(p: &Precision) -> Table {
    let mut table = Table::of(
        " | numbers | structure | >points | >wrong % | >false | >missed | >farthest \
         | >per point",
    );
    for row in region_rows(p) {
        table.add_row([
            mark(row.on_front, row.is_tie).to_owned(),
            row.errors.numbers.to_owned(),
            row.structure.clone(),
            row.errors.points.to_string(),
            percent(row.errors.wrong),
            row.errors.false_region_count.to_string(),
            row.errors.missed_region_count.to_string(),
            format!("{:.2e}", row.errors.worst_false),
            time(&row.times),
        ]);
    }
    table
}

fn stability_table(p: &Precision) -> Table {
    let mut table = Table::of(">cameras | >pairs in final order | >CPU time");
    for row in &p.stability {
        table.add_row([
            row.cameras.to_string(),
            text::percent(row.pairs_in_order),
            text::time(row.seconds * 1e9),
        ]);
    }
    table
}

/// Percent, with how far another seed may come out.
pub fn elsewhere(rate: Option<Rate>) -> String {
    let rate = rate.map(|rate| rate.per(100.0));
    rate.map_or_else(String::new, |rate| {
        text::plus_minus(rate.value, rate.elsewhere)
    })
}

/// Tests by ratios.
fn sizes_table(rows: &[SizeRow]) -> Table {
    let mut header = vec!["s/D".to_owned()];
    header.extend(rows.iter().map(|row| row.size_over_depth.to_string()));
    let mut table = Table::of_numbers(header);
    let visible = rows.iter().map(|row| text::count(row.visible as usize));
    table.add_row(["visible".to_owned()].into_iter().chain(visible));
    for (i, test) in rows[0].tests.iter().enumerate() {
        let excess = rows.iter().map(|row| elsewhere(row.tests[i].excess));
        table.add_row([test.test.to_owned()].into_iter().chain(excess));
    }
    table
}

/// What the table rests on, and what each test costs.
fn sizes_note(rows: &[SizeRow]) -> String {
    let first = &rows[0];
    let middle = rows
        .iter()
        .find(|row| row.size_over_depth == SIZE_RATIOS[2]);
    let costs = middle.unwrap_or(first).tests.iter().filter_map(|t| {
        let ns = text::significant(t.ns_per_box?);
        Some(format!("{} {ns}", t.test))
    });
    format!(
        "{} frusta and {} for each ratio; ± is how far another seed may come out (99.999 %), from the \
         spread over the frusta. ns per box in blocks of sixteen: {}.",
        text::count(first.frusta),
        text::counted(first.cubes as usize, "cube"),
        costs.collect::<Vec<_>>().join(", ")
    )
}

/// A value of a sweep: as a power of two where it is a large one.
pub fn swept(value: f64) -> String {
    match value {
        power if power >= 1024.0 && power.log2().fract() == 0.0 => format!("2^{}", power.log2()),
        plain if plain == 0.0 || (1e-3..1e3).contains(&plain) => plain.to_string(),
        _ => format!("{value:e}"),
    }
}

/// A sweep as a table of what loses anything, and a line of what does not.
fn sweep_shown(name: &str, what: &str, rows: &[&SweepRow]) -> String {
    let mut values: Vec<f64> = rows.iter().map(|row| row.value).collect();
    values.dedup();
    let mut header = vec!["six-plane".to_owned()];
    header.extend(
        values
            .iter()
            .map(|value| format!("{value:.4e}").replace(".0000", "")),
    );
    let mut table = Table::of_numbers(header);
    let (mut losers, mut sound) = (0, Vec::new());
    for kind in rows.iter().filter(|row| row.value == values[0]) {
        let own: Vec<&&SweepRow> = rows.iter().filter(|row| row.names == kind.names).collect();
        let is_sound = |row: &&&SweepRow| row.errors.is_some_and(|e| e.false_negatives == 0);
        if own.iter().all(is_sound) {
            sound.push(numbers(&kind.names));
            continue;
        }
        losers += 1;
        let ppm = own.iter().map(|row| match &row.refused {
            Some(_) => "refused".to_owned(),
            None => text::rate(row.false_negative_ppm, 1.0),
        });
        let label = numbers(&kind.names);
        let is_named = kind.names.planes != "frame";
        let short = label.strip_prefix("f32 ").filter(|_| is_named);
        let label = short.unwrap_or(&label).to_owned();
        table.add_row([label].into_iter().chain(ppm));
    }
    let least = rows.iter().filter_map(|row| row.false_negative_ppm?.upper);
    let least = least.fold(f64::INFINITY, f64::min);
    let sound = match sound.is_empty() {
        true => String::new(),
        false => format!(
            "Nothing missed (below {} ppm): {}.",
            text::significant(least),
            sound.join(", ")
        ),
    };
    let table = match losers {
        0 => String::new(),
        _ => format!("{table}\n"),
    };
    format!("\nMissed visible items (ppm) by {name} ({what}), nothing rebased:\n{table}{sound}")
}
