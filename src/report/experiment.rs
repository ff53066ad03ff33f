//! An experiment in the calling process: from names to a report.

use std::collections::BTreeSet;
use std::time::SystemTime;

use super::Report;
use super::stream::{Header, StoredPart, Stream, digits, utc};
use crate::index::StructureSpec;
use crate::measure::{
    Effort, ExperimentError, Extras, Machine, Part, PathOf, Plan, PlannedScene, Share,
    measure_loaded, measure_scene,
};
use crate::path::{self, CameraPath};
use crate::scene::Scene;

/// A plan that the calling process measures alone.
///
/// Times have no intervals: those need several processes.
///
/// ```
/// use cullbench::prelude::*;
///
/// let report = Experiment::new("city:n=500")
///     .path("orbit:frames=8")
///     .structures(Registry::builtin().structures("linear,bvh")?)
///     .run()?;
/// assert_eq!(report.cells[1].structure, "bvh");
/// assert!(report.cells[1].value("query_ns") > Some(0.0));
///
/// // Boxes and cameras of your own, in memory.
/// use cullbench::scene::WorldBox;
/// use glam::DVec3;
///
/// let boxes = (0..99).map(|i| WorldBox::standing(DVec3::X * f64::from(4 * i), DVec3::ONE));
/// let scene = Scene::from_boxes("row", &boxes.collect::<Vec<_>>())?;
/// let frame = look_at(DVec3::new(-9.0, -30.0, 5.0), DVec3::ZERO, DVec3::Z)?;
/// let lens = Lens::perspective(60.0, 1.5, 0.1, None)?;
/// let path = CameraPath {
///     name: "mine".to_owned(),
///     cameras: vec![Camera { frame, lens }],
///     ..CameraPath::default()
/// };
/// let bvh = Registry::builtin().structures("bvh")?;
/// let report = Experiment::of(scene, path).structures(bvh).run()?;
/// assert_eq!(report.cells[0].status, Status::Ok);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Experiment {
    /// The plan, for settings that have no method here.
    pub plan: Plan,
    held: Option<(Scene, CameraPath)>,
}

impl Experiment {
    /// An experiment on a scene: a file, a sample or a spec.
    ///
    /// Loaded by [`scene::load`]. Frustum queries and region searches with warm caches, a tenth of
    /// a second per structure and path.
    ///
    /// [`scene::load`]: crate::scene::load
    pub fn new(scene: &str) -> Experiment {
        Experiment {
            held: None,
            plan: Plan {
                scenes: vec![PlannedScene::new(scene, &[])],
                structures: Vec::new(),
                cullings: vec![Default::default()],
                lens: Default::default(),
                motions: Vec::new(),
                views_per_frame: 1,
                load: Default::default(),
                effort: Effort {
                    processes: 1,
                    rounds: [3, 40],
                    task_ns: 1e8,
                    pass_ns: 1e8,
                    extras: Extras::RegionSearch,
                },
                bounds: false,
                seed: 1,
            },
        }
    }

    /// An experiment on a scene and a path in memory.
    ///
    /// Otherwise like [`Experiment::new`].
    pub fn of(scene: Scene, path: CameraPath) -> Experiment {
        let experiment = Experiment::new(&scene.name).path(&path.name);
        Experiment {
            held: Some((scene, path)),
            ..experiment
        }
    }

    /// Adds a camera path: file or spec ([`path::load`](crate::path::load)).
    pub fn path(mut self, path: &str) -> Experiment {
        for scene in &mut self.plan.scenes {
            scene.paths.push(path.to_owned());
        }
        self
    }

    /// Adds structures, from [`Registry::structures`] or made otherwise.
    ///
    /// [`Registry::structures`]: crate::index::Registry::structures
    pub fn structures(mut self, structures: Vec<StructureSpec>) -> Experiment {
        self.plan.structures.extend(structures);
        self
    }

    /// Loads, builds, checks every answer, and times.
    ///
    /// # Errors
    /// A scene or a path that cannot be read or made, a camera without a view; a plan that measures
    /// nothing, or that a single process cannot measure.
    pub fn run(&self) -> Result<Report, ExperimentError> {
        self.check()?;
        let started_at = utc(SystemTime::now());
        let id = format!("{started_at}-{}", digits(SystemTime::now()));
        let header = Header::of(&self.plan, Machine::capture(), id, started_at);
        let mut stream = Stream::of(header);
        for planned in &self.plan.scenes {
            let share = Share::first(self.plan.groups_of(planned).len());
            let mut keep = |part: Part, _| {
                stream.parts.push(StoredPart {
                    part,
                    ..StoredPart::default()
                });
            };
            let held = self.held.as_ref();
            let held = held.filter(|(scene, _)| scene.name == planned.source);
            let Some((scene, own)) = held else {
                measure_scene(&self.plan, planned, &share, &mut keep, &|_, _| ())?;
                continue;
            };
            let path = |name: &str, scale| match name == own.name {
                true => Ok(own.clone()),
                false => path::load_scaled(name, scene, &self.plan.lens, scale),
            };
            let world = (scene, &path as PathOf);
            measure_loaded(&self.plan, planned, &share, world, &mut keep, &|_, _| ())?;
        }
        stream.finished_at = Some(utc(SystemTime::now()));
        Ok(stream.report())
    }

