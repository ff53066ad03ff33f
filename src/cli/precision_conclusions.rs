//! The sentences that `cullbench precision` ends with: what its figures say, from
//! the figures alone.

use super::diagram;
use super::error_figure::{Measured, against};
use super::figure::{Figure, ends};
use super::precision_tables::{CullingPoint, elsewhere, named, numbers, percent, swept};
use super::text;
use crate::measure::Status;
use crate::precision::{Point, Precision, RegionErrors, SWEEPS, SizeRow, SweepRow};
use crate::statistics::Rate;

pub fn conclusions(p: &Precision) -> Vec<String> {
    let (sizes, sweeps) = (of_sizes(&p.size_sweep), of_sweeps(&p.sweeps));
    let others = [of_storage(p), of_regions(p), sizes, sweeps].into_iter();
    of_points(p).into_iter().chain(others.flatten()).collect()
}

/// No visible item missed, a margin that is proven (docs/NUMERICS.md), and a time.
fn is_safe(point: &&CullingPoint) -> bool {
    let errors = point.errors.counts.unwrap_or_default();
    let missed = errors.false_negatives + errors.touch_dropped;
    point.time.is_some() && missed == 0 && point.errors.names.epsilon > 0.0
}

fn missed(point: &CullingPoint) -> u64 {
    point.errors.counts.unwrap_or_default().false_negatives
}

fn ratio(a: &CullingPoint, b: &CullingPoint) -> String {
    let both = a.query_ns().zip(b.query_ns());
    text::significant(both.map_or(f64::NAN, |(a, b)| a / b))
}

/// The false positives of a point in words.
fn extras(point: &CullingPoint) -> String {
    match point.errors.excess {
        None => "nothing is visible".to_owned(),
        excess => format!("false positives {} %", percent(excess)),
    }
}

fn of_points(p: &Precision) -> Vec<String> {
    let mut sound = p.points.iter().filter(is_safe);
    let Some(fastest) = sound.clone().next() else {
        return vec!["No point that is safe by its margin has a time.".to_owned()];
    };
    let (name, time) = (named(fastest), text::time_plus_minus(fastest.time));
    let mut all = vec![format!(
        "Fastest point that cannot miss an item: {name} at {time}, {}.",
        extras(fastest)
    )];
    let extra = |point: &CullingPoint| point.errors.counts.map(|errors| errors.false_positives);
    let tight = sound.find(|point| extra(point) < extra(fastest));
    if let Some(tight) = tight {
        let (times, name, extra) = (ratio(tight, fastest), named(tight), extras(tight));
        all.push(format!(
            "Fewer false positives take {times} times as long or more: {name}, {extra}."
        ));
    }
    let depth = |point: &CullingPoint| point.errors.worst_miss_px.unwrap_or(0.0);
    let unsafe_ = p.points.iter().filter(|point| missed(point) > 0);
    let worst = unsafe_.max_by(|a, b| depth(a).total_cmp(&depth(b)));
    all.push(match worst {
        Some(worst) => format!(
            "Missed items: up to {} pixels deep ({}).",
            text::significant(depth(worst)),
            named(worst)
        ),
        None if p.points.iter().any(is_wrong) => {
            "Points of right answers missed no visible item on these cameras.".to_owned()
        }
        None => "No point missed a visible item on these cameras.".to_owned(),
    });
    all
}

/// The structure itself is at fault, so that its errors are not known.
pub fn is_wrong<E>(point: &Point<E>) -> bool {
    matches!(point.status, Status::Wrong | Status::Panicked)
}

fn of_storage(p: &Precision) -> Option<String> {
    let memory = |point: &&CullingPoint| point.errors.memory_bytes_per_item;
    let least = p.points.iter().filter(is_safe);
    let least = least.min_by(|a, b| memory(a).total_cmp(&memory(b)))?;
    let (name, bytes) = (named(least), text::significant(memory(&least)));
    let extra = extras(least);
    let time = text::some(least.query_ns(), text::time);
    Some(format!(
        "Least memory: {name} at {bytes} B/item, {extra}, {time}."
    ))
}

fn of_regions(p: &Precision) -> Option<String> {
    let of = |numbers: &'static str| {
        let points = p.region_points.iter();
        points.filter(move |point| point.errors.numbers == numbers)
    };
    let (plain, checked) = (of("f32").next()?, of("f32 + check").next()?);
    let mut same = of("f32 + check").filter(|point| point.structure == plain.structure);
    let cost = same.next().and_then(|point| point.query_ns());
    let cost = cost.zip(plain.query_ns());
    let (errors, rest) = (&plain.errors, &checked.errors);
    let points = text::counted(errors.points as usize, "point");
    let (wrong, farthest) = (percent(errors.wrong), text::significant(errors.worst_false));
    let left = rest.false_region_count + rest.missed_region_count;
    let times = text::significant(cost.map_or(f64::NAN, |(a, b)| a / b));
    Some(format!(
        "Region search in f32 is wrong for {wrong} % of {points} (farthest {farthest} outside); an \
         exact test of the hits leaves {left} wrong and takes {times} times as long on {}.",
        plain.structure
    ))
}

