//! The tables of `cullbench funnel`: a row for each stage and back end, what each stage
//! of the chain is worth, and what follows.

use super::document::Block;
use super::table::Table;
use super::text;
use crate::funnel::{FunnelReport, Gain, LeftOutRow, LevelRow, StageRow, Times};
use crate::visibility::Guarantee;
use crate::visibility::hiders::{BlocksRow, GroundRow, InnerRow};
use crate::visibility::occlusion::OccluderChoice;

/// No line is longer.
const WIDTH: u16 = 100;

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
            "{} of the items are cut out by a mask ({}, tiles of {}): they hide nothing where it has holes.",
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
        ("Samples and fragments of what is left", fragments(report)),
        ("What is seen in the mirror", mirror(report)),
        ("What is left, drawn in every order", orders(report)),
        ("What is under a cursor", picks(report)),
        (
            "Lower bounds: what must be read or written at any rate",
            bounds(report),
        ),
        (
            "With and without each stage of the chain, and the draw cost above which it pays",
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
        let line = "The fragment stage is timed as it is done here: exactly, along the ray of each \
                    sample, on one thread. A graphics processor does it in hardware.";
        blocks.push(Block::Line(line.into()));
    }
    blocks.extend(report.left_out.iter().map(|row| {
        let LeftOutRow {
            section,
            name,
            reason,
        } = row;
        Block::Line(format!("Left out ({section}, {name}): {reason}."))
    }));
    blocks.extend(report.conclusions.iter().cloned().map(Block::Line));
    blocks
}

/// What the selection of a level saves; nothing where there is but one.
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

/// What hides in a mesh, and what finding it took.
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

/// What hides below the ground, and what finding it took.
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

/// What hides in a map, and what finding it took.
fn solid_blocks(row: &BlocksRow) -> Block {
    Block::Line(match row.unclosed_sector_count {
        0 => format!(
            "Occluders: {} in the solid between the rooms of the map, below floors and above \
             ceilings; found in {}.",
            text::counted(row.box_count, "box"),
            text::time(row.build_ns)
        ),
        unclosed => format!(
            "Occluders: none, as the linedefs of {} do not close, or disagree with others.",
            text::counted(unclosed, "sector")
        ),
    })
}

/// What the times rest on.
pub fn spread(processes: usize) -> String {
    match processes {
        0..3 => text::over(processes, None),
        _ => format!(
            "times over {}, with 95 % intervals",
            text::counted(processes, "process")
        ),
    }
}

/// The blocks for a terminal.
pub fn terminal(blocks: &[Block]) -> String {
    let lines = blocks.iter().map(|block| match block {
        Block::Heading(_, text) | Block::Line(text) => text::wrapped(text, WIDTH.into()),
        Block::Table(table) => table.to_string(),
        Block::Picture(_) => String::new(),
    });
    lines.map(|line| line + "\n").collect()
}

fn stages(report: &FunnelReport) -> Table {
    let mut table = Table::of("stage | by | >in | >out | >truth | >FP | >FN | >time | >per item");
    let level = &report.level;
    let mut first = vec!["level".to_owned(), level.selected.clone()];
    first.extend([level.input_count, level.output_count].map(|n| n.to_string()));
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

/// The mark of what nobody has proven.
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
        row.ns_per_removed.map(text::time).unwrap_or_default(),
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
fn of_fragments() -> Table {
    Table::of("test | >samples asked | >kept out | >fragments | >clear | >shaded | >covered")
}

/// The reflected scene on the samples of a mirror, and on all.
fn mirror(report: &FunnelReport) -> Table {
    let mut table = of_fragments();
    let drawn = report.mirror.iter().flat_map(|mirror| {
        [
            ("z-test", &mirror.without_stencil),
            ("stencil-test", &mirror.with_stencil),
        ]
    });
    table.rows.extend(drawn.map(|(name, counts)| {
        let mut cells = vec![name.to_owned()];
        cells.extend(counts.in_order().map(count));
        cells
    }));
    table
}

/// One test alone has nothing to be compared with.
fn fragments(report: &FunnelReport) -> Table {
    let mut table = of_fragments();
    let tests = report
        .stages
        .iter()
        .filter_map(|row| Some((row, row.fragments?)));
    table.rows.extend(tests.map(|(row, counts)| {
        let mut cells = vec![row.back_end.name.to_owned()];
        cells.extend(counts.in_order().map(count));
        cells
    }));
    if table.rows.len() < 2 {
        table.rows.clear();
    }
    table
}

fn orders(report: &FunnelReport) -> Table {
    let mut table = Table::of(
        "order | >fragments | >shaded | >overdraw | >pairs | >wrong | >wrong samples | >time",
    );
    table.rows.extend(report.orders.iter().map(|row| {
        vec![
            row.name.to_owned(),
            count(row.fragment_count),
            count(row.shaded_count),
            row.overdraw.map(text::significant).unwrap_or_default(),
            count(row.pair_count),
            count(row.wrong_pair_count),
            count(row.wrong_sample_count),
            of_view(&row.times),
        ]
    }));
    table
}

fn picks(report: &FunnelReport) -> Table {
    let mut table = Table::of("question | by | >cursors | >wrong | >time per cursor");
    table.rows.extend(report.picks.iter().map(|row| {
        vec![
            row.question.name().to_owned(),
            format!("{}{}", row.name, doubt(row.guarantee)),
            row.ray_count.to_string(),
            row.wrong_count.to_string(),
            row.ns_per_ray.map(text::time).unwrap_or_default(),
        ]
    }));
    table
}

fn bounds(report: &FunnelReport) -> Table {
    let mut table = Table::of("bound | of | >time | >ratio");
    table.rows.extend(report.bounds.iter().map(|row| {
        vec![
            row.name.to_owned(),
            row.back_end.to_owned(),
            of_view(&row.times),
            row.ratio.map(text::significant).unwrap_or_default(),
        ]
    }));
    table
}

fn gains(report: &FunnelReport) -> Table {
    let mut table =
        Table::of("stage | >time with | >without | counted | >with | >without | >pays above");
    table.rows.extend(report.gains.iter().map(gain));
    table
}

fn gain(gain: &Gain) -> Vec<String> {
    let time = |ns: Option<f64>| ns.map(text::time).unwrap_or_default();
    vec![
        format!("{} ({})", gain.stage.name(), gain.back_end),
        time(gain.with_ns),
        time(gain.without_ns),
        gain.unit.to_owned(),
        count(gain.with_count),
        count(gain.without_count),
        match gain.break_even_ns {
            Some(_) => text::time_plus_minus(
                gain.break_even_ns,
                [gain.break_even_ns_lower, gain.break_even_ns_upper],
            ),
            None if gain.removed() > 0.0 => String::new(),
            None => "removes nothing".to_owned(),
        },
    ]
}
