//! Costs and limits of the advice, and scenes without advice.

use serde::Serialize;

use crate::index::BuildError;
use crate::measure::WorkloadError;

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

/// A scene and a path without advice.
#[derive(Debug, thiserror::Error)]
pub enum AdviseError {
    /// A camera of the path has no view.
    #[error(transparent)]
    Workload(#[from] WorkloadError),
    /// A structure of a rule cannot be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// Nothing to cull, nothing to cull for, or another scene than planned.
    #[error("{0}")]
    Refused(String),
}
