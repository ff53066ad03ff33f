//! The tables of `cullbench funnel`.
//!
//! A row for each stage and back end, the gain of each stage of the chain, and conclusions.

use super::document::{Block, Column, Table};
use super::text::{self, shortened, some};
use crate::funnel::{FunnelReport, Gain, NONE, PickRow, StageKind, StageRow};
use crate::visibility::Guarantee;
use crate::visibility::fragment::FragmentCounts;

/// The chain and its gain; with `all` every other back end too.
pub fn blocks(report: &FunnelReport, all: bool) -> Vec<Block> {
    let all_views = text::counted(report.cameras, "view");
    let [views, more] = match report.views == report.cameras {
        true => [all_views, String::new()],
        false => [
            format!("{} of {all_views}", text::count(report.views)),
            format!("; --frames {} takes all", report.cameras),
        ],
    };
    let items = text::items(report.items, report.skipped_items);
    let times = text::over(report.processes, None);
    let [width, height] = report.samples;
    let mut blocks = vec![
        Block::Heading(1, format!("Funnel of {}, {}", report.scene, report.path)),
        Block::Line(format!(
            "{items}; {views} of {width} x {height} samples; {times}; figures are means per \
             view{more}."
        )),
    ];
    if let Some(made) = &report.cut_outs {
        let (count, mask, tile) = (made.item_count, made.typed.mask.name(), made.typed.tile);
        blocks.push(Block::Line(format!(
            "{count} of the items are cut out by a mask ({mask}, tiles of {tile}): they hide \
             nothing at its holes."
        )));
    }
    blocks.push(Block::Table(stages(report, false)));
    let may_lose = |row: &StageRow| {
        let is_unproven = row.back_end.guarantee == Guarantee::Unproven;
        is_unproven && row.back_end.stage == StageKind::Occlusion && (all || row.is_chosen)
    };
    let is_lossy = report.stages.iter().any(may_lose);
    let both = |row: &&StageRow| row.is_chosen && row.back_end.does_object_stage;
    if let Some(row) = report.stages.iter().find(both) {
        let what = "searches a tree of its own: its time includes the object stage.";
        let line = format!("{} {what}", row.back_end.name);
        blocks.extend([Block::line(""), Block::Line(line)]);
    }
    if all {
        let stages = stages(report, true);
        blocks.extend(Block::section("Every back end of every stage", stages));
    }
    blocks.extend(Block::more(!is_lossy, "?: FN at these samples only"));
    // Not every scene has all of them.
    for (heading, table) in [
        ("Occluders: boxes that hide others", occluders(report)),
        (
            "Samples and fragments of the remaining items",
            fragments(report),
        ),
        ("Picking: items under a cursor", picks(report)),
        ("With and without each stage of the chain", gains(report)),
    ] {
        if all && !table.rows.is_empty() {
            blocks.extend(Block::section(heading, table));
        }
    }
    blocks.push(Block::line(""));
    if all && report.stages.iter().any(|row| row.fragments.is_some()) {
        let line = "The time of the fragment stage is that of an exact test along the ray of each \
                    sample, on one thread. A GPU does this in hardware.";
        blocks.push(Block::line(line));
    }
    let left_out = report.left_out.iter();
    let left_out = left_out.filter(|row| all || row.section == "stages");
    blocks.extend(left_out.map(|row| {
        let (section, name, reason) = (row.section, &row.name, &row.reason);
        Block::Line(format!("Left out ({section}, {name}): {reason}."))
    }));
    // Notes about other back ends are shown together with them only.
    let is_shown = |told: &&String| {
        let mut others = report.stages.iter().filter(|row| !row.is_chosen);
        all || !others.any(|row| row.loss().as_ref() == Some(*told))
    };
    let told = report.conclusions.iter().filter(is_shown).cloned();
    blocks.extend(told.map(Block::Line));
    let more = "every other back end, picking: --all";
    blocks.extend(Block::more(all, more));
    blocks
}

/// Stages of the chain and the gain of each; with `all` every back end.
fn stages(report: &FunnelReport, all: bool) -> Table {
    let mut table = Table::of(match all {
        true => "stage | by | >in | >out | >truth | >FP | >FN | >time | >per removed",
        false => "stage | by | >in | >out | >time | >worth it from",
    });
    let level = &report.level;
    if all || level.map_count > 1 {
        let [given, left] = [level.input_count, level.output_count].map(text::count);
        let selected = shortened(&level.selected, 24);
        table.add_row(["level".to_owned(), selected, given, left]);
    }
    let is_in_chain = |row: &StageRow| row.is_chosen && row.back_end.name != NONE;
    for row in report.stages.iter().filter(|row| all || is_in_chain(row)) {
        let (stage, errors) = (row.back_end.stage, &row.errors);
        let mark = if all && row.is_chosen { "*" } else { "" };
        let name = shortened(row.structure.as_deref().unwrap_or(row.back_end.name), 24);
        let by = format!("{name}{mark}{}", doubt(row.back_end.guarantee));
        let mut cells = vec![stage.name().to_owned(), by];
        cells.extend([errors.input_count, errors.output_count].map(count));
        if all {
            let extra = (errors.false_positive_count, errors.false_negative_count);
            cells.extend([errors.truth_count, extra.0, extra.1].map(count));
        }
        cells.push(text::time_plus_minus(row.time));
        cells.push(match gain(report, stage) {
            _ if all => some(row.ns_per_removed, text::time),
            // Another stage does it in its own traversal.
            None if stage == StageKind::Object => "in occlusion".to_owned(),
            Some(_) if errors.false_negative_count > 0.0 => "loses visible".to_owned(),
            gain => some(gain, worth),
        });
        table.add_row(cells);
    }
    table
}

