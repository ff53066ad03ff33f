//! The triangle stage as a contract, and the back end that tests nothing.

use std::sync::Arc;

use super::clusters::Clusters;
use super::eye::Eye;
use super::selection::Selection;
use crate::kernel::Kernel;
use crate::visibility::Guarantee;

/// A back end, built for certain clusters.
pub trait TriangleCull: Send + Sync {
    /// Removes triangles that cannot be seen from `kept`; adds none.
    ///
    /// The answer is the same with every kernel.
    fn cull(&self, eye: &Eye, kernel: Kernel, kept: &mut Selection);
}

/// A row of the table of back ends.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct TriangleRow {
    /// Name on the command line and in tables.
    pub name: &'static str,
    /// One line for tables and help.
    pub summary: &'static str,
    /// Guarantee of its answers.
    pub guarantee: Guarantee,
    /// Builds it.
    pub build: fn(&Arc<Clusters>) -> Box<dyn TriangleCull>,
}

/// No test: what the stage costs if it is left out.
pub const NONE: TriangleRow = TriangleRow {
    name: "none",
    summary: "Keeps every triangle",
    guarantee: Guarantee::Conservative,
    build: |_| Box::new(()),
};

impl TriangleCull for () {
    fn cull(&self, _: &Eye, _: Kernel, _: &mut Selection) {}
}
