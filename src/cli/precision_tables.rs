//! What `cullbench precision` prints: tables of errors and times, the Pareto
//! fronts, the sweeps, and what follows from them.

use std::io::{self, Write};

use serde::Serialize;

use super::text;
use crate::measure::Status;
use crate::precision::{
    Names, Point, Precision, RegionPoint, SIZE_RATIOS, SWEEPS, SizeRow, SweepRow,
};
use crate::statistics::Rate;
use crate::verify::ErrorCount;

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
const WIDTH: usize = 100;

pub fn show(outcome: &Outcome) -> io::Result<()> {
    let mut out = text::terminal();
    let p = &outcome.precision;
    let mut say = |sentence: &str| writeln!(out, "{}", text::wrapped(sentence, WIDTH));
    let visible = p.points.first().map_or(0, |point| point.errors.visible);
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
        "* On the front: by no values is another point as good in every error, in the depth of its \
         misses, in memory and in time. A tie is off it by values that intervals paired by camera \
         and by process do not tell apart.",
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
    say("\nConclusions:")?;
    for sentence in conclusions(outcome) {
        say(&format!("- {sentence}"))?;
    }
    out.flush()
}

fn named(point: &Point) -> String {
    let Names {
        test,
        arithmetic,
        planes,
        epsilon,
    } = point.names;
    format!(
        "{} {test} {arithmetic} {planes} eps {epsilon}",
        point.structure
    )
}

/// A culling in short; items in few bits are told by how they are stored.
fn culling(point: &Point) -> String {
    let Names { test, .. } = point.names;
    match point.structure.strip_prefix("quantised:") {
        Some(stored) => format!("{test} {stored}"),
        None => format!("{test} {}", numbers(&point.names)),
    }
}

/// Numbers, planes where they are not the frame's, and epsilon.
fn numbers(names: &Names) -> String {
    let planes = match names.planes {
        "frame" => String::new(),
        planes => format!(" {planes}"),
    };
    let is_f64 = matches!(names.arithmetic, "f64" | "double-double" | "interval");
    let epsilon = match is_f64 {
        true => String::new(),
        false => format!(" c={}", names.epsilon),
    };
    format!("{}{planes}{epsilon}", names.arithmetic)
}

/// The first point of each culling, in their order by test; points come fastest
/// first.
fn fastest(points: &[Point]) -> Vec<&Point> {
    let mut found: Vec<&Point> = Vec::new();
    for point in points {
        let is_same = |other: &&Point| culling(other) == culling(point);
        if !found.iter().any(is_same) {
            found.push(point);
        }
    }
    let key = |p: &Point| {
        (
            p.structure.starts_with("quantised:"),
            p.names.test,
            culling(p),
        )
    };
    found.sort_by_key(|p| key(p));
    found
}

fn percent(rate: Option<Rate>) -> String {
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

fn errors_table(points: &[&Point]) -> text::Table {
    let header = [
        "culling",
        "excess %",
        "by source",
        "missed ppm",
        "px",
        "flicker %",
    ];
    let mut table = text::table(&header, &[1, 2, 3, 4, 5]);
    for point in points {
        let judged = point.status != Status::Refused;
        let of = |value: String| if judged { value } else { String::new() };
        table.add_row([
            culling(point),
            percent(point.excess),
            of(by_source(&point.errors)),
            text::rate(point.false_negative_ppm, 1.0),
            of(point
                .worst_miss_px
                .map(text::significant)
                .unwrap_or_default()),
            percent(point.flicker),
        ]);
    }
    table
}

fn times_table(points: &[&Point]) -> text::Table {
    let header = [
        "",
        "culling",
        "structure",
        "query [95 % interval]",
        "B/item",
        "status",
    ];
    let mut table = text::table(&header, &[3, 4]);
    for point in points {
        let structure = point.structure.split(':').next().unwrap_or_default();
        let memory = point.memory_bytes_per_item.map(|b| format!("{b:.1}"));
        table.add_row([
            mark(point.on_front, point.is_tie).to_owned(),
            culling(point),
            structure.to_owned(),
            time(&point.times),
            memory.unwrap_or_default(),
            point.status.name().to_owned(),
        ]);
    }
    table
}

fn mark(on_front: bool, is_tie: bool) -> &'static str {
    match (on_front, is_tie) {
        (true, _) => "*",
        (_, true) => "tie",
        _ => "",
    }
}

fn time(times: &crate::precision::Times) -> String {
    text::time_within(times.query_ns, [times.query_ns_lower, times.query_ns_upper])
}

