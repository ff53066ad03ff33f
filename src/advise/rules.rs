//! Rules of omission: one function each, which adds both sides as tasks.
//!
//! Rules about structures, their updates and the camera's basis; rules about the stages after the
//! frustum, which read a funnel of a few views: one side removes candidates that the other returns,
//! so the saved drawing is compared with the time of the stage.

use std::slice;

use super::case::{NO_NODES, TOLERANCE, default_of};
use super::change::Axis;
use super::choice::{ns, over, policy_of};
use super::planes;
use super::rule::{EnteredRule, Finding, Rule};
use super::tasks::Basis::{Error, Rule as Statistic, Time};
use super::tasks::{BASE, PairResult, TaskList, TaskPair};
use crate::drift::walk;
use crate::funnel::StageKind::{self, Occlusion, Region, Triangle};
use crate::funnel::{Chain, FunnelInput, FunnelReport, Gain, NONE};
use crate::index::StructureSpec;
use crate::measure::Setting;
use crate::shown::{count, counted, significant};
use crate::visibility::SampleGrid;

/// All rules: name, work to leave out; statistic; decision.
pub(super) const RULES: &[Rule] = rows! {
    Rule { name, left_out, statistic_name, by, enter }
    "needless-planes", "all six planes",
        "share of all planes that the n-vertex of the scene's bounds is not inside of",
        Time, planes::needless_planes;
    "plane-masks", "plane masks", "share of the plane tests that masks save",
        Time, planes::plane_masks;
    "no-index", "index", "items", Time, no_index;
    "six-planes", "exact test (SAT)", "cost of drawing what six planes let through, ns a query",
        Statistic, |_| planes::six_planes();
    "regions", "portals",
        "share of the items left by the other stages that lie in no region that is seen",
        Statistic, |_| reads(Region);
    "occlusion", "occlusion culling",
        "share of the items left by the other stages that others hide",
        Statistic, |_| reads(Occlusion);
    "back-faces", "back-face tests", "share of the triangles of the items left that face away",
        Statistic, |_| reads(Triangle);
    "third-dimension", "third dimension", "height of the scene", Time, third_dimension;
    "rebasing", "rebasing", "margin for rounding in world coordinates / depth of the view",
        Error, planes::rebasing;
    "rebuild", "rebuilds", "time of a frame without rebuilds, ns",
        Statistic, |_| rebuild();
    "f64-kernel", "double precision", "margin for rounding to f32 / depth of the view",
        Error, planes::f64_kernel;
    "frame-correction", "orthonormalization", "error of the axes after all steps of the path",
        Error, frame_correction;
};

/// Rule: the index itself; below some number of items a scan is as fast.
///
/// The number follows from measurements on parts of the scene ([`Axis::Items`]).
fn no_index(tasks: &mut TaskList) -> anyhow::Result<EnteredRule> {
    let case = tasks.case;
    let [scan, tree] = [&case.scan, &case.spec].map(|spec| spec.label.clone());
    let items = &case.workload.scene.items;
    let whole = tasks.index(case.scan.build(items)?, &case.workload.views[..]);
    let place = ["", ", at rest"][usize::from(case.workload.motion.is_some())];
    let sides = TaskPair::new(format!("{tree} against {scan}{place}"), BASE, whole);
    let all = items.len() as f64;
    Ok(EnteredRule::concluded(sides, move |advice, check| {
        let taken = &advice.structure;
        // Follows the chosen structure if there was a choice.
        let [tree, fastest] = taken.tree_and_scan();
        let both = tree.zip(fastest);
        let of_pairs = advice.test.costs;
        let costs = both.and_then(|(tree, scan)| Some([ns(tree)?, ns(scan)?]));
        let costs = of_pairs.or(costs);
        let is_tie = costs.map(|_| taken.is_scan_or_tree());
        let alone = check.filter(|_| costs.is_none());
        let change = advice.changes.iter().find(|c| c.axis == Axis::Items);
        let below = change.and_then(|change| change.below.as_ref());
        let wins = |check: &PairResult| check.left_out.ns <= check.kept.ns;
        let scan_wins = alone.map_or(taken.is_scan(), wins);
        // Smaller parts are not measured once another structure is faster.
        let measured = change.map(|change| change.measured[0]);
        let least = below.map(|turn| turn.upper).or(measured).unwrap_or(all);
        // The whole scene is the limit if both tie there.
        let below = below.filter(|turn| turn.structure == scan && turn.at < all);
        let crossing = match below {
            _ if scan_wins => all,
            Some(turn) => turn.at,
            None => 0.0,
        };
        let (least, most) = (count(least as usize), crossing.round() as usize);
        let reason = match crossing {
            _ if costs.is_none() => format!("by all items alone{place}"),
            _ if is_tie == Some(true) => "a scan and a tree tie".to_owned(),
            _ if scan_wins => "a scan wins".to_owned(),
            _ if of_pairs.is_some() => "a tree wins with its test".to_owned(),
            0.0 => format!("no scan wins from {least} items on"),
            _ => format!("a scan wins up to {}", counted(most, "item")),
        };
        Finding {
            cost_ns: costs,
            leaves_out: costs.map(|_| taken.is_scan()),
            is_tie,
            ..Finding::new(all, crossing, reason)
        }
    }))
}

