//! Triangles whose screen box holds no sample: between the rays, at this size of
//! image.

use std::sync::Arc;

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::contract::{Criterion, TriangleCull, TriangleRow};
use super::screen::Screen;
use super::selection::Selection;
use super::view::View;
use crate::kernel::Kernel;

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "smaller than a sample",
    summary: "Drops what no sample of the image can meet: its screen box holds none",
    guarantee: Guarantee::SampleExact,
    criterion: Criterion::Samples,
    build: |clusters| Box::new(Small(clusters.clone())),
};

struct Small(Arc<Clusters>);

impl TriangleCull for Small {
    fn cull(&self, view: &View, _: Kernel, kept: &mut Selection) {
        let Some(screen) = Screen::of(view) else {
            return;
        };
        let clusters = &*self.0;
        kept.retain(|cluster, bit| {
            let corners = clusters
                .surfaces
                .corners(clusters.triangles_of(cluster)[bit]);
            match screen.samples(corners) {
                None => true,
                Some([columns, rows]) => !columns.is_empty() && !rows.is_empty(),
            }
        });
    }

    fn bytes(&self) -> usize {
        let surfaces = &self.0.surfaces;
        size_of_val(&surfaces.points[..]) + size_of_val(&surfaces.triangles[..])
    }
}
