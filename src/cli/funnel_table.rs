//! The tables of `cullbench funnel`: a row for each stage and back end, the gain of
//! each stage of the chain, and conclusions.

use super::document::Block;
use super::table::{Column, Table};
use super::text;
use crate::funnel::{
    BoundRow, FragmentCounts, FunnelReport, Gain, LevelRow, OrderRow, PickRow, StageRow, Times,
};
use crate::visibility::Guarantee;
use crate::visibility::hiders::{BlocksRow, GroundRow, InnerRow};
use crate::visibility::occlusion::OccluderChoice;

/// Most columns of a line.
pub const WIDTH: u16 = 100;

pub fn blocks(report: &FunnelReport) -> Vec<Block> {
    let mut blocks = vec![
        Block::Heading(1, format!("Funnel of {}, {}", report.scene, report.path)),
        Block::Line(format!(
            "{}; {} of {} x {} samples; {}; figures are means per view.",
            text::counted(report.items, "item"),
            text::counted(report.views, "view"),
            report.samples[0],
            report.samples[1],
            spread(report.processes),
        )),
        Block::Table(stages(report).fit(WIDTH)),
    ];
    blocks.extend(saved_load(&report.level).map(Block::Line));
    blocks.extend(report.inner_boxes.as_ref().map(inner_boxes));
    blocks.extend(report.ground.as_ref().map(ground));
    blocks.extend(report.solid_blocks.as_ref().map(solid_blocks));
    if let Some(made) = &report.cut_outs {
        let line = format!(
            "{} of the items are cut out by a mask ({}, tiles of {}): they hide nothing at its \
             holes.",
            made.item_count, made.mask, made.tile
        );
        blocks.insert(2, Block::Line(line));
    }
    if report.occluders != OccluderChoice::All.to_string() {
        let line = format!("Occluders of hierarchical-z: {}.", report.occluders);
        blocks.insert(2, Block::Line(line));
    }
    // Not every scene has all of them.
    for (heading, table) in [
        (
            "Samples and fragments of the remaining items",
            fragments(report),
        ),
        ("Items seen in the mirror", mirror(report)),
        ("Draw orders of the remaining items", orders(report)),
        ("Picking: items under a cursor", picks(report)),
        (
            "Lower bounds: the least that must be read or written",
            bounds(report),
        ),
        (
            "With and without each stage of the chain, and the draw cost above which it pays off",
            gains(report),
        ),
    ] {
        if !table.rows.is_empty() {
            blocks.extend([
                Block::Heading(2, heading.into()),
                Block::Table(table.fit(WIDTH)),
            ]);
        }
    }
    if report.stages.iter().any(|row| row.fragments.is_some()) {
        let line = "The time of the fragment stage is that of an exact test along the ray of each \
                    sample, on one thread. A GPU does this in hardware.";
        blocks.push(Block::Line(line.into()));
    }
    blocks.extend(report.left_out.iter().map(|row| {
        let (section, name, reason) = (row.section, row.name, &row.reason);
        Block::Line(format!("Left out ({section}, {name}): {reason}."))
    }));
    blocks.extend(report.conclusions.iter().cloned().map(Block::Line));
    blocks
}

/// Line on the load that the selection of a level saves; none for a single level.
fn saved_load(level: &LevelRow) -> Option<String> {
    let [lower, upper] = [level.saved_load_ns_lower?, level.saved_load_ns_upper?];
    let others = text::counted(level.map_count - 1, "other map");
    Some(match lower > 0.0 {
        true => format!(
            "Decoding the {others} of the file takes {} of wall time, which the level stage saves.",
            text::time_plus_minus(level.saved_load_ns, [Some(lower), Some(upper)])
        ),
        false => format!(
            "Decoding the {others} of the file takes less than {} of wall time: what the level \
             stage saves is within noise.",
            text::time(upper)
        ),
    })
}

/// Line on the occluders inside a mesh.
fn inner_boxes(row: &InnerRow) -> Block {
    let held = row.volume_share.map(|share| {
        let [held, lost] = [share, 1.0 - share].map(|share| share * 100.0);
        format!(", {held:.1} % of the volume of these (loss {lost:.1} %)")
    });
    let inside = match row.boxed_count {
        0 => "any".to_owned(),
        boxed => text::count(boxed),
    };
    Block::Line(format!(
        "Occluders: {} proven inside {inside} of {}{}; found in {}.",
        text::counted(row.box_count, "box"),
        text::counted(row.item_count, "item"),
        held.unwrap_or_default(),
        text::time(row.build_ns)
    ))
}

/// Line on the occluders below the ground.
fn ground(row: &GroundRow) -> Block {
    let held = row.volume_share.map(|share| {
        let held = share * 100.0;
        format!(", {held:.1} % of the volume between the ground and its lowest place")
    });
    Block::Line(format!(
        "Ground: {} below {}{}; found in {}.",
        text::counted(row.box_count, "box"),
        text::counted(row.item_count, "item"),
        held.unwrap_or_default(),
        text::time(row.build_ns)
    ))
}

/// Line on the occluders in the solid of a map.
fn solid_blocks(row: &BlocksRow) -> Block {
    Block::Line(match row.unclosed_sector_count {
        0 => format!(
            "Occluders: {} in the solid between the rooms of the map, below floors and above \
             ceilings; found in {}.",
            text::counted(row.box_count, "box"),
            text::time(row.build_ns)
        ),
        unclosed => format!(
            "Occluders: none, since the linedefs of {} are not closed or contradict others.",
            text::counted(unclosed, "sector")
        ),
    })
}

