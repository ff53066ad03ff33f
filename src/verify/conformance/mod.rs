//! What every structure must do, one function per property of the contract in
//! [`RegionIndex`](crate::index::RegionIndex) and [`FrustumQuery`].
//! [`conformance!`](crate::conformance)
//! makes a test of each; an error says what differed and on which scene.

mod declared;
mod locate;
mod questions;
mod refit;
mod views;

use std::ops::ControlFlow;

use glam::Vec3;

use super::{RandomCase, Reference, edge_scenes, edge_volumes};
use crate::geometry::{Aabb, ConvexVolume, Plane};
use crate::index::{BuildError, FrustumQuery};
use crate::query::{Containment, ItemId, NoRecorder, QueryCost, Region, Sink};
use crate::scene::Dice;

use questions::{Questions, build, ensure, generated_scenes, located, points, seen, sorted};

pub use declared::declared_capabilities_are_true;
pub use locate::many_points_are_answered_as_one_by_one;
pub use locate::region_search_is_the_closed_box_scan;
pub use refit::items_that_come_and_go_are_followed;
pub use refit::refit_equals_a_fresh_build;
pub use views::every_view_sees_what_the_scan_sees;

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
    pub name: &'static str,
    /// `Err` says what differed, and on which scene.
    pub check: fn() -> Result<(), String>,
}

/// All properties for a structure, in the order of the list.
pub fn properties<T: FrustumQuery>() -> &'static [Property] {
    crate::conformance!(@each table T)
}

/// Seeds of the random cases of each property.
const SEEDS: std::ops::Range<u64> = 0..64;

/// `visible` returns exactly what a look at every box returns, where scenes
/// are degenerate and planes touch boxes.
pub fn reference_set_on_edge_scenes<T: FrustumQuery>() -> Result<(), String> {
    for (name, items) in edge_scenes() {
        let index: T = build(name, &items)?;
        Questions::on_edge(name, &items).visible_is_right(&index, &items)?;
    }
    Ok(())
}

/// The same on [`RandomCase`]s.
pub fn reference_set_on_random_cases<T: FrustumQuery>() -> Result<(), String> {
    for seed in SEEDS.start..SEEDS.end * 4 {
        let case = RandomCase::new(seed);
        let questions = Questions::of_case(seed, &case);
        let index: T = build(&questions.scene, &case.items)?;
        questions.visible_is_right(&index, &case.items)?;
    }
    Ok(())
}

/// The same on small generated worlds, through cameras.
pub fn reference_set_on_generated_scenes<T: FrustumQuery>() -> Result<(), String> {
    for (questions, items) in generated_scenes(1500)? {
        let index: T = build(&questions.scene, &items)?;
        questions.visible_is_right(&index, &items)?;
    }
    Ok(())
}

/// The same boxes in another order give the same set.
pub fn order_of_items_changes_nothing<T: FrustumQuery>() -> Result<(), String> {
    for seed in SEEDS {
        let case = RandomCase::new(seed);
        let scene = format!("random case {seed}");
        let wanted = sorted(seen(&build::<T>(&scene, &case.items)?, &case.volume));
        let count = case.items.len();
        let turn = 1 + seed as usize * 7;
        // Which item of the scene stands at a place of the reordered one.
        let orders: [Box<dyn Fn(usize) -> usize>; 2] = [
            Box::new(|place| (place + turn) % count),
            Box::new(|place| count - 1 - place),
        ];
        for order in orders {
            let reordered: Vec<Aabb> = (0..count).map(|place| case.items[order(place)]).collect();
            let found = seen(&build::<T>(&scene, &reordered)?, &case.volume);
            let known = found.iter().all(|&id| (id as usize) < count);
            let named = found.iter().filter(|_| known);
            let found = sorted(named.map(|&id| order(id as usize) as ItemId).collect());
            ensure(known && found == wanted, || {
                format!(
                    "{} on '{scene}': {} ids in one order, {} others in another",
                    T::INFO.name,
                    wanted.len(),
                    found.len()
                )
            })?;
        }
    }
    Ok(())
}

/// A volume with more planes sees nothing that the one with fewer does not.
pub fn smaller_volume_sees_a_subset<T: FrustumQuery>() -> Result<(), String> {
    for seed in SEEDS {
        let case = RandomCase::new(seed);
        let more = RandomCase::new(seed + 1);
        let both = case.volume.planes().iter().chain(more.volume.planes());
        let planes: Vec<Plane> = both.copied().take(32).collect();
        let smaller = ConvexVolume::from_planes(&planes).map_err(|error| error.to_string())?;
        let scene = format!("random case {seed}");
        let index: T = build(&scene, &case.items)?;
        let (large, small) = (sorted(seen(&index, &case.volume)), seen(&index, &smaller));
        let lost = small.iter().find(|id| large.binary_search(id).is_err());
        ensure(lost.is_none(), || {
            format!(
                "{} on '{scene}': item {lost:?} is seen by the smaller volume only",
                T::INFO.name
            )
        })?;
    }
    Ok(())
}

