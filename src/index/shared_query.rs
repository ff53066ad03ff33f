//! One query shared among threads, in parts with one list each.
//!
//! Lists are passed to the sink in order, so answers do not depend on which thread is faster.

use std::cell::Cell;
use std::ops::ControlFlow;

use super::frontier::{put_back, take};
use super::{BuildError, check_range};
use crate::query::{Context, ItemId};
use crate::threads::{MOST_THREADS, Workers};

/// The threads of a structure's queries; `None` for a single thread.
///
/// # Errors
/// A number out of range, or threads that the system cannot create.
pub fn workers(threads: usize, structure: &'static str) -> Result<Option<Workers>, BuildError> {
    let most = MOST_THREADS as f64;
    check_range(structure, "threads", threads as f64, 1.0, most)?;
    let refused = |error| BuildError::Refused {
        structure,
        reason: format!("{threads} threads: {error}"),
    };
    let more = (threads > 1).then(|| Workers::new(threads).map_err(refused));
    more.transpose()
}

/// A list of ids per part, kept from query to query.
#[derive(Default)]
struct Lists(Vec<Vec<ItemId>>);

thread_local! {
    static PARTS: Cell<Option<Box<Lists>>> = const { Cell::new(None) };
}

/// Answers the parts of a query on the threads, each into its own list.
///
/// Ids go to the sink in order.
pub fn in_parts<C: Context>(
    workers: &Workers,
    parts: usize,
    answer: impl Fn(usize, &mut Vec<ItemId>) + Sync,
    cx: &mut C,
) -> ControlFlow<()> {
    let mut lists = take(&PARTS);
    if lists.0.len() < parts {
        lists.0.resize_with(parts, Vec::new);
    }
    workers.share(lists.0[..parts].iter_mut().enumerate(), |(index, ids)| {
        ids.clear();
        answer(index, ids);
    });
    let flow = lists.0[..parts].iter().try_for_each(|ids| cx.accept(ids));
    put_back(&PARTS, lists);
    flow
}

#[cfg(test)]
mod tests {
    use crate::geometry::{Aabb, ConvexVolume, Plane, Spheres, sphere_cube};
    use crate::index::{Input, StructureSpec};
    use glam::Vec3;

    #[test]
    fn threads_do_not_change_an_answer_or_its_order() {
        let normal = Vec3::new(0.6, -0.5, 0.3);
        let planes = [Plane::new(normal, -9.0), Plane::new(-normal, 14.0)];
        let volume = ConvexVolume::from_planes(&planes).unwrap();
        let spheres = Spheres::new(&volume);
        for count in [0, 15, 16_385, 131_072, 150_001] {
            let at = |i: u32| Vec3::new((i % 37) as f32, (i / 37 % 41) as f32, (i / 1517) as f32);
            let items = (0..count).map(|i| Aabb::around(at(i), Vec3::splat(0.3)));
            let items: Vec<Aabb> = items.collect();
            let cubes: Vec<Aabb> = items.iter().map(sphere_cube).collect();
            let answers = |threads: usize| {
                let spec = StructureSpec::parse(&format!("linear:threads={threads}")).unwrap();
                assert_eq!(spec.query_threads(), threads);
                let (mut seen, mut in_balls) = (Vec::new(), Vec::new());
                spec.build(&items)
                    .unwrap()
                    .query((&volume).into(), &mut seen);
                let balls = spec.build(Input::new(&cubes).spheres(true)).unwrap();
                balls.query((&spheres).into(), &mut in_balls);
                (seen, in_balls)
            };
            let alone = answers(1);
            assert!(count < 16_384 || !alone.0.is_empty() && alone.0.len() <= alone.1.len());
            for threads in [2, 3, 8] {
                assert_eq!(answers(threads), alone, "{count} items, {threads} threads");
            }
        }
    }

    #[test]
    fn numbers_of_threads_are_checked() {
        for text in ["linear:threads=0", "linear:threads=1000", "bvh:threads=2"] {
            assert!(StructureSpec::parse(text).is_err(), "{text}");
        }
    }
}
