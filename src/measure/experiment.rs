//! The plan of a run, and the measurement of one scene by one process.
//!
//! All processes have the same [`Plan`]; a [`Share`] is the part that one process measures.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::bounds::BOUNDS;
use super::frames::measure;
use super::group::GroupPlan;
use super::key::{CellKey, GroupKey};
use super::process_result::{Part, ReferenceResults, TaskSamples};
use super::schedule::cameras_within;
use super::{
    Machine, Notice, Protocol, SceneInfo, Status, Subject, Verdict, Workload, WorkloadError,
};
use crate::culling::{Culling, CullingTest};
use crate::index::{Kind, StructureSpec};
use crate::input::InputError;
use crate::motion::Motion;
use crate::path::{self, CameraPath, LensDefaults};
use crate::scene::{self, LoadOptions, Scene};

/// Updates are measured in every n-th process, because they cost many builds.
const UPDATES_EVERY: u32 = 4;

/// Amount of measurement: processes, rounds, times.
#[derive(Clone, Copy, PartialEq, Debug, serde::Deserialize)]
pub struct Effort {
    /// Processes that share the rounds; an interval needs ten.
    pub processes: u32,
    /// Fewest and most rounds of a task in one process.
    pub rounds: [usize; 2],
    /// CPU time of a task in one process, ns.
    pub task_ns: f64,
    /// Time in which a plain loop over all items answers the timed cameras, ns.
    ///
    /// Determines the number of timed cameras.
    pub pass_ns: f64,
    /// Additional measurements.
    pub extras: Extras,
}

/// Measurements in addition to frustum queries.
#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Extras {
    /// Frustum queries only.
    Nothing,
    /// Region search of the cameras' eyes among the scene's regions.
    RegionSearch,
    /// Region search, updates, lower bounds, and one structure measured twice.
    All,
}

/// A scene of a plan with its camera paths.
#[derive(Clone, PartialEq, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannedScene {
    /// File, sample or spec, as [`crate::scene::load`] takes it.
    #[serde(rename = "scene")]
    pub source: String,
    /// Files or specs, as [`crate::path::load`] takes them.
    #[serde(default = "default_paths")]
    pub paths: Vec<String>,
    /// True if it is measured with cold caches as well as with warm ones.
    #[serde(default)]
    pub cold: bool,
}

fn default_paths() -> Vec<String> {
    vec![path::DEFAULT_PATH.to_owned()]
}

impl PlannedScene {
    /// A scene with its camera paths, and warm caches only.
    pub fn new(source: &str, paths: &[&str]) -> PlannedScene {
        PlannedScene {
            source: source.to_owned(),
            paths: paths.iter().map(|&path| path.to_owned()).collect(),
            cold: false,
        }
    }
}

/// Plan of a run: data, complete before anything runs.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Scenes, measured one after the other.
    pub scenes: Vec<PlannedScene>,
    /// Structures, all of which take part in every group.
    pub structures: Vec<StructureSpec>,
    /// Culling tests with their arithmetic and planes, a group each.
    pub cullings: Vec<Culling>,
    /// Lens of cameras whose path has none.
    pub lens: LensDefaults,
    /// Files or specs, as [`Motion::load`] takes them; none for still scenes.
    pub motions: Vec<String>,
    /// Queries after each frame of a motion.
    pub views_per_frame: usize,
    /// Options for reading scenes.
    pub load: LoadOptions,
    /// Processes, rounds and additional measurements.
    pub effort: Effort,
    /// True if lower bounds are timed beside the structures.
    pub bounds: bool,
    /// Seed of the order in which structures are measured.
    pub seed: u64,
}

impl Plan {
    /// Groups of a scene with their cullings, in the order of measurement.
    ///
    /// Tests over boxes precede those over spheres, so that structures are built at most twice.
    pub fn groups_of(&self, scene: &PlannedScene) -> Vec<(GroupKey, Culling)> {
        let still = [String::new()];
        let motions = match self.motions.is_empty() {
            true => &still[..],
            false => &self.motions[..],
        };
        let mut groups = Vec::new();
        for path in &scene.paths {
            for &cold in &[false, true][..1 + usize::from(scene.cold)] {
                for motion in motions {
                    groups.extend(self.cullings.iter().map(|culling| {
                        let key = GroupKey::of(&scene.source, path, cold, culling, motion);
                        (key, *culling)
                    }));
                }
            }
        }
        groups.sort_by_key(|(_, culling)| culling.test == CullingTest::Sphere);
        groups
    }

