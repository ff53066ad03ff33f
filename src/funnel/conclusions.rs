//! What follows from a funnel, in sentences: which stages pay from which draw cost on,
//! and which back ends lost what is visible.

use super::fragment_rows;
use super::mirror::MirrorRow;
use super::orders::OrderRow;
use super::report::{FunnelReport, Gain, StageRow};
use super::stage::StageKind;
use crate::shown::counted;

/// A sentence for each stage of the chain, and one for each back end that lost items.
pub fn conclusions(report: &FunnelReport) -> Vec<String> {
    let mut sentences: Vec<String> = report.gains.iter().map(of_gain).collect();
    let lossy = |row: &&StageRow| row.errors.false_negative_count > 0.0;
    sentences.extend(report.stages.iter().filter(lossy).map(of_loss));
    sentences.extend(of_stencil(report));
    sentences.extend(report.mirror.as_ref().map(of_mirror));
    sentences.extend(report.orders.iter().flat_map(of_order));
    let of_chain = |stage| {
        let mut chosen = report.stages.iter().filter(|row| row.is_chosen);
        chosen.find(|row| row.back_end.stage == stage)
    };
    if let Some(last) = of_chain(StageKind::Occlusion) {
        sentences.push(format!(
            "Of {} items {:.1} are left and {:.1} are in front at a sample, per view.",
            report.items, last.errors.output_count, last.errors.truth_count
        ));
    }
    sentences
}

fn of_gain(gain: &Gain) -> String {
    let what = format!("{} ({})", gain.stage.name(), gain.back_end);
    let (removed, unit) = (gain.removed(), gain.unit);
    if removed <= 0.0 {
        return format!("{what} removes nothing that the other stages leave: leave it out.");
    }
    match gain.break_even_ns {
        Some(0.0) => format!("{what} removes {removed:.1} {unit} per view and saves time as well."),
        Some(ns) => format!(
            "{what} removes {removed:.1} {unit} per view and pays where {} one of them takes more \
             than {ns:.1} ns.",
            match gain.stage {
                StageKind::Fragment => "shading",
                _ => "drawing",
            }
        ),
        None => format!("{what} removes {removed:.1} {unit} per view."),
    }
}

/// What the stencil saves, against the same tests without it.
fn of_stencil(report: &FunnelReport) -> Option<String> {
    let tests = || report.stages.iter().filter(|row| row.fragments.is_some());
    let stencil = tests().find(|row| row.back_end.name == fragment_rows::STENCIL)?;
    let other = fragment_rows::default(report.cut_outs.is_some());
    let other = tests().find(|row| row.back_end.name == other)?;
    let [with, without] = [stencil, other].map(|row| row.fragments);
    let (with, without) = (with?.asked_count, without?.asked_count);
    Some(format!(
        "fragment {} asks {with:.0} samples per view in place of {without:.0} ({:.1} % fewer) and \
         leaves {} items as {} does.",
        stencil.back_end.name,
        (1.0 - with / without) * 100.0,
        match stencil.errors.output_count == other.errors.output_count {
            true => "as many",
            false => "not as many",
        },
        other.back_end.name,
    ))
}

/// What the stencil of a mirror saves.
fn of_mirror(row: &MirrorRow) -> String {
    let MirrorRow {
        with_stencil: with,
        without_stencil: without,
        ..
    } = row;
    format!(
        "In item {} as a mirror across {} (in front in {}, at {:.1} samples per view) {:.1} items are \
         seen; the stencil asks {:.0} samples per view in place of {:.0}, and {} are shown differently.",
        row.item,
        row.axis,
        counted(row.view_count, "view"),
        row.marked_count,
        row.shown_count,
        with.asked_count,
        without.asked_count,
        counted(row.wrong_sample_count as usize, "sample")
    )
}

/// Where an order that is declared exact is not.
fn of_order(row: &OrderRow) -> impl Iterator<Item = String> {
    row.exceptions.iter().map(|(reason, views)| {
        format!(
            "Order {} may be wrong in {}: {reason}.",
            row.name,
            counted(*views, "view")
        )
    })
}

fn of_loss(row: &StageRow) -> String {
    let errors = &row.errors;
    format!(
        "{} {} lost {:.2} visible items per view, one of them {} samples large.",
        row.back_end.stage.name(),
        row.back_end.name,
        errors.false_negative_count,
        errors.worst_missing_samples
    )
}
