//! The cones of the crate `meshopt` (Kapoulkine's meshoptimizer): bounds computed by
//! the library, tested as its header says, one cluster at a time.

use std::sync::Arc;

use glam::Vec3;

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::contract::{Criterion, TriangleCull, TriangleRow};
use super::selection::Selection;
use super::view::View;
use crate::kernel::Kernel;

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "meshopt",
    summary: "One cone per cluster: crate meshopt's bounds and documented test, scalar",
    guarantee: Guarantee::Unproven,
    criterion: Criterion::Facing,
    build: |clusters| Box::new(MeshoptCones::of(clusters)),
};

/// The library's bounds of clusters.
pub struct MeshoptCones {
    bounds: Vec<meshopt::Bounds>,
}

impl MeshoptCones {
    /// One for each cluster. O(t).
    pub fn of(clusters: &Arc<Clusters>) -> MeshoptCones {
        let surfaces = &clusters.surfaces;
        let points: Vec<[f32; 3]> = surfaces.points.iter().map(|p| p.to_array()).collect();
        let bytes: &[u8] = bytemuck::cast_slice(&points);
        let vertices = meshopt::VertexDataAdapter::new(bytes, size_of::<[f32; 3]>(), 0)
            .expect("points are whole triples");
        let bounds = (0..clusters.len()).map(|cluster| {
            let corners = clusters.triangles_of(cluster).iter();
            let corners: Vec<u32> = corners
                .flat_map(|&t| surfaces.triangles[t as usize])
                .collect();
            let mut bounds = meshopt::compute_cluster_bounds(&corners, &vertices);
            if clusters.is_two_sided(cluster) {
                // As the library says of a cluster without a cone.
                bounds.cone_axis = [0.0; 3];
                bounds.cone_cutoff = 1.0;
            }
            bounds
        });
        MeshoptCones {
            bounds: bounds.collect(),
        }
    }

    /// The test alone, one bool per cluster. `out` is overwritten.
    pub fn reject(&self, eye: Vec3, out: &mut Vec<bool>) {
        out.clear();
        out.extend(self.bounds.iter().map(|bounds| rejects(bounds, eye)));
    }
}

/// `dot(normalize(cone_apex - camera_position), cone_axis) >= cone_cutoff`.
#[inline(always)]
fn rejects(bounds: &meshopt::Bounds, eye: Vec3) -> bool {
    let way = Vec3::from(bounds.cone_apex) - eye;
    let unit = way * (1.0 / way.length());
    unit.dot(Vec3::from(bounds.cone_axis)) >= bounds.cone_cutoff
}

impl TriangleCull for MeshoptCones {
    fn cull(&self, view: &View, _: Kernel, kept: &mut Selection) {
        let eye = view.eye.nearest;
        if view.eye.weight == 0.0 {
            // `dot(view, cone_axis) >= cone_cutoff` for a parallel lens.
            for (bounds, word) in self.bounds.iter().zip(kept.words_mut()) {
                if (-eye).dot(Vec3::from(bounds.cone_axis)) >= bounds.cone_cutoff {
                    *word = 0;
                }
            }
            return;
        }
        for (bounds, word) in self.bounds.iter().zip(kept.words_mut()) {
            if rejects(bounds, eye) {
                *word = 0;
            }
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.bounds[..])
    }
}