    /// Keys of the groups of a scene, in the same order.
    pub fn keys_of(&self, scene: &PlannedScene) -> Vec<GroupKey> {
        let groups = self.groups_of(scene).into_iter();
        groups.map(|(key, _)| key).collect()
    }

    /// Keys of all groups, in the order of measurement.
    pub fn groups(&self) -> Vec<GroupKey> {
        let keys_of = |scene| self.keys_of(scene);
        self.scenes.iter().flat_map(keys_of).collect()
    }

    /// Keys of all cells: each structure in each group.
    pub fn cells(&self) -> Vec<CellKey> {
        let cells_of = |group: GroupKey| {
            self.structures.iter().map(move |spec| CellKey {
                group: group.clone(),
                structure: spec.label.clone(),
            })
        };
        self.groups().into_iter().flat_map(cells_of).collect()
    }

    /// The queries of a path with a culling test.
    ///
    /// A refusal if only another test of the plan has a view of every camera.
    ///
    /// # Errors
    /// No culling test of the plan has a view of every camera.
    pub fn workload<'s>(
        &self,
        scene: &'s Scene,
        path: &CameraPath,
        culling: &Culling,
        motion: Option<Motion>,
    ) -> Result<Result<Workload<'s>, Verdict>, WorkloadError> {
        let views = self.views_per_frame;
        let name = motion.as_ref().map(|motion| motion.name.clone());
        let has_views = |other: &Culling| {
            let motion = name.iter().find_map(|name| Motion::load(name, scene).ok());
            Workload::moving(scene, path, other, motion, views).is_ok()
        };
        match Workload::moving(scene, path, culling, motion, views) {
            Err(error) if self.cullings.iter().any(has_views) => {
                Ok(Err(Verdict::new(Status::Refused, error.to_string())))
            }
            made => made.map(Ok),
        }
    }

    fn has_all(&self) -> bool {
        self.effort.extras == Extras::All
    }

    /// Shard `i` of `n` (from 1): a plan with every n-th pair of scene and path.
    ///
    /// Structures, cache states, motions and tests of a pair stay together.
    ///
    /// # Panics
    /// If `n` is zero.
    pub fn shard(mut self, i: usize, n: usize) -> Plan {
        let mut pair = 0;
        for scene in &mut self.scenes {
            scene.paths.retain(|_| {
                pair += 1;
                (pair - 1) % n == i - 1
            });
        }
        self.scenes.retain(|scene| !scene.paths.is_empty());
        self
    }

    /// Builds all structures, and the first that is no scan a second time (the twin).
    fn subjects(
        &self,
        scene: &Scene,
        test: CullingTest,
        share: &Share,
        notice: Notice,
    ) -> Vec<Subject> {
        let is_due = share.process.is_multiple_of(UPDATES_EVERY) && !share.plan_only;
        // Frames have their own updates.
        let has_updates = is_due && self.has_all() && self.motions.is_empty();
        let mut structures = self.structures.iter();
        let preferred = structures.find(|s| s.row.info.kind != Kind::Scan);
        let twin = preferred.or(self.structures.first());
        let once = self.structures.iter().map(|s| (s, false));
        // A structure that has ended a process is not tried again, nor as a twin.
        let twin = twin.filter(|spec| self.has_all() && !share.failed.contains_key(&spec.label));
        let mut subjects: Vec<_> = once.chain(twin.map(|s| (s, true))).collect();
        // Another order in each process: the first build gets other memory pages than later ones.
        let first = share.process as usize % subjects.len().max(1);
        subjects.rotate_left(first);
        let built = subjects.into_iter().map(|(spec, is_twin)| {
            if let Some(verdict) = share.failed.get(&spec.label) {
                return Subject {
                    spec: spec.clone(),
                    is_twin,
                    built: Err(verdict.clone()),
                };
            }
            notice(Some(&spec.label), "building");
            let built = Subject::build(spec.clone(), is_twin, scene, test);
            if !has_updates || is_twin {
                return built;
            }
            notice(Some(&spec.label), "updating");
            built.with_updates(scene, test)
        });
        let mut built: Vec<Subject> = built.collect();
        built.rotate_right(first);
        built
    }
}

