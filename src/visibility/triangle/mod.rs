//! Triangle stage: the triangles of the remaining items that may be visible.
//!
//! One file per back end, all of them in one table.

mod clusters;
mod cones;
mod exact;
mod per_triangle;

use std::sync::Arc;

use crate::kernel::{Kernel, LANES};
use crate::visibility::{Guarantee, Row};

pub use clusters::{Clusters, MOST_TRIANGLES};
pub use cones::{Cone, Cones};
pub use exact::{Eye, exact_normal, faces, normal};

/// All back ends of this stage.
pub const TRIANGLE_ROWS: &[TriangleRow] = rows! { TriangleRow { name, guarantee, summary, build }
    "per-triangle", Guarantee::Exact,
        "The side of each triangle's plane, exactly (f32, f64, then expansions)",
        |clusters| Box::new(per_triangle::PerTriangle::of(clusters));
    "cone-f32-safe", Guarantee::Conservative,
        "One normal cone per cluster, sixteen at a time, rounding proven; 28 B",
        |clusters| Box::new(Cones::of(clusters));
};

#[cfg(test)]
mod tests;

/// Set of triangles of clusters.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Selection {
    /// Words in blocks; those beyond the last cluster are zero.
    blocks: Vec<[u64; LANES]>,
    clusters: usize,
}

impl Selection {
    /// Set of all triangles.
    pub fn all(clusters: &Clusters) -> Selection {
        Selection::of_items(clusters, 0..clusters.of_item.len() as u32)
    }

    /// All triangles of these items, which the object stage left.
    pub fn of_items(clusters: &Clusters, items: impl IntoIterator<Item = u32>) -> Selection {
        let mut selection = Selection {
            blocks: vec![[0; LANES]; clusters.len().div_ceil(LANES)],
            clusters: clusters.len(),
        };
        let words = selection.words_mut();
        for item in items {
            for cluster in clusters.of_item[item as usize].clone() {
                words[cluster as usize] = clusters.word(cluster as usize);
            }
        }
        selection
    }

    /// One word per cluster; bit `i` is the `i`-th of [`Clusters::triangles_of`].
    pub fn words(&self) -> &[u64] {
        &self.blocks.as_flattened()[..self.clusters]
    }

    /// Mutable words, to remove triangles.
    ///
    /// Bits beyond the triangles of a cluster must stay zero.
    pub fn words_mut(&mut self) -> &mut [u64] {
        &mut self.blocks.as_flattened_mut()[..self.clusters]
    }

    /// Number of triangles in the set.
    pub fn triangles(&self) -> usize {
        let counts = self.words().iter().map(|word| word.count_ones() as usize);
        counts.sum()
    }

    /// Number of triangles that are not in another set.
    pub fn without(&self, other: &Selection) -> usize {
        let pairs = self.words().iter().zip(other.words());
        pairs.map(|(a, b)| (a & !b).count_ones() as usize).sum()
    }
}

/// Back end, built for certain clusters.
pub trait TriangleCull: Send + Sync {
    /// Removes triangles that cannot be visible from `kept`; adds none.
    ///
    /// The answer does not depend on the kernel.
    fn cull(&self, eye: &Eye, kernel: Kernel, kept: &mut Selection);
}

/// Row of the table of back ends.
pub type TriangleRow = Row<fn(&Arc<Clusters>) -> Box<dyn TriangleCull>>;

/// Truth of this stage: triangles of `candidates` that face the eye.
///
/// Includes all two-sided triangles. Exact; one predicate per triangle, without a shared structure.
pub fn facing(clusters: &Clusters, eye: &Eye, candidates: &Selection) -> Selection {
    let mut truth = candidates.clone();
    for (cluster, word) in truth.words_mut().iter_mut().enumerate() {
        *word = clusters.seen(eye, cluster, *word);
    }
    truth
}
