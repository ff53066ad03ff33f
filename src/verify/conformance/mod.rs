//! What every structure must do, one function per property of the contract in
//! [`RegionIndex`] and [`FrustumQuery`]. [`conformance!`](crate::conformance)
//! makes a test of each; an error says what differed and on which scene.

mod views;

use std::ops::ControlFlow;

use glam::{DVec3, Vec3};

use super::{RandomCase, Reference, edge_scenes, edge_volumes};
use super::{explain_containment, explain_visibility};
use crate::camera::{Camera, Frame, Lens, PlaneOptions, Surroundings};
use crate::geometry::{Aabb, ConvexVolume, Plane};
use crate::index::{BuildError, FrustumQuery, RegionIndex};
use crate::query::{Containment, ItemId, Located, ManySink, NoRecorder, QueryCost, Region, Sink};
use crate::scene::{self, Dice};

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

/// All properties for a structure, in the order of this file.
pub fn properties<T: FrustumQuery>() -> &'static [Property] {
    crate::conformance!(@each table T)
}

/// Seeds of the random cases of each property.
const SEEDS: std::ops::Range<u64> = 0..64;

fn build<T: RegionIndex>(scene: &str, items: &[Aabb]) -> Result<T, String> {
    T::build(items, None, &T::Params::default())
        .map_err(|error| format!("{} on '{scene}': {error}", T::NAME))
}

/// The answer in the structure's own order.
fn seen<T: FrustumQuery>(index: &T, volume: &ConvexVolume) -> Vec<ItemId> {
    let mut ids = Vec::new();
    // A Vec never breaks off.
    let _ = index.visible(volume, &mut ids, &mut NoRecorder);
    ids
}

fn located<T: RegionIndex>(index: &T, p: Vec3) -> Vec<ItemId> {
    let mut ids = Vec::new();
    let _ = index.locate(p, &mut ids, &mut NoRecorder);
    ids
}

fn sorted(mut ids: Vec<ItemId>) -> Vec<ItemId> {
    ids.sort_unstable();
    ids
}

/// `Err` with the first of the words that fails to hold.
fn ensure(holds: bool, otherwise: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(otherwise()) }
}

/// What an index is asked in a scene.
struct Questions {
    scene: String,
    volumes: Vec<ConvexVolume>,
    points: Vec<Vec3>,
}

impl Questions {
    fn on_edge(scene: &str, items: &[Aabb]) -> Questions {
        Questions {
            scene: scene.to_owned(),
            volumes: edge_volumes(items),
            points: points(items),
        }
    }

    fn of_case(seed: u64, case: &RandomCase) -> Questions {
        let mut points = points(&case.items);
        points.push(case.point);
        Questions {
            scene: format!("random case {seed}"),
            volumes: vec![case.volume.clone()],
            points,
        }
    }

    fn visible_is_right<T: FrustumQuery>(&self, index: &T, items: &[Aabb]) -> Result<(), String> {
        let mut reference = Reference::new(items.len());
        for (i, volume) in self.volumes.iter().enumerate() {
            reference.see(items, volume);
            let difference = reference.compare(&seen(index, volume));
            ensure(difference.is_none(), || {
                let first = difference.first.and_then(|id| items.get(id as usize));
                let why = first.map_or(String::new(), |b| explain_visibility(b, volume));
                format!(
                    "{} on '{}', volume {i}: {difference}; {why}",
                    T::NAME,
                    self.scene
                )
            })?;
        }
        Ok(())
    }

    fn locate_is_right<T: RegionIndex>(&self, index: &T, items: &[Aabb]) -> Result<(), String> {
        let mut reference = Reference::new(items.len());
        for &p in &self.points {
            let holding = items.iter().zip(0..).filter(|(b, _)| b.contains_point(p));
            reference.expect(holding.map(|(_, id)| id));
            let difference = reference.compare(&located(index, p));
            ensure(difference.is_none(), || {
                let first = difference.first.and_then(|id| items.get(id as usize));
                let why = first.map_or(String::new(), |b| explain_containment(b, p));
                format!(
                    "{} on '{}', point {p}: {difference}; {why}",
                    T::NAME,
                    self.scene
                )
            })?;
        }
        Ok(())
    }

