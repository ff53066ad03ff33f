//! Queries for the properties: volumes and points of a scene.
//!
//! Also compares an answer with the reference.

use std::ops::{ControlFlow, Range};

use glam::{DVec3, Vec3};

use super::super::{RandomCase, Trial, edge_scenes, edge_volumes, scan};
use super::super::{explain_containment, explain_visibility};
use crate::camera::{Camera, CameraError, Frame, Lens, PlaneOptions};
use crate::geometry::{Aabb, ConvexVolume, Plane};
use crate::index::{FrustumQuery, Input, RegionIndex, caught};
use crate::kernel::{Kernel, Plain};
use crate::query::{ItemId, NoRecorder, QueryContext, QueryCost, QueryVolume, Recorder, Sink};
use crate::scene;

/// Result of a property's check, with the reason why it fails.
pub(super) type Outcome = Result<(), String>;

pub(super) fn build<T: RegionIndex>(items: &[Aabb]) -> Result<T, String> {
    build_from(&Input::new(items))
}

pub(super) fn build_from<T: RegionIndex>(input: &Input) -> Result<T, String> {
    T::build(input, &T::Params::default()).map_err(|error| error.to_string())
}

/// Queries with the portable instruction set; `Break` if the sink broke off.
pub(super) fn query<T: RegionIndex, Q: QueryVolume, S: Sink, R: Recorder>(
    index: &T,
    volume: &Q,
    sink: &mut S,
    recorder: &mut R,
) -> ControlFlow<()> {
    index.query(volume, &mut QueryContext::new(Plain, sink, recorder))
}

/// Answer in the structure's own order.
pub(super) fn ids_of<T: RegionIndex, Q: QueryVolume>(index: &T, volume: &Q) -> Vec<ItemId> {
    let mut ids = Vec::new();
    // A Vec never breaks off.
    let _ = query(index, volume, &mut ids, &mut NoRecorder);
    ids
}

pub(super) fn sorted(mut ids: Vec<ItemId>) -> Vec<ItemId> {
    ids.sort_unstable();
    ids
}

/// Returns `Err` with the message unless the condition holds.
pub(super) fn ensure(holds: bool, otherwise: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(otherwise()) }
}

/// A scene and the queries on it.
pub(super) struct QuerySet {
    pub(super) scene: String,
    pub(super) items: Vec<Aabb>,
    pub(super) volumes: Vec<ConvexVolume>,
    pub(super) points: Vec<Vec3>,
}

/// Checks a property of a structure that is built over each of the scenes.
///
/// An error begins with the names of both.
pub(super) fn each<T: RegionIndex>(
    scenes: impl IntoIterator<Item = QuerySet>,
    mut holds: impl FnMut(&mut QuerySet, &mut T) -> Outcome,
) -> Outcome {
    each_of(&mut scenes.into_iter(), &mut holds)
}

/// Compiled once per structure, not once per property.
fn each_of<T: RegionIndex>(
    scenes: &mut dyn Iterator<Item = QuerySet>,
    holds: &mut dyn FnMut(&mut QuerySet, &mut T) -> Outcome,
) -> Outcome {
    for mut queries in scenes {
        let outcome = caught(|| {
            let mut index = build(&queries.items)?;
            holds(&mut queries, &mut index)
        });
        let outcome = outcome.unwrap_or_else(|message| Err(format!("panicked: {message}")));
        outcome.map_err(|why| format!("{} on '{}': {why}", T::INFO.name, queries.scene))?;
    }
    Ok(())
}

/// The [`edge_scenes`] with their volumes.
pub(super) fn edges() -> impl Iterator<Item = QuerySet> {
    edge_scenes().into_iter().map(|(scene, items)| QuerySet {
        scene: scene.to_owned(),
        volumes: edge_volumes(&items),
        points: points(&items),
        items,
    })
}

/// The [`RandomCase`]s of some seeds, with derived volumes.
///
/// The last point is the case's own.
pub(super) fn cases(seeds: Range<u64>) -> impl Iterator<Item = QuerySet> {
    seeds.map(|seed| {
        let (case, next) = (RandomCase::new(seed), RandomCase::new(seed + 1));
        let mut volumes = derived(&case.volume, &next.volume, &case.items);
        volumes.insert(0, case.volume);
        QuerySet {
            scene: format!("random case {seed}"),
            volumes,
            points: [points(&case.items), vec![case.point]].concat(),
            items: case.items,
        }
    })
}

/// Intersection of two volumes, a volume around all items, and one beside them.
fn derived(volume: &ConvexVolume, other: &ConvexVolume, items: &[Aabb]) -> Vec<ConvexVolume> {
    let bounds = Aabb::union_of(items);
    let reach = bounds.min.abs().max(bounds.max.abs()) * 2.0;
    let axes = [Vec3::X, Vec3::Y, Vec3::Z].into_iter();
    let around = axes.flat_map(|axis| [axis, -axis].map(|n| Plane::new(n, reach.dot(axis))));
    let both = volume.planes().iter().chain(other.planes()).copied();
    let beside = vec![Plane::new(Vec3::X, -bounds.max.x.next_up())];
    let sets: [Vec<Plane>; 3] = [both.take(32).collect(), around.collect(), beside];
    // Without items, or with items that reach half the largest float, there is none around or
    // beside.
    let sets = sets.iter().filter(|set| set.iter().all(Plane::is_finite));
    sets.map(|planes| ConvexVolume::from_planes(planes).expect("32 finite planes at most"))
        .collect()
}

