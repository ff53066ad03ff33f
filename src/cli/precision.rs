//! `cullbench precision`: error against run time of a scene and path.
//!
//! With the sweeps over item size and ill-conditioned cameras: tables, a figure, and conclusions in
//! sentences.

use std::cmp::Ordering;

use anyhow::Result;

use super::advise::ties;
use super::args::PrecisionArgs;
use super::document::{Block, Column, Table, show};
use super::figure::{Figure, ends, picture};
use super::page::to_page;
use super::processes::Timing;
use super::run_figures::{Measured, against};
use super::run_verdict::BLIND;
use super::study::{ROUNDS, Study, load};
use super::text::{self, significant, some, time_plus_minus};
use super::{Ending, diagram, expect_places, print, write_if};
use crate::index::Registry;
use crate::measure::{ProcessTimes, Status};
use crate::precision::{self, Names, Point, Precision, SWEEPS, Sweep, SweepRow, sweep};
use crate::report::grouped;

pub fn precision(registry: &Registry, args: &PrecisionArgs) -> Result<Ending> {
    let outputs = [("--svg", &args.svg), ("--html", &args.html)];
    expect_places(&outputs, &[&args.study.scene, &args.study.path])?;
    let setting = load(registry, &args.study, ROUNDS, None, [2, 0, 0])?;
    let spread = &args.study.spread;
    let about = format!("{}, {}: ", args.study.scene, args.study.path);
    let study = Study::new(about, 0, spread)?;
    study.begin("every point, checked");
    let prepared = precision::prepare(&setting, args.frames as usize)?;
    let items = text::counted(setting.scene.items.len(), "item");
    study.announce(&items, "about a minute");
    let mut sweeps = Vec::new();
    if args.cubes > 0 {
        for (which, name, _) in SWEEPS {
            study.begin(&format!("the sweep over {name}"));
            sweeps.extend(sweep(which, which.cameras(args.cubes), spread.seed));
        }
    }
    let lens_scale = setting.path.lens_scale;
    let times = study.times("every point, timed", lens_scale, &prepared.plan)?;
    let outcome = Precision {
        seed: spread.seed,
        sweeps,
        ..prepared.conclude(&times)
    };
    let wrong = outcome.points.iter().any(is_wrong);
    let shown = print(args.format, &outcome, || {
        let room = if args.all { usize::MAX } else { text::width() };
        show(&blocks(&outcome, args.all, room))
    });
    let figures: Vec<Figure> = figure(&outcome).into_iter().collect();
    write_if(&args.svg, || picture(&figures, 1))?;
    write_if(&args.html, || {
        let title = format!("precision {}, {}", args.study.scene, args.study.path);
        let told = conclusions(&outcome).into_iter();
        let tables = tables(&outcome, true, usize::MAX);
        to_page(&title, told.map(Block::Line), figures, tables)
    })?;
    shown?;
    Ok(Ending::of(!wrong))
}

/// Tables, then the conclusions.
fn blocks(outcome: &Precision, all: bool, room: usize) -> Vec<Block> {
    let mut blocks = tables(outcome, all, room);
    blocks.push(Block::heading("Conclusions:"));
    let told = conclusions(outcome).into_iter();
    blocks.extend(told.map(|sentence| Block::Line(format!("- {sentence}"))));
    blocks.extend(Block::more(all, "errors of every culling, sweeps: --all"));
    blocks
}

/// Times all points in one process.
pub fn time(registry: &Registry, args: &PrecisionArgs, timing: &Timing) -> Result<ProcessTimes> {
    let setting = load(registry, &args.study, ROUNDS, Some(timing), [0; 3])?;
    let plan = timing.plan()?;
    Ok(precision::time(&setting, args.frames as usize, &plan)?)
}

pub fn conclusions(p: &Precision) -> Vec<String> {
    let (sizes, cameras) = (of_sizes(&p.sweeps), of_cameras(&p.sweeps));
    let others = [sizes, cameras].into_iter();
    of_points(p).into_iter().chain(others.flatten()).collect()
}

/// No visible item missed, a proven margin (docs/NUMERICS.md), and a time.
fn is_safe(point: &&Point) -> bool {
    let missed = point.counts.unwrap_or_default().dropped();
    point.time.is_some() && missed == 0 && point.names.epsilon > 0.0
}

fn missed(point: &Point) -> u64 {
    point.counts.unwrap_or_default().false_negatives
}