    /// All answers in the structure's own order: equal for equal structures.
    fn answers<T: FrustumQuery>(&self, index: &T) -> Vec<Vec<ItemId>> {
        let visible = self.volumes.iter().map(|volume| seen(index, volume));
        let holding = self.points.iter().map(|&p| located(index, p));
        visible.chain(holding).collect()
    }
}

/// Corners and centres of some boxes, and points one step of a float beside.
fn points(items: &[Aabb]) -> Vec<Vec3> {
    let step = items.len().div_ceil(20).max(1);
    let of_box = |b: &Aabb| {
        let beside = Vec3::new(b.max.x.next_up(), b.max.y, b.max.z);
        [b.min, b.max, b.centre(), beside]
    };
    items.iter().step_by(step).flat_map(of_box).collect()
}

/// Generated worlds with cameras around and within them.
fn generated_scenes(n: usize) -> Result<Vec<(Questions, Vec<Aabb>)>, String> {
    let load = |family: &scene::Family| {
        let source = format!("{}:n={n},seed=5", family.name);
        let scene = scene::load(&source, &scene::LoadOptions::default())
            .map_err(|error| format!("{source}: {error}"))?;
        let questions = Questions {
            volumes: camera_volumes(&scene).map_err(|error| format!("{source}: {error}"))?,
            points: points(&scene.items),
            scene: source,
        };
        Ok((questions, scene.items))
    };
    scene::FAMILIES.iter().map(load).collect()
}

fn camera_volumes(scene: &scene::Scene) -> Result<Vec<ConvexVolume>, crate::camera::CameraError> {
    let centre = scene.origin + scene.bounds.centre().as_dvec3();
    let radius = scene.bounds.extent().as_dvec3().length() / 2.0;
    let around = Surroundings {
        origin: scene.origin,
        reach: scene.bounds.reach(),
    };
    let volume = |i: u32| {
        let angle = std::f64::consts::TAU * f64::from(i) / 8.0;
        let arm = DVec3::new(libm::cos(angle), libm::sin(angle), 0.3) * radius;
        // From outside, from within, and close to the middle.
        let eye = centre + arm * [1.2, 0.5, 0.05][i as usize % 3];
        let far = (i % 4 != 3).then_some(radius * [0.5, 1.0, 3.0][i as usize % 3]);
        let camera = Camera {
            frame: Frame::looking_along(eye, -arm, DVec3::Z)?,
            lens: Lens::perspective(50.0, 1.5, radius * 1e-3, far)?,
        };
        camera.volume(&PlaneOptions::default(), &around)
    };
    (0..8).map(volume).collect()
}

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

/// `locate` returns exactly the boxes that hold the point, bounds closed.
pub fn region_search_is_the_closed_box_scan<T: FrustumQuery>() -> Result<(), String> {
    for (name, items) in edge_scenes() {
        let index: T = build(name, &items)?;
        Questions::on_edge(name, &items).locate_is_right(&index, &items)?;
    }
    for seed in SEEDS {
        let case = RandomCase::new(seed);
        let questions = Questions::of_case(seed, &case);
        let index: T = build(&questions.scene, &case.items)?;
        questions.locate_is_right(&index, &case.items)?;
    }
    for (questions, items) in generated_scenes(500)? {
        let index: T = build(&questions.scene, &items)?;
        questions.locate_is_right(&index, &items)?;
    }
    Ok(())
}

