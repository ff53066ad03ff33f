//! The plan of a run, and the measurement of one scene by one process.
//!
//! A [`Plan`] is the same for all processes; a [`Share`] says what one process measures.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::bounds::BOUNDS;
use super::group::{GroupPlan, measure_part};
use super::key::{CellKey, GroupKey};
use super::process_result::{Known, Part, TaskSamples};
use super::progress::Notice;
use super::refitted::refitted_ln;
use super::schedule::cameras_within;
use super::{
    Machine, PathInfo, Protocol, SceneInfo, Status, Subject, Verdict, Workload, WorkloadError,
};
use crate::culling::{Culling, CullingTest};
use crate::index::{Kind, StructureSpec};
use crate::input::InputError;
use crate::path::{self, LensDefaults, PathError};
use crate::scene::{self, LoadOptions, Scene};

/// Updates are measured in every n-th process, because they cost many builds.
const UPDATES_EVERY: u32 = 4;

/// Amount of measurement: processes, rounds, times.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Effort {
    /// Processes that the rounds are spread over; an interval needs ten.
    pub processes: u32,
    /// Rounds of a task in one process, at least and at most.
    pub rounds: [usize; 2],
    /// CPU time of a task in one process, ns.
    pub task_ns: f64,
    /// Time in which a plain loop over all items answers the timed cameras, ns:
    /// decides on their number.
    pub pass_ns: f64,
    /// Additional measurements.
    pub extras: Extras,
}

/// Measurements beside frustum queries.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum Extras {
    /// Frustum queries only.
    Nothing,
    /// Region search of the cameras' eyes among the scene's regions.
    RegionSearch,
    /// Region search, updates, lower bounds, and one structure measured twice.
    All,
}

/// A scene of a plan with its camera paths.
#[derive(Clone, PartialEq, Debug)]
pub struct PlannedScene {
    /// File, sample or spec, as [`crate::scene::load`] takes it.
    pub source: String,
    /// Files or specs, as [`crate::path::load`] takes them.
    pub paths: Vec<String>,
    /// Cache states to measure: true is cold.
    pub caches: Vec<bool>,
}

/// Plan of a run: data, complete before anything runs.
#[derive(Clone)]
pub struct Plan {
    /// Scenes, measured one after the other.
    pub scenes: Vec<PlannedScene>,
    /// Structures, all of which take part in every group.
    pub structures: Vec<StructureSpec>,
    /// Culling tests with their arithmetic and planes, each a group of its own.
    pub cullings: Vec<Culling>,
    /// Lens of cameras whose path has none.
    pub lens: LensDefaults,
    /// Options for reading scenes.
    pub load: LoadOptions,
    /// Processes, rounds and additional measurements.
    pub effort: Effort,
    /// True if lower bounds are timed beside the structures.
    pub bounds: bool,
    /// Seed of the order in which structures are measured.
    pub seed: u64,
}

/// A group of one scene: path, cache state and culling test.
#[derive(Clone, PartialEq, Debug)]
pub struct SceneGroup {
    /// File or spec of the path.
    pub path: String,
    /// True if caches are emptied before each query.
    pub cold: bool,
    /// Test, arithmetic and planes.
    pub culling: Culling,
}

impl Plan {
    /// The groups of a scene, in the order in which they are measured.
    ///
    /// Tests over boxes come before those over spheres, so that structures are built
    /// twice at most.
    pub fn groups_of(&self, scene: &PlannedScene) -> Vec<SceneGroup> {
        let of_spheres = |c: &&Culling| c.test == CullingTest::Sphere;
        let (spheres, boxes): (Vec<&Culling>, Vec<&Culling>) =
            self.cullings.iter().partition(of_spheres);
        let mut groups = Vec::new();
        for cullings in [boxes, spheres] {
            for path in &scene.paths {
                for &cold in &scene.caches {
                    groups.extend(cullings.iter().map(|&&culling| SceneGroup {
                        path: path.clone(),
                        cold,
                        culling,
                    }));
                }
            }
        }
        groups
    }