fn of_sizes(rows: &[SizeRow]) -> Option<String> {
    let of = |row: &SizeRow, test: &str| {
        let found = row.tests.iter().find(|t| t.test == test);
        elsewhere(found.and_then(|t| t.excess))
    };
    let (first, last) = (rows.first()?, rows.last()?);
    let [planes, more] = [first, last].map(|row| of(row, "six-plane"));
    let [exact, also] = [first, last].map(|row| of(row, "exact + epsilon"));
    let [small, large] = [first, last].map(|row| row.size_over_depth);
    let is_bounded = [&planes, &more, &exact, &also]
        .iter()
        .any(|s| s.contains('±'));
    let bounds = ["", " (± bounds the result of another seed)"][usize::from(is_bounded)];
    Some(format!(
        "Six planes return {planes} % false positives where a cube's edge is {small} of the \
         frustum's depth, and {more} % at {large}; the exact test with c = 8: {exact} and {also} %{bounds}."
    ))
}

/// Misses of the default over the sweeps, and the most of any over each.
fn of_sweeps(rows: &[SweepRow]) -> Option<String> {
    let lost = |row: &SweepRow| row.false_negative_ppm.map_or(0.0, |rate| rate.value);
    let default = rows.iter().filter(|row| numbers(&row.names) == "f32 c=8");
    let errors = default.filter_map(|row| row.errors);
    let missed: u64 = errors.map(|errors| errors.false_negatives).sum();
    let worst = SWEEPS.iter().filter_map(|(sweep, name, _)| {
        let own = rows.iter().filter(|row| row.sweep == *sweep);
        let worst = own.max_by(|a, b| lost(a).total_cmp(&lost(b)))?;
        let (value, numbers) = (swept(worst.value), numbers(&worst.names));
        let lost = Some(lost(worst).round() as usize).filter(|_| lost(worst) > 0.0)?;
        let lost = text::count(lost);
        Some(format!("{name} {value} ({numbers}, {lost} ppm)"))
    });
    let others = match text::joined(worst) {
        none if none.is_empty() => "no other numbers do either".to_owned(),
        worst => format!("others miss items, most at {worst}"),
    };
    (!rows.is_empty()).then(|| {
        let names: Vec<&str> = SWEEPS.iter().map(|sweep| sweep.1).collect();
        let (names, missed) = (names.join(", "), text::counted(missed as usize, "item"));
        format!("Over {names} the default (six planes, f32 c=8) misses {missed}; {others}.")
    })
}

/// A point of a figure, if it has a time and an error.
fn measured<E>(
    point: &Point<E>,
    test: &str,
    error: Option<Rate>,
    is_cross: bool,
    note: String,
) -> Option<Measured> {
    Some(Measured {
        structure: point.structure.clone(),
        test: test.to_owned(),
        point: diagram::Point {
            at: [point.query_ns()?, error?.value * 100.0],
            ends: error.and_then(|rate| Some([rate.lower? * 100.0, rate.upper? * 100.0])),
            wide: point.time.and_then(ends),
            note,
            is_cross,
            is_large: point.on_front,
        },
    })
}

fn of(point: &CullingPoint) -> Option<Measured> {
    let (errors, missed) = (&point.errors, missed(point));
    let (name, time) = (named(point), text::some(point.query_ns(), text::time));
    let extra = percent(errors.excess);
    let note = format!("{name}: {time}, false positives {extra} %, {missed} missed");
    measured(point, errors.names.test, errors.excess, missed > 0, note)
}

fn of_region(point: &Point<RegionErrors>) -> Option<Measured> {
    let errors = &point.errors;
    let note = format!("{} {}", point.structure, errors.numbers);
    let is_cross = errors.missed_region_count > 0;
    measured(point, errors.numbers, errors.wrong, is_cross, note)
}

/// Frustum queries, then region search where it was measured.
pub fn figures(precision: &Precision) -> Vec<Figure> {
    let about = format!("{}, {}", precision.scene, precision.path);
    let caption = format!("{about}: error against run time; dashed: misses visible items");
    let axes = ["time per query", "false positives, % of visible"];
    let points = precision.points.iter().filter_map(of);
    let queries = against(&caption, axes, 3e-5, points.collect());
    let caption = format!("{about}: region search; dashed: misses regions");
    let axes = ["time per point", "points with a wrong answer, %"];
    let points = precision.region_points.iter().filter_map(of_region);
    let regions = against(&caption, axes, 3e-3, points.collect());
    queries.into_iter().chain(regions).collect()
}