impl QuerySet {
    pub(super) fn visible_is_right<T: RegionIndex>(&self, index: &T) -> Outcome {
        self.volumes.iter().enumerate().try_for_each(|(i, volume)| {
            let why = |b: &Aabb| explain_visibility(b, volume);
            is_right(&format!("volume {i}"), index, &self.items, volume, why)
        })
    }

    pub(super) fn locate_is_right<T: RegionIndex>(&self, index: &T) -> Outcome {
        self.points.iter().try_for_each(|p| {
            let why = |b: &Aabb| explain_containment(b, *p);
            is_right(&format!("point {p}"), index, &self.items, p, why)
        })
    }

    pub(super) fn both_are_right<T: RegionIndex>(&self, index: &T) -> Outcome {
        self.visible_is_right(index)?;
        self.locate_is_right(index)
    }

    /// All answers in the structure's own order: equal for equal structures.
    pub(super) fn answers<T: RegionIndex>(&self, index: &T) -> Vec<Vec<ItemId>> {
        let visible = self.volumes.iter().map(|volume| ids_of(index, volume));
        let holding = self.points.iter().map(|p| ids_of(index, p));
        visible.chain(holding).collect()
    }
}

/// Checks that a structure returns exactly the items that the scan does.
///
/// `explain` states why an item is in the answer or not. The best kernel and a counted query must
/// return the same ids. The counts must include every returned item, as tested or accepted with a
/// subtree, and at most one evaluation of each open plane per comparison.
pub(super) fn is_right<T: RegionIndex, Q: QueryVolume>(
    kind: &str,
    index: &T,
    items: &[Aabb],
    volume: &Q,
    explain: impl Fn(&Aabb) -> String,
) -> Outcome {
    let mut trial = Trial::new(items.len());
    trial.set_expected(scan(items, |b| volume.sees(b)));
    let answer = trial.run(|ids| *ids = ids_of(index, volume));
    let why = |id: usize| Some(explain(items.get(id)?));
    let plain = answer.map_err(|fault| format!("{kind}: {}", fault.explained(why)))?;
    let best = index.visible(volume);
    let is_same = best == plain || sorted(best.clone()) == sorted(plain.to_vec());
    ensure(is_same, || {
        let (best, kernel, plain) = (best.len(), Kernel::best().name(), plain.len());
        format!("{kind}: {best} ids by {kernel}, other {plain} by portable")
    })?;
    let (mut ids, mut cost) = (Vec::new(), QueryCost::default());
    let _ = query(index, volume, &mut ids, &mut cost);
    let planes = Q::planes_open(volume.mask());
    let looked_at = cost.items_tested + cost.items_accepted_untested;
    let most = cost.comparisons() * u64::from(planes);
    let count = ids.len() as u64;
    let is_counted = looked_at >= count && cost.items_accepted_untested <= count;
    ensure(
        ids == plain && is_counted && cost.planes_tested <= most,
        || {
            let plain = plain.len();
            format!(
                "{kind}: {count} ids when counted, expected {plain}; {looked_at} items tested or accepted, \
             expected {count} or more, of which {} accepted, expected {count} at most; {} planes, \
             expected {most} at most",
                cost.items_accepted_untested, cost.planes_tested
            )
        },
    )
}

/// Corners and centres of some boxes, and points one float step outside.
pub(super) fn points(items: &[Aabb]) -> Vec<Vec3> {
    let step = items.len().div_ceil(20).max(1);
    let of_box = |b: &Aabb| {
        let beside = Vec3::new(b.max.x.next_up(), b.max.y, b.max.z);
        [b.min, b.max, b.centre(), beside]
    };
    items.iter().step_by(step).flat_map(of_box).collect()
}

/// Generated worlds with cameras around and inside them.
pub(super) fn generated_scenes(n: usize) -> Result<Vec<QuerySet>, String> {
    let load = |family: &scene::Family| {
        let source = format!("{}:n={n},seed=5", family.name);
        let scene = scene::load(&source, &scene::LoadOptions::default())
            .map_err(|error| format!("{source}: {error}"))?;
        Ok(QuerySet {
            volumes: camera_volumes(&scene).map_err(|error| format!("{source}: {error}"))?,
            points: points(&scene.items),
            scene: source,
            items: scene.items,
        })
    };
    scene::FAMILIES.iter().map(load).collect()
}

/// More items than 16 bits number, of which a query sees some of the last.
pub(super) fn large_scene() -> QuerySet {
    let at = |n: u32| Vec3::new((n % 256) as f32, (n / 256) as f32, 0.0);
    let corner = Aabb::around(Vec3::new(256.0, 256.0, 0.0), Vec3::splat(9.0));
    QuerySet {
        scene: "a grid of 66,000 boxes".to_owned(),
        items: (0..66_000)
            .map(|n| Aabb::around(at(n), Vec3::ONE))
            .collect(),
        volumes: vec![ConvexVolume::of_box(&corner)],
        points: Vec::new(),
    }
}

fn camera_volumes(scene: &scene::Scene) -> Result<Vec<ConvexVolume>, CameraError> {
    let centre = scene.origin + scene.bounds.centre().as_dvec3();
    let radius = scene.bounds.extent().as_dvec3().length() / 2.0;
    let around = scene.surroundings();
    let volume = |i: u32| {
        let angle = std::f64::consts::TAU * f64::from(i) / 8.0;
        let arm = DVec3::new(libm::cos(angle), libm::sin(angle), 0.3) * radius;
        // From outside, from inside, and close to the centre.
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