/// `locate_many` hands over, for every point in order, what `locate` does:
/// whatever the size of the batch, with points that come again, lie on faces or
/// outside, or are no numbers; and stops where its sink does.
pub fn many_points_are_answered_as_one_by_one<T: FrustumQuery>() -> Result<(), String> {
    let mut scenes = generated_scenes(500)?;
    for (name, items) in edge_scenes() {
        scenes.push((Questions::on_edge(name, &items), items));
    }
    for seed in SEEDS {
        let case = RandomCase::new(seed);
        scenes.push((Questions::of_case(seed, &case), case.items));
    }
    scenes.push(cells());
    for (questions, items) in scenes {
        let index: T = build(&questions.scene, &items)?;
        let mut points = questions.points.clone();
        let strange = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX];
        for value in strange {
            points.push(Vec3::splat(value));
            points.extend(questions.points.iter().take(4).map(|p| p.with_y(value)));
        }
        // Neighbours in a batch, and far apart.
        points.extend_from_within(points.len() / 2..);
        let mut reference = Reference::new(items.len());
        for count in [0, 1, 3, points.len()] {
            let points = &points[..count.min(points.len())];
            let mut many = Located::default();
            let flow = index.locate_many(points, &mut many);
            ensure(many.len() == points.len() && flow.is_continue(), || {
                let answered = many.len();
                format!(
                    "{} on '{}': {answered} of {} points answered, {flow:?}",
                    T::NAME,
                    questions.scene,
                    points.len()
                )
            })?;
            for (&p, found) in points.iter().zip(many.iter()) {
                let holding = items.iter().zip(0..).filter(|(b, _)| b.contains_point(p));
                reference.expect(holding.map(|(_, id)| id));
                let difference = reference.compare(found);
                let right = difference.is_none() && found == located(&index, p);
                ensure(right, || {
                    format!(
                        "{} on '{}', {p} among {} points: {difference}; {found:?}, alone {:?}",
                        T::NAME,
                        questions.scene,
                        points.len(),
                        located(&index, p)
                    )
                })?;
            }
        }
        if points.len() > 1 {
            let mut sink = StopsAfter {
                points: points.len() as u32 / 2,
                next: 0,
            };
            let flow = index.locate_many(&points, &mut sink);
            ensure(flow.is_break() && sink.next == sink.points, || {
                format!(
                    "{} on '{}': stopped after {} points, got {} and {flow:?}",
                    T::NAME,
                    questions.scene,
                    sink.points,
                    sink.next
                )
            })?;
        }
    }
    Ok(())
}

/// Breaks when it has its points.
struct StopsAfter {
    points: u32,
    next: u32,
}

impl ManySink for StopsAfter {
    fn accept(&mut self, _: u32, _: &[ItemId]) -> ControlFlow<()> {
        self.next += 1;
        match self.next < self.points {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    }
}

/// Cells that tile a block, with points within, on faces, edges and corners,
/// and beside the block.
fn cells() -> (Questions, Vec<Aabb>) {
    const SIDE: u16 = 11;
    let grid = |i: u16| {
        Vec3::new(
            f32::from(i % SIDE),
            f32::from(i / SIDE % SIDE),
            f32::from(i / SIDE / SIDE),
        )
    };
    let items = (0..SIDE * SIDE * SIDE).map(|i| Aabb::new(grid(i), grid(i) + 1.0));
    // Halves: every other coordinate is a face.
    let points = (0..2 * SIDE * SIDE).map(|i| {
        let step = i.wrapping_mul(31);
        Vec3::new(
            f32::from(i % 23),
            f32::from(step % 23),
            f32::from(step / 23 % 25),
        ) * 0.5
    });
    let questions = Questions {
        scene: "cells".to_owned(),
        volumes: vec![],
        points: points.collect(),
    };
    (questions, items.collect())
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
                    T::NAME,
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
                T::NAME
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
                    T::NAME
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
                    T::NAME
                )
            })?;
            ensure(handed == collected && flow.is_continue(), || {
                format!(
                    "{} on '{scene}': two sinks got different ids, or {flow:?}",
                    T::NAME
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
                T::NAME,
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
                        T::NAME
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
                        T::NAME,
                        sink.calls
                    )
                })?;
            }
        }
    }
    ensure(broken > 0, || format!("{}: nothing to break", T::NAME))
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
                    T::NAME,
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

