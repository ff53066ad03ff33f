//! Rules about the stages behind the frustum, read off a funnel of a few views.
//!
//! One side removes what the other returns, so the drawing that this saves is weighed
//! against the time that it takes.

use std::slice;

use super::super::omission::Check;
use super::super::rule::{Draft, Finding};
use crate::funnel::{Chain, FunnelInput, FunnelReport, Gain, NONE, StageKind};
use crate::index::StructureSpec;
use crate::measure::Setting;
use crate::shown::significant;
use crate::visibility::SampleGrid;

/// Most views, and most items of all of them.
const VIEWS: usize = 8;
const ITEMS: usize = 100_000;
/// Samples of a view and of the occlusion buffer; of the image that is shaded.
const SAMPLES: SampleGrid = SampleGrid::new(320, 180);
const SHADED: SampleGrid = SampleGrid::new(1920, 1080);

/// The stages on a tree.
pub fn input<'s>(setting: &'s Setting, tree: &'s StructureSpec) -> FunnelInput<'s> {
    let most = (ITEMS / setting.scene.items.len().max(1)).clamp(1, VIEWS);
    let structures = slice::from_ref(tree);
    let chain = Chain::for_scene(&setting.scene, structures, false)
        .with(StageKind::Triangle, "several-cones")
        .with(StageKind::Fragment, NONE);
    FunnelInput {
        structures,
        all: false,
        picks: false,
        sorted: true,
        ..FunnelInput::new(setting, chain, (most, SAMPLES), tree.execution)
    }
}

/// Cost of shading a fragment, ns: an image of 1920 x 1080 in 2 ms.
const SHADE_NS: f64 = 1.0;

/// A rule about a stage; where the funnel has none it does not apply, for a reason.
pub(super) fn reads(stage: StageKind) -> anyhow::Result<Draft> {
    Ok(Draft::concluded(None, move |facts, _| {
        let funnel = facts.funnel.as_ref().map_err(String::clone);
        let found = funnel.and_then(|funnel| finding(funnel, stage, facts.draw_ns));
        found.unwrap_or_else(Finding::none)
    }))
}

/// The gain of a stage, weighed; of the fragment stage, that of sorting.
fn finding(funnel: &FunnelReport, stage: StageKind, draw_ns: f64) -> Result<Finding, String> {
    let gain = |stage| funnel.gains.iter().find(|gain| gain.stage == stage);
    let mut left_out = funnel.left_out.iter();
    let is_own = |section, name| match stage {
        StageKind::Fragment => section == "orders",
        _ => name == stage.name(),
    };
    let own = gain(stage).ok_or_else(|| {
        let row = left_out.find(|row| is_own(row.section, row.name));
        let none = "the scene has no rooms or sectors that portals join";
        row.map_or(none, |row| &row.reason).to_owned()
    })?;
    let items = gain(StageKind::Occlusion).map_or(f64::NAN, |gain| gain.with_count);
    let of_item = own.without_count / items;
    let large = SHADED.samples() as f64 / SAMPLES.samples() as f64;
    Ok(match stage {
        StageKind::Triangle => weigh(own, "triangle", 1.0, draw_ns / of_item),
        StageKind::Fragment => weigh(own, "fragment", large, SHADE_NS),
        _ => weigh(own, "item", 1.0, draw_ns),
    })
}

/// Leaves out where removing takes longer than drawing the removed candidates.
///
/// A counted candidate, `one`, stands for `scale` of them; one that is not removed costs
/// `cost_ns`.
fn weigh(gain: &Gain, one: &str, scale: f64, cost_ns: f64) -> Finding {
    let [with, without] = [gain.with_count, gain.without_count].map(|n| n * scale);
    if without == 0.0 {
        return Finding::none(format!("no {one} is in any view that was looked at"));
    }
    let removed = without - with;
    let left_out_ns = gain.without_ns.unwrap_or(f64::NAN);
    let ratio = gain.ratio.map_or(f64::NAN, |ratio| ratio.value);
    let kept_ns = ratio * left_out_ns;
    let testing = kept_ns - left_out_ns;
    let from = (testing > 0.0 && removed > 0.0).then_some(testing / removed);
    let pays_from = from.map(|ns| format!(", pays from {}", significant(ns)));
    let pays = (testing / (cost_ns * without)).max(0.0);
    let reason = format!(
        "{} ns/{one}{}",
        significant(cost_ns),
        pays_from.unwrap_or_default()
    );
    let on = format!("{} {}, as in funnel", gain.stage.name(), gain.back_end);
    let check = Check {
        same_answers: gain.unit == "fragments" || removed == 0.0,
        ..Check::of_times(on, [kept_ns, left_out_ns], gain.ratio)
    };
    Finding {
        check: Some(check),
        cost_ns: Some([kept_ns + with * cost_ns, left_out_ns + without * cost_ns]),
        ..Finding::new(removed / without, pays, reason)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::omission::{By, Decision};
    use super::super::super::rule::{Omission, some_rule};
    use super::*;
    use crate::statistics::Estimate;

    fn settled([with_count, without_count]: [f64; 2], ratio: f64, cost_ns: f64) -> Omission {
        let counts = [with_count, without_count];
        let named = ("rays", "items");
        let mut gain = Gain::new(StageKind::Occlusion, named, counts, Default::default());
        (gain.without_ns, gain.ratio) = (Some(100.0), Some(Estimate::exact(ratio)));
        some_rule(By::Rule).omission(weigh(&gain, "thing", 1.0, cost_ns), None)
    }

    #[test]
    fn a_stage_is_left_out_where_it_takes_longer_than_what_it_saves() {
        // 200 ns for 40 of 50: pays above 5 ns each.
        let dear = settled([10.0, 50.0], 3.0, 5.1);
        assert_eq!(dear.decision, Decision::Keep);
        assert_eq!(dear.statistic, Some(0.8));
        assert!((dear.threshold.unwrap() - 200.0 / 255.0).abs() < 1e-12);
        assert_eq!(dear.reason, "5.10 ns/thing, pays from 5.00");
        // A cost that is not 0 is not shown as 0.
        let little = settled([0.0, 1e6], 1.1, 1.0);
        assert_eq!(little.reason, "1.00 ns/thing, pays from 0.0000100");
        let cheap = settled([10.0, 50.0], 3.0, 4.9);
        assert_eq!(cheap.decision, Decision::LeaveOut);
        // It costs 300 + 49 with and 100 + 245 without.
        assert!((cheap.saving.unwrap() - (1.0 - 345.0 / 349.0)).abs() < 1e-12);
        let of_all = |ratio| settled([50.0, 50.0], ratio, 1e9).decision;
        assert_eq!([3.0, 0.5].map(of_all), [Decision::LeaveOut; 2]);
        let nothing = settled([0.0, 0.0], 3.0, 1.0);
        assert_eq!((nothing.statistic, nothing.threshold), (None, None));
        assert!(nothing.reason.contains("no thing"), "{}", nothing.reason);
    }
}
