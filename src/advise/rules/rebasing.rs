//! Moving the scene to a zero of its own: near the world's zero f32 has digits
//! enough without. One side has the scene about its centre, the other about the world's
//! zero.

use glam::DVec3;

use super::super::case::part_of;
use super::super::rule::{Draft, Finding, Unfit, not_applicable};
use super::super::trials::{BASE, Sides, Trials};
use crate::culling::Culling;
use crate::measure::Workload;

pub(super) fn prepare(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let scene = case.scene();
    let is_moved = scene.origin != DVec3::ZERO;
    let elsewhere = if is_moved {
        DVec3::ZERO
    } else {
        let bounds = scene.world_bounds();
        bounds.min / 2.0 + bounds.max / 2.0
    };
    let other = part_of(scene, elsewhere, scene.items.len()).map_err(not_applicable)?;
    let workload = Workload::new(&other, case.path, &Culling::default());
    let views = workload.map_err(not_applicable)?.views;
    let there = trials.index(case.spec.build(&other.items)?, views);
    let (at_zero, moved, sides) = match is_moved {
        true => (&other, scene, [BASE, there]),
        false => (scene, &other, [there, BASE]),
    };
    let (margin, better) = (case.margin(at_zero), case.margin(moved));
    let reason = format!(
        "{margin:.1e} of the depth about the world's zero, {better:.1e} about ({}, {}, {}); this scene {}",
        moved.origin.x,
        moved.origin.y,
        moved.origin.z,
        if is_moved {
            "is moved"
        } else {
            "stays where it is"
        }
    );
    let sides = Sides::new(&case.spec.label, sides[0], sides[1]);
    let finding = Finding::new(margin, case.options.tolerance, reason)
        .noted(format!("f32 errs by {margin:.0e} of depth"));
    Ok(Draft::new(vec![sides], finding))
}
