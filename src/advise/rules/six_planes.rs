//! Axes beyond the six planes: the volume's own box and its silhouettes, which
//! the exact test adds. They cost test time and save the drawing of what cannot
//! be seen.

use super::super::AdviseError;
use super::super::case::{Case, asked};
use super::super::omission::{By, Draft, Forced, LeftOutIf, Omission, Way};
use crate::culling::{Culling, CullingTest};

pub(super) const NAME: &str = "six-planes";

pub(super) fn prepare<'c>(case: &'c Case<'c>) -> Result<Draft<'c>, AdviseError> {
    let omission = Omission::new(
        NAME,
        "axes beyond the six planes",
        "cost of drawing what six planes let through, ns a query",
        LeftOutIf::AtMost,
        By::Rule,
    );
    let exact = Culling {
        test: CullingTest::Exact,
        ..Culling::default()
    };
    let views = match case.views(&exact) {
        Ok(views) => views,
        Err(error) => return Ok(omission.because(error.to_string()).draft(Vec::new())),
    };
    let forced = Forced {
        on: case.spec.label.clone(),
        kept: Way::Other(asked(case.tree_for(CullingTest::Exact)?, views)),
        left_out: Way::Base,
        same: false,
        judged: true,
    };
    let draw_ns = case.options.draw_ns;
    let predicted = predicted_excess(case);
    Ok(omission.draft(vec![forced]).finished_by(move |omission| {
        let Some(check) = omission.checks.first() else {
            return;
        };
        let Some(more) = check.more_false_positives() else {
            return;
        };
        let (drawing, testing) = (more * draw_ns, check.kept_ns - check.left_out_ns);
        let excess = check.left_out_excess.unwrap_or(0.0);
        let worth = testing / more;
        let (kept, left_out) = (check.kept_ns, check.left_out_ns + drawing);
        omission.reason = format!(
            "{more:.1} items a query too many ({:.2} %; 4 (s/D)^2 predicts {:.2} %) at {draw_ns} ns each, \
             against the extra test time{}",
            excess * 100.0,
            predicted * 100.0,
            match worth.is_finite() && worth > 0.0 {
                true => format!("; worth it above {worth:.0} ns an item"),
                false => String::new(),
            }
        );
        omission.weigh(drawing, testing);
        omission.saving = Some(1.0 - left_out / kept).filter(|saving| saving.is_finite());
    }))
}

/// `4 (s/D)^2` for the mean square of the items' edges s and the mean depth D
/// of the views: docs/NUMERICS.md.
fn predicted_excess(case: &Case) -> f64 {
    let items = &case.scene().items;
    let squares = items
        .iter()
        .map(|item| f64::from(item.extent().length_squared()) / 3.0);
    let square = squares.sum::<f64>() / items.len() as f64;
    let cameras = case.workload.cameras.len();
    let depth = (0..cameras).map(|frame| case.depth(frame)).sum::<f64>() / cameras as f64;
    4.0 * square / (depth * depth)
}