/// Rule: the third dimension of the cells.
///
/// An octree's third split separates nothing in a scene that is flatter than a quadtree's leaves
/// are wide. Bounds stay three-dimensional either way.
fn third_dimension(tasks: &mut TaskList) -> anyhow::Result<EnteredRule> {
    let case = tasks.case;
    let (scene, by) = (case.workload.scene, case.spec.execution);
    let [octree, quadtree] = ["octree", "quadtree"].map(|name| default_of(name, by));
    let leaf = quadtree.params["leaf"].as_f64().unwrap_or(f64::NAN);
    let extent = scene.bounds.max.as_dvec3() - scene.bounds.min.as_dvec3();
    let mut extents = extent.to_array();
    extents.sort_by(f64::total_cmp);
    let [height, widths @ ..] = extents;
    let cell = 2.0 * (widths[0] * widths[1]).sqrt() / (scene.items.len() as f64 / leaf).sqrt();
    let [kept, left_out] = [octree.build(&scene.items)?, quadtree.build(&scene.items)?]
        .map(|index| tasks.index(index, &case.workload.views[..]));
    let sides = TaskPair::new("octree against quadtree", kept, left_out);
    Ok(EnteredRule::concluded(sides, move |advice, _| {
        if advice.structure.is_scan() {
            return Finding::none(NO_NODES);
        }
        let taken = advice.structure.name.as_deref().unwrap_or_default();
        let flat = taken.starts_with("quadtree");
        let is_either = flat || taken.starts_with("octree");
        let is_either = is_either && advice.structure.ties.is_empty();
        Finding {
            leaves_out: is_either.then_some(flat),
            ..Finding::new(height, cell, "octree against quadtree")
        }
    }))
}

/// Rule: a rebuild in every frame of a motion, compared with refits only.
///
/// A refit keeps the tree and is faster, but queries of the refitted tree are slower.
fn rebuild() -> anyhow::Result<EnteredRule> {
    Ok(EnteredRule::concluded(None, |advice, _| {
        let Some(motion) = &advice.motion else {
            return Finding::none("nothing moves without --motion");
        };
        let cell = |policy| {
            let mut ranked = motion.policies.iter().filter(|cell| cell.rank.is_some());
            ranked.find(|cell| policy_of(&cell.structure) == policy)
        };
        let ruled_out = motion.ruled_out.first();
        if let Some((&(_, frames), refitted)) = ruled_out.zip(cell("refit").and_then(ns)) {
            let builds = frames * refitted;
            return Finding {
                cost_ns: Some([builds, refitted]),
                ..Finding::new(refitted, builds, "its builds alone")
            };
        }
        let both = cell("rebuild").zip(cell("refit"));
        let costs = both.and_then(|(kept, left_out)| Some([ns(kept)?, ns(left_out)?]));
        let Some(((rebuilt, refitted), [kept, left_out])) = both.zip(costs) else {
            return Finding::none("not both policies were measured");
        };
        let (on, ratio) = (&refitted.structure, over(rebuilt, refitted));
        let check = PairResult::of_times(format!("frames of {on}"), [kept, left_out], ratio);
        Finding {
            check: Some(check),
            ..Finding::new(left_out, kept, "rebuilt in every frame")
        }
    }))
}

/// Rule: correction of a camera basis by a polar Newton step per 100 rotations.
///
/// Axes in f32 that are rotated and never corrected drift by some 5e-8 per step; a walk of as many
/// steps as the path has cameras measures the error. A basis that is built for each camera
/// does not need the correction.
fn frame_correction(tasks: &mut TaskList) -> anyhow::Result<EnteredRule> {
    let path = tasks.case.path;
    let steps = path.cameras.len() + path.left_out;
    let [(error, without), (_, with)] =
        ["f32", "f32-polar-100"].map(|method| walk(method, steps as u64));
    let [kept, left_out] = [with, without].map(|ask| tasks.enter(false, ask));
    // The error of a basis that is lost is infinite.
    let error = error.unwrap_or(f64::INFINITY);
    let reason = format!("500 steps are timed; error after {steps}: {error:.1e}");
    let finding = Finding::new(error, TOLERANCE, reason);
    let sides = TaskPair::new("500 steps of a frame", kept, left_out);
    Ok(EnteredRule::new(sides, finding))
}

