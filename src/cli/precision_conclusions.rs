//! The sentences that `cullbench precision` ends with: what its figures say, from
//! the figures alone.

use std::io::{self, Write};

use super::precision_tables::{Outcome, WIDTH, elsewhere, named, numbers, percent, swept, time};
use super::text;
use crate::precision::{Names, Point, Precision, SWEEPS, SizeRow, SweepRow};

pub fn show(outcome: &Outcome) -> io::Result<()> {
    let mut out = text::terminal();
    writeln!(out, "\nConclusions:")?;
    for sentence in conclusions(outcome) {
        writeln!(out, "{}", text::wrapped(&format!("- {sentence}"), WIDTH))?;
    }
    out.flush()
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
    let errors = point.errors.unwrap_or_default();
    point.times.query_ns.is_some() && errors.false_negatives + errors.touch_dropped == 0
}

fn missed(point: &Point) -> u64 {
    point.errors.map_or(0, |errors| errors.false_negatives)
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
    let extra = |point: &Point| point.errors.map(|errors| errors.false_positives);
    let tight = sound.find(|point| extra(point) < extra(fastest));
    if let Some(tight) = tight {
        all.push(format!(
            "Less excess begins at {} times its time: {}, excess {} %.",
            ratio(tight, fastest),
            named(tight),
            percent(tight.excess)
        ));
    }
    let unsafe_ = p.points.iter().filter(|point| missed(point) > 0);
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
            let extra = |point: &Point| point.errors.unwrap_or_default().false_positives as i64;
            let extra = extra(point) - extra(own);
            told.push(format!(
                "{} {} times ({extra:+} items, {} missed)",
                point.names.arithmetic,
                ratio(point, own),
                missed(point)
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
        let default: u64 = default
            .filter_map(|row| row.errors)
            .map(|e| e.false_negatives)
            .sum();
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
