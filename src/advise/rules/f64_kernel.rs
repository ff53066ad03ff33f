//! The plane test in f64: f32 planes, moved outward for their rounding, miss
//! nothing either, and let through a margin that is mostly far too thin to hold
//! an item.

use super::super::case::{Case, asked};
use super::super::omission::{By, Draft, Forced, LeftOutIf, Omission, Way};
use super::super::rule::{Rule, Unfit, not_applicable};
use crate::culling::{Arithmetic, Culling, CullingTest};

pub(super) const RULE: Rule = Rule {
    name: "f64-kernel",
    left_out: "the plane test in f64",
    advice: ["f32 plane tests are enough", "use f64 plane tests"],
    statistic_name: "margin for rounding to f32 / depth of the view",
    left_out_if: LeftOutIf::AtMost,
    by: By::Rule,
    prepare,
};

fn prepare<'c>(case: &'c Case<'c>, omission: Omission) -> Result<Draft<'c>, Unfit> {
    let wide = Culling {
        arithmetic: Arithmetic::F64,
        ..Culling::default()
    };
    let views = case.views(&wide).map_err(not_applicable)?;
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