/// Most views, and most items in all views together.
const VIEWS: usize = 8;
const ITEMS: usize = 100_000;
/// Samples of a view and of the occlusion buffer.
const SAMPLES: SampleGrid = SampleGrid::new(320, 180);

/// Input of a funnel with the stages on a tree.
pub fn input<'s>(setting: &'s Setting, tree: &'s StructureSpec) -> FunnelInput<'s> {
    let most = (ITEMS / setting.scene.items.len().max(1)).clamp(1, VIEWS);
    let structures = slice::from_ref(tree);
    let chain = Chain::for_scene(&setting.scene, structures, false).with(StageKind::Fragment, NONE);
    FunnelInput {
        structures,
        all: false,
        ..FunnelInput::new(setting, chain, (most, SAMPLES), tree.execution)
    }
}

/// Rule about a stage; does not apply if the funnel lacks the stage.
fn reads(stage: StageKind) -> anyhow::Result<EnteredRule> {
    Ok(EnteredRule::concluded(None, move |advice, _| {
        let funnel = advice.funnel.as_ref().map_err(String::clone);
        let found = funnel.and_then(|funnel| finding(funnel, stage, advice.draw_ns));
        found.unwrap_or_else(Finding::none)
    }))
}

/// Finding for a stage, from its gain.
fn finding(funnel: &FunnelReport, stage: StageKind, draw_ns: f64) -> Result<Finding, String> {
    let gain = |stage| funnel.gains.iter().find(|gain| gain.stage == stage);
    let mut left_out = funnel.left_out.iter();
    let own = gain(stage).ok_or_else(|| {
        let row = left_out.find(|row| row.name == stage.name());
        let none = "the scene has no rooms or sectors that portals join";
        row.map_or(none, |row| &row.reason).to_owned()
    })?;
    let items = gain(StageKind::Occlusion).map_or(f64::NAN, |gain| gain.with_count);
    let of_item = own.without_count / items;
    Ok(match stage {
        StageKind::Triangle => gain_finding(own, "triangle", draw_ns / of_item),
        _ => gain_finding(own, "item", draw_ns),
    })
}

/// Leaves a stage out if it takes longer than drawing what it removes.
///
/// A candidate (`one`) that is not removed costs `cost_ns`.
fn gain_finding(gain: &Gain, one: &str, cost_ns: f64) -> Finding {
    let (with, without) = (gain.with_count, gain.without_count);
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
    let (cost, pays_from) = (significant(cost_ns), pays_from.unwrap_or_default());
    let reason = format!("{cost} ns/{one}{pays_from}");
    let on = format!("{} {}, as in funnel", gain.stage.name(), gain.back_end);
    let check = PairResult {
        same_answers: gain.unit == "fragments" || removed == 0.0,
        ..PairResult::of_times(on, [kept_ns, left_out_ns], gain.ratio)
    };
    Finding {
        check: Some(check),
        cost_ns: Some([kept_ns + with * cost_ns, left_out_ns + without * cost_ns]),
        ..Finding::new(removed / without, pays, reason)
    }
}

#[cfg(test)]
mod tests {
    use super::super::rule::{Omission, some_rule};
    use super::super::tasks::{Basis, Decision};
    use super::*;
    use crate::statistics::Estimate;

    fn settled([with_count, without_count]: [f64; 2], ratio: f64, cost_ns: f64) -> Omission {
        let counts = [with_count, without_count];
        let named = ("rays", "items");
        let mut gain = Gain::new(StageKind::Occlusion, named, counts, Default::default());
        (gain.without_ns, gain.ratio) = (Some(100.0), Some(Estimate::exact(ratio)));
        some_rule(Basis::Rule).omission(gain_finding(&gain, "thing", cost_ns), None)
    }

    #[test]
    fn a_stage_is_left_out_where_it_takes_longer_than_what_it_saves() {
        // 200 ns for 40 of 50: pays above 5 ns each.
        let dear = settled([10.0, 50.0], 3.0, 5.1);
        assert_eq!(dear.decision, Decision::Keep);
        assert_eq!(dear.statistic, Some(0.8));
        assert!((dear.threshold.unwrap() - 200.0 / 255.0).abs() < 1e-12);
        assert_eq!(dear.reason, "5.10 ns/thing, pays from 5.00");
        // A positive cost is not shown as 0.
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