    /// The key of a group of a scene.
    pub fn key(&self, scene: &PlannedScene, group: &SceneGroup) -> GroupKey {
        GroupKey::of(&scene.source, &group.path, group.cold, &group.culling)
    }

    /// Keys of all groups, in the order in which they are measured.
    pub fn groups(&self) -> Vec<GroupKey> {
        let of_scene = |scene| {
            let groups = self.groups_of(scene).into_iter();
            groups.map(move |group| self.key(scene, &group))
        };
        self.scenes.iter().flat_map(of_scene).collect()
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

    fn has_all(&self) -> bool {
        self.effort.extras == Extras::All
    }

    fn has_updates(&self, share: &Share) -> bool {
        share.process.is_multiple_of(UPDATES_EVERY) && self.has_all() && !share.plan_only
    }

    /// Shard `i` of `n` (from 1), a smaller plan: every n-th pair of scene and path.
    ///
    /// Structures, cache states and tests of a pair stay together.
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
        let preferred = self
            .structures
            .iter()
            .find(|s| s.row.info.kind != Kind::Scan);
        let twin = preferred.or(self.structures.first());
        let once = self.structures.iter().map(|s| (s, false));
        // A structure that has ended a process is not tried again, not as a twin either.
        let twin = twin.filter(|spec| self.has_all() && !share.failed.contains_key(&spec.label));
        once.chain(twin.map(|s| (s, true)))
            .map(|(spec, is_twin)| {
                if let Some(verdict) = share.failed.get(&spec.label) {
                    return Subject {
                        spec: spec.clone(),
                        is_twin,
                        built: Err(verdict.clone()),
                    };
                }
                notice(Some(&spec.label), "building");
                let built = Subject::build(spec.clone(), is_twin, scene, test);
                match self.has_updates(share) && !is_twin {
                    true => built.with_updates(scene, test),
                    false => built,
                }
            })
            .collect()
    }
}

