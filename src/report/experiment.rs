//! An experiment in the process of its caller: from names to a report.

use std::collections::BTreeMap;
use std::time::SystemTime;

use super::Report;
use super::stream::{Header, KeptPart, Stream, utc};
use crate::index::StructureSpec;
use crate::measure::{
    Effort, ExperimentError, Extras, Machine, Part, Plan, PlannedScene, Share, measure_scene,
};

/// A plan that the calling process measures alone. Times have no intervals:
/// those need several processes.
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
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Experiment {
    /// The plan, for settings that have no method here.
    pub plan: Plan,
}

impl Experiment {
    /// An experiment on a scene: a file, a sample or a spec, as [`scene::load`] takes
    /// it. Frustum queries and region searches with warm caches, a tenth of a second per
    /// structure and path.
    ///
    /// [`scene::load`]: crate::scene::load
    pub fn new(scene: &str) -> Experiment {
        Experiment {
            plan: Plan {
                scenes: vec![PlannedScene {
                    source: scene.to_owned(),
                    paths: Vec::new(),
                    caches: vec![false],
                }],
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

    /// Adds a camera path: file or spec ([`path::load`](crate::path::load)).
    pub fn path(mut self, path: &str) -> Experiment {
        for scene in &mut self.plan.scenes {
            scene.paths.push(path.to_owned());
        }
        self
    }

    /// Adds structures, those of [`Registry::structures`] or others.
    ///
    /// [`Registry::structures`]: crate::index::Registry::structures
    pub fn structures(mut self, structures: Vec<StructureSpec>) -> Experiment {
        self.plan.structures.extend(structures);
        self
    }

    /// Loads, builds, checks every answer, and times.
    ///
    /// # Errors
    /// The errors of [`measure_scene`].
    pub fn run(&self) -> Result<Report, ExperimentError> {
        let started_at = utc(SystemTime::now());
        let (machine, id) = (Machine::capture(), started_at.clone());
        let mut header = Header::of(&self.plan, machine, id, started_at);
        header.run.processes = 1;
        let mut stream = Stream::of(header);
        for planned in &self.plan.scenes {
            let share = Share::first(self.plan.groups_of(planned).len());
            let mut keep = |part: Part, _| {
                stream.parts.push(KeptPart {
                    part,
                    rows: BTreeMap::new(),
                    samples_end: 0,
                });
            };
            let never = || false;
            measure_scene(&self.plan, planned, &share, &mut keep, &|_, _| (), &never)?;
        }
        stream.finished_at = Some(utc(SystemTime::now()));
        Ok(stream.report())
    }
}
