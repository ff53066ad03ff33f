//! The plane test in f64: f32 planes, moved outward for their rounding, miss
//! nothing either, and let through a margin that is mostly far too thin to hold
//! an item.

use super::super::AdviseError;
use super::super::case::{Case, asked};
use super::super::omission::{By, Draft, Forced, LeftOutIf, Omission, Way};
use crate::culling::{Arithmetic, Culling, CullingTest};

pub(super) const NAME: &str = "f64-kernel";

pub(super) fn prepare<'c>(case: &'c Case<'c>) -> Result<Draft<'c>, AdviseError> {
    let omission = Omission::new(
        NAME,
        "the plane test in f64",
        ["f32 plane tests are enough", "use f64 plane tests"],
        "margin for rounding to f32 / depth of the view",
        LeftOutIf::AtMost,
        By::Rule,
    );
    let wide = Culling {
        arithmetic: Arithmetic::F64,
        ..Culling::default()
    };
    let views = match case.views(&wide) {
        Ok(views) => views,
        Err(error) => return Ok(omission.because(error.to_string()).draft(Vec::new())),
    };
    let (margin, tolerance) = (case.margin(case.scene()), case.options.tolerance);
    let omission = omission.compares(margin, tolerance).because(format!(
        "f32 planes are moved outward by up to {margin:.1e} of the depth; {tolerance:.0e} are tolerated"
    ));
    let forced = Forced {
        on: case.spec.label.clone(),
        kept: Way::Other(asked(case.tree_for(CullingTest::SixPlane)?, views)),
        left_out: Way::Base,
        same: false,
        judged: true,
    };
    Ok(omission.draft(vec![forced]))
}