/// Number of visible items of all cameras, if any culling was judged.
fn visible(p: &Precision) -> Option<u64> {
    let mut counts = p.points.iter().filter_map(|point| point.counts);
    Some(counts.next()?.visible)
}

/// The false positives of a point in words.
fn extras(point: &Point) -> String {
    format!("false positives {} %", text::rate(point.excess, 100.0))
}

/// The first of some points in order of time, and its name with those as fast.
fn first<'p>(mut points: impl Iterator<Item = &'p Point>) -> Option<(&'p Point, String)> {
    let first = points.next()?;
    let others: Vec<String> = points.filter(|p| !first.is_faster(p)).map(named).collect();
    Some((first, named(first) + &ties(&others)))
}

fn of_points(p: &Precision) -> Vec<String> {
    if visible(p) == Some(0) {
        return vec![BLIND.to_owned()];
    }
    let sound = p.points.iter().filter(is_safe);
    let Some((fastest, name)) = first(sound.clone()) else {
        return vec!["No point that is safe by its margin has a time.".to_owned()];
    };
    let time = text::time_plus_minus(fastest.time);
    let mut all = vec![format!(
        "Fastest point that cannot miss an item: {name} at {time}, {}.",
        extras(fastest)
    )];
    let extra = |point: &Point| point.counts.map(|errors| errors.false_positives);
    let tight = sound.clone().filter(|point| extra(point) < extra(fastest));
    if let Some((tight, name)) = first(tight) {
        let times = tight.query_ns().zip(fastest.query_ns()).map(|(a, b)| a / b);
        let times = times.filter(|_| fastest.is_faster(tight)).map(significant);
        let longer = times.map_or("no longer".to_owned(), |times| {
            format!("{times} times as long or more")
        });
        let extra = extras(tight);
        all.push(format!(
            "Fewer false positives take {longer}: {name}, {extra}."
        ));
    }
    let unsafe_ = p.points.iter().filter(|point| missed(point) > 0);
    // Cameras without rays have no pixels.
    let by = |point: &Point| (point.worst_miss_px.unwrap_or(-1.0), missed(point));
    let worst = unsafe_.max_by(|a, b| by(a).partial_cmp(&by(b)).unwrap_or(Ordering::Equal));
    all.push(
        match worst.map(|worst| (named(worst), worst.worst_miss_px)) {
            Some((name, Some(depth))) => {
                let depth = text::significant(depth);
                format!("Missed items: up to {depth} pixels deep ({name}).")
            }
            Some((name, None)) => format!("Items are missed, most by {name}."),
            None if p.points.iter().any(is_wrong) => {
                "Points of right answers missed no visible item on these cameras.".to_owned()
            }
            None => "No point missed a visible item on these cameras.".to_owned(),
        },
    );
    let memory = |point: &Point| point.memory_bytes_per_item;
    let least = sound.clone().map(memory).fold(f64::INFINITY, f64::min);
    // The fastest of those within 1 % of the least memory.
    let small = sound.filter(|point| memory(point) <= 1.01 * least);
    all.extend(first(small).map(|(small, name)| {
        let (bytes, extra) = (significant(memory(small)), extras(small));
        let time = text::some(small.query_ns(), text::time);
        format!("Least memory: {name} at {bytes} B/item, {extra}, {time}.")
    }));
    all
}

/// Returns true if the structure itself is wrong, so that its errors are unknown.
pub fn is_wrong(point: &Point) -> bool {
    matches!(point.status, Status::Wrong | Status::Panicked)
}

