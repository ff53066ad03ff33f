//! The property of what a structure declares: it can do what it says, and does
//! not do what it does not say.

use super::*;
use crate::query::Ranges;
use crate::threads::Pool;

/// Items that move are taken over if the structure says that it refits, and
/// declined if not; it has a tree order if it says so, and then answers in
/// ranges of it are the reference set. A build looks at how many threads it may
/// use if it says so, and answers the same with several.
pub fn declared_capabilities_are_true<T: RegionIndex>() -> Outcome {
    let says = T::INFO.capabilities;
    each(generated_scenes(500)?, |asked, index: &mut T| {
        let ordered = index.tree_order().is_some();
        ensure(ordered == says.ranges, || {
            let (says, has) = (says.ranges, if ordered { "has" } else { "lacks" });
            format!("declares ranges: {says}, yet {has} a tree order")
        })?;
        if let Some(ids) = index.tree_order() {
            for volume in &asked.volumes {
                let mut ranges = Vec::new();
                let mut sink = Ranges::onto(&mut ranges);
                let _ = ask(index, volume, &mut sink, &mut NoRecorder);
                let places = ranges.into_iter().flatten();
                let found = places.map(|place| ids.get(place as usize).copied());
                let found: Option<Vec<ItemId>> = found.collect();
                let wanted = sorted(seen(index, volume));
                ensure(found.map(sorted).as_ref() == Some(&wanted), || {
                    let count = wanted.len();
                    format!("its ranges are not the {count} items that it sees")
                })?;
            }
        }
        let pool = Pool::new(3);
        let shared = T::build(&Input::new(&asked.items).pool(&pool), &T::Params::default());
        let shared = shared.map_err(|error| error.to_string())?;
        let was_asked = pool.was_asked();
        ensure(was_asked == says.threaded_build, || {
            let says = says.threaded_build;
            format!("declares threaded-build: {says}, yet its build asks for threads: {was_asked}")
        })?;
        ensure(asked.answers(&shared) == asked.answers(index), || {
            "built on three threads, answered differently".to_owned()
        })?;
        let moved: Vec<ItemId> = (0..asked.items.len() as ItemId).step_by(7).collect();
        for &id in &moved {
            let b = &mut asked.items[id as usize];
            *b = Aabb::new(b.min + b.extent(), b.max + b.extent());
        }
        let refitted = index.refit(&asked.items, &moved);
        ensure(refitted == says.refits, || {
            let (says, count) = (says.refits, moved.len());
            format!("declares refits: {says}, yet refit of {count} items says {refitted}")
        })
    })
}
