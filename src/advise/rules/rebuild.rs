//! A rebuild after items have moved: a refit keeps the tree and is quicker,
//! but what it leaves answers more slowly. Weighed for a share of items that
//! move and a number of queries between two updates.

use super::super::rule::{Draft, Finding, Unfit, not_applicable};
use super::super::trials::{Sides, Trials};
use crate::measure::{Stopwatch, input_of, move_share};

pub(super) fn prepare(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let scene = case.scene();
    if case.workload.motion.is_some() {
        return Err(not_applicable(
            "the frames of the motion decide on rebuilds",
        ));
    }
    let mut items = scene.items.clone();
    let moved = move_share(&mut items, case.options.moved);
    let mut refitted = case.spec.build(input_of(scene, &scene.items))?;
    // Some structures allocate room for refits at the first one.
    let can = refitted.refit(&scene.items, &moved);
    let watch = Stopwatch::start();
    if !can || !refitted.refit(&items, &moved) {
        let why = format!("'{}' cannot be refitted", case.spec.label);
        return Err(not_applicable(why));
    }
    let refit_ns = watch.lap().cpu_ns;
    let watch = Stopwatch::start();
    let rebuilt = case.spec.build(input_of(scene, &items))?;
    let rebuild_ns = watch.lap().cpu_ns;
    // Moved items are not the scene's: there is no truth about them.
    let [kept, left_out] = [rebuilt, refitted]
        .map(|index| trials.unjudged(move |n, out| index.query(case.views()[n].as_any(), out)));
    let on = format!("{}, queries after an update", case.spec.label);
    let queries = case.options.queries_per_update;
    let (share, count) = (case.options.moved, moved.len());
    let mut draft = Draft::concluded(vec![Sides::same(on, kept, left_out)], move |facts| {
        let (check, [refit_ns, rebuild_ns]) = (&facts.checks[0], facts.once_ns);
        let slower = queries * (check.left_out_ns - check.kept_ns);
        let kept = rebuild_ns + queries * check.kept_ns;
        let left_out = refit_ns + queries * check.left_out_ns;
        let reason = format!(
            "{count} items moved by their own size ({} %), {queries} queries an update: refit {:.0} us, \
             rebuild {:.0} us",
            share * 100.0,
            refit_ns / 1e3,
            rebuild_ns / 1e3
        );
        Finding::new(slower, rebuild_ns - refit_ns, reason)
            .noted(format!(
                "{} % moved, {queries} {} each",
                share * 100.0,
                if queries == 1.0 { "query" } else { "queries" }
            ))
            .costing([kept, left_out])
    });
    draft.once = Some(trials.once_ns.len());
    trials.once_ns.extend([refit_ns, rebuild_ns]);
    Ok(draft)
}
