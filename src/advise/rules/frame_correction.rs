//! Correcting a camera's frame: axes in f32 that are turned and never
//! straightened drift by some 2e-8 a step. A frame that is made anew for each
//! camera, or takes few steps, does not need it. Checked by walking.

use super::super::case::Case;
use super::super::omission::{By, Draft, LeftOutIf, Omission};
use super::super::rule::{Rule, Unfit, not_applicable};
use crate::drift::rotations;
use crate::statistics::Estimate;

pub(super) const RULE: Rule = Rule {
    name: "frame-correction",
    left_out: "correcting an f32 camera frame between steps",
    advice: [
        "no need to correct an f32 camera frame between steps",
        "correct an f32 camera frame between steps",
    ],
    statistic_name: "drift after all steps of the path, radians",
    left_out_if: LeftOutIf::AtMost,
    by: By::Rule,
    prepare,
};

/// What an f32 frame drifts by a step: docs/NUMERICS.md.
const DRIFT: f64 = 2e-8;
/// "Much less than the tolerance" is this share of it.
const MUCH_LESS: f64 = 0.1;
const KEPT: &str = "f32-polar-100";
const LEFT_OUT: &str = "f32";

fn prepare<'c>(case: &'c Case<'c>, omission: Omission) -> Result<Draft<'c>, Unfit> {
    let tolerance = case.options.tolerance;
    let steps = case.workload.cameras.len() as u64;
    let rotations = rotations(&[KEPT, LEFT_OUT], steps);
    let &[(kept, kept_ns), (left_out, left_out_ns)] = &rotations[..] else {
        return Err(not_applicable("no such method"));
    };
    let walked = |error: Option<f64>| match error {
        Some(error) => format!("{error:.1e}"),
        None => "lost".to_owned(),
    };
    let (kept_error, left_out_error) = (walked(kept), walked(left_out));
    let mut omission = omission.compares(steps as f64 * DRIFT, tolerance * MUCH_LESS);
    // What was walked outweighs the estimate.
    if let Some(error) = left_out {
        omission.confirmed = omission.predicted.map(|said| said == (error <= tolerance));
        omission.predicted = Some(error <= tolerance);
    }
    let mut draft = omission.draft(Vec::new());
    draft.once_ns = vec![left_out_ns, kept_ns];
    Ok(draft.finished_by(move |omission, aside| {
        let ([left_out_ns, kept_ns], Some(ratio)) = (&aside.once_ns[..], &aside.once_ratio) else {
            return;
        };
        let dearer = dearer(ratio);
        omission.reason = format!(
            "{steps} steps of {DRIFT:.0e}; walked: {left_out_error} uncorrected at {left_out_ns:.0} ns a step, \
             {kept_error} with a Newton step to the polar factor every 100 at {kept_ns:.0} ns ({dearer}); a tenth of \
             {tolerance:.0e} is used up after some {:.0} steps",
            tolerance * MUCH_LESS / DRIFT
        );
        omission.saving = Some(1.0 - 1.0 / ratio.value);
    }))
}

/// How much longer it takes, and whether the processes show that it does.
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
