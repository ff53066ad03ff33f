//! The occlusion stage: pays where the eye is among things that hide others, and is
//! left out where it looks down on them. Predicted from a few of the cameras.

use super::super::case::{BUFFER, Case};
use super::super::rule::{Draft, Unfit, not_applicable};
use super::super::trials::{BASE, Sides, Trials};
use super::removal::{PROBED, of_items};
use crate::funnel::{OCCLUSION_ROWS, Run};
use crate::visibility::SampleGrid;

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

/// Predicts the share from a few of the cameras.
///
/// Rays to a few items predicted 68 % of a wood, of which 28 % is removed: many items there
/// hide a part of a pixel or of an item.
pub(super) fn prepare(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let run = masked_inner(case, BUFFER)?;
    let kept = trials.unjudged(move |n, out| run(n, None, out));
    let [left, given] = [kept, BASE].map(|task| trials.mean_count(task, PROBED));
    let predicted = if given > 0.0 { 1.0 - left / given } else { 0.0 };
    let SampleGrid { width, height } = BUFFER;
    let on = format!("masked-inner {width}x{height} against {}", case.spec.label);
    Ok(of_items(trials, Sides::new(on, kept, BASE), predicted))
}

pub(super) fn prepare_buffer(trials: &mut Trials) -> Result<Draft, Unfit> {
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
