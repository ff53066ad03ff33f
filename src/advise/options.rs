//! What the advice depends on, and why there may be none.

use serde::Serialize;

use crate::index::BuildError;
use crate::measure::WorkloadError;

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
    #[error(
        "{found} ways to answer; the plan has {planned}: the scene or the cameras have changed \
         on the way"
    )]
    OtherPlan { found: usize, planned: usize },
}
