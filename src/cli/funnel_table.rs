//! The tables of `cullbench funnel`: a row for each stage and back end, what each stage
//! of the chain is worth, and what follows.

use std::io::{self, Write};

use super::document::{Block, Rows};
use super::text;
use crate::funnel::{FunnelReport, Gain, InnerRow, ProofCounts, SeenFrom, StageRow, Times};
use crate::shown::shown_field;
use crate::visibility::Guarantee;
use crate::visibility::occlusion::OccluderChoice;

/// No line is longer.
const WIDTH: usize = 100;

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
        Block::Table(stages(report)),
    ];
    blocks.extend(report.inner_boxes.as_ref().map(inner_boxes));
    if let Some(made) = &report.cut_outs {
        let line = format!(
            "{} of the items are cut out by a mask ({}, tiles of {}): they hide nothing where it has holes.",
            made.item_count, made.mask, made.tile
        );
        blocks.insert(2, Block::Line(line));
    }
    if report.from == SeenFrom::Region {
        let line = "The region stage is asked what may be seen from anywhere in the eye's region.";
        blocks.insert(2, Block::Line(line.into()));
    }
    if report.occluders != OccluderChoice::All.to_string() {
        let line = format!(
            "Occluders of the back ends in two passes: {}.",
            report.occluders
        );
        blocks.insert(2, Block::Line(line));
    }
    // Drawn in order and picked are solid boxes only.
    for (heading, table) in [
        (
            "What was removed within the frustum, by its proof, over all views",
            proofs(report),
        ),
        ("Samples and fragments of what is left", fragments(report)),
        ("What is left, drawn in every order", orders(report)),
        ("What is under a cursor", picks(report)),
        (
            "Lower bounds: what must be read or written at any rate",
            bounds(report),
        ),
        ("With and without each stage of the chain", gains(report)),
    ] {
        if !table.rows.is_empty() {
            blocks.extend([Block::Heading(2, heading.into()), Block::Table(table)]);
        }
    }
    blocks.extend(report.conclusions.iter().cloned().map(Block::Line));
    blocks
}

/// What hides in a mesh, and what finding it took.
fn inner_boxes(row: &InnerRow) -> Block {
    let held = row.volume_share.map(|share| {
        let [held, lost] = [share, 1.0 - share].map(|share| share * 100.0);
        format!(", {held:.1} % of the volume of these (loss {lost:.1} %)")
    });
    Block::Line(format!(
        "Occluders: boxes proven inside {} of {}{}; found in {}.",
        row.boxed_count,
        text::counted(row.item_count, "item"),
        held.unwrap_or_default(),
        text::time(row.build_ns)
    ))
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
        Block::Heading(_, text) | Block::Line(text) => text::wrapped(text, WIDTH),
        Block::Table(rows) => rows.terminal(),
        Block::Picture(_) => String::new(),
    });
    lines.map(|line| line + "\n").collect()
}

fn stages(report: &FunnelReport) -> Rows {
    let mut rows = Rows {
        header: [
            "stage", "by", "in", "out", "truth", "FP", "FN", "time", "per item",
        ]
        .map(str::to_owned)
        .into(),
        right: (2..9).collect(),
        rows: Vec::new(),
    };
    let level = &report.level;
    let mut first = vec!["level".to_owned(), level.selected.clone()];
    first.extend([level.input_count, level.output_count].map(|n| n.to_string()));
    first.resize(rows.header.len(), String::new());
    if level.map_count > 1 {
        first[7] = format!("-{}", text::time(level.saved_load_ns));
    }
    rows.rows.push(first);
    rows.rows.extend(report.stages.iter().map(stage));
    rows
}

