//! No test: what leaving the stage out costs.

use std::sync::Arc;

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::contract::{TriangleCull, TriangleRow};
use super::eye::Eye;
use super::selection::Selection;
use crate::kernel::Kernel;

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "none",
    summary: "Keeps every triangle",
    guarantee: Guarantee::Conservative,
    build,
};

struct Nothing;

fn build(_: &Arc<Clusters>) -> Box<dyn TriangleCull> {
    Box::new(Nothing)
}

impl TriangleCull for Nothing {
    fn cull(&self, _: &Eye, _: Kernel, _: &mut Selection) {}
}