    /// Checks that no part of the plan is empty, and that its numbers are usable.
    fn check(&self) -> Result<(), ExperimentError> {
        let (plan, effort) = (&self.plan, &self.plan.effort);
        let (scenes, [least, most]) = (&plan.scenes, effort.rounds);
        let labels: BTreeSet<_> = plan.structures.iter().map(|s| &s.label).collect();
        let is_time = |ns: f64| (0.0..f64::INFINITY).contains(&ns);
        // A name given twice would count as two processes.
        let once = |names: Vec<&String>| names.iter().collect::<BTreeSet<_>>().len() == names.len();
        let sources = scenes.iter().map(|s| &s.source);
        let has_each_once = |s: &PlannedScene| once(s.paths.iter().collect());
        let is_warm = |s: &PlannedScene| plan.motions.is_empty() || !s.cold;
        let rules = [
            (once(sources.collect()), "a scene twice"),
            (scenes.iter().all(has_each_once), "a path twice"),
            (once(plan.motions.iter().collect()), "a motion twice"),
            (scenes.iter().all(is_warm), "cold caches of items that move"),
            (!scenes.is_empty(), "no scene"),
            (scenes.iter().all(|s| !s.paths.is_empty()), "no path"),
            (!labels.is_empty(), "no structure"),
            (!plan.cullings.is_empty(), "no culling"),
            (plan.views_per_frame > 0, "no views_per_frame"),
            (labels.len() == plan.structures.len(), "a structure twice"),
            (effort.processes == 1, "processes other than 1"),
            ((1..=most).contains(&least), "rounds of 0 or descending"),
            (is_time(effort.task_ns), "task_ns below 0 or not finite"),
            (is_time(effort.pass_ns), "pass_ns below 0 or not finite"),
        ];
        let broken = rules.into_iter().find(|(holds, _)| !holds);
        broken.map_or(Ok(()), |(_, found)| Err(ExperimentError::Plan(found)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_is_named_once_and_what_moves_is_warm() {
        let named = |paths: [&str; 2]| {
            let spec = StructureSpec::parse("linear").unwrap();
            let begun = Experiment::new("uniform:n=20").structures(vec![spec]);
            paths.into_iter().fold(begun, Experiment::path)
        };
        assert!(named(["spin:frames=2", "orbit:frames=2"]).check().is_ok());
        let twice = named(["spin:frames=2"; 2]).check().unwrap_err().to_string();
        assert!(twice.contains("a path twice"), "{twice}");
        let mut cold = named(["spin:frames=2", "orbit:frames=2"]);
        cold.plan.motions.push("drift".to_owned());
        cold.plan.scenes[0].cold = true;
        let cold = cold.check().unwrap_err().to_string();
        assert!(cold.contains("cold caches"), "{cold}");
    }

    #[test]
    fn a_plan_that_measures_nothing_or_not_what_it_says_is_an_error() {
        let sound = || {
            let spec = |name| StructureSpec::parse(name).unwrap();
            Experiment::new("city:n=50")
                .path("orbit:frames=1")
                .structures(vec![spec("linear"), spec("bvh")])
        };
        assert_eq!(sound().check().map_err(|e| e.to_string()), Ok(()));
        type Break = fn(&mut Plan);
        let breaks: [(Break, &str); 13] = [
            (|p| p.scenes.clear(), "no scene"),
            (|p| p.scenes[0].paths.clear(), "no path"),
            (|p| p.structures.clear(), "no structure"),
            (|p| p.cullings.clear(), "no culling"),
            (|p| p.views_per_frame = 0, "no views_per_frame"),
            (
                |p| p.structures[1] = p.structures[0].clone(),
                "a structure twice",
            ),
            (|p| p.effort.processes = 10, "processes other than 1"),
            (|p| p.effort.processes = 0, "processes other than 1"),
            (|p| p.effort.rounds = [0, 0], "rounds of 0 or descending"),
            (|p| p.effort.rounds = [5, 2], "rounds of 0 or descending"),
            (|p| p.effort.task_ns = f64::NAN, "task_ns below 0 or not"),
            (
                |p| p.effort.pass_ns = f64::INFINITY,
                "pass_ns below 0 or not",
            ),
            (|p| p.effort.pass_ns = -1.0, "pass_ns below 0 or not"),
        ];
        for (make, wanted) in breaks {
            let mut experiment = sound();
            make(&mut experiment.plan);
            let error = experiment.run().map(|_| ()).unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("the plan has {wanted}"))
                    && error.contains("; expected "),
                "{error}"
            );
        }
    }
}
