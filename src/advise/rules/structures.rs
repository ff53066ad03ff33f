//! Rules about structures, their updates, and the camera's frame.

use super::super::change::Axis;
use super::super::omission::Decision;
use super::super::options::default_of;
use super::super::rule::{Draft, Finding, not_applicable};
use super::super::trials::{BASE, Sides, Trials};
use crate::drift::rotations;
use crate::measure::{Stopwatch, input_of, move_share};
use crate::shown::{count, counted, significant};
use crate::statistics::Estimate;

/// The index itself: below some number of items a scan is as fast.
///
/// The number follows from the parts of the scene that are measured beside it
/// ([`Axis::Items`]).
pub(super) fn no_index(trials: &mut Trials) -> anyhow::Result<Draft> {
    let case = trials.case;
    let [scan, tree] = [&case.scan, &case.spec].map(|spec| spec.label.clone());
    let items = &case.scene().items;
    let whole = trials.index(case.scan.build(items)?, case.views());
    let place = ["", ", at rest"][usize::from(case.workload.motion.is_some())];
    let sides = Sides::same(format!("{tree} against {scan}{place}"), BASE, whole);
    let all = items.len() as f64;
    Ok(Draft::concluded(vec![sides], move |facts| {
        let taken = facts.structure;
        let change = facts.changes.iter().find(|c| c.axis == Axis::Items);
        let below = change.and_then(|change| change.below.as_ref());
        let crossing = match below.filter(|turn| turn.structure == scan) {
            _ if taken.is_scan => all,
            Some(turn) => turn.at,
            None => 0.0,
        };
        let least = change.map_or(all, |change| change.measured[0]);
        // Follows the structure taken, wherever there was a choice.
        let costs = taken.tree_and_scan_ns();
        let is_tie = taken.tree_and_scan_tie();
        // A scan that ties with a tree wins nowhere.
        let ties = taken.is_scan && is_tie == Some(true);
        let reason = match costs {
            None => format!("no part was measured with both {scan} and {tree}: their times decide"),
            Some(_) if ties => format!("{scan} and {tree} tie at {} items", count(all as usize)),
            Some(_) => format!(
                "{scan} is faster than {tree} up to {} items, of parts of {} to {} items",
                count(crossing as usize),
                count(least as usize),
                count(all as usize)
            ),
        };
        let pays = facts.checks.first().and_then(|check| check.pays);
        Finding {
            saving: costs.map(|[tree, scan]| 1.0 - scan / tree),
            cost_ns: costs,
            decision: costs.map(|_| Decision::of(taken.is_scan)),
            is_tie,
            measured: pays.filter(|_| costs.is_none()),
            note: match crossing {
                // Parts are measured with the structures that there were.
                _ if costs.is_none() => String::new(),
                _ if ties => "a scan and a tree tie".to_owned(),
                0.0 => format!("no scan wins from {} items on", count(least as usize)),
                _ => format!("a scan wins up to {}", counted(crossing as usize, "item")),
            },
            compared: costs.map(|_| [all, crossing]),
            reason,
            ..Finding::default()
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
    let [low, narrow, wide] = extents.map(significant);
    let cell = 2.0 * (widths[0] * widths[1]).sqrt() / (scene.items.len() as f64 / leaf).sqrt();
    let reason = format!(
        "height {low} by widths {narrow} and {wide}; the threshold is two leaves of {leaf} items, \
         2 W / sqrt(N / leaf)"
    );
    let [kept, left_out] = [octree.build(&scene.items)?, quadtree.build(&scene.items)?]
        .map(|index| trials.index(index, case.views()));
    let sides = Sides::same("octree against quadtree", kept, left_out);
    Ok(Draft::concluded(vec![sides], move |facts| {
        let taken = facts.structure.name.as_deref().unwrap_or_default();
        let flat = taken.starts_with("quadtree");
        let is_either = flat || taken.starts_with("octree");
        let is_either = is_either && facts.structure.ties.is_empty();
        Finding {
            decision: is_either.then_some(Decision::of(flat)),
            note: "octree against quadtree".to_owned(),
            ..Finding::new(height, cell, reason)
        }
    }))
}

/// A rebuild after items have moved.
///
/// A refit keeps the tree and is quicker, but leaves a tree that answers more slowly. Weighed
/// for a share of items that move and a number of queries between two updates.
pub(super) fn rebuild(trials: &mut Trials) -> anyhow::Result<Draft> {
    let case = trials.case;
    let scene = case.scene();
    if case.workload.motion.is_some() {
        let why = "the frames of the motion decide on rebuilds";
        return Err(not_applicable(why));
    }
    let mut items = scene.items.clone();
    let moved = move_share(&mut items, case.options.moved);
    let mut refitted = case.spec.build(input_of(scene, &scene.items))?;
    // Some structures allocate room for refits at the first one.
    let can = refitted.refit(&scene.items, &moved);
    let watch = Stopwatch::start_for(case.spec.is_threaded());
    if !can || !refitted.refit(&items, &moved) {
        let why = format!("'{}' cannot be refitted", case.spec.label);
        return Err(not_applicable(why));
    }
    let refit_ns = watch.lap().cpu_ns;
    let watch = Stopwatch::start_for(case.spec.is_threaded());
    let rebuilt = case.spec.build(input_of(scene, &items))?;
    let rebuild_ns = watch.lap().cpu_ns;
    // Moved items are not the scene's: there is no truth about them.
    let [kept, left_out] = [rebuilt, refitted]
        .map(|index| trials.unjudged(move |n, out| index.query(case.views()[n].as_any(), out)));
    let on = format!("{}, queries after an update", case.spec.label);
    let queries = case.options.queries_per_update;
    let count = moved.len();
    let share = significant(count as f64 / items.len() as f64 * 100.0);
    let mut draft = Draft::concluded(vec![Sides::same(on, kept, left_out)], move |facts| {
        let (check, [refit_ns, rebuild_ns]) = (&facts.checks[0], facts.once_ns);
        let slower = queries * (check.left_out_ns - check.kept_ns);
        let kept = rebuild_ns + queries * check.kept_ns;
        let left_out = refit_ns + queries * check.left_out_ns;
        let many = match queries {
            1.0 => "1 query".to_owned(),
            more => format!("{more} queries"),
        };
        let reason = format!(
            "{} moved by {} own size ({share} %), {many} an update: refit {:.0} us, rebuild {:.0} us",
            counted(count, "item"),
            if count == 1 { "its" } else { "their" },
            refit_ns / 1e3,
            rebuild_ns / 1e3
        );
        Finding::new(slower, rebuild_ns - refit_ns, reason)
            .noted(format!("{share} % moved, {many} each"))
            .costing([kept, left_out])
    });
    draft.once = Some(trials.once_ns.len());
    trials.once_ns.extend([refit_ns, rebuild_ns]);
    Ok(draft)
}

/// Drift of an f32 frame per step, radians: docs/NUMERICS.md.
const DRIFT: f64 = 5e-8;
const METHODS: [&str; 2] = ["f32", "f32-polar-100"];

/// Correcting a camera's frame.
///
/// Axes in f32 that are turned and never straightened drift by some 5e-8 a step. A frame
/// that is built for each camera, or takes few steps, does not need it. Checked by walking.
pub(super) fn frame_correction(trials: &mut Trials) -> anyhow::Result<Draft> {
    let tolerance = trials.case.options.tolerance;
    let path = trials.case.path;
    let steps = (path.cameras.len() + path.left_out) as u64;
    let rotations = rotations(&METHODS, steps);
    let &[(left_out, left_out_ns), (kept, kept_ns)] = &rotations[..] else {
        return Err(not_applicable("no such method"));
    };
    let [kept_error, left_out_error] = [kept, left_out]
        .map(|error| error.map_or("lost".to_owned(), |error| format!("{error:.1e}")));
    let compared = [steps as f64 * DRIFT, tolerance];
    let walked = left_out.is_some_and(|error| error <= tolerance);
    let mut draft = Draft::concluded(Vec::new(), move |facts| {
        let mut finding = Finding {
            compared: Some(compared),
            measured: Some(walked),
            ..Finding::default()
        };
        let ([left_out_ns, kept_ns], Some(ratio)) = (facts.once_ns, &facts.once_ratio) else {
            return finding;
        };
        let many = counted(steps as usize, "step");
        finding.reason = format!(
            "{many} of {DRIFT:.0e}; walked: {left_out_error} uncorrected at {left_out_ns:.0} ns a step, \
             {kept_error} with a Newton step to the polar factor every 100 at {kept_ns:.0} ns ({}); \
             {tolerance:.0e} is used up after some {:.0} steps",
            dearer(ratio),
            tolerance / DRIFT
        );
        finding.note = format!("{many}: drift of {left_out_error} rad");
        finding.cost_ns = Some([kept_ns, left_out_ns]);
        let ends = ratio.lower.zip(ratio.upper);
        finding.is_tie = ends.map(|(lower, upper)| lower <= 1.0 && 1.0 <= upper);
        finding.saving = Some(1.0 - 1.0 / ratio.value);
        finding
    });
    draft.once = Some(trials.once_ns.len());
    trials.once_ns.extend([left_out_ns, kept_ns]);
    Ok(draft)
}

/// A ratio of times in words, with its interval.
fn dearer(ratio: &Estimate) -> String {
    let value = ratio.value;
    match ratio.lower.zip(ratio.upper) {
        None => format!("{value:.2} times as long"),
        Some((lower, upper)) if lower > 1.0 => {
            format!("{value:.2} [{lower:.2}, {upper:.2}] times as long")
        }
        Some((lower, upper)) => format!("as long: {value:.2} [{lower:.2}, {upper:.2}]"),
    }
}
