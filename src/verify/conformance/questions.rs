//! What the properties ask: volumes and points of a scene, and how an answer is
//! got and compared with the reference. What a structure must do with them is
//! the properties' business.

use glam::{DVec3, Vec3};

use super::super::{RandomCase, Reference, edge_volumes};
use super::super::{explain_containment, explain_visibility};
use crate::camera::{Camera, Frame, Lens, PlaneOptions, Surroundings};
use crate::geometry::{Aabb, ConvexVolume};
use crate::index::{FrustumQuery, RegionIndex};
use crate::query::{ItemId, NoRecorder};
use crate::scene;

pub(super) fn build<T: RegionIndex>(scene: &str, items: &[Aabb]) -> Result<T, String> {
    T::build(items, None, &T::Params::default())
        .map_err(|error| format!("{} on '{scene}': {error}", T::INFO.name))
}

/// The answer in the structure's own order.
pub(super) fn seen<T: FrustumQuery>(index: &T, volume: &ConvexVolume) -> Vec<ItemId> {
    let mut ids = Vec::new();
    // A Vec never breaks off.
    let _ = index.visible(volume, &mut ids, &mut NoRecorder);
    ids
}

pub(super) fn located<T: RegionIndex>(index: &T, p: Vec3) -> Vec<ItemId> {
    let mut ids = Vec::new();
    let _ = index.locate(p, &mut ids, &mut NoRecorder);
    ids
}

pub(super) fn sorted(mut ids: Vec<ItemId>) -> Vec<ItemId> {
    ids.sort_unstable();
    ids
}

/// `Err` with the first of the words that fails to hold.
pub(super) fn ensure(holds: bool, otherwise: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(otherwise()) }
}

/// What an index is asked in a scene.
pub(super) struct Questions {
    pub(super) scene: String,
    pub(super) volumes: Vec<ConvexVolume>,
    pub(super) points: Vec<Vec3>,
}

impl Questions {
    pub(super) fn on_edge(scene: &str, items: &[Aabb]) -> Questions {
        Questions {
            scene: scene.to_owned(),
            volumes: edge_volumes(items),
            points: points(items),
        }
    }

    pub(super) fn of_case(seed: u64, case: &RandomCase) -> Questions {
        let mut points = points(&case.items);
        points.push(case.point);
        Questions {
            scene: format!("random case {seed}"),
            volumes: vec![case.volume.clone()],
            points,
        }
    }

    pub(super) fn visible_is_right<T: FrustumQuery>(
        &self,
        index: &T,
        items: &[Aabb],
    ) -> Result<(), String> {
        let mut reference = Reference::new(items.len());
        for (i, volume) in self.volumes.iter().enumerate() {
            reference.see(items, volume);
            let difference = reference.compare(&seen(index, volume));
            ensure(difference.is_none(), || {
                let first = difference.first.and_then(|id| items.get(id as usize));
                let why = first.map_or(String::new(), |b| explain_visibility(b, volume));
                format!(
                    "{} on '{}', volume {i}: {difference}; {why}",
                    T::INFO.name,
                    self.scene
                )
            })?;
        }
        Ok(())
    }

    pub(super) fn locate_is_right<T: RegionIndex>(
        &self,
        index: &T,
        items: &[Aabb],
    ) -> Result<(), String> {
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
                    T::INFO.name,
                    self.scene
                )
            })?;
        }
        Ok(())
    }

    /// All answers in the structure's own order: equal for equal structures.
    pub(super) fn answers<T: FrustumQuery>(&self, index: &T) -> Vec<Vec<ItemId>> {
        let visible = self.volumes.iter().map(|volume| seen(index, volume));
        let holding = self.points.iter().map(|&p| located(index, p));
        visible.chain(holding).collect()
    }
}

/// Corners and centres of some boxes, and points one step of a float beside.
pub(super) fn points(items: &[Aabb]) -> Vec<Vec3> {
    let step = items.len().div_ceil(20).max(1);
    let of_box = |b: &Aabb| {
        let beside = Vec3::new(b.max.x.next_up(), b.max.y, b.max.z);
        [b.min, b.max, b.centre(), beside]
    };
    items.iter().step_by(step).flat_map(of_box).collect()
}

/// Generated worlds with cameras around and within them.
pub(super) fn generated_scenes(n: usize) -> Result<Vec<(Questions, Vec<Aabb>)>, String> {
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

pub(super) fn camera_volumes(
    scene: &scene::Scene,
) -> Result<Vec<ConvexVolume>, crate::camera::CameraError> {
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