/// A volume that the scene's bounds lie wholly inside of sees every item that
/// is not empty; one that they lie outside of sees none.
pub fn inside_means_all_and_outside_none<T: FrustumQuery>() -> Result<(), String> {
    for seed in SEEDS {
        let case = RandomCase::new(seed);
        let bounds = Aabb::union_of(&case.items);
        if bounds.is_empty() {
            continue;
        }
        let sound = case.items.iter().filter(|b| !b.is_empty()).count();
        let around = [bounds.min, bounds.max].map(|p| p * 2.0);
        let enclosing = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| {
            let reach = around[0].abs().max(around[1].abs()).dot(axis);
            [Plane::new(axis, reach), Plane::new(-axis, reach)]
        });
        let enclosing: Vec<Plane> = enclosing.collect();
        let beside = [Plane::new(Vec3::X, -bounds.max.x.next_up())];
        let made = [&enclosing[..], &beside].map(ConvexVolume::from_planes);
        let scene = format!("random case {seed}");
        let index: T = build(&scene, &case.items)?;
        for volume in made.into_iter().chain([Ok(case.volume)]) {
            let volume = volume.map_err(|error| error.to_string())?;
            let found = seen(&index, &volume).len();
            let (verdict, _) = volume.classify(&bounds, volume.start(), &mut NoRecorder);
            let right = match verdict {
                Containment::Inside => found == sound,
                Containment::Outside => found == 0,
                Containment::Straddles => true,
            };
            ensure(right, || {
                format!(
                    "{} on '{scene}': the scene is {verdict:?}, yet {found} of {sound} are seen",
                    T::INFO.name
                )
            })?;
        }
    }
    Ok(())
}

/// Keeps the slices apart as they come.
#[derive(Default)]
struct Slices(Vec<Vec<ItemId>>);

impl Sink for Slices {
    fn accept(&mut self, ids: &[ItemId]) -> ControlFlow<()> {
        self.0.push(ids.to_vec());
        ControlFlow::Continue(())
    }
}

/// No id is handed over twice or does not exist, in one slice or over all;
/// the query ends with `Continue`; any sink gets the same ids.
pub fn each_id_comes_once<T: FrustumQuery>() -> Result<(), String> {
    for seed in SEEDS {
        let case = RandomCase::new(seed);
        let scene = format!("random case {seed}");
        let index: T = build(&scene, &case.items)?;
        for region_search in [false, true] {
            let mut slices = Slices::default();
            let (flow, collected) = if region_search {
                let flow = index.locate(case.point, &mut slices, &mut NoRecorder);
                (flow, located(&index, case.point))
            } else {
                let flow = index.visible(&case.volume, &mut slices, &mut NoRecorder);
                (flow, seen(&index, &case.volume))
            };
            let handed = slices.0.concat();
            let ids = sorted(handed.clone());
            let wrong = ids
                .windows(2)
                .find(|pair| pair[0] == pair[1])
                .map(|pair| pair[0])
                .or(ids
                    .last()
                    .copied()
                    .filter(|&id| id as usize >= case.items.len()));
            ensure(wrong.is_none(), || {
                format!(
                    "{} on '{scene}': id {wrong:?} comes twice or is none",
                    T::INFO.name
                )
            })?;
            ensure(handed == collected && flow.is_continue(), || {
                format!(
                    "{} on '{scene}': two sinks got different ids, or {flow:?}",
                    T::INFO.name
                )
            })?;
        }
    }
    Ok(())
}

/// The same items give the same structure: the same ids in the same order.
pub fn building_again_gives_the_same_structure<T: FrustumQuery>() -> Result<(), String> {
    for seed in SEEDS {
        let case = RandomCase::new(seed);
        let questions = Questions::of_case(seed, &case);
        let [first, second] = [(); 2].map(|()| build::<T>(&questions.scene, &case.items));
        let same = questions.answers(&first?) == questions.answers(&second?);
        ensure(same, || {
            format!(
                "{} on '{}': built twice, answered differently",
                T::INFO.name,
                questions.scene
            )
        })?;
    }
    Ok(())
}

