//! What every back end of the triangle stage does.

use std::sync::Arc;

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::eye::Eye;
use super::selection::Selection;
use crate::kernel::Kernel;

/// A back end, built for certain clusters.
pub trait TriangleCull: Send + Sync {
    /// Takes away triangles that cannot be seen. Of what was not in `kept` nothing
    /// is added. The same answer with every kernel.
    fn cull(&self, eye: &Eye, kernel: Kernel, kept: &mut Selection);
}

/// A row of the table of back ends.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct TriangleRow {
    /// As it is typed and shown.
    pub name: &'static str,
    /// What it does, in a line.
    pub summary: &'static str,
    /// What it promises.
    pub guarantee: Guarantee,
    /// Builds it.
    pub build: fn(&Arc<Clusters>) -> Box<dyn TriangleCull>,
}