/// Basis of the times.
pub fn spread(processes: usize) -> String {
    match processes {
        0..3 => text::over(processes, None),
        _ => format!(
            "times over {}, with 95 % intervals",
            text::counted(processes, "process")
        ),
    }
}

fn stages(report: &FunnelReport) -> Table {
    let mut table = Table::of("stage | by | >in | >out | >truth | >FP | >FN | >time | >per item");
    let level = &report.level;
    let [given, left] = [level.input_count, level.output_count].map(|n| n.to_string());
    let mut first = vec!["level".to_owned(), level.selected.clone(), given, left];
    first.resize(table.header.len(), String::new());
    table.add_row(first);
    table.rows.extend(report.stages.iter().map(stage));
    table
}

/// A back end with its marks.
fn by(row: &StageRow) -> String {
    let name = row.structure.as_deref().unwrap_or(row.back_end.name);
    let mark = if row.is_chosen { "*" } else { "" };
    format!("{name}{mark}{}", doubt(row.back_end.guarantee))
}

/// Mark of an unproven back end.
pub fn doubt(guarantee: Guarantee) -> &'static str {
    match guarantee {
        Guarantee::Unproven => "?",
        _ => "",
    }
}

fn stage(row: &StageRow) -> Vec<String> {
    let errors = &row.errors;
    vec![
        row.back_end.stage.name().to_owned(),
        by(row),
        count(errors.input_count),
        count(errors.output_count),
        count(errors.truth_count),
        count(errors.false_positive_count),
        count(errors.false_negative_count),
        of_view(&row.times),
        text::some(row.ns_per_removed, text::time),
    ]
}

/// A time with half of its interval.
fn of_view(times: &Times) -> String {
    text::time_plus_minus(times.stage_ns, [times.stage_ns_lower, times.stage_ns_upper])
}

/// A mean of counts.
fn count(mean: f64) -> String {
    match mean {
        mean if mean >= 100.0 || mean.fract() == 0.0 => format!("{mean:.0}"),
        mean => text::significant(mean),
    }
}

/// Counts of fragments, by the name of a test.
fn fragment_table<'c>(tests: impl Iterator<Item = (&'c str, &'c FragmentCounts)>) -> Table {
    let mut table =
        Table::of("test | >samples tested | >kept out | >fragments | >clear | >shaded | >covered");
    for (name, counts) in tests {
        let counts = counts.in_order().into_iter().map(count);
        table.add_row([name.to_owned()].into_iter().chain(counts));
    }
    table
}

/// The reflected scene on the samples of a mirror, and on all.
fn mirror(report: &FunnelReport) -> Table {
    fragment_table(report.mirror.iter().flat_map(|mirror| {
        [
            ("z-test", &mirror.without_stencil),
            ("stencil-test", &mirror.with_stencil),
        ]
    }))
}

/// The tests of the fragment stage, if there are several to compare.
fn fragments(report: &FunnelReport) -> Table {
    let rows = report.stages.iter();
    let tests = rows.filter_map(|row| Some((row.back_end.name, row.fragments.as_ref()?)));
    let mut table = fragment_table(tests);
    if table.rows.len() < 2 {
        table.rows.clear();
    }
    table
}

fn orders(report: &FunnelReport) -> Table {
    let columns: &[Column<&OrderRow>] = &[
        ("order", |row| row.name.to_owned()),
        (">fragments", |row| count(row.fragment_count)),
        (">shaded", |row| count(row.shaded_count)),
        (">overdraw", |row| {
            text::some(row.overdraw, text::significant)
        }),
        (">pairs", |row| count(row.pair_count)),
        (">wrong", |row| count(row.wrong_pair_count)),
        (">wrong samples", |row| count(row.wrong_sample_count)),
        (">time", |row| of_view(&row.times)),
    ];
    Table::with(&report.orders, columns)
}

fn picks(report: &FunnelReport) -> Table {
    let columns: &[Column<&PickRow>] = &[
        ("question", |row| row.question.name().to_owned()),
        ("by", |row| format!("{}{}", row.name, doubt(row.guarantee))),
        (">cursors", |row| row.ray_count.to_string()),
        (">wrong", |row| row.wrong_count.to_string()),
        (">time per cursor", |row| {
            text::some(row.ns_per_ray, text::time)
        }),
    ];
    Table::with(&report.picks, columns)
}

fn bounds(report: &FunnelReport) -> Table {
    let columns: &[Column<&BoundRow>] = &[
        ("bound", |row| row.name.to_owned()),
        ("of", |row| row.back_end.to_owned()),
        (">time", |row| of_view(&row.times)),
        (">ratio", |row| text::some(row.ratio, text::significant)),
    ];
    Table::with(&report.bounds, columns)
}

fn gains(report: &FunnelReport) -> Table {
    let columns: &[Column<&Gain>] = &[
        ("stage", |gain| {
            format!("{} ({})", gain.stage.name(), gain.back_end)
        }),
        (">time with", |gain| text::some(gain.with_ns, text::time)),
        (">without", |gain| text::some(gain.without_ns, text::time)),
        ("counted", |gain| gain.unit.to_owned()),
        (">with", |gain| count(gain.with_count)),
        (">without", |gain| count(gain.without_count)),
        (">pays above", |gain| match gain.break_even_ns {
            None if gain.removed() <= 0.0 => "removes nothing".to_owned(),
            ns => {
                let ends = [gain.break_even_ns_lower, gain.break_even_ns_upper];
                text::time_plus_minus(ns, ends)
            }
        }),
    ];
    Table::with(&report.gains, columns)
}