/// The reason why a scene could not be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExperimentError {
    /// The scene or the path cannot be read, or the path has no cameras in this scene.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A camera of the path cannot be culled with.
    #[error(transparent)]
    Workload(#[from] WorkloadError),
    /// A plan that measures nothing, or is inconsistent.
    #[error("the plan has {0}; expected one or more of everything, finite times, one process")]
    Plan(&'static str),
}

/// The groups of one scene that one process measures, and its starting data.
#[derive(Clone, Default, Debug, Serialize, Deserialize)]
pub struct Share {
    /// Number of the process; the first, 0, counts and plans for the others.
    pub process: u32,
    /// Per group: answers and schedule of the first process; `None` in that process.
    pub known: Vec<Option<ReferenceResults>>,
    /// Per group: true if it is to be measured.
    pub wanted: Vec<bool>,
    /// True to count, check and plan without timing.
    pub plan_only: bool,
    /// Structures that have ended a process before, each with its verdict.
    pub failed: BTreeMap<String, Verdict>,
}

impl Share {
    /// All groups of a scene with `groups` groups, in the first process.
    pub fn first(groups: usize) -> Share {
        Share {
            known: vec![None; groups],
            wanted: vec![true; groups],
            ..Share::default()
        }
    }
}

/// Measures one process's share of one scene.
///
/// Builds the structures, then measures group after group. `keep` gets each part as soon as its
/// group is finished.
///
/// # Errors
/// A scene or a path that cannot be read or made, a camera without a view.
pub fn measure_scene(
    plan: &Plan,
    planned: &PlannedScene,
    share: &Share,
    keep: &mut dyn FnMut(Part, Vec<TaskSamples>),
    notice: Notice,
) -> Result<(), ExperimentError> {
    notice(None, "loading the scene");
    let scene = scene::load(&planned.source, &plan.load)?;
    let path = |name: &str, scale| path::load_scaled(name, &scene, &plan.lens, scale);
    measure_loaded(plan, planned, share, (&scene, &path), keep, notice)
}

/// Cameras of a path by its name, and by the known scale of far, if any.
pub type PathOf<'a> = &'a dyn Fn(&str, Option<f64>) -> Result<CameraPath, InputError>;

/// Measures one process's share of a loaded scene, like [`measure_scene`].
///
/// # Errors
/// A path that cannot be read or made, a camera without a view.
pub fn measure_loaded(
    plan: &Plan,
    planned: &PlannedScene,
    share: &Share,
    (scene, path_of): (&Scene, PathOf),
    keep: &mut dyn FnMut(Part, Vec<TaskSamples>),
    notice: Notice,
) -> Result<(), ExperimentError> {
    let info = SceneInfo::of(scene);
    let sweep = Machine::capture().cache_sweep_bytes();
    let mut built: Option<(bool, Vec<Subject>)> = None;
    for (n, (key, culling)) in plan.groups_of(planned).into_iter().enumerate() {
        if !share.wanted[n] {
            continue;
        }
        let known = share.known[n].as_ref();
        // Built once for all tests over boxes, and again for spheres.
        let of_spheres = culling.test == CullingTest::Sphere;
        // Drop the old ones first: memory for one set is enough.
        drop(built.take_if(|(kind, _)| *kind != of_spheres));
        let build = || plan.subjects(scene, culling.test, share, notice);
        let (_, subjects) = built.get_or_insert_with(|| (of_spheres, build()));
        notice(None, &key.path);
        let scale = known.and_then(|known| known.lens_scale);
        let path = path_of(&key.path, scale)?;
        let motion = Some(&key.motion).filter(|motion| !motion.is_empty());
        let motion = motion.map(|motion| Motion::load(motion, scene));
        let workload = plan.workload(scene, &path, &culling, motion.transpose()?)?;
        let workload = match workload {
            Ok(workload) => workload,
            Err(verdict) => {
                let mut part = Part::of_failed(&key, &plan.structures, &verdict);
                part.path.camera_count = path.cameras.len();
                part.path.digest = key.motion.is_empty().then(|| path::digest(&path.cameras));
                (part.process, part.scene) = (share.process, info.clone());
                part.failed.clone_from(&share.failed);
                keep(part, Vec::new());
                continue;
            }
        };
        let protocol = Protocol {
            rounds: plan.effort.rounds,
            task_ns: plan.effort.task_ns,
            cameras: cameras_within(plan.effort.pass_ns, scene.items.len()),
            cold: key.cache == "cold",
            // Different orders in each process.
            seed: plan.seed.wrapping_add(u64::from(share.process)),
            cache_bytes: sweep,
        };
        let has_bounds = plan.bounds && plan.has_all();
        let settings = GroupPlan {
            process: share.process,
            bounds: if has_bounds { BOUNDS } else { &[] },
            known,
            plan_only: share.plan_only,
            locate: plan.effort.extras != Extras::Nothing,
            notice,
            ..GroupPlan::new(&workload, &info, protocol)
        };
        let (mut part, samples) = measure(&workload, subjects, settings);
        part.failed.clone_from(&share.failed);
        keep(part, samples);
    }
    Ok(())
}

#[cfg(test)]
mod tests;