fn front_lines(p: &Precision) -> String {
    let line = |&i: &usize| {
        let point = &p.points[i];
        let is_tie = |other: &&Point| other.is_tie && other.dominated_by == Some(i);
        let ties = p.points.iter().filter(is_tie).count();
        let memory = point.memory_bytes_per_item.unwrap_or(f64::NAN);
        format!(
            "* {}: {}, {} B/item, excess {} %, missed {} ppm{}",
            named(point),
            point.times.query_ns.map(text::time).unwrap_or_default(),
            text::significant(memory),
            percent(point.excess),
            text::rate(point.false_negative_ppm, 1.0),
            match ties {
                0 => String::new(),
                _ => format!("; {}", text::counted(ties, "tie")),
            }
        )
    };
    p.front.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// The fastest point of each kind of numbers.
fn region_rows(p: &Precision) -> Vec<&RegionPoint> {
    let mut rows: Vec<&RegionPoint> = Vec::new();
    for point in &p.region_points {
        if !rows.iter().any(|row| row.numbers == point.numbers) {
            rows.push(point);
        }
    }
    rows
}

fn regions_table(p: &Precision) -> text::Table {
    let header = [
        "",
        "numbers",
        "structure",
        "points",
        "wrong %",
        "false",
        "missed",
        "farthest",
        "per point",
    ];
    let mut table = text::table(&header, &[3, 4, 5, 6, 7, 8]);
    for row in region_rows(p) {
        table.add_row([
            mark(row.on_front, row.is_tie).to_owned(),
            row.numbers.to_owned(),
            row.structure.clone(),
            row.points.to_string(),
            percent(row.wrong),
            row.false_region_count.to_string(),
            row.missed_region_count.to_string(),
            format!("{:.2e}", row.worst_false),
            time(&row.times),
        ]);
    }
    table
}

fn stability_table(p: &Precision) -> text::Table {
    let mut table = text::table(&["cameras", "pairs in final order", "CPU time"], &[0, 1, 2]);
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
fn elsewhere(rate: Option<Rate>) -> String {
    let rate = rate.map(|rate| rate.per(100.0));
    rate.map_or_else(String::new, |rate| {
        text::plus_minus(rate.value, rate.elsewhere)
    })
}

/// Tests by ratios.
fn sizes_table(rows: &[SizeRow]) -> text::Table {
    let mut header = vec!["s/D".to_owned()];
    header.extend(rows.iter().map(|row| row.size_over_depth.to_string()));
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut table = text::table(&header, &(1..header.len()).collect::<Vec<_>>());
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
fn swept(value: f64) -> String {
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
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut table = text::table(&header, &(1..header.len()).collect::<Vec<_>>());
    let (mut losers, mut sound) = (0, Vec::new());
    for kind in rows.iter().filter(|row| row.value == values[0]) {
        let own: Vec<&&SweepRow> = rows.iter().filter(|row| row.names == kind.names).collect();
        let is_sound = |row: &&&SweepRow| row.refused.is_none() && row.errors.false_negatives == 0;
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

/// What the figures say, sentence by sentence.
fn conclusions(outcome: &Outcome) -> Vec<String> {
    let p = &outcome.precision;
    let mut all = Vec::new();
    all.extend(of_points(p));
    all.extend(of_numbers(p));
    all.extend(of_storage(p));
    all.extend(of_regions(p));
    all.extend(of_sizes(&outcome.size_sweep));
    all.extend(of_sweeps(&outcome.sweeps));
    all
}

/// No visible item missed, and a time.
fn is_sound(point: &&Point) -> bool {
    let errors = &point.errors;
    point.times.query_ns.is_some() && errors.false_negatives + errors.touch_dropped == 0
}

fn ratio(a: &Point, b: &Point) -> String {
    let both = a.times.query_ns.zip(b.times.query_ns);
    text::significant(both.map_or(f64::NAN, |(a, b)| a / b))
}

fn of_points(p: &Precision) -> Vec<String> {
    // The margin is proven for these: docs/NUMERICS.md.
    let proven = ["f32", "f32-relative", "f32-fma"];
    let safe = |point: &&Point| {
        let Names {
            arithmetic,
            epsilon,
            ..
        } = point.names;
        arithmetic == "interval" || epsilon > 0.0 && proven.contains(&arithmetic)
    };
    let mut sound = p.points.iter().filter(is_sound).filter(safe);
    let Some(fastest) = sound.clone().next() else {
        return vec!["No point that is safe by its margin has a time.".to_owned()];
    };
    let mut all = vec![format!(
        "Fastest of those that cannot miss anything: {} at {}, excess {} %.",
        named(fastest),
        time(&fastest.times),
        percent(fastest.excess)
    )];
    let tight = sound.find(|point| point.errors.false_positives < fastest.errors.false_positives);
    if let Some(tight) = tight {
        all.push(format!(
            "Less excess begins at {} times its time: {}, excess {} %.",
            ratio(tight, fastest),
            named(tight),
            percent(tight.excess)
        ));
    }
    let unsafe_ = p
        .points
        .iter()
        .filter(|point| point.errors.false_negatives > 0);
    let worst = unsafe_.max_by(|a, b| {
        a.worst_miss_px
            .unwrap_or(0.0)
            .total_cmp(&b.worst_miss_px.unwrap_or(0.0))
    });
    all.push(match worst {
        Some(worst) => format!(
            "Missed items: up to {} pixels deep ({}).",
            text::significant(worst.worst_miss_px.unwrap_or(0.0)),
            named(worst)
        ),
        None => "No point missed a visible item on these cameras.".to_owned(),
    });
    all
}

/// The other numbers against f32, in the same loop.
fn of_numbers(p: &Precision) -> Option<String> {
    let mut scans = p.points.iter().filter(|point| point.structure == "scan");
    let own = scans
        .clone()
        .find(|point| point.names.arithmetic == "f32")?;
    let mut told: Vec<String> = Vec::new();
    let timed = scans
        .by_ref()
        .filter(|point| point.times.query_ns.is_some());
    for point in timed {
        let is_new = !told
            .iter()
            .any(|line| line.starts_with(point.names.arithmetic));
        if point.names.arithmetic != "f32" && is_new {
            let extra = point.errors.false_positives as i64 - own.errors.false_positives as i64;
            told.push(format!(
                "{} {} times ({extra:+} items, {} missed)",
                point.names.arithmetic,
                ratio(point, own),
                point.errors.false_negatives
            ));
        }
    }
    Some(format!(
        "In the same loop, against f32 with epsilon: {}.",
        told.join("; ")
    ))
}

fn of_storage(p: &Precision) -> Option<String> {
    let memory = |point: &&Point| point.memory_bytes_per_item.unwrap_or(f64::INFINITY);
    let least = p.points.iter().filter(is_sound);
    let least = least.min_by(|a, b| memory(a).total_cmp(&memory(b)))?;
    Some(format!(
        "Least memory: {} at {} B/item, excess {} %, {}.",
        named(least),
        text::significant(memory(&least)),
        percent(least.excess),
        least.times.query_ns.map(text::time).unwrap_or_default()
    ))
}

fn of_regions(p: &Precision) -> Option<String> {
    let of = |numbers: &str| {
        p.region_points
            .iter()
            .find(|point| point.numbers == numbers)
    };
    let (plain, checked) = (of("f32")?, of("f32 + check")?);
    let same = p.region_points.iter();
    let mut same = same.filter(|c| c.numbers == "f32 + check" && c.structure == plain.structure);
    let cost = same
        .next()
        .and_then(|c| c.times.query_ns)
        .zip(plain.times.query_ns);
    Some(format!(
        "Region search in f32 is wrong for {} % of {} (farthest {} outside); an exact look at the hits \
         leaves {} wrong and takes {} times as long on {}.",
        percent(plain.wrong),
        text::counted(plain.points as usize, "point"),
        text::significant(plain.worst_false),
        checked.false_region_count + checked.missed_region_count,
        text::significant(cost.map_or(f64::NAN, |(a, b)| a / b)),
        plain.structure
    ))
}

fn of_sizes(rows: &[SizeRow]) -> Option<String> {
    let of = |row: &SizeRow, test: &str| {
        let found = row.tests.iter().find(|t| t.test == test);
        elsewhere(found.and_then(|t| t.excess))
    };
    let (first, last) = (rows.first()?, rows.last()?);
    Some(format!(
        "Six planes return {} % too much at s/D = {} and {} % at {}; the exact test with epsilon {} and \
         {} %.",
        of(first, "six-plane"),
        first.size_over_depth,
        of(last, "six-plane"),
        last.size_over_depth,
        of(first, "exact + epsilon"),
        of(last, "exact + epsilon")
    ))
}

/// Who loses most over each sweep, and whether the default does.
fn of_sweeps(rows: &[SweepRow]) -> Vec<String> {
    let of = |(sweep, name, _): &(_, &str, _)| {
        let own = rows.iter().filter(|row| row.sweep == *sweep);
        let lost = |row: &&SweepRow| row.false_negative_ppm.map_or(0.0, |rate| rate.value);
        let worst = own.clone().max_by(|a, b| lost(a).total_cmp(&lost(b)))?;
        let default = own.filter(|row| numbers(&row.names) == "f32 c=8");
        let default: u64 = default.map(|row| row.errors.false_negatives).sum();
        if lost(&worst) == 0.0 {
            return Some(format!("Over {name} nothing is missed by any."));
        }
        Some(format!(
            "Over {name} the default misses {default}; most is missed by {} at {}: {} ppm.",
            numbers(&worst.names),
            swept(worst.value),
            text::rate(worst.false_negative_ppm, 1.0)
        ))
    };
    SWEEPS.iter().filter_map(of).collect()
}
