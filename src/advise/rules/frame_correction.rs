//! Correcting a camera's frame: axes in f32 that are turned and never
//! straightened drift by some 2e-8 a step. A frame that is built for each
//! camera, or takes few steps, does not need it. Checked by walking.

use super::super::rule::{Draft, Finding, Unfit, not_applicable};
use super::super::trials::Trials;
use crate::drift::rotations;
use crate::statistics::Estimate;

/// Drift of an f32 frame per step, radians: docs/NUMERICS.md.
const DRIFT: f64 = 2e-8;
/// "Much less than the tolerance" is this share of it.
const MUCH_LESS: f64 = 0.1;
const KEPT: &str = "f32-polar-100";
const LEFT_OUT: &str = "f32";

pub(super) fn prepare(trials: &mut Trials) -> Result<Draft, Unfit> {
    let tolerance = trials.case.options.tolerance;
    let steps = trials.case.workload.cameras.len() as u64;
    let rotations = rotations(&[KEPT, LEFT_OUT], steps);
    let &[(kept, kept_ns), (left_out, left_out_ns)] = &rotations[..] else {
        return Err(not_applicable("no such method"));
    };
    let walked = |error: Option<f64>| match error {
        Some(error) => format!("{error:.1e}"),
        None => "lost".to_owned(),
    };
    let (kept_error, left_out_error) = (walked(kept), walked(left_out));
    let compared = [steps as f64 * DRIFT, tolerance * MUCH_LESS];
    // A walk outweighs the estimate.
    let predicted = left_out.map(|error| error <= tolerance);
    let mut draft = Draft::concluded(Vec::new(), move |facts| {
        let mut finding = Finding {
            compared: Some(compared),
            predicted,
            confirmed: predicted.map(|walked| (compared[0] <= compared[1]) == walked),
            ..Finding::default()
        };
        let ([left_out_ns, kept_ns], Some(ratio)) = (facts.once_ns, &facts.once_ratio) else {
            return finding;
        };
        finding.reason = format!(
            "{steps} steps of {DRIFT:.0e}; walked: {left_out_error} uncorrected at {left_out_ns:.0} ns a step, \
             {kept_error} with a Newton step to the polar factor every 100 at {kept_ns:.0} ns ({}); a tenth of \
             {tolerance:.0e} is used up after some {:.0} steps",
            dearer(ratio),
            tolerance * MUCH_LESS / DRIFT
        );
        finding.note = format!("{steps} steps drift {left_out_error} rad");
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
