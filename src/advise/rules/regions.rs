//! The region stage.
//!
//! It pays where walls close off most of the items in the frustum, and is left out where
//! the eye is in the open. Predicted from the regions that a few rays pass.

use std::cell::RefCell;

use super::super::case::some_of;
use super::super::rule::{Draft, Unfit, not_applicable};
use super::super::trials::{BASE, Sides, Trials};
use super::removal::{PROBED, PROBES, of_items};
use crate::funnel::{PORTAL_CLIP, left_out_of};
use crate::visibility::region::{IdSet, Scratch, seen_by_samples};

pub(super) fn prepare(trials: &mut Trials) -> Result<Draft, Unfit> {
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
