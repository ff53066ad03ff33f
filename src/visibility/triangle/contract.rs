//! What every back end of the triangle stage does.

use std::sync::Arc;

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::selection::Selection;
use super::view::View;
use crate::kernel::Kernel;

named! {
    /// What a back end decides by, and so which truth it is held against.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
    #[non_exhaustive]
    pub enum Criterion {
        /// The side of a triangle that the eye is on.
        Facing = "facing",
        /// Whether a triangle is within the window and between near and far.
        Window = "window",
        /// Whether a triangle's screen box holds a sample.
        Samples = "samples",
    }
}

/// A back end, built for certain clusters.
pub trait TriangleCull: Send + Sync {
    /// Takes away triangles that cannot be seen. Of what was not in `kept` nothing
    /// is added. The same answer with every kernel.
    fn cull(&self, view: &View, kernel: Kernel, kept: &mut Selection);
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
    /// What it decides by.
    pub criterion: Criterion,
    /// Builds it.
    pub build: fn(&Arc<Clusters>) -> Box<dyn TriangleCull>,
}