/// A back end with its marks.
fn by(row: &StageRow) -> String {
    let name = row.structure.as_deref().unwrap_or(row.back_end.name);
    let mark = if row.is_chosen { "*" } else { "" };
    let doubt = match row.back_end.guarantee {
        Guarantee::Unproven => "?",
        _ => "",
    };
    format!("{name}{mark}{doubt}")
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

/// Every back end that removed what is in view, where proofs were made.
fn proofs(report: &FunnelReport) -> Rows {
    let mut rows = Rows::of_numbers([
        "stage",
        "by",
        "hidden",
        "tied",
        "along lines",
        "undecided",
        "sub-sample",
        "visible",
    ]);
    rows.right.retain(|column| *column > 1);
    let proven = report.stages.iter();
    let proven = proven.filter_map(|row| Some((row, row.proofs.as_ref()?)));
    for (row, proofs) in proven.filter(|(_, proofs)| **proofs != ProofCounts::default()) {
        let mut cells = vec![row.back_end.stage.name().to_owned(), by(row)];
        let counts = [
            proofs.hidden_count,
            proofs.tied_count,
            proofs.along_lines_count,
            proofs.undecided_count,
            proofs.sub_sample_count,
            proofs.visible_count,
        ];
        cells.extend(counts.map(|count| count.to_string()));
        rows.rows.push(cells);
    }
    rows
}

/// One test alone has nothing to be compared with.
fn fragments(report: &FunnelReport) -> Rows {
    let mut rows = Rows::of_numbers([
        "test",
        "samples asked",
        "kept out",
        "fragments",
        "clear",
        "shaded",
        "covered",
    ]);
    let tests = report
        .stages
        .iter()
        .filter_map(|row| Some((row, row.fragments?)));
    rows.rows.extend(tests.map(|(row, counts)| {
        let mut cells = vec![row.back_end.name.to_owned()];
        cells.extend(counts.in_order().map(count));
        cells
    }));
    if rows.rows.len() < 2 {
        rows.rows.clear();
    }
    rows
}

fn orders(report: &FunnelReport) -> Rows {
    let mut rows = Rows::of_numbers([
        "order",
        "fragments",
        "shaded",
        "overdraw",
        "pairs",
        "wrong",
        "wrong samples",
        "time",
    ]);
    rows.rows.extend(report.orders.iter().map(|row| {
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
    rows
}

fn picks(report: &FunnelReport) -> Rows {
    let mut rows = Rows::of_numbers(["question", "by", "cursors", "wrong", "time per cursor"]);
    rows.right.retain(|column| *column > 1);
    rows.rows.extend(report.picks.iter().map(|row| {
        let doubt = if row.guarantee == Guarantee::Unproven {
            "?"
        } else {
            ""
        };
        vec![
            row.question.name().to_owned(),
            format!("{}{doubt}", row.name),
            row.ray_count.to_string(),
            row.wrong_count.to_string(),
            row.ns_per_ray.map(text::time).unwrap_or_default(),
        ]
    }));
    rows
}

fn bounds(report: &FunnelReport) -> Rows {
    let mut rows = Rows::of_numbers(["bound", "of", "time", "ratio"]);
    rows.right.retain(|column| *column > 1);
    rows.rows.extend(report.bounds.iter().map(|row| {
        vec![
            row.name.to_owned(),
            row.back_end.to_owned(),
            of_view(&row.times),
            row.ratio.map(text::significant).unwrap_or_default(),
        ]
    }));
    rows
}

fn gains(report: &FunnelReport) -> Rows {
    let mut rows = Rows::of_numbers([
        "stage",
        "time with",
        "without",
        "items with",
        "without",
        "pays above a draw cost of",
    ]);
    rows.rows.extend(report.gains.iter().map(gain));
    rows
}

fn gain(gain: &Gain) -> Vec<String> {
    let time = |ns: Option<f64>| ns.map(text::time).unwrap_or_default();
    vec![
        format!("{} ({})", gain.stage.name(), gain.back_end),
        time(gain.with_ns),
        time(gain.without_ns),
        count(gain.with_count),
        count(gain.without_count),
        match gain.break_even_ns {
            Some(_) => text::time_plus_minus(
                gain.break_even_ns,
                [gain.break_even_ns_lower, gain.break_even_ns_upper],
            ),
            None => "removes nothing".to_owned(),
        },
    ]
}

/// One tidy row for each stage and back end; numbers as they are.
pub fn csv(report: &FunnelReport, out: impl Write) -> io::Result<()> {
    let mut out = csv::Writer::from_writer(out);
    out.write_record([
        "scene",
        "path",
        "stage",
        "back_end",
        "guarantee",
        "is_chosen",
        "unit",
        "input_count",
        "output_count",
        "truth_count",
        "false_positive_count",
        "false_negative_count",
        "worst_missing_samples",
        "image_error",
        "stage_ns",
        "ns_per_removed",
        "ns_per_decided",
        "asked_count",
        "kept_out_count",
        "fragment_count",
        "clear_count",
        "shaded_count",
        "covered_count",
    ])?;
    for row in &report.stages {
        let errors = &row.errors;
        let name = row.structure.as_deref().unwrap_or(row.back_end.name);
        let optional = |value: Option<f64>| value.map(|v| v.to_string()).unwrap_or_default();
        let mut record = vec![
            shown_field(&report.scene),
            shown_field(&report.path),
            row.back_end.stage.name().to_owned(),
            shown_field(name),
            row.back_end.guarantee.name().to_owned(),
            row.is_chosen.to_string(),
            row.unit.to_owned(),
            errors.input_count.to_string(),
            errors.output_count.to_string(),
            errors.truth_count.to_string(),
            errors.false_positive_count.to_string(),
            errors.false_negative_count.to_string(),
            errors.worst_missing_samples.to_string(),
            optional(errors.image_error.map(|rate| rate.value)),
            optional(row.times.stage_ns),
            optional(row.ns_per_removed),
            optional(row.ns_per_decided),
        ];
        let counts = row.fragments.map(|counts| counts.in_order());
        record.extend((0..6).map(|n| optional(counts.map(|counts| counts[n]))));
        out.write_record(record)?;
    }
    out.flush()
}
