//! What the advice depends on, and why there may be none.

use serde::Serialize;

use crate::index::BuildError;
use crate::input::InputError;
use crate::measure::WorkloadError;

/// What the advice depends on beside scene and path.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct AdviseOptions {
    /// Cost of drawing an item that cannot be seen, ns.
    pub draw_ns: f64,
    /// Cost of shading a fragment, ns.
    pub shade_ns: f64,
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
            shade_ns: 1.0,
            tolerance: 1e-5,
            moved: 0.01,
            queries_per_update: 1.0,
        }
    }
}

/// Why there is no advice.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AdviseError {
    /// There is nothing to cull.
    #[error("scene '{scene}' has no items; expected at least one")]
    NoItems {
        /// Name of the scene.
        scene: String,
    },
    /// There is nothing to cull for.
    #[error("path '{path}' has no cameras; expected at least one")]
    NoCameras {
        /// Name of the path.
        path: String,
    },
    /// A camera of the path cannot be culled with.
    #[error(transparent)]
    Workload(#[from] WorkloadError),
    /// A structure that a rule needs cannot be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The scene's file, read a second time.
    #[error(transparent)]
    Input(#[from] InputError),
    /// Another process has prepared something else.
    #[error(
        "{found} ways to answer; the plan has {planned}: the scene or the cameras have changed \
         on the way"
    )]
    OtherPlan {
        /// Ways to answer in this process.
        found: usize,
        /// Ways to answer in the plan.
        planned: usize,
    },
}
