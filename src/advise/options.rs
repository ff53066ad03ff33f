//! Inputs of the advice, and the structures that its plans name.

use anyhow::{Result, ensure};

use crate::culling::Culling;
use crate::funnel::check_memory;
use crate::index::{Execution, StructureSpec};
use crate::measure::{Setting, Workload};
use crate::motion::Motion;

/// Largest acceptable error: of planes in depths of the view, of a camera's axes.
pub(super) const TOLERANCE: f64 = 1e-5;
/// Reason for which rules about nodes do not apply.
pub(super) const NO_NODES: &str = "the structure taken has no nodes";

/// Bytes per item of the structures and trees of all rules; 950 were measured.
const BYTES_PER_ITEM: u64 = 1000;

/// Scene, path and options.
#[derive(Clone, Copy)]
pub struct AdviseInput<'a> {
    /// Scene, cameras, structures to choose from, rounds and times of a process.
    pub setting: &'a Setting,
    /// Motion of the items, file or spec; `None` for a still scene.
    pub motion: Option<&'a str>,
    /// Queries per frame.
    pub views: usize,
    /// Cost of drawing an item that is not visible, ns.
    pub draw_ns: f64,
}

impl<'a> AdviseInput<'a> {
    /// The queries of the path.
    ///
    /// # Errors
    /// A path without cameras, an unfit motion.
    pub fn workload(&self) -> Result<Workload<'a>> {
        let Setting { scene, path, .. } = self.setting;
        ensure!(
            !path.cameras.is_empty(),
            "path '{}' has no cameras; expected at least one",
            path.name
        );
        check_memory(&scene.name, BYTES_PER_ITEM * scene.items.len() as u64)?;
        let motion = self.motion.map(|motion| Motion::load(motion, scene));
        let (motion, culling) = (motion.transpose()?, Culling::default());
        let motion = motion.inspect(|own| own.tell_numbers(path, self.views));
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
