//! Conclusions of a funnel, in sentences.
//!
//! They name the draw cost above which each stage pays, and the back ends that lost visible
//! items.

use super::back_ends::{STENCIL, default_test};
use super::mirror::MirrorRow;
use super::orders::OrderRow;
use super::report::{FunnelReport, Gain, StageRow};
use super::stage::StageKind;
use crate::shown::{counted, significant, time};

/// Remaining items and the worth of each stage in a paragraph, then sentences.
///
/// The sentences are on back ends that lost items, the stencil, a mirror and orders.
pub fn conclusions(report: &FunnelReport) -> Vec<String> {
    let is_last = |row: &&StageRow| row.is_chosen && row.back_end.stage == StageKind::Occlusion;
    let last = report.stages.iter().find(is_last).map(|last| {
        format!(
            "Of {} {} remain to be drawn and {} are in front at some sample, per view.",
            counted(report.items, "item"),
            significant(last.errors.output_count),
            significant(last.errors.truth_count)
        )
    });
    let gains = report.gains.iter().filter_map(of_gain);
    let told: Vec<String> = last.into_iter().chain(gains).collect();
    let mut sentences = vec![told.join(" ")];
    sentences.extend(report.stages.iter().filter_map(StageRow::loss));
    sentences.extend(of_stencil(report));
    sentences.extend(report.mirror.as_ref().map(MirrorRow::sentence));
    sentences.extend(report.orders.iter().flat_map(of_order));
    sentences
}

/// A sentence on a stage.
///
/// None on the depth test, which costs a GPU next to nothing.
fn of_gain(gain: &Gain) -> Option<String> {
    let what = format!("{} ({})", gain.stage.name(), gain.back_end);
    let unit = gain.unit.trim_end_matches('s');
    let ns = gain.break_even;
    match (ns.map(|ns| ns.value), ns.and_then(|ns| ns.lower)) {
        _ if gain.stage == StageKind::Fragment => None,
        (None, _) if gain.removed() <= 0.0 => Some(format!(
            "{what} is not needed: it removes nothing that the other stages leave."
        )),
        (None, _) => None,
        (Some(0.0), _) => Some(format!("Use {what}: it saves time as well.")),
        (_, Some(0.0)) => Some(format!("Use {what}: it takes no more time than it saves.")),
        (Some(ns), _) => Some(format!(
            "Use {what} if drawing one {unit} takes more than {}.",
            time(ns)
        )),
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
