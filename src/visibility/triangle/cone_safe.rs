//! One cone per cluster in f32, with a proven margin for rounding.

use std::sync::Arc;

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::cone_block::{ConeBlock, cull_clusters};
use super::contract::{TriangleCull, TriangleRow};
use super::eye::Eye;
use super::normal_cone::Cone;
use super::selection::Selection;
use crate::kernel::{Isa, Kernel, LANES, Work};

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "cone-f32-safe",
    summary: "One normal cone per cluster, sixteen at a time, rounding proven; 28 B",
    guarantee: Guarantee::Conservative,
    build: |clusters| Box::new(SafeCones::of(clusters)),
};

/// The cones of clusters.
#[derive(Clone, Debug)]
pub struct SafeCones {
    blocks: Vec<ConeBlock>,
}

impl SafeCones {
    /// One cone per cluster. O(t).
    pub fn of(clusters: &Arc<Clusters>) -> SafeCones {
        let mut blocks = vec![ConeBlock::EMPTY; clusters.len().div_ceil(LANES)];
        for (cluster, triangles) in clusters.one_sided() {
            if let Some(cone) = Cone::fit(&triangles) {
                blocks[cluster / LANES].set(cluster % LANES, &cone);
            }
        }
        SafeCones { blocks }
    }

    /// A lower bound of any test of these cones: reads all of them once. The value
    /// only keeps the compiler from leaving it out.
    pub fn read(&self, kernel: Kernel) -> u64 {
        kernel.run(Read(bytemuck::cast_slice(&self.blocks)))
    }
}

struct Read<'a>(&'a [[u64; 8]]);

impl Work for Read<'_> {
    type Output = u64;

    #[inline(always)]
    fn run<I: Isa>(self, _: I) -> u64 {
        let mut all = [0; 8];
        for line in self.0 {
            for (all, word) in all.iter_mut().zip(line) {
                *all ^= word;
            }
        }
        all.iter().fold(0, |all, word| all ^ word)
    }
}

impl TriangleCull for SafeCones {
    fn cull(&self, eye: &Eye, kernel: Kernel, kept: &mut Selection) {
        cull_clusters(&self.blocks, eye, kernel, kept);
    }
}
