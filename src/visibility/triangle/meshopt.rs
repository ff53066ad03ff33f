//! The cones of the crate `meshopt` (Kapoulkine's meshoptimizer): bounds computed by
//! the library, tested as its header says, one cluster at a time.

use std::sync::Arc;

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::cone_f32::{PlainCone, cull_one_by_one};
use super::contract::{TriangleCull, TriangleRow};
use super::eye::Eye;
use super::selection::Selection;
use crate::kernel::Kernel;

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "meshopt",
    summary: "One cone per cluster: crate meshopt's bounds and documented test, scalar",
    guarantee: Guarantee::Unproven,
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
}

impl TriangleCull for MeshoptCones {
    fn cull(&self, eye: &Eye, _: Kernel, kept: &mut Selection) {
        let plain = |bounds: &meshopt::Bounds| PlainCone {
            apex: bounds.cone_apex.into(),
            axis: bounds.cone_axis.into(),
            cutoff: bounds.cone_cutoff,
        };
        cull_one_by_one(&self.bounds, plain, eye, kept);
    }
}
