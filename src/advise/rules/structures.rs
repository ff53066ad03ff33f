//! Rules about structures, their updates, and the camera's frame.

use super::super::change::Axis;
use super::super::choice::{ns, over};
use super::super::motion::policy_of;
use super::super::omission::{Check, is_longer};
use super::super::options::{NO_NODES, TOLERANCE, default_of};
use super::super::rule::{Draft, Finding};
use super::super::trials::{BASE, Sides, Trials};
use crate::drift::walk;
use crate::shown::{count, counted};

/// The index itself: below some number of items a scan is as fast.
///
/// The number follows from the parts of the scene that are measured beside it
/// ([`Axis::Items`]).
pub(super) fn no_index(trials: &mut Trials) -> anyhow::Result<Draft> {
    let case = trials.case;
    let [scan, tree] = [&case.scan, &case.spec].map(|spec| spec.label.clone());
    let items = &case.scene().items;
    let whole = trials.index(case.scan.build(items)?, &case.workload.views[..]);
    let place = ["", ", at rest"][usize::from(case.workload.motion.is_some())];
    let sides = Sides::new(format!("{tree} against {scan}{place}"), BASE, whole);
    let all = items.len() as f64;
    Ok(Draft::concluded(sides, move |facts, check| {
        let taken = facts.structure;
        // Follows the structure taken, wherever there was a choice.
        let [tree, fastest] = taken.tree_and_scan();
        let both = tree.zip(fastest);
        let costs = both.and_then(|(tree, scan)| Some([ns(tree)?, ns(scan)?]));
        let ratio = both.and_then(|(tree, scan)| over(tree, scan));
        let is_tie = ratio.map(|ratio| is_longer(ratio).is_none());
        let alone = check.filter(|_| costs.is_none());
        let change = facts.changes.iter().find(|c| c.axis == Axis::Items);
        let below = change.and_then(|change| change.below.as_ref());
        // Smaller parts are not measured once another structure is ahead.
        let least = below.map(|turn| turn.upper);
        let wins = |check: &Check| check.left_out.ns <= check.kept.ns;
        let scan_wins = alone.map_or(taken.is_scan(), wins);
        let below = below.filter(|turn| turn.structure == scan && alone.is_none());
        let crossing = match below {
            _ if scan_wins => all,
            Some(turn) => turn.at,
            None => 0.0,
        };
        let least = least.or(change.map(|change| change.measured[0]));
        let reason = match crossing {
            _ if costs.is_none() => format!("by all items alone{place}"),
            // A scan that ties with a tree wins nowhere.
            _ if taken.is_scan() && is_tie == Some(true) => "a scan and a tree tie".to_owned(),
            0.0 => format!(
                "no scan wins from {} items on",
                count(least.unwrap_or(all) as usize)
            ),
            _ => format!(
                "a scan wins up to {}",
                counted(crossing.round() as usize, "item")
            ),
        };
        Finding {
            cost_ns: costs,
            leaves_out: costs.map(|_| taken.is_scan()),
            is_tie,
            ..Finding::new(all, crossing, reason)
        }
    }))
}

/// The third dimension of the cells.
///
/// An octree's third split separates nothing in a scene that is flatter than a quadtree's
/// leaves are wide. Bounds stay three-dimensional either way.
pub(super) fn third_dimension(trials: &mut Trials) -> anyhow::Result<Draft> {
    let case = trials.case;
    let (scene, by) = (case.scene(), case.spec.execution);
    let [octree, quadtree] = ["octree", "quadtree"].map(|name| default_of(name, by));
    let leaf = quadtree.params["leaf"].as_f64().unwrap_or(f64::NAN);
    let extent = scene.bounds.max.as_dvec3() - scene.bounds.min.as_dvec3();
    let mut extents = extent.to_array();
    extents.sort_by(f64::total_cmp);
    let [height, widths @ ..] = extents;
    let cell = 2.0 * (widths[0] * widths[1]).sqrt() / (scene.items.len() as f64 / leaf).sqrt();
    let [kept, left_out] = [octree.build(&scene.items)?, quadtree.build(&scene.items)?]
        .map(|index| trials.index(index, &case.workload.views[..]));
    let sides = Sides::new("octree against quadtree", kept, left_out);
    Ok(Draft::concluded(sides, move |facts, _| {
        if facts.structure.is_scan() {
            return Finding::none(NO_NODES);
        }
        let taken = facts.structure.name.as_deref().unwrap_or_default();
        let flat = taken.starts_with("quadtree");
        let is_either = flat || taken.starts_with("octree");
        let is_either = is_either && facts.structure.ties.is_empty();
        Finding {
            leaves_out: is_either.then_some(flat),
            ..Finding::new(height, cell, "octree against quadtree")
        }
    }))
}

/// A rebuild in every frame of a motion, against refits alone.
///
/// A refit keeps the tree and is quicker, but leaves a tree that answers more slowly.
pub(super) fn rebuild() -> anyhow::Result<Draft> {
    Ok(Draft::concluded(None, |facts, _| {
        let Some(motion) = facts.motion else {
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
        let check = Check::of_times(format!("frames of {on}"), [kept, left_out], ratio);
        Finding {
            check: Some(check),
            ..Finding::new(left_out, kept, "rebuilt in every frame")
        }
    }))
}

/// Correcting a camera's frame, by a polar Newton step every 100 steps.
///
/// Axes in f32 that are turned and never straightened drift by some 5e-8 a step: a walk of
/// as many steps says how far. A frame that is built for each camera does not need it.
pub(super) fn frame_correction(trials: &mut Trials) -> anyhow::Result<Draft> {
    let path = trials.case.path;
    let steps = path.cameras.len() + path.left_out;
    let [(error, without), (_, with)] =
        ["f32", "f32-polar-100"].map(|method| walk(method, steps as u64));
    let [kept, left_out] = [with, without].map(|ask| trials.enter(false, ask));
    // That of a basis that is lost is infinite.
    let error = error.unwrap_or(f64::INFINITY);
    let reason = format!("{}: error {error:.1e}", counted(steps, "step"));
    let finding = Finding::new(error, TOLERANCE, reason);
    let sides = Sides::new("500 steps of a frame", kept, left_out);
    Ok(Draft::new(sides, finding))
}
