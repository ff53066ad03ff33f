//! Tables of `cullbench precision`: errors and times, the Pareto fronts and the
//! sweeps. Sentences about them are in `precision_conclusions`.

use std::io::{self, Write};

use serde::Serialize;

use super::table::{Column, Table};
use super::text::{self, some};
use crate::precision::{
    CullingErrors, Names, Point, Precision, RegionErrors, SIZE_RATIOS, SWEEPS, SizeRow,
    StableAfter, SweepRow,
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
        "± is the 95 % interval over the cameras; <: none observed, 95 % upper bound 3/n. FP: false \
         positives, % of the visible items; by source: storage/planes/test, of all cameras. px: how deep \
         the deepest miss reaches into a view 1080 pixels high. Flicker: items that change between \
         successive cameras of the path while their truth does not, of the visible. c is the factor \
         of the conservative epsilon. All structures have the same errors.",
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
        "* On the Pareto front: no other point is significantly better in an error, the depth of \
         misses, memory or time and as good in the rest. Points that do not differ significantly \
         (intervals paired by camera and by process) share the front.",
    )?;
    say(&format!(
        "\nRegion search, the fastest structure for each:\n{}",
        regions_table(p)
    ))?;
    say(&format!(
        "\nNumber of cameras after which the order of the points by time is final:\n{}",
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
    let (structure, names) = (&point.structure, &point.errors.names);
    let (test, arithmetic, planes) = (names.test, names.arithmetic, names.planes);
    format!(
        "{structure} {test} {arithmetic} {planes} eps {}",
        names.epsilon
    )
}

/// A culling in short.
fn culling(point: &CullingPoint) -> String {
    let names = &point.errors.names;
    format!("{} {}", names.test, numbers(names))
}

/// Numbers, planes where they are not the frame's, and epsilon.
pub fn numbers(names: &Names) -> String {
    let Names {
        arithmetic, planes, ..
    } = names;
    let planes = match *planes {
        "frame" => String::new(),
        planes => format!(" {planes}"),
    };
    let epsilon = match *arithmetic {
        "f64" => String::new(),
        _ => format!(" c={}", names.epsilon),
    };
    format!("{arithmetic}{planes}{epsilon}")
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

/// False positives by source: storage, planes and test.
fn by_source(errors: &ErrorCount) -> String {
    let (storage, planes, test) = (errors.by_storage, errors.by_planes, errors.by_test());
    format!("{storage}/{planes}/{test}")
}

fn errors_table(points: &[&CullingPoint]) -> Table {
    let columns: &[Column<&&CullingPoint>] = &[
        ("culling", |point| culling(point)),
        (">FP %", |point| percent(point.errors.excess)),
        (">by source", |point| {
            some(point.errors.counts.as_ref(), by_source)
        }),
        (">missed ppm", |point| {
            text::rate(point.errors.false_negative_ppm, 1.0)
        }),
        (">px", |point| {
            some(point.errors.worst_miss_px, text::significant)
        }),
        (">flicker %", |point| percent(point.errors.flicker)),
    ];
    Table::with(points, columns)
}

fn times_table(points: &[&CullingPoint]) -> Table {
    let columns: &[Column<&&CullingPoint>] = &[
        ("", |point| mark(point.on_front, point.is_tie).to_owned()),
        ("culling", |point| culling(point)),
        ("structure", |point| {
            let name = point.structure.split(':').next();
            name.unwrap_or_default().to_owned()
        }),
        (">query [95 % interval]", |point| time(&point.times)),
        (">B/item", |point| {
            format!("{:.1}", point.errors.memory_bytes_per_item)
        }),
        ("status", |point| point.status.name().to_owned()),
    ];
    Table::with(points, columns)
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
            "* {}: {}, {} B/item, FP {} %, missed {} ppm{}",
            named(point),
            some(point.times.query_ns, text::time),
            text::significant(point.errors.memory_bytes_per_item),
            percent(point.errors.excess),
            text::rate(point.errors.false_negative_ppm, 1.0),
            if point.is_tie { "; tie" } else { "" }
        )
    };
    p.front.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// The fastest point of each kind of numbers.
fn regions_table(p: &Precision) -> Table {
    let mut rows: Vec<&Point<RegionErrors>> = Vec::new();
    for point in &p.region_points {
        let is_same = |row: &&Point<RegionErrors>| row.errors.numbers == point.errors.numbers;
        if !rows.iter().any(is_same) {
            rows.push(point);
        }
    }
    let columns: &[Column<&Point<RegionErrors>>] = &[
        ("", |row| mark(row.on_front, row.is_tie).to_owned()),
        ("numbers", |row| row.errors.numbers.to_owned()),
        ("structure", |row| row.structure.clone()),
        (">points", |row| row.errors.points.to_string()),
        (">wrong %", |row| percent(row.errors.wrong)),
        (">false", |row| row.errors.false_region_count.to_string()),
        (">missed", |row| row.errors.missed_region_count.to_string()),
        (">farthest", |row| format!("{:.2e}", row.errors.worst_false)),
        (">per point", |row| time(&row.times)),
    ];
    Table::with(rows, columns)
}

fn stability_table(p: &Precision) -> Table {
    let columns: &[Column<&StableAfter>] = &[
        (">cameras", |row| row.cameras.to_string()),
        (">pairs in final order", |row| {
            text::percent(row.pairs_in_order)
        }),
        (">CPU time", |row| text::time(row.seconds * 1e9)),
    ];
    Table::with(&p.stability, columns)
}

/// Percent, with how far another seed may come out.
pub fn elsewhere(rate: Option<Rate>) -> String {
    some(rate.map(|rate| rate.per(100.0)), |rate| {
        text::plus_minus(rate.value, rate.elsewhere)
    })
}

/// Tests by ratios.
fn sizes_table(rows: &[SizeRow]) -> Table {
    let ratios = rows.iter().map(|row| row.size_over_depth.to_string());
    let mut table = Table::of_numbers(["s/D".to_owned()].into_iter().chain(ratios));
    let visible = rows.iter().map(|row| text::count(row.visible as usize));
    table.add_row(["visible".to_owned()].into_iter().chain(visible));
    for (i, test) in rows[0].tests.iter().enumerate() {
        let excess = rows.iter().map(|row| elsewhere(row.tests[i].excess));
        table.add_row([test.test.to_owned()].into_iter().chain(excess));
    }
    table
}

/// Basis of the table, and the cost of each test.
fn sizes_note(rows: &[SizeRow]) -> String {
    let first = &rows[0];
    let mut middle = rows
        .iter()
        .filter(|row| row.size_over_depth == SIZE_RATIOS[2]);
    let tests = middle.next().unwrap_or(first).tests.iter();
    let costs = tests.filter_map(|t| {
        let ns = text::significant(t.ns_per_box?);
        Some(format!("{} {ns}", t.test))
    });
    format!(
        "{} frusta and {} for each ratio; ± bounds the result of another seed (99.999 %), from \
         the spread over the frusta. ns per box in blocks of sixteen: {}.",
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
    let head = |value: &f64| format!("{value:.4e}").replace(".0000", "");
    let header = ["six-plane".to_owned()].into_iter();
    let mut table = Table::of_numbers(header.chain(values.iter().map(head)));
    let mut sound = Vec::new();
    for kind in rows.iter().filter(|row| row.value == values[0]) {
        let own: Vec<&&SweepRow> = rows.iter().filter(|row| row.names == kind.names).collect();
        let is_sound = |row: &&&SweepRow| row.errors.is_some_and(|e| e.false_negatives == 0);
        if own.iter().all(is_sound) {
            sound.push(numbers(&kind.names));
            continue;
        }
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
    let table = match table.rows.is_empty() {
        true => String::new(),
        false => format!("{table}\n"),
    };
    format!("\nMissed visible items (ppm) by {name} ({what}), nothing rebased:\n{table}{sound}")
}