/// A NaN or infinite bound makes the build fail and is named, whatever box
/// and coordinate it stands in; the first one, if there are more.
pub fn bad_items_are_refused_and_named<T: FrustumQuery>() -> Result<(), String> {
    let sound: Vec<Aabb> = (0..40u8)
        .map(|i| Aabb::around(Vec3::splat(f32::from(i)), Vec3::ONE))
        .collect();
    for item in [0, 17, sound.len() - 1] {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for coordinate in 0..6 {
                let mut items = sound.clone();
                let bad = |b: &mut Aabb| {
                    let corner = if coordinate < 3 {
                        &mut b.min
                    } else {
                        &mut b.max
                    };
                    corner[coordinate % 3] = value;
                };
                bad(&mut items[item]);
                bad(&mut items[sound.len() - 1]);
                let error = T::build(&items, None, &T::Params::default()).err();
                let named = matches!(
                    error, Some(BuildError::NonFiniteItem { item: named, .. }) if named == item
                );
                ensure(named, || {
                    format!(
                        "{}: {value} in coordinate {coordinate} of item {item}: {error:?}",
                        T::INFO.name
                    )
                })?;
            }
        }
    }
    Ok(())
}

/// Breaks at a given call and notes what comes later.
struct BreaksAt {
    call: usize,
    calls: usize,
    ids: Vec<ItemId>,
}

impl Sink for BreaksAt {
    fn accept(&mut self, ids: &[ItemId]) -> ControlFlow<()> {
        self.calls += 1;
        self.ids.extend_from_slice(ids);
        if self.calls >= self.call {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }
}

/// A sink that breaks gets no further call, has what came first, and the
/// query says `Break`.
pub fn a_sink_that_breaks_is_not_called_again<T: FrustumQuery>() -> Result<(), String> {
    let mut broken = 0;
    for seed in SEEDS {
        let case = RandomCase::new(seed);
        let scene = format!("random case {seed}");
        let index: T = build(&scene, &case.items)?;
        for region_search in [false, true] {
            let mut slices = Slices::default();
            let _ = if region_search {
                index.locate(case.point, &mut slices, &mut NoRecorder)
            } else {
                index.visible(&case.volume, &mut slices, &mut NoRecorder)
            };
            let calls = slices.0.len();
            for call in [1, 2, calls / 2, calls] {
                if !(1..=calls).contains(&call) {
                    continue;
                }
                let mut sink = BreaksAt {
                    call,
                    calls: 0,
                    ids: Vec::new(),
                };
                let flow = if region_search {
                    index.locate(case.point, &mut sink, &mut NoRecorder)
                } else {
                    index.visible(&case.volume, &mut sink, &mut NoRecorder)
                };
                broken += 1;
                let first = slices.0[..call].concat();
                let right = sink.calls == call && sink.ids == first && flow.is_break();
                ensure(right, || {
                    format!(
                        "{} on '{scene}': broke at call {call}, got {} and {flow:?}",
                        T::INFO.name,
                        sink.calls
                    )
                })?;
            }
        }
    }
    ensure(broken > 0, || format!("{}: nothing to break", T::INFO.name))
}

/// A counted query gives the same ids; every answer was either tested or
/// accepted with its subtree; no test evaluates a plane twice.
pub fn counters_are_plausible<T: FrustumQuery>() -> Result<(), String> {
    let mut scenes = generated_scenes(500)?;
    for seed in SEEDS {
        let case = RandomCase::new(seed);
        scenes.push((Questions::of_case(seed, &case), case.items));
    }
    for (questions, items) in scenes {
        let index: T = build(&questions.scene, &items)?;
        let counted = |ids: Vec<ItemId>, plain: Vec<ItemId>, cost: QueryCost, planes: usize| {
            let looked_at = cost.items_tested + cost.items_accepted_untested;
            let most = cost.comparisons() * planes as u64;
            let right = ids == plain && looked_at >= ids.len() as u64 && cost.planes_tested <= most;
            ensure(right, || {
                format!(
                    "{} on '{}': {} ids, {} when counted, {planes} planes: {cost:?}",
                    T::INFO.name,
                    questions.scene,
                    plain.len(),
                    ids.len()
                )
            })
        };
        for volume in &questions.volumes {
            let (mut ids, mut cost) = (Vec::new(), QueryCost::default());
            let _ = index.visible(volume, &mut ids, &mut cost);
            counted(ids, seen(&index, volume), cost, volume.planes().len())?;
        }
        for &p in &questions.points {
            let (mut ids, mut cost) = (Vec::new(), QueryCost::default());
            let _ = index.locate(p, &mut ids, &mut cost);
            counted(ids, located(&index, p), cost, 0)?;
        }
    }
    Ok(())
}
