//! Properties of every structure, one function per property.
//!
//! They are the properties of the contract in [`RegionIndex`]. [`conformance!`](crate::conformance)
//! makes a test of each; an error names the difference and the scene.

mod behaviour;
mod queries;

use std::ops::{ControlFlow, Range};

use glam::Vec3;

use super::{Trial, scan};
use crate::geometry::{Aabb, ConvexVolume};
use crate::index::{BuildError, Input, RegionIndex};
use crate::query::{ItemId, NoRecorder, Sink};
use crate::scene::SeededRng;

use queries::{
    Outcome, QuerySet, build, build_from, cases, each, edges, ensure, generated_scenes, ids_of,
    is_right, large_scene, points, query, sorted,
};

pub use behaviour::{
    declared_capabilities_are_true, every_view_sees_what_the_scan_sees,
    items_that_come_and_go_are_followed, many_points_are_answered_as_one_by_one,
    refit_equals_a_fresh_build, region_search_is_the_closed_box_scan,
};

/// Generates one `#[test]` per property of the contract for a structure.
///
/// The structure has its default parameters. The tests are named after the properties, so two
/// structures need two modules.
///
/// ```
/// # struct MyIndex;
/// # mod cullbench { pub use cullbench::conformance; }
/// #[cfg(test)]
/// mod my_index {
///     cullbench::conformance!(super::MyIndex);
/// }
/// ```
#[macro_export]
macro_rules! conformance {
    // The only list of properties.
    (@each $make:ident $structure:ty) => {
        $crate::conformance! { @$make $structure:
            reference_set_on_edge_scenes
            reference_set_on_random_cases
            reference_set_on_generated_scenes
            every_view_sees_what_the_scan_sees
            region_search_is_the_closed_box_scan
            many_points_are_answered_as_one_by_one
            building_again_gives_the_same_structure
            bad_items_are_refused_and_named
            a_sink_that_breaks_is_not_called_again
            refit_equals_a_fresh_build
            items_that_come_and_go_are_followed
            declared_capabilities_are_true
        }
    };
    (@tests $structure:ty: $($property:ident)*) => {$(
        #[test]
        fn $property() -> ::std::result::Result<(), ::std::string::String> {
            $crate::verify::conformance::$property::<$structure>()
        }
    )*};
    (@table $structure:ty: $($property:ident)*) => {
        &[$((stringify!($property), $property::<$structure> as fn() -> Outcome)),*]
    };
    ($structure:ty) => {
        $crate::conformance!(@each tests $structure);
    };
}

/// Property of the contract: the name of its test, and the check.
///
/// `Err` describes the difference and the scene.
pub type Property = (&'static str, fn() -> Outcome);

/// All properties for a structure, in the order of the list.
pub fn properties<T: RegionIndex>() -> &'static [Property] {
    crate::conformance!(@each table T)
}

/// Seeds of the random cases of each property.
const SEEDS: Range<u64> = 0..64;

/// Checks that `visible` returns what a test of every box returns.
///
/// In degenerate scenes, with planes that touch boxes.
pub fn reference_set_on_edge_scenes<T: RegionIndex>() -> Outcome {
    each(edges(), |queries, index: &mut T| {
        queries.visible_is_right(index)
    })
}

/// Checks `visible` on [`RandomCase`](super::RandomCase)s, items in two orders.
pub fn reference_set_on_random_cases<T: RegionIndex>() -> Outcome {
    let four_times = SEEDS.start..SEEDS.end * 4;
    each(cases(four_times), |queries, index: &mut T| {
        queries.visible_is_right(index)?;
        let third = queries.items.len() / 3;
        queries.items.reverse();
        queries.items.rotate_left(third);
        let right = queries.visible_is_right(&build::<T>(&queries.items)?);
        right.map_err(|error| format!("in another order: {error}"))
    })
}

