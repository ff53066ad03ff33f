//! The index itself: below some number of items a scan is as fast.
//!
//! That number follows from the parts of the scene that are measured beside it
//! ([`Axis::Items`]).

use super::super::change::Axis;
use super::super::omission::Decision;
use super::super::rule::{Draft, Finding, Unfit};
use super::super::trials::{BASE, Sides, Trials};

pub(super) fn prepare(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let [scan, tree] = [&case.scan, &case.spec].map(|spec| spec.label.clone());
    let items = &case.scene().items;
    let whole = trials.index(case.scan.build(items)?, case.views());
    let sides = Sides::same(format!("{tree} against {scan}"), BASE, whole);
    let all = items.len() as f64;
    Ok(Draft::concluded(vec![sides], move |facts| {
        let taken = facts.structure;
        let change = facts.changes.iter().find(|c| c.axis == Axis::Items);
        let below = change.and_then(|change| change.below.as_ref());
        let crossing = match below.filter(|turn| turn.structure == scan) {
            _ if taken.is_scan => all,
            Some(turn) => turn.at,
            None => 0.0,
        };
        let least = change.map_or(all, |change| change.measured[0]);
        let reason = format!(
            "{scan} is faster than {tree} up to {crossing:.0} items, of parts of {least:.0} to {all:.0} items"
        );
        Finding {
            saving: facts.saving(),
            // As the structure taken, wherever there was a choice.
            decision: taken.is_open.then_some(Decision::of(taken.is_scan)),
            is_tie: taken.is_mixed.then_some(true),
            note: match crossing {
                0.0 => format!("no scan wins from {least:.0} items on"),
                _ => format!("a scan wins up to {crossing:.0} items"),
            },
            ..Finding::new(all, crossing, reason)
        }
    }))
}
