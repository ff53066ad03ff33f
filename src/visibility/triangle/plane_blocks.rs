//! The planes of triangles, sixteen side by side: what tests of each triangle read.

use glam::Vec3;

use super::clusters::Clusters;
use crate::kernel::LANES;

/// Sixteen triangles: normal and corner.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub struct Planes {
    pub normal: [[f32; LANES]; 3],
    pub corner: [[f32; LANES]; 3],
}

/// The planes of clusters.
pub struct PlaneBlocks {
    /// Rows of each cluster; one more at the end. None for a two-sided one.
    starts: Vec<u32>,
    planes: Vec<Planes>,
}

impl PlaneBlocks {
    /// The normals of triangles as `normal` has them, `missing` in lanes without one. O(t).
    pub fn of(
        clusters: &Clusters,
        missing: f32,
        normal: impl Fn([Vec3; 3]) -> Option<Vec3>,
    ) -> PlaneBlocks {
        let empty = Planes {
            normal: [[missing; LANES]; 3],
            corner: [[0.0; LANES]; 3],
        };
        let mut blocks = PlaneBlocks {
            starts: vec![0],
            planes: Vec::new(),
        };
        for cluster in 0..clusters.len() {
            let first = blocks.planes.len();
            if !clusters.is_two_sided(cluster) {
                let rows = clusters.triangles_of(cluster).len().div_ceil(LANES);
                blocks.planes.resize(first + rows, empty);
                for (bit, corners) in clusters.corners_of(cluster).enumerate() {
                    let (row, lane) = (&mut blocks.planes[first + bit / LANES], bit % LANES);
                    let n = normal(corners).unwrap_or(Vec3::splat(missing));
                    for k in 0..3 {
                        row.normal[k][lane] = n[k];
                        row.corner[k][lane] = corners[0][k];
                    }
                }
            }
            blocks.starts.push(blocks.planes.len() as u32);
        }
        blocks
    }

    /// The rows of a cluster: none of a two-sided one.
    #[inline(always)]
    pub fn of_cluster(&self, cluster: usize) -> &[Planes] {
        &self.planes[self.starts[cluster] as usize..self.starts[cluster + 1] as usize]
    }
}
