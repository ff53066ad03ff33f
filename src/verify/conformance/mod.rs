//! The properties of every structure, one function per property of the contract in
//! [`RegionIndex`]. [`conformance!`](crate::conformance) makes a test of each; an
//! error names the difference and the scene.

mod behaviour;
mod questions;

use std::ops::{ControlFlow, Range};

use glam::Vec3;

use super::{Trial, scan};
use crate::geometry::{Aabb, ConvexVolume, Plane};
use crate::index::{BuildError, Input, RegionIndex};
use crate::query::{Containment, ItemId, NoRecorder, Predicate, Sink};
use crate::scene::SeededRng;

use questions::{
    Outcome, Questions, ask, build, cases, counts_are_plausible, each, edges, ensure,
    generated_scenes, is_right, points, seen, sorted,
};

pub use behaviour::{
    declared_capabilities_are_true, every_view_sees_what_the_scan_sees,
    items_that_come_and_go_are_followed, many_points_are_answered_as_one_by_one,
    refit_equals_a_fresh_build, region_search_is_the_closed_box_scan,
};

/// Stamps one `#[test]` per property of the contract for a structure with its
/// default parameters. The tests are named after the properties: two
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
    // The one list of properties.
    (@each $make:ident $structure:ty) => {
        $crate::conformance! { @$make $structure:
            reference_set_on_edge_scenes
            reference_set_on_random_cases
            reference_set_on_generated_scenes
            every_view_sees_what_the_scan_sees
            region_search_is_the_closed_box_scan
            many_points_are_answered_as_one_by_one
            order_of_items_changes_nothing
            smaller_volume_sees_a_subset
            inside_means_all_and_outside_none
            each_id_comes_once
            building_again_gives_the_same_structure
            bad_items_are_refused_and_named
            a_sink_that_breaks_is_not_called_again
            counters_are_plausible
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
        &[$(Property {
            name: stringify!($property),
            check: $property::<$structure>,
        }),*]
    };
    ($structure:ty) => {
        $crate::conformance!(@each tests $structure);
    };
}

/// A property of the contract, for one structure.
#[derive(Clone, Copy, Debug)]
pub struct Property {
    /// Name of its test.
    pub name: &'static str,
    /// `Err` says what differed, and on which scene.
    pub check: fn() -> Outcome,
}

/// All properties for a structure, in the order of the list.
pub fn properties<T: RegionIndex>() -> &'static [Property] {
    crate::conformance!(@each table T)
}

/// Seeds of the random cases of each property.
const SEEDS: Range<u64> = 0..64;

/// `visible` returns exactly what a look at every box returns, where scenes
/// are degenerate and planes touch boxes.
pub fn reference_set_on_edge_scenes<T: RegionIndex>() -> Outcome {
    each(edges(), |asked, index: &mut T| {
        asked.visible_is_right(index)
    })
}

/// The same on [`RandomCase`](super::RandomCase)s.
pub fn reference_set_on_random_cases<T: RegionIndex>() -> Outcome {
    let four_times = SEEDS.start..SEEDS.end * 4;
    each(cases(four_times), |asked, index: &mut T| {
        asked.visible_is_right(index)
    })
}

/// The same on small generated worlds, through cameras.
pub fn reference_set_on_generated_scenes<T: RegionIndex>() -> Outcome {
    each(generated_scenes(1500)?, |asked, index: &mut T| {
        asked.visible_is_right(index)
    })
}

/// The same boxes in another order give the same set.
pub fn order_of_items_changes_nothing<T: RegionIndex>() -> Outcome {
    let mut turns = (1..).step_by(7);
    each(cases(SEEDS), |asked, index: &mut T| {
        let (volume, count) = (&asked.volumes[0], asked.items.len());
        let wanted = sorted(seen(index, volume));
        let turn = turns.next().unwrap_or(1);
        // Which item of the scene stands at a place of the reordered one.
        let orders: [&dyn Fn(usize) -> usize; 2] =
            [&|place| (place + turn) % count, &|place| count - 1 - place];
        for order in orders {
            let reordered: Vec<Aabb> = (0..count).map(|place| asked.items[order(place)]).collect();
            let found = seen(&build::<T>(&reordered)?, volume);
            let known = found.iter().all(|&id| (id as usize) < count);
            let named = found.iter().filter(|_| known);
            let found = sorted(named.map(|&id| order(id as usize) as ItemId).collect());
            ensure(known && found == wanted, || {
                let (one, other) = (wanted.len(), found.len());
                format!("{one} ids in one order, {other} others in another")
            })?;
        }
        Ok(())
    })
}

/// A volume with more planes sees nothing that the one with fewer does not.
pub fn smaller_volume_sees_a_subset<T: RegionIndex>() -> Outcome {
    let mut others = cases(SEEDS.start + 1..SEEDS.end + 1);
    each(cases(SEEDS), |asked, index: &mut T| {
        let more = others.next().map_or(vec![], |other| other.volumes);
        let both = asked.volumes.iter().chain(&more).flat_map(|v| v.planes());
        let planes: Vec<Plane> = both.copied().take(32).collect();
        let smaller = ConvexVolume::from_planes(&planes).map_err(|error| error.to_string())?;
        let (large, small) = (
            sorted(seen(index, &asked.volumes[0])),
            seen(index, &smaller),
        );
        let lost = small.iter().find(|id| large.binary_search(id).is_err());
        ensure(lost.is_none(), || {
            format!("item {lost:?} is seen by the smaller volume only")
        })
    })
}