/// Checks `visible` on small generated worlds, with cameras, and on a large grid.
pub fn reference_set_on_generated_scenes<T: RegionIndex>() -> Outcome {
    let scenes = generated_scenes(1500)?.into_iter().chain([large_scene()]);
    each(scenes, |queries, index: &mut T| {
        queries.visible_is_right(index)
    })
}

/// Passes the answer for a case's first volume, or for its last point, to a sink.
fn pass<T: RegionIndex, S: Sink>(
    index: &T,
    case: &QuerySet,
    region_search: bool,
    sink: &mut S,
) -> ControlFlow<()> {
    match case.points.last() {
        Some(p) if region_search => query(index, p, sink, &mut NoRecorder),
        _ => query(index, &case.volumes[0], sink, &mut NoRecorder),
    }
}

/// Checks that the same items give the same ids in the same order.
pub fn building_again_gives_the_same_structure<T: RegionIndex>() -> Outcome {
    each(cases(SEEDS), |queries, index: &mut T| {
        let same = queries.answers(index) == queries.answers(&build::<T>(&queries.items)?);
        ensure(same, || "built twice, answered differently".to_owned())
    })
}

/// Checks that a build fails and names the box if a bound is NaN or infinite.
///
/// In any box and coordinate; if there are several, the first.
pub fn bad_items_are_refused_and_named<T: RegionIndex>() -> Outcome {
    let cube = |i: u8| Aabb::around(Vec3::splat(f32::from(i)), Vec3::ONE);
    let sound: Vec<Aabb> = (0..40).map(cube).collect();
    for item in [0, 17, sound.len() - 1] {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for coordinate in 0..6 {
                let mut items = sound.clone();
                for bad in [item, sound.len() - 1] {
                    let b = &mut items[bad];
                    let corner = [&mut b.min, &mut b.max].into_iter().nth(coordinate / 3);
                    corner.into_iter().for_each(|c| c[coordinate % 3] = value);
                }
                let error = T::build(&Input::new(&items), &T::Params::default()).err();
                let named = matches!(
                    error, Some(BuildError::NonFiniteItem { item: named, .. }) if named == item
                );
                ensure(named, || {
                    let name = T::INFO.name;
                    format!("{name}: {value} in coordinate {coordinate} of item {item}: {error:?}")
                })?;
            }
        }
    }
    Ok(())
}

/// Checks that any sink gets the same ids, and that none is called after a break.
///
/// A sink that breaks has received the first ids, and the query returns `Break`.
pub fn a_sink_that_breaks_is_not_called_again<T: RegionIndex>() -> Outcome {
    let mut broken = 0;
    each(cases(SEEDS), |queries, index: &mut T| {
        for region_search in [false, true] {
            // Keeps the slices separate, and breaks at a given call.
            let until = |breaks_at: usize| {
                let mut slices = Vec::new();
                let mut sink = |ids: &[ItemId]| {
                    slices.push(ids.to_vec());
                    match slices.len() < breaks_at {
                        true => ControlFlow::Continue(()),
                        false => ControlFlow::Break(()),
                    }
                };
                let flow = pass(index, queries, region_search, &mut sink);
                (slices, flow)
            };
            let mut collected: Vec<ItemId> = Vec::new();
            let ended = pass(index, queries, region_search, &mut collected);
            let (all, flow) = until(usize::MAX);
            let same = all.concat() == collected && ended.is_continue() && flow.is_continue();
            ensure(same, || {
                format!("two sinks got different ids, or {flow:?} and {ended:?}")
            })?;
            let calls = all.len();
            let possible = |call: &usize| (1..=calls).contains(call);
            for call in [1, 2, calls / 2, calls].into_iter().filter(possible) {
                let (slices, flow) = until(call);
                broken += 1;
                ensure(slices == all[..call] && flow.is_break(), || {
                    let got = slices.len();
                    format!("broke at call {call}, got {got} and {flow:?}")
                })?;
            }
        }
        Ok(())
    })?;
    ensure(broken > 0, || format!("{}: nothing to break", T::INFO.name))
}
