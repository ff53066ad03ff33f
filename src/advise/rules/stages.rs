//! Rules about the region and the occlusion stage.
//!
//! One side removes items that the other returns, so the drawing that this saves is weighed
//! against the time that it takes.

use std::cell::RefCell;

use super::super::case::{BUFFER, Case, some_of};
use super::super::rule::{Draft, Unfit, not_applicable};
use super::super::trials::{BASE, Sides, Trials};
use super::removal::{PROBED, PROBES, of_items};
use crate::funnel::{OCCLUSION_ROWS, PORTAL_CLIP, Run, left_out_of};
use crate::visibility::SampleGrid;
use crate::visibility::region::{IdSet, Scratch, seen_by_samples};

/// The region stage.
///
/// It pays where walls close off most of the items in the frustum, and is left out where
/// the eye is in the open. Predicted from the regions that a few rays pass.
pub(super) fn regions(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let scene = case.scene();
    let none = || match left_out_of(scene) {
        Some(row) => not_applicable(row.reason),
        None => not_applicable("the scene has no rooms or sectors that portals join"),
    };
    let world = case.world.as_ref().map_err(not_applicable)?;
    let regions = world.regions.as_ref().ok_or_else(none)?;
    let row = regions.row(PORTAL_CLIP).ok_or_else(none)?;
    let graph = &regions.graph;
    if graph.openings().is_empty() {
        return Err(none());
    }
    let state = RefCell::new((Scratch::default(), IdSet::default(), Vec::new()));
    // Items of the visible regions against the six planes; all items by the tree where the
    // eye is in no region.
    let kept = trials.unjudged(move |n, out| {
        let (scratch, marks, seen) = &mut *state.borrow_mut();
        match row.from_eye(world.rays(n), scratch, seen) {
            true => {
                regions.items.of_regions(seen, marks, out);
                out.retain(|&id| world.views[n].volume.sees(&scene.items[id as usize]));
            }
            false => case.query(n, out),
        }
    });
    // The share of the items in view that lie in no region that a few rays pass.
    let (mut met, mut gone) = (0, 0);
    let (mut homes, mut seen, mut listed) = (Vec::new(), Vec::new(), Vec::new());
    for camera in some_of(case.cameras(), PROBED) {
        let found = case.found(camera);
        met += found.len();
        if graph.homes(world.rays(camera), &mut homes) {
            seen_by_samples(graph, world.rays(camera), PROBES, &mut seen);
            regions
                .items
                .of_regions(&seen, &mut IdSet::default(), &mut listed);
            let is_gone = |id: &&u32| listed.binary_search(id).is_err();
            gone += found.iter().filter(is_gone).count();
        }
    }
    let on = format!("portal-clip against {}", case.spec.label);
    let predicted = gone as f64 / met.max(1) as f64;
    Ok(of_items(trials, Sides::new(on, kept, BASE), predicted))
}

/// The buffer with half of the columns and rows of [`BUFFER`].
const SMALL: SampleGrid = SampleGrid::new(BUFFER.width / 2, BUFFER.height / 2);

/// The default back end, by the tree of the occluders.
fn masked_inner<'c>(case: &'c Case, buffer: SampleGrid) -> Result<Run<'c>, Unfit> {
    let world = case.world.as_ref().map_err(not_applicable)?;
    let blocks = world.hiders.blocks.as_ref();
    if blocks.is_some_and(|row| row.box_count == 0) {
        let reason = "no boxes are known in the solid between the map's rooms";
        return Err(not_applicable(reason));
    }
    Ok(world.run_occlusion(&OCCLUSION_ROWS[0], buffer))
}

/// The occlusion stage.
///
/// It pays where the eye is among things that hide others, and is left out where it looks
/// down on them. Predicted from a few of the cameras: rays to a few items predicted 68 % of
/// a wood, of which 28 % is removed, since many items there hide a part of a pixel or of an
/// item.
pub(super) fn occlusion(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let run = masked_inner(case, BUFFER)?;
    let kept = trials.unjudged(move |n, out| run(n, None, out));
    let [left, given] = [kept, BASE].map(|task| trials.mean_count(task, PROBED));
    let predicted = if given > 0.0 { 1.0 - left / given } else { 0.0 };
    let SampleGrid { width, height } = BUFFER;
    let on = format!("masked-inner {width}x{height} against {}", case.spec.label);
    Ok(of_items(trials, Sides::new(on, kept, BASE), predicted))
}

/// Half of the occlusion buffer's columns and rows.
pub(super) fn occlusion_buffer(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let [large, small] = [masked_inner(case, BUFFER)?, masked_inner(case, SMALL)?];
    let kept = trials.unjudged(move |n, out| large(n, None, out));
    let left_out = trials.unjudged(move |n, out| small(n, None, out));
    let [few, more] = [kept, left_out].map(|task| trials.mean_count(task, PROBED));
    let on = "masked-inner 320x180 against 160x90";
    Ok(of_items(
        trials,
        Sides::new(on, kept, left_out),
        1.0 - few / more,
    ))
}
