//! What the rules about stages beyond the frustum have in common: both sides hand on
//! different items, so what is weighed is the drawing that one of them saves against
//! the time that it takes.

use super::super::case::Case;
use super::super::omission::{Draft, Forced, Omission, Way};
use crate::measure::Ask;

/// Cameras on which items are counted, evenly spread.
const MOST_COUNTED: usize = 64;

/// So many of the cameras, or all, evenly spread.
pub(super) fn frames(cameras: usize, most: usize) -> impl Iterator<Item = usize> {
    let count = cameras.min(most);
    (0..count).map(move |n| n * cameras / count)
}

/// Mean number of items that are handed on, over some of the cameras.
pub(super) fn mean_count(ask: &Ask, cameras: usize, most: usize) -> f64 {
    let mut out = Vec::new();
    let counts = frames(cameras, most).map(|frame| {
        out.clear();
        ask(frame, &mut out);
        out.len()
    });
    let counts: Vec<usize> = counts.collect();
    counts.iter().sum::<usize>() as f64 / counts.len().max(1) as f64
}

/// A rule with both sides: `kept` hands on less than `left_out`. `predicted` is the
/// share of what the latter hands on that the former removes, from something cheaper
/// than doing it.
pub(super) fn draft<'c>(
    case: &'c Case<'c>,
    omission: Omission,
    on: String,
    kept: Ask<'c>,
    left_out: Way<'c>,
    predicted: f64,
) -> Draft<'c> {
    let frames = case.workload.views.len();
    let base: Ask = Box::new(|n, out| case.index.query(case.workload.views[n].as_any(), out));
    let with = mean_count(&kept, frames, MOST_COUNTED);
    let without = match &left_out {
        Way::Base => mean_count(&base, frames, MOST_COUNTED),
        Way::Other(ask) => mean_count(ask, frames, MOST_COUNTED),
    };
    let forced = Forced {
        on,
        kept: Way::Other(kept),
        left_out,
        same: false,
        judged: false,
    };
    let draw_ns = case.options.draw_ns;
    omission.draft(vec![forced]).finished_by(move |omission, _| {
        let Some(check) = omission.checks.first() else {
            return;
        };
        let removed = without - with;
        let testing = check.kept_ns - check.left_out_ns;
        let pays = (testing / (draw_ns * without)).max(0.0);
        let share = removed / without;
        let costs = [check.kept_ns + with * draw_ns, check.left_out_ns + without * draw_ns];
        omission.reason = format!(
            "{:.1} of {without:.1} items a view are removed ({:.1} %; predicted {:.1} %), which saves \
             {draw_ns} ns each{}",
            removed,
            share * 100.0,
            predicted * 100.0,
            match testing > 0.0 && removed > 0.0 {
                true => format!("; pays above {:.1} ns per item", testing / removed),
                false => String::new(),
            }
        );
        omission.weigh(share, pays);
        omission.saving = Some(1.0 - costs[1] / costs[0]).filter(|saving| saving.is_finite());
        omission.confirmed = (predicted.is_finite() && pays.is_finite())
            .then_some((predicted <= pays) == (share <= pays));
    })
}
