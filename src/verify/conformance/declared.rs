//! The property of what a structure declares: it can do what it says, and does
//! not do what it does not say.

use super::*;
use crate::query::Ranges;
use crate::threads::Pool;

/// Items that move are taken over if the structure says that it refits, and
/// declined if not; it has a tree order if it says so, and then answers in
/// ranges of it are the reference set. A build looks at how many threads it may
/// use if it says so, and answers the same with several.
pub fn declared_capabilities_are_true<T: FrustumQuery>() -> Result<(), String> {
    let says = T::INFO.capabilities;
    for (questions, mut items) in generated_scenes(500)? {
        let scene = &questions.scene;
        let mut index: T = build(scene, &items)?;
        let ordered = index.tree_order().is_some();
        ensure(ordered == says.ranges, || {
            let (name, has) = (T::INFO.name, if ordered { "has" } else { "lacks" });
            format!(
                "{name} on '{scene}': declares ranges: {}, yet {has} a tree order",
                says.ranges
            )
        })?;
        if let Some(ids) = index.tree_order() {
            for volume in &questions.volumes {
                let mut ranges = Vec::new();
                let _ = index.visible(volume, &mut Ranges::onto(&mut ranges), &mut NoRecorder);
                let places = ranges.into_iter().flatten();
                let found = places.map(|place| ids.get(place as usize).copied());
                let found: Option<Vec<ItemId>> = found.collect();
                let wanted = sorted(seen(&index, volume));
                ensure(found.map(sorted).as_ref() == Some(&wanted), || {
                    format!(
                        "{} on '{scene}': its ranges are not the {} items that it sees",
                        T::INFO.name,
                        wanted.len()
                    )
                })?;
            }
        }
        let pool = Pool::new(3);
        let built = T::build_by(&pool, &items, None, &T::Params::default());
        let shared = built.map_err(|error| format!("{} on '{scene}': {error}", T::INFO.name))?;
        ensure(pool.was_asked() == says.threaded_build, || {
            format!(
                "{} on '{scene}': declares threaded-build: {}, yet its build asks for threads: {}",
                T::INFO.name,
                says.threaded_build,
                pool.was_asked()
            )
        })?;
        ensure(
            questions.answers(&shared) == questions.answers(&index),
            || {
                format!(
                    "{} on '{scene}': built on three threads, answered differently",
                    T::INFO.name
                )
            },
        )?;
        let moved: Vec<ItemId> = (0..items.len() as ItemId).step_by(7).collect();
        for &id in &moved {
            let b = &mut items[id as usize];
            *b = Aabb::new(b.min + b.extent(), b.max + b.extent());
        }
        let refitted = index.refit(&items, &moved);
        ensure(refitted == says.refits, || {
            format!(
                "{} on '{scene}': declares refits: {}, yet refit of {} items says {refitted}",
                T::INFO.name,
                says.refits,
                moved.len()
            )
        })?;
    }
    Ok(())
}