/// Brings an index up to date: by refitting where it can, else by building.
/// An index that cannot must not have changed.
fn update<T: FrustumQuery>(
    index: &mut T,
    items: &[Aabb],
    moved: &[ItemId],
    questions: &Questions,
) -> Result<(), String> {
    let before = questions.answers(index);
    if index.refit(items, moved) {
        return Ok(());
    }
    ensure(before == questions.answers(index), || {
        format!(
            "{} on '{}': refit refused, but changed the structure",
            T::NAME,
            questions.scene
        )
    })?;
    *index = build(&questions.scene, items)?;
    Ok(())
}

/// After 0.1 %, 1 %, 10 % and 100 % of the items have moved, one after the
/// other, a structure that refits answers as one built anew.
pub fn refit_equals_a_fresh_build<T: FrustumQuery>() -> Result<(), String> {
    let mut scenes = generated_scenes(1000)?;
    for (name, items) in edge_scenes() {
        if ["all the same", "needles", "inverted among sound"].contains(&name) {
            scenes.push((Questions::on_edge(name, &items), items));
        }
    }
    for (mut questions, mut items) in scenes {
        let mut dice = Dice::new(11);
        let width = f64::from(Aabb::union_of(&items).extent().max_element());
        let mut index: T = build(&questions.scene, &items)?;
        update(&mut index, &items, &[], &questions)?;
        for step in [1000, 100, 10, 1] {
            let moved: Vec<ItemId> = (0..items.len() as ItemId)
                .skip(step / 3)
                .step_by(step)
                .collect();
            for (at, &id) in moved.iter().enumerate() {
                // Most move a little, some far.
                let far = if at % 5 == 0 { 0.5 } else { 0.01 };
                let by = (dice.normal3() * width * far).as_vec3();
                let b = &mut items[id as usize];
                *b = Aabb::new(b.min + by, b.max + by);
            }
            update(&mut index, &items, &moved, &questions)?;
            questions.points = points(&items);
            let moved_points = moved.iter().take(20).map(|&id| items[id as usize].max);
            questions.points.extend(moved_points);
            let right = questions
                .visible_is_right(&index, &items)
                .and_then(|()| questions.locate_is_right(&index, &items));
            right.map_err(|error| format!("after {} moves: {error}", moved.len()))?;
        }
    }
    Ok(())
}

/// An item that becomes empty is gone, and one that becomes sound is there.
pub fn items_that_come_and_go_are_followed<T: FrustumQuery>() -> Result<(), String> {
    for (name, mut items) in edge_scenes() {
        if !["one", "coplanar", "inverted among sound", "only inverted"].contains(&name) {
            continue;
        }
        let questions = Questions::on_edge(name, &items);
        let mut index: T = build(name, &items)?;
        let flip = |b: &Aabb| Aabb::new(b.max, b.min);
        let last = items.len() - 1;
        // The first and the last turn about (a sound box becomes empty and
        // the other way round) and back, then all of them at once.
        let steps = [vec![0], vec![0], vec![last], vec![last]];
        let all: Vec<ItemId> = (0..items.len() as ItemId).collect();
        let ids = |step: Vec<usize>| step.into_iter().map(|i| i as ItemId).collect();
        for moved in steps.map(ids).into_iter().chain([all.clone(), all]) {
            for &id in &moved {
                items[id as usize] = flip(&items[id as usize]);
            }
            update(&mut index, &items, &moved, &questions)?;
            let right = questions
                .visible_is_right(&index, &items)
                .and_then(|()| questions.locate_is_right(&index, &items));
            right.map_err(|error| format!("{} items turned about: {error}", moved.len()))?;
        }
    }
    Ok(())
}
