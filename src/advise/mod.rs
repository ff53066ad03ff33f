//! Advice about one scene and path: which structure, which culling test, and
//! what can be left out, each with what was measured for it. It owns the rules
//! of omission and how their evidence is weighed; scenes, structures, clocks and
//! the truth belong to other modules.

mod case;
mod choice;
mod omission;
mod rules;
mod trials;

use serde::Serialize;

pub use choice::{StructureChoice, StructureRow, TestChoice, TestRow};
pub use omission::{Check, Decision, LeftOutIf, Omission};

use crate::culling::Culling;
use crate::index::{BuildError, Kind, StructureSpec};
use crate::measure::{Contender, Protocol, Workload, WorkloadError, measure_group};
use crate::path::CameraPath;
use crate::scene::Scene;

use case::Case;
use rules::RULES;
use trials::Trials;

/// What the advice depends on beside scene and path.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct AdviseOptions {
    /// What drawing an item costs that cannot be seen, ns.
    pub draw_ns: f64,
    /// What planes may be off for rounding, in frustum depths, and a camera's
    /// frame by drift, in radians.
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
            tolerance: 1e-5,
            moved: 0.01,
            queries_per_update: 1.0,
        }
    }
}

/// What to use and what to leave out, with the evidence.
#[derive(Clone, Debug, Serialize)]
pub struct Advice {
    pub scene: String,
    pub path: String,
    pub items: usize,
    /// Bad items that were left out on request.
    pub skipped_items: usize,
    pub cameras: usize,
    pub options: AdviseOptions,
    /// How far apart a structure and its twin lie at most: smaller differences
    /// of time are ties.
    pub noise_floor: f64,
    pub structure: StructureChoice,
    pub test: TestChoice,
    pub omissions: Vec<Omission>,
}

impl Advice {
    /// Whether something gave a wrong answer on the way.
    pub fn found_wrong_answers(&self) -> bool {
        let structures = self.structure.rows.iter();
        let omissions = self.omissions.iter().flat_map(|o| &o.checks);
        structures.into_iter().any(|row| row.is_failure)
            || omissions.into_iter().any(Check::is_wrong)
    }
}

/// Why there is no advice.
#[derive(Debug, thiserror::Error)]
pub enum AdviseError {
    #[error("scene '{scene}' has no items; expected at least one")]
    NoItems { scene: String },
    #[error("path '{path}' has no cameras; expected at least one")]
    NoCameras { path: String },
    #[error(transparent)]
    Workload(#[from] WorkloadError),
    #[error(transparent)]
    Build(#[from] BuildError),
}

/// Measures what the advice rests on; `None` if stopped. `progress` is told
/// what comes next.
///
/// Every structure is verified and timed as a run does it; then every rule is
/// forced on and off on the fastest tree, side by side in the same rounds, and
/// both sides are compared with each other and with the exact truth.
///
/// # Errors
/// Nothing to look at, a camera without a view, a scene that the structures of
/// the rules refuse.
pub fn advise(
    scene: &Scene,
    path: &CameraPath,
    structures: &[StructureSpec],
    options: &AdviseOptions,
    protocol: &Protocol,
    stop: &dyn Fn() -> bool,
    progress: &dyn Fn(&str),
) -> Result<Option<Advice>, AdviseError> {
    if scene.items.is_empty() {
        let scene = scene.name.clone();
        return Err(AdviseError::NoItems { scene });
    }
    if path.cameras.is_empty() {
        let path = path.name.clone();
        return Err(AdviseError::NoCameras { path });
    }
    let culling = Culling::default();
    let workload = Workload::new(scene, path, &culling)?;
    progress("every structure");
    let contenders = entered(structures, scene, &culling);
    let Some(group) = measure_group(&workload, &contenders, &[], protocol, stop) else {
        return Ok(None);
    };
    drop(contenders);
    let structure = StructureChoice::of(&group);
    let specs = [structure.tree(structures)?, structure.scan(structures)?];
    let case = Case::new(&workload, path, specs, options, protocol)?;
    let mut trials = Trials::new(&case);
    let mut drafts = Vec::with_capacity(RULES.len());
    for rule in RULES {
        if stop() {
            return Ok(None);
        }
        progress(rule.name);
        drafts.push((rule.prepare)(&case)?);
    }
    let tests = choice::enter_tests(&case, &mut trials)?;
    let places: Vec<_> = drafts.iter_mut().map(|draft| trials.enter(draft)).collect();
    progress("every rule forced on and off");
    let Some(timed) = trials.timed(stop) else {
        return Ok(None);
    };
    let noise_floor = timed.noise_floor().max(structure.noise_floor);
    let test = TestChoice::of(&case, &tests, &timed, noise_floor);
    let settled = drafts.into_iter().zip(places).map(|(draft, places)| {
        let checks = places.iter().map(|place| timed.check(place)).collect();
        let mut omission = draft.settled(checks, noise_floor);
        rules::follow_test(&mut omission, &test);
        omission
    });
    let omissions = settled.collect();
    Ok(Some(Advice {
        scene: scene.name.clone(),
        path: path.name.clone(),
        items: scene.items.len(),
        skipped_items: scene.skipped_items,
        cameras: path.cameras.len(),
        options: *options,
        noise_floor,
        structure,
        test,
        omissions,
    }))
}

/// All structures, and the first that is no scan once more: the twin.
fn entered(structures: &[StructureSpec], scene: &Scene, culling: &Culling) -> Vec<Contender> {
    let proper = structures.iter().find(|s| s.info().kind != Kind::Scan);
    let twin = proper.or(structures.first());
    let once = structures.iter().map(|spec| (spec, false));
    let entries = once.chain(twin.map(|spec| (spec, true)));
    entries
        .map(|(spec, is_twin)| Contender::build(spec.clone(), is_twin, scene, culling.test))
        .collect()
}