/// A volume that the scene's bounds lie wholly inside of sees every item that
/// is not empty; one that they lie outside of sees none.
pub fn inside_means_all_and_outside_none<T: RegionIndex>() -> Outcome {
    each(cases(SEEDS), |asked, index: &mut T| {
        let bounds = Aabb::union_of(&asked.items);
        if bounds.is_empty() {
            return Ok(());
        }
        let sound = asked.items.iter().filter(|b| !b.is_empty()).count();
        let around = [bounds.min, bounds.max].map(|p| p * 2.0);
        let enclosing = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| {
            let reach = around[0].abs().max(around[1].abs()).dot(axis);
            [Plane::new(axis, reach), Plane::new(-axis, reach)]
        });
        let enclosing: Vec<Plane> = enclosing.collect();
        let beside = [Plane::new(Vec3::X, -bounds.max.x.next_up())];
        let made = [&enclosing[..], &beside].map(ConvexVolume::from_planes);
        for volume in made.into_iter().chain([Ok(asked.volumes[0].clone())]) {
            let volume = volume.map_err(|error| error.to_string())?;
            let found = seen(index, &volume).len();
            let (verdict, _) = volume.classify(&bounds, volume.mask(), &mut NoRecorder);
            let right = match verdict {
                Containment::Inside => found == sound,
                Containment::Outside => found == 0,
                Containment::Straddles => true,
            };
            ensure(right, || {
                format!("the scene is {verdict:?}, yet {found} of {sound} are seen")
            })?;
        }
        Ok(())
    })
}

/// Keeps the slices apart as they come, and breaks at a given call.
struct Slices {
    slices: Vec<Vec<ItemId>>,
    breaks_at: usize,
}

impl Slices {
    /// The answer for the camera of a random case, or for its point, up to a break.
    fn of<T: RegionIndex>(
        index: &T,
        case: &Questions,
        region_search: bool,
        breaks_at: usize,
    ) -> (Slices, ControlFlow<()>) {
        let slices = Vec::new();
        let mut sink = Slices { slices, breaks_at };
        let flow = match case.points.last() {
            Some(p) if region_search => ask(index, p, &mut sink, &mut NoRecorder),
            _ => ask(index, &case.volumes[0], &mut sink, &mut NoRecorder),
        };
        (sink, flow)
    }
}

impl Sink for Slices {
    fn accept(&mut self, ids: &[ItemId]) -> ControlFlow<()> {
        self.slices.push(ids.to_vec());
        match self.slices.len() < self.breaks_at {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    }
}

/// No id is passed twice or does not exist, in one slice or over all;
/// the query ends with `Continue`; any sink gets the same ids.
pub fn each_id_comes_once<T: RegionIndex>() -> Outcome {
    each(cases(SEEDS), |asked, index: &mut T| {
        let located = asked.points.last().map(|p| seen(index, p));
        let answers = [seen(index, &asked.volumes[0]), located.unwrap_or_default()];
        for (region_search, collected) in [false, true].into_iter().zip(answers) {
            let (sink, flow) = Slices::of(index, asked, region_search, usize::MAX);
            let passed = sink.slices.concat();
            let ids = sorted(passed.clone());
            let twice = ids.windows(2).find(|pair| pair[0] == pair[1]);
            let unknown = ids.last().filter(|id| **id as usize >= asked.items.len());
            let wrong = twice.map(|pair| pair[0]).or(unknown.copied());
            ensure(wrong.is_none(), || {
                format!("id {wrong:?} comes twice or is none")
            })?;
            ensure(passed == collected && flow.is_continue(), || {
                format!("two sinks got different ids, or {flow:?}")
            })?;
        }
        Ok(())
    })
}

/// The same items give the same structure: the same ids in the same order.
pub fn building_again_gives_the_same_structure<T: RegionIndex>() -> Outcome {
    each(cases(SEEDS), |asked, index: &mut T| {
        let same = asked.answers(index) == asked.answers(&build::<T>(&asked.items)?);
        ensure(same, || "built twice, answered differently".to_owned())
    })
}

/// A NaN or infinite bound makes the build fail and is named, whatever box
/// and coordinate it stands in; the first one, if there are more.
pub fn bad_items_are_refused_and_named<T: RegionIndex>() -> Outcome {
    let sound: Vec<Aabb> = (0..40u8)
        .map(|i| Aabb::around(Vec3::splat(f32::from(i)), Vec3::ONE))
        .collect();
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

/// A sink that breaks gets no further call, has what came first, and the
/// query says `Break`.
pub fn a_sink_that_breaks_is_not_called_again<T: RegionIndex>() -> Outcome {
    let mut broken = 0;
    each(cases(SEEDS), |asked, index: &mut T| {
        for region_search in [false, true] {
            let (all, _) = Slices::of(index, asked, region_search, usize::MAX);
            let calls = all.slices.len();
            let possible = |call: &usize| (1..=calls).contains(call);
            for call in [1, 2, calls / 2, calls].into_iter().filter(possible) {
                let (sink, flow) = Slices::of(index, asked, region_search, call);
                broken += 1;
                let right = sink.slices == all.slices[..call] && flow.is_break();
                ensure(right, || {
                    let got = sink.slices.len();
                    format!("broke at call {call}, got {got} and {flow:?}")
                })?;
            }
        }
        Ok(())
    })?;
    ensure(broken > 0, || format!("{}: nothing to break", T::INFO.name))
}

/// A counted query gives the same ids; every answer was either tested or
/// accepted with its subtree; no test evaluates a plane twice.
pub fn counters_are_plausible<T: RegionIndex>() -> Outcome {
    let scenes = generated_scenes(500)?.into_iter().chain(cases(SEEDS));
    each(scenes, |asked, index: &mut T| {
        let mut volumes = asked.volumes.iter();
        volumes.try_for_each(|volume| counts_are_plausible(index, volume))?;
        let mut points = asked.points.iter();
        points.try_for_each(|p| counts_are_plausible(index, p))
    })
}
