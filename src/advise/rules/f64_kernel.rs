//! The plane test in f64: f32 planes, moved outward for their rounding, miss
//! nothing either, and let through a margin that is mostly far too thin to hold
//! an item.

use super::super::rule::{Draft, Finding, Unfit, not_applicable};
use super::super::trials::{BASE, Sides, Trials};
use crate::culling::{Arithmetic, Culling, CullingTest};

pub(super) fn prepare(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let in_f64 = Culling {
        arithmetic: Arithmetic::F64,
        ..Culling::default()
    };
    let views = case.views_by(&in_f64).map_err(not_applicable)?;
    let kept = trials.index(case.tree_for(CullingTest::SixPlane)?, views);
    let (margin, tolerance) = (case.margin(case.scene()), case.options.tolerance);
    let reason = format!(
        "f32 planes are moved outward by up to {margin:.1e} of the depth; {tolerance:.0e} are tolerated"
    );
    let sides = Sides::new(&case.spec.label, kept, BASE);
    Ok(Draft::new(
        vec![sides],
        Finding::new(margin, tolerance, reason).noted(format!("f32 errs by {margin:.0e} of depth")),
    ))
}