fn gain(report: &FunnelReport, stage: StageKind) -> Option<&Gain> {
    report.gains.iter().find(|gain| gain.stage == stage)
}

/// Cost of drawing above which a stage pays off: "2.03 us/item".
fn worth(gain: &Gain) -> String {
    let unit = gain.unit.trim_end_matches('s');
    let Some(ns) = gain.break_even else {
        return ["", "never"][usize::from(gain.removed() <= 0.0)].to_owned();
    };
    match (ns.value, ns.lower, ns.upper) {
        (0.0, _, None | Some(0.0)) => "always".to_owned(),
        // Within the noise of saving time as well.
        (_, Some(0.0), Some(most)) => format!("<{}/{unit}", text::time(most)),
        (ns, ..) => format!("{}/{unit}", text::time(ns)),
    }
}

/// Boxes found in the solid of a scene.
fn occluders(report: &FunnelReport) -> Table {
    let mut table = Table::of("where | >boxes | >of the volume, % | >found in");
    let mut add = |place: String, boxes: usize, share: Option<f64>, ns: f64| {
        let share = some(share, |share| format!("{:.1}", share * 100.0));
        table.add_row([place, text::count(boxes), share, text::time(ns)]);
    };
    if let Some(row) = &report.inner_boxes {
        let of = text::counted(row.item_count, "item");
        let place = format!("inside {} of {of}", text::count(row.boxed_count));
        add(place, row.box_count, row.volume_share, row.build_ns);
    }
    if let Some(row) = &report.ground {
        let items = text::counted(row.item_count, "item");
        let place = format!("below {items} of ground, down to the lowest place");
        add(place, row.box_count, row.volume_share, row.build_ns);
    }
    if let Some(row) = &report.solid_blocks {
        let unclosed = text::any(row.unclosed_sector_count, "sector", |sectors| {
            format!(": {sectors} not closed or contradicting")
        });
        let place = format!("solid between the rooms of the map{unclosed}");
        add(place, row.box_count, None, row.build_ns);
    }
    table
}

/// Mark of an unproven back end.
pub fn doubt(guarantee: Guarantee) -> &'static str {
    ["", "?"][usize::from(guarantee == Guarantee::Unproven)]
}

/// A mean of counts.
pub fn count(mean: f64) -> String {
    match mean {
        mean if mean.fract() == 0.0 => text::count(mean as usize),
        mean => text::significant(mean),
    }
}

/// The tests of the fragment stage, if there are several to compare.
fn fragments(report: &FunnelReport) -> Table {
    let columns: &[Column<(&'static str, FragmentCounts<f64>)>] = &[
        ("test", |(name, _)| (*name).to_owned()),
        (">samples tested", |(_, of)| count(of.asked_count)),
        (">kept out", |(_, of)| count(of.kept_out_count)),
        (">fragments", |(_, of)| count(of.fragment_count)),
        (">clear", |(_, of)| count(of.clear_count)),
        (">shaded", |(_, of)| count(of.shaded_count)),
        (">covered", |(_, of)| count(of.covered_count)),
    ];
    let tests = report.stages.iter();
    let tests = tests.filter_map(|row| Some((row.back_end.name, row.fragments?)));
    let tests: Vec<_> = tests.collect();
    Table::with(if tests.len() < 2 { vec![] } else { tests }, columns)
}

fn picks(report: &FunnelReport) -> Table {
    let columns: &[Column<&PickRow>] = &[
        ("question", |row| row.question.name().to_owned()),
        ("by", |row| row.name.clone()),
        (">cursors", |row| text::count(row.ray_count)),
        (">wrong", |row| text::count(row.wrong_count)),
        (">time per cursor", |row| some(row.ns_per_ray, text::time)),
    ];
    Table::with(&report.picks, columns)
}

fn gains(report: &FunnelReport) -> Table {
    let columns: &[Column<&Gain>] = &[
        ("stage", |gain| {
            let back_end = shortened(&gain.back_end, 24);
            format!("{} ({back_end})", gain.stage.name())
        }),
        (">time with", |gain| some(gain.with_ns, text::time)),
        (">without", |gain| some(gain.without_ns, text::time)),
        (">left with", |gain| count(gain.with_count)),
        (">without", |gain| count(gain.without_count)),
        (">worth it from", |gain| worth(gain)),
    ];
    Table::with(&report.gains, columns)
}
