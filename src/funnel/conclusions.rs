//! Conclusions of a funnel, in sentences.
//!
//! They name the draw cost above which each stage pays, and the back ends that lost visible
//! items.

use super::back_ends::{STENCIL, default_test};
use super::mirror::MirrorRow;
use super::orders::OrderRow;
use super::report::{FunnelReport, Gain, StageRow};
use super::stage::StageKind;
use crate::shown::counted;

/// A sentence for each stage of the chain, and for each back end that lost items.
pub fn conclusions(report: &FunnelReport) -> Vec<String> {
    let mut sentences: Vec<String> = report.gains.iter().map(of_gain).collect();
    sentences.extend(report.stages.iter().filter_map(StageRow::loss));
    sentences.extend(of_stencil(report));
    sentences.extend(report.mirror.as_ref().map(MirrorRow::sentence));
    sentences.extend(report.orders.iter().flat_map(of_order));
    let is_last = |row: &&StageRow| row.is_chosen && row.back_end.stage == StageKind::Occlusion;
    sentences.extend(report.stages.iter().find(is_last).map(|last| {
        format!(
            "Of {} items, {:.1} remain and {:.1} are in front at some sample, per view.",
            report.items, last.errors.output_count, last.errors.truth_count
        )
    }));
    sentences
}

fn of_gain(gain: &Gain) -> String {
    let what = format!("{} ({})", gain.stage.name(), gain.back_end);
    let (removed, unit) = (gain.removed(), gain.unit);
    if removed <= 0.0 {
        return format!("{what} removes nothing that the other stages leave: skip it.");
    }
    match gain.break_even.map(|ns| ns.value) {
        Some(0.0) => format!("{what} removes {removed:.1} {unit} per view and saves time as well."),
        Some(ns) => format!(
            "{what} removes {removed:.1} {unit} per view and pays off if {} one of them takes \
             more than {ns:.1} ns.",
            match gain.stage {
                StageKind::Fragment => "shading",
                _ => "drawing",
            }
        ),
        None => format!("{what} removes {removed:.1} {unit} per view."),
    }
}

/// Samples that the stencil-test saves against the default test.
fn of_stencil(report: &FunnelReport) -> Option<String> {
    let test = |name: &str| {
        let row = report.stages.iter().find(|row| row.back_end.name == name)?;
        Some((row, row.fragments?.asked_count))
    };
    let (stencil, with) = test(STENCIL)?;
    let (other, without) = test(default_test(report.cut_outs.is_some()))?;
    Some(format!(
        "fragment {} tests {with:.0} samples per view instead of {without:.0} ({:.1} % fewer) and \
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

impl MirrorRow {
    /// A sentence on the reflected items and what the stencil saves.
    pub fn sentence(&self) -> String {
        format!(
            "In item {} as a mirror across {} (in front in {}, at {:.1} samples per view) {:.1} items \
         are seen; with the stencil, {:.0} samples per view are tested instead of {:.0}, and {} \
         differ.",
            self.item,
            self.axis,
            counted(self.view_count, "view"),
            self.marked_count,
            self.shown_count,
            self.with_stencil.asked_count,
            self.without_stencil.asked_count,
            counted(self.wrong_sample_count as usize, "sample")
        )
    }
}

/// Exceptions of an order that is declared exact.
fn of_order(row: &OrderRow) -> impl Iterator<Item = String> {
    row.exceptions.iter().map(|(reason, views)| {
        let views = counted(*views, "view");
        format!("Order {} may be wrong in {views}: {reason}.", row.name)
    })
}