/// Why a scene could not be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExperimentError {
    /// The scene cannot be read.
    #[error(transparent)]
    Scene(#[from] InputError),
    /// The path cannot be read or has no cameras in this scene.
    #[error(transparent)]
    Path(#[from] PathError),
    /// A camera of the path cannot be culled with.
    #[error(transparent)]
    Workload(#[from] WorkloadError),
    /// The name of a structure or a parameter of it is wrong.
    #[error(transparent)]
    Spec(#[from] crate::spec::SpecError),
}

/// The groups of one scene that one process measures, and what it starts from.
#[derive(Clone, Default, Debug, Serialize, Deserialize)]
pub struct Share {
    /// Number of the process; the first, 0, counts and plans for the others.
    pub process: u32,
    /// Per group: answers and schedule of the first process; `None` in that process.
    pub known: Vec<Option<Known>>,
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

/// Measures one process's share of one scene; returns false if stopped.
///
/// Builds the structures, then measures group after group. `keep` gets each part as soon
/// as its group is finished.
///
/// # Errors
/// A scene or a path that cannot be read or made, a camera without a view.
pub fn measure_scene(
    plan: &Plan,
    planned: &PlannedScene,
    share: &Share,
    keep: &mut dyn FnMut(Part, Vec<TaskSamples>),
    notice: Notice,
    stop: &dyn Fn() -> bool,
) -> Result<bool, ExperimentError> {
    notice(None, "loading the scene");
    let scene = scene::load(&planned.source, &plan.load)?;
    let info = SceneInfo::of(&scene);
    let sweep = Machine::capture().cache_sweep_bytes();
    let mut built: Option<(bool, Vec<Subject>)> = None;
    let mut first = true;
    for (n, group) in plan.groups_of(planned).into_iter().enumerate() {
        if !share.wanted[n] {
            continue;
        }
        let known = share.known[n].as_ref();
        // Built once for all tests over boxes, and again for spheres.
        let of_spheres = group.culling.test == CullingTest::Sphere;
        if built.as_ref().is_none_or(|(kind, _)| *kind != of_spheres) {
            // The old ones go first: memory for one set is enough.
            drop(built.take());
            let all = plan.subjects(&scene, group.culling.test, share, notice);
            built = Some((of_spheres, all));
        }
        let Some((_, subjects)) = &built else {
            continue;
        };
        notice(None, &group.path);
        let scale = known.and_then(|known| known.lens_scale);
        let path = path::load_scaled(&group.path, &scene, &plan.lens, scale)?;
        let workload = Workload::new(&scene, &path, &group.culling)?;
        let settings = GroupPlan {
            scene: &info,
            path: PathInfo::of(&group.path, &workload, group.cold),
            process: share.process,
            protocol: Protocol {
                rounds: plan.effort.rounds,
                task_ns: plan.effort.task_ns,
                cameras: cameras_within(plan.effort.pass_ns, scene.items.len()),
                cold: group.cold,
                // Other orders in each process.
                seed: plan.seed.wrapping_add(u64::from(share.process)),
                cache_bytes: sweep,
            },
            bounds: if plan.bounds && plan.has_all() {
                BOUNDS
            } else {
                &[]
            },
            known,
            plan_only: share.plan_only,
            locate: plan.effort.extras != Extras::Nothing,
        };
        let protocol = settings.protocol;
        let Some((mut part, samples)) = measure_part(&workload, subjects, settings, notice, stop)
        else {
            return Ok(false);
        };
        // In the first group of each scene only.
        if first && plan.has_updates(share) {
            for subject in &mut part.subjects {
                let spec = plan.structures.iter().find(|s| s.label == subject.label);
                if let Some(spec) = spec.filter(|_| subject.verdict.status == Status::Ok) {
                    notice(Some(&spec.label), "refitting");
                    subject.refitted_ln = refitted_ln(spec, &workload, &protocol);
                }
            }
        }
        first = false;
        part.failed.clone_from(&share.failed);
        keep(part, samples);
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::super::Group;
    use super::*;
    use crate::index::Registry;

    fn planned(source: &str, paths: &[&str], caches: &[bool]) -> PlannedScene {
        PlannedScene {
            source: source.to_owned(),
            paths: paths.iter().map(|&path| path.to_owned()).collect(),
            caches: caches.to_vec(),
        }
    }

    fn plan() -> Plan {
        let sphere = Culling {
            test: CullingTest::Sphere,
            ..Culling::default()
        };
        Plan {
            scenes: vec![
                planned("city:n=100", &["orbit:frames=8", "spin"], &[false, true]),
                planned("uniform:n=50", &["outside:frames=4"], &[false]),
                planned("city:n=200", &["orbit:frames=8", "spin", "zoom"], &[true]),
            ],
            structures: Registry::builtin().structures("linear,bvh,octree").unwrap(),
            cullings: vec![sphere, Culling::default()],
            lens: LensDefaults::default(),
            load: LoadOptions::default(),
            effort: Effort {
                processes: 1,
                rounds: [1, 1],
                task_ns: 1e4,
                pass_ns: 1e4,
                extras: Extras::All,
            },
            bounds: false,
            seed: 1,
        }
    }

    #[test]
    fn shards_are_the_plan_and_leave_what_is_compared_together() {
        let whole = plan();
        let cells = whole.cells();
        // (2 paths x 2 caches + 1 + 3 paths) x 2 tests x 3 structures.
        assert_eq!(cells.len(), 8 * 2 * 3);
        for n in 1..=8 {
            let shards: Vec<Vec<CellKey>> =
                (1..=n).map(|i| whole.clone().shard(i, n).cells()).collect();
            let of_pair = |cell: &CellKey, other: &CellKey| {
                (&cell.group.scene, &cell.group.path) == (&other.group.scene, &other.group.path)
            };
            for cell in &cells {
                let holding = shards.iter().filter(|shard| shard.contains(cell));
                let holding: Vec<_> = holding.collect();
                assert_eq!(holding.len(), 1, "{cell:?} in {n} shards");
                let together = cells.iter().filter(|other| of_pair(cell, other));
                assert!(together.clone().all(|other| holding[0].contains(other)));
            }
            let sum: usize = shards.iter().map(Vec::len).sum();
            assert_eq!(sum, cells.len(), "nothing twice in {n} shards");
        }
        // Six pairs: the seventh of seven shards has nothing to do.
        assert!(whole.clone().shard(7, 7).scenes.is_empty());
    }

    #[test]
    fn keys_are_told_apart_and_structures_built_twice_at_most() {
        let plan = plan();
        let cells = plan.cells();
        for (n, cell) in cells.iter().enumerate() {
            assert!(!cells[..n].contains(cell), "{cell:?} comes twice");
        }
        for scene in &plan.scenes {
            let groups = plan.groups_of(scene);
            let mut spheres = groups.iter().map(|g| g.culling.test == CullingTest::Sphere);
            let first = spheres.position(|is_sphere| is_sphere);
            assert!(first.is_some_and(|first| first > 0));
            assert!(spheres.all(|is_sphere| is_sphere), "boxes after spheres");
        }
    }

    #[test]
    fn one_process_has_the_cells_of_the_plan_in_its_order() {
        let plan = plan();
        let mut groups = Vec::new();
        let all_of = |planned: &PlannedScene| Share::first(plan.groups_of(planned).len());
        for planned in &plan.scenes {
            let mut keep = |part: Part, _| groups.push((part.key.clone(), Group::of(&[part])));
            let share = all_of(planned);
            let done = measure_scene(&plan, planned, &share, &mut keep, &|_, _| (), &|| false);
            assert!(done.unwrap());
        }
        let found = groups.iter().flat_map(|(key, group)| {
            group.cells.iter().map(|cell| CellKey {
                group: key.clone(),
                structure: cell.structure.clone(),
            })
        });
        assert!(found.eq(plan.cells()));
        for (_, group) in &groups {
            assert!(group.twin.as_ref().is_some_and(|(label, _)| label == "bvh"));
            for cell in &group.cells {
                assert_eq!(cell.status, super::super::Status::Ok);
            }
        }
        let (first, mut keep) = (&plan.scenes[0], |_, _| {
            panic!("stopped before the first part")
        });
        let stopped = measure_scene(&plan, first, &all_of(first), &mut keep, &|_, _| (), &|| {
            true
        });
        assert!(!stopped.unwrap());
    }

    #[test]
    fn what_has_ended_a_process_is_not_built_again() {
        let mut plan = plan();
        plan.scenes.truncate(1);
        let verdict = Verdict::new(super::super::Status::OutOfMemory, "while building");
        let mut share = Share::first(plan.groups_of(&plan.scenes[0]).len());
        share.failed.insert("bvh".to_owned(), verdict.clone());
        let building = std::cell::RefCell::new(Vec::new());
        let notice = |structure: Option<&str>, step: &str| {
            if let (Some(structure), "building") = (structure, step) {
                building.borrow_mut().push(structure.to_owned());
            }
        };
        let mut parts = Vec::new();
        let mut keep = |part: Part, _| parts.push(part);
        let done = measure_scene(&plan, &plan.scenes[0], &share, &mut keep, &notice, &|| {
            false
        });
        assert!(done.unwrap());
        assert!(!building.borrow().contains(&"bvh".to_owned()));
        for part in &parts {
            let own = part.subjects.iter().find(|s| s.label == "bvh");
            assert_eq!(own.map(|s| &s.verdict), Some(&verdict));
            assert!(part.tasks.iter().all(|t| !t.label.starts_with("bvh")));
        }
    }
}
