//! The sentences that `cullbench precision` ends with: what its figures say, from
//! the figures alone.

use std::cmp::Ordering;

use super::diagram;
use super::error_figure::{Measured, against};
use super::figure::{Figure, ends};
use super::precision_tables::{culling, named, numbers, percent, swept};
use super::text;
use crate::measure::Status;
use crate::precision::{Point, Precision, SWEEPS, Sweep, SweepRow};

pub fn conclusions(p: &Precision) -> Vec<String> {
    let (sizes, cameras) = (of_sizes(&p.sweeps), of_cameras(&p.sweeps));
    let others = [of_storage(p), sizes, cameras].into_iter();
    of_points(p).into_iter().chain(others.flatten()).collect()
}

/// No visible item missed, a margin that is proven (docs/NUMERICS.md), and a time.
fn is_safe(point: &&Point) -> bool {
    let missed = point.counts.unwrap_or_default().dropped();
    point.time.is_some() && missed == 0 && point.names.epsilon > 0.0
}

fn missed(point: &Point) -> u64 {
    point.counts.unwrap_or_default().false_negatives
}

fn ratio(a: &Point, b: &Point) -> String {
    let both = a.query_ns().zip(b.query_ns());
    text::significant(both.map_or(f64::NAN, |(a, b)| a / b))
}

/// The false positives of a point in words.
fn extras(point: &Point) -> String {
    match point.excess {
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
    let extra = |point: &Point| point.counts.map(|errors| errors.false_positives);
    let tight = sound.find(|point| extra(point) < extra(fastest));
    if let Some(tight) = tight {
        let (times, name, extra) = (ratio(tight, fastest), named(tight), extras(tight));
        all.push(format!(
            "Fewer false positives take {times} times as long or more: {name}, {extra}."
        ));
    }
    let unsafe_ = p.points.iter().filter(|point| missed(point) > 0);
    // Cameras without rays have no pixels.
    let by = |point: &Point| (point.worst_miss_px.unwrap_or(-1.0), missed(point));
    let worst = unsafe_.max_by(|a, b| by(a).partial_cmp(&by(b)).unwrap_or(Ordering::Equal));
    all.push(match worst {
        Some(worst) => match worst.worst_miss_px {
            Some(depth) => format!(
                "Missed items: up to {} pixels deep ({}).",
                text::significant(depth),
                named(worst)
            ),
            None => format!("Items are missed, most by {}.", named(worst)),
        },
        None if p.points.iter().any(is_wrong) => {
            "Points of right answers missed no visible item on these cameras.".to_owned()
        }
        None => "No point missed a visible item on these cameras.".to_owned(),
    });
    all
}

/// The structure itself is at fault, so that its errors are not known.
pub fn is_wrong(point: &Point) -> bool {
    matches!(point.status, Status::Wrong | Status::Panicked)
}

fn of_storage(p: &Precision) -> Option<String> {
    let memory = |point: &&Point| point.memory_bytes_per_item;
    let least = p.points.iter().filter(is_safe);
    let least = least.min_by(|a, b| memory(a).total_cmp(&memory(b)))?;
    let (name, bytes) = (named(least), text::significant(memory(&least)));
    let extra = extras(least);
    let time = text::some(least.query_ns(), text::time);
    Some(format!(
        "Least memory: {name} at {bytes} B/item, {extra}, {time}."
    ))
}

fn of_sizes(rows: &[SweepRow]) -> Option<String> {
    let [small, .., large] = Sweep::Size.values();
    let of = |size: f64, name: &str| {
        let mut own = rows
            .iter()
            .filter(|row| row.sweep == Sweep::Size && row.value == size);
        let found = own.find(|row| culling(&row.names) == name);
        text::rate(found.and_then(SweepRow::error), 1.0)
    };
    let [planes, more] = [small, large].map(|size| of(size, "six-plane f32 c=0"));
    let [exact, also] = [small, large].map(|size| of(size, "exact f32 c=8"));
    (!rows.is_empty()).then(|| {
        format!(
            "Six planes return {planes} % false positives where a cube's edge is {small} of the \
             frustum's depth, and {more} % at {large}; the exact test with c = 8: {exact} and \
             {also} %."
        )
    })
}

/// Misses of the default over the sweeps of cameras, and the most of any over each.
fn of_cameras(rows: &[SweepRow]) -> Option<String> {
    let lost = |row: &SweepRow| row.false_negative_ppm.map_or(0.0, |rate| rate.value);
    let sweeps = SWEEPS.into_iter().filter(|sweep| sweep.0 != Sweep::Size);
    let rows = rows.iter().filter(|row| row.sweep != Sweep::Size);
    let default = rows.clone().filter(|row| numbers(&row.names) == "f32 c=8");
    let errors = default.filter_map(|row| row.errors);
    let missed: u64 = errors.map(|errors| errors.false_negatives).sum();
    let worst = sweeps.clone().filter_map(|(sweep, name, _)| {
        let own = rows.clone().filter(|row| row.sweep == sweep);
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
    rows.clone().next().map(|_| {
        let names: Vec<&str> = sweeps.map(|sweep| sweep.1).collect();
        let (names, missed) = (names.join(", "), text::counted(missed as usize, "item"));
        format!("Over {names} the default (six planes, f32 c=8) misses {missed}; {others}.")
    })
}

/// A point of a figure, if it has a time and an error.
fn measured(point: &Point) -> Option<Measured> {
    let missed = missed(point);
    let (name, time) = (named(point), text::some(point.query_ns(), text::time));
    let (rate, extra) = (point.excess?, percent(point.excess));
    Some(Measured {
        structure: point.structure.clone(),
        test: point.names.test.to_owned(),
        point: diagram::Point {
            at: [point.query_ns()?, rate.value * 100.0],
            ends: rate
                .lower
                .zip(rate.upper)
                .map(|(low, high)| [low * 100.0, high * 100.0]),
            wide: point.time.and_then(ends),
            note: format!("{name}: {time}, false positives {extra} %, {missed} missed"),
            is_cross: missed > 0,
            is_large: point.on_front,
        },
    })
}

/// False positives against time; `None` without any point.
pub fn figure(p: &Precision) -> Option<Figure> {
    let (scene, path) = (&p.scene, &p.path);
    let caption = format!("{scene}, {path}: error against run time; dashed: misses visible items");
    let axes = ["time per query", "false positives, % of visible"];
    let points = p.points.iter().filter_map(measured);
    against(&caption, axes, 3e-5, points.collect())
}
