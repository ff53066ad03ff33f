//! Costs and limits of the advice, and its inputs.

use serde::Serialize;

use crate::culling::Culling;
use crate::funnel::{StudyError, check_memory};
use crate::index::{Execution, StructureSpec};
use crate::measure::{Protocol, Workload};
use crate::motion::Motion;
use crate::path::CameraPath;
use crate::scene::Scene;

/// Costs and limits that the advice depends on.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct AdviseOptions {
    /// Cost of drawing an item that cannot be seen, ns.
    pub draw_ns: f64,
    /// Cost of shading a fragment, ns.
    pub shade_ns: f64,
    /// Tolerated rounding of planes, in frustum depths, and drift of a camera's basis,
    /// radians.
    pub tolerance: f64,
    /// Share of the items that move between two updates.
    pub moved: f64,
    /// Queries between two updates.
    pub queries_per_update: f64,
}

impl Default for AdviseOptions {
    fn default() -> Self {
        AdviseOptions {
            draw_ns: 1000.0,
            shade_ns: 1.0,
            tolerance: 1e-5,
            moved: 0.01,
            queries_per_update: 1.0,
        }
    }
}

/// Bytes per item of the structures and trees of all rules; 950 were measured.
const BYTES_PER_ITEM: u64 = 1000;

/// Scene, path and options.
#[derive(Clone, Copy)]
pub struct AdviseInput<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The cameras.
    pub path: &'a CameraPath,
    /// Structures to choose from.
    pub structures: &'a [StructureSpec],
    /// Motion of the items, file or spec; `None` for a still scene.
    pub motion: Option<&'a str>,
    /// Queries per frame.
    pub views: usize,
    /// Costs and limits.
    pub options: &'a AdviseOptions,
    /// Rounds and times of a process.
    pub protocol: &'a Protocol,
}

impl<'a> AdviseInput<'a> {
    /// Refuses a scene without items, a path without cameras, an unfit motion.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn check(&self) -> Result<(), StudyError> {
        self.workload().map(|_| ())
    }

    pub(super) fn workload(&self) -> Result<Workload<'a>, StudyError> {
        let (scene, path) = (self.scene, self.path);
        for (kind, name, things, count) in [
            ("scene", &scene.name, "items", scene.items.len()),
            ("path", &path.name, "cameras", path.cameras.len()),
        ] {
            if count == 0 {
                return Err(StudyError::Refused(format!(
                    "{kind} '{name}' has no {things}; expected at least one"
                )));
            }
        }
        check_memory(&scene.name, BYTES_PER_ITEM * scene.items.len() as u64)?;
        let motion = self.motion.map(|motion| Motion::load(motion, scene));
        let (motion, culling) = (motion.transpose()?, Culling::default());
        Ok(Workload::moving(scene, path, &culling, motion, self.views)?)
    }
}

/// The structure that a plan names.
///
/// One of the list, one under a policy of the advice's own (`wide@rebuild`), or one of this
/// crate.
pub(super) fn planned(structures: &[StructureSpec], label: &str) -> StructureSpec {
    let (alone, policy) = label.split_once('@').unwrap_or((label, ""));
    let named = |name: &str| structures.iter().find(|spec| spec.label == name).cloned();
    let Some(mut spec) = named(label).or_else(|| named(alone)) else {
        let execution = structures.first().map(|spec| spec.execution);
        let name = if alone == SCAN { SCAN } else { TREE };
        return default_of(name, execution.unwrap_or_default());
    };
    spec.policy = policy.parse().unwrap_or(spec.policy);
    label.clone_into(&mut spec.label);
    spec
}

/// Structures of the rules where the list has no tree, no scan.
pub(super) const TREE: &str = "wide";
pub(super) const SCAN: &str = "linear";

/// A structure of this crate with its default parameters.
pub(super) fn default_of(name: &'static str, execution: Execution) -> StructureSpec {
    let spec = StructureSpec::parse(name).expect("a name of this crate's own");
    spec.by(execution)
}
