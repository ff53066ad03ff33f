//! Costs and limits of the advice, and its inputs.

use anyhow::{Result, ensure};
use clap::Args;
use serde::Serialize;

use crate::culling::Culling;
use crate::funnel::check_memory;
use crate::index::{Execution, StructureSpec};
use crate::measure::{Setting, Workload};
use crate::motion::Motion;
use crate::spec::values;

/// Costs and limits that the advice depends on.
#[derive(Args, Clone, Copy, PartialEq, Debug, Serialize)]
pub struct AdviseOptions {
    /// Cost of drawing an item that is not visible, ns
    #[arg(long, value_name = "NS", default_value_t = 1000.0, value_parser = values::at_least_zero)]
    pub draw_ns: f64,
    /// Cost of shading a fragment, ns (1 shades an image of 1920 x 1080 in 2 ms)
    #[arg(long, value_name = "NS", default_value_t = 1.0, value_parser = values::at_least_zero)]
    pub shade_ns: f64,
    /// Largest acceptable error: of planes relative to the depth of the view, of a
    /// camera basis in radians
    #[arg(long, value_name = "SHARE", default_value_t = 1e-5, value_parser = values::above_zero)]
    pub tolerance: f64,
    /// Share of the items that move between two updates
    #[arg(long, value_name = "SHARE", default_value = "1%", value_parser = values::share)]
    pub moved: f64,
    /// Queries between two updates
    #[arg(long, value_name = "N", default_value_t = 1.0, value_parser = values::at_least_zero)]
    pub queries_per_update: f64,
}

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
    /// Costs and limits.
    pub options: &'a AdviseOptions,
}

impl<'a> AdviseInput<'a> {
    /// The queries of the path.
    ///
    /// # Errors
    /// A scene without items, a path without cameras, an unfit motion.
    pub fn workload(&self) -> Result<Workload<'a>> {
        let Setting { scene, path, .. } = self.setting;
        for (kind, name, things, count) in [
            ("scene", &scene.name, "items", scene.items.len()),
            ("path", &path.name, "cameras", path.cameras.len()),
        ] {
            ensure!(
                count > 0,
                "{kind} '{name}' has no {things}; expected at least one"
            );
        }
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