fn of_sizes(rows: &[SweepRow]) -> Option<String> {
    let [small, .., large] = Sweep::Size.values();
    let of = |size: f64, name: &str| {
        let mut own = rows.iter().filter(|row| row.sweep == Sweep::Size);
        let found = own.find(|row| row.value == size && culling(&row.names) == name);
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

/// Misses of the default over the camera sweeps, and the most of any per sweep.
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
    let (rate, extra) = (point.excess?, text::rate(point.excess, 100.0));
    let place = diagram::Point {
        at: [point.query_ns()?, rate.value * 100.0],
        ends: rate.times(100.0).ends(),
        wide: point.time.and_then(ends),
        note: format!("{name}: {time}, false positives {extra} %, {missed} missed"),
        level: point.names.test.to_owned(),
        is_cross: missed > 0,
        is_large: point.on_front,
    };
    Some((point.structure.clone(), place))
}

/// False positives against time; `None` without any point.
pub fn figure(p: &Precision) -> Option<Figure> {
    let (scene, path) = (&p.scene, &p.path);
    let caption = format!("{scene}, {path}: error against run time; dashed: misses visible items");
    let points = p.points.iter().filter_map(measured);
    against(&caption, points.collect())
}

/// The Pareto front within `room` characters.
///
/// With `all` also the errors of every culling and the sweeps.
fn tables(p: &Precision, all: bool, room: usize) -> Vec<Block> {
    let items = text::items(p.items, p.skipped_items);
    let cameras = text::counted(p.cameras, "camera");
    let rounds = text::counted(p.rounds, "round");
    let visible = text::count(visible(p).unwrap_or_default() as usize);
    let over = text::over(p.processes, p.twin.as_ref());
    let head = format!(
        "{}: {items}; {}: {cameras}, {visible} visible in all; {over}; {rounds} in each",
        p.scene, p.path
    );
    let mut blocks = vec![Block::Line(head)];
    let (errors_note, front_note) = NOTES.split_once('\n').unwrap_or_default();
    let mut add = |title: &str, table: Table, note: &str| {
        blocks.extend(Block::section(title, table));
        blocks.extend((!note.is_empty()).then(|| Block::line(note)));
    };
    if all {
        let title = "Errors, by test, numbers and planes";
        add(title, errors_table(&p.points), errors_note);
    }
    let title = "Pareto front of error, memory and time, fastest first";
    let whole = front_table(p, all);
    let front = whole.within(room, &["tie", "alike", "B/item"]);
    let heads = whole.header.iter();
    let gone = match text::joined(heads.filter(|head| !front.header.contains(head))) {
        none if none.is_empty() => none,
        gone => format!(" Columns that do not fit here: {gone}."),
    };
    add(title, front, &(front_note.trim_end().to_owned() + &gone));
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

/// Explanations of the errors and of the front.
const NOTES: &str = include_str!("assets/precision_notes.txt");

pub fn named(point: &Point) -> String {
    format!("{} with {}", structure(point), culling(&point.names))
}

/// Short name of a culling.
pub fn culling(names: &Names) -> String {
    format!("{} {}", names.test, numbers(names))
}

/// Arithmetic, planes if they are not the frame's, and epsilon.
pub fn numbers(names: &Names) -> String {
    let arithmetic = names.arithmetic;
    let planes = Some(names.planes).filter(|planes| *planes != "frame");
    let planes = some(planes, |planes| format!(" {planes}"));
    let epsilon = (arithmetic != "f64").then_some(names.epsilon);
    let epsilon = some(epsilon, |c| format!(" c={c}"));
    format!("{arithmetic}{planes}{epsilon}")
}

/// Errors of each culling, the same for every structure.
fn errors_table(points: &[Point]) -> Table {
    let all = grouped(points.iter().map(|p| (&p.names, p)));
    let mut points: Vec<&Point> = all.iter().map(|(_, own)| own[0]).collect();
    points.sort_by_key(|p| (p.names.test, culling(&p.names)));
    let columns: &[Column<&Point>] = &[
        ("culling", |p| culling(&p.names)),
        (">FP %", |p| match p.counts {
            None => p.status.name().to_owned(),
            Some(_) => text::rate(p.excess, 100.0),
        }),
        (">by source", |p| some(p.counts, text::sources)),
        (">FN ppm", |p| text::rate(p.false_negative_ppm, 1.0)),
        (">px", |p| some(p.worst_miss_px, significant)),
    ];
    Table::with(points, columns)
}

/// A row for points of one structure, test, arithmetic and errors.
///
/// Shows the fastest that is safe by its margin, else the fastest; with `all` a row each.
fn front_table(p: &Precision, all: bool) -> Table {
    let key = |i: usize| {
        let point = &p.points[i];
        let errors = point.counts.map(|e| (e.false_positives, e.false_negatives));
        let (names, own) = (&point.names, all.then_some(i));
        (structure(point), names.test, names.arithmetic, errors, own)
    };
    let alike = grouped(p.front.iter().map(|&i| (key(i), &p.points[i])));
    let columns: &[Column<Vec<&Point>>] = &[
        ("structure", |p| structure(p[0])),
        ("culling", |p| culling(&p[0].names)),
        (">query", |p| time_plus_minus(p[0].time)),
        (">alike", |p| {
            some((p.len() > 1).then(|| p.len() - 1), |n| n.to_string())
        }),
        (">B/item", |p| format!("{:.1}", p[0].memory_bytes_per_item)),
        (">FP %", |p| match p[0].excess {
            Some(found) if found.value > 0.0 => significant(100.0 * found.value),
            none => text::rate(none, 100.0),
        }),
        (">FN ppm", |p| text::rate(p[0].false_negative_ppm, 1.0)),
        ("tie", |p| if p[0].is_tie { "tie" } else { "" }.to_owned()),
    ];
    let rows = alike.into_iter().map(|(_, mut points)| {
        points.sort_by_key(|point| !is_safe(point));
        points
    });
    Table::with(rows, columns).without_empty_columns()
}

/// The structure without its parameters.
fn structure(point: &Point) -> String {
    let name = point.structure.split(':').next();
    name.unwrap_or_default().to_owned()
}

/// A value of a sweep; a large power of two as such.
pub fn swept(value: f64) -> String {
    match value {
        power if power >= 1024.0 && power.log2().fract() == 0.0 => format!("2^{}", power.log2()),
        plain if plain == 0.0 || (1e-3..1e3).contains(&plain) => plain.to_string(),
        _ => format!("{value:e}"),
    }
}

/// Table of the cullings with errors, and a line about the others.
fn swept_errors(rows: &[&SweepRow]) -> (Table, String) {
    type Named = fn(&Names) -> String;
    let ([header, nothing, unit], name): (_, Named) = match rows[0].sweep {
        Sweep::Size => (["culling", "No false positives", "%"], culling),
        // All have the same test.
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
    use crate::statistics::Estimate;
    use crate::verify::ErrorCount;

    #[test]
    fn the_fastest_is_named_with_its_ties_and_none_where_nothing_is_visible() {
        let point = |structure: &str, extra, ns: f64, noise: f64| {
            let mut point = Point::default();
            structure.clone_into(&mut point.structure);
            (point.time, point.memory_bytes_per_item) = (Some(Estimate::exact(ns)), ns);
            point.counts = Some(ErrorCount {
                visible: 9,
                false_positives: extra,
                ..ErrorCount::default()
            });
            point.ln_ns = [0.0, 0.1, 0.2].map(|speed| ns.ln() + speed).to_vec();
            point.ln_ns[1] += noise;
            point.names = Names::of(&crate::culling::Culling::default());
            point
        };
        let mut p = Precision::default();
        p.points.extend([
            point("bvh", 3, 10.0, 0.0),
            point("bsp", 3, 10.1, 0.5),
            point("wide", 2, 10.2, 0.5),
            point("linear", 2, 40.0, 0.0),
        ]);
        let starts = |p: &Precision, n: usize, start: &str| {
            let told = &conclusions(p)[n];
            assert!(told.starts_with(start), "{told}");
        };
        let fastest = "Fastest point that cannot miss an item: bvh with six-plane f32 c=8";
        starts(&p, 0, &format!("{fastest} (a tie with bsp"));
        starts(&p, 1, "Fewer false positives take no longer: wide with");
        let least = "Least memory: bvh with six-plane f32 c=8 (a tie with bsp";
        starts(&p, 3, least);
        p.points.drain(1..3);
        starts(&p, 0, &format!("{fastest} at"));
        let longer = "Fewer false positives take 4.00 times as long or more: linear";
        starts(&p, 1, longer);
        for point in &mut p.points {
            point.counts = Some(ErrorCount::default());
        }
        assert_eq!(conclusions(&p), [BLIND]);
    }

    #[test]
    fn what_nothing_missed_means_is_the_largest_bound() {
        let mut rows = sweep(Sweep::Offset, 1, 1);
        let (first, last) = (rows[0].names, rows.last().expect("a row").names);
        assert_ne!(first, last);
        for (row, bound) in rows.iter_mut().zip([2.0, 1.0].into_iter().cycle()) {
            let misses = u64::from(row.names == last);
            row.errors = Some(ErrorCount {
                false_negatives: misses,
                ..Default::default()
            });
            row.false_negative_ppm = Some(Estimate {
                value: misses as f64,
                lower: None,
                upper: Some(bound + 9.0 * misses as f64),
            });
        }
        let (_, told) = swept_errors(&rows.iter().collect::<Vec<_>>());
        let wanted = "Nothing missed (below 2.00 ppm): ";
        assert!(told.starts_with(wanted), "{told}");
    }
}
