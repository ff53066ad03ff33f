//! The triangles that a stage takes and returns, a bit each in a word per cluster.
//!
//! With the contract of its back ends, and the truth that they are compared with.

use std::sync::Arc;

use super::clusters::Clusters;
use super::exact::Eye;
use crate::kernel::{Kernel, LANES};
use crate::visibility::Guarantee;

/// Some of the triangles of clusters.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Selection {
    /// Those beyond the last cluster are zero.
    blocks: Vec<[u64; LANES]>,
    clusters: usize,
}

impl Selection {
    /// All triangles.
    pub fn all(clusters: &Clusters) -> Selection {
        let mut selection = Selection::none(clusters);
        for (cluster, word) in selection.words_mut().iter_mut().enumerate() {
            *word = clusters.word(cluster);
        }
        selection
    }

    /// All triangles of these items: what the object stage left.
    pub fn of_items(clusters: &Clusters, items: impl IntoIterator<Item = u32>) -> Selection {
        let mut selection = Selection::none(clusters);
        let words = selection.words_mut();
        for item in items {
            for cluster in clusters.of_item[item as usize].clone() {
                words[cluster as usize] = clusters.word(cluster as usize);
            }
        }
        selection
    }

    fn none(clusters: &Clusters) -> Selection {
        let clusters = clusters.len();
        Selection {
            blocks: vec![[0; LANES]; clusters.div_ceil(LANES)],
            clusters,
        }
    }

    /// One word per cluster; bit `i` is the `i`-th of [`Clusters::triangles_of`].
    pub fn words(&self) -> &[u64] {
        &self.blocks.as_flattened()[..self.clusters]
    }

    /// The words, to remove triangles.
    ///
    /// Bits beyond the triangles of a cluster stay zero.
    pub fn words_mut(&mut self) -> &mut [u64] {
        &mut self.blocks.as_flattened_mut()[..self.clusters]
    }

    /// The words of sixteen clusters at a time.
    ///
    /// Those beyond the last cluster are zero and stay so.
    pub(super) fn blocks_mut(&mut self) -> &mut [[u64; LANES]] {
        &mut self.blocks
    }

    /// How many triangles there are.
    pub fn triangles(&self) -> usize {
        self.words()
            .iter()
            .map(|word| word.count_ones() as usize)
            .sum()
    }

    /// How many of these triangles are not in another selection.
    pub fn without(&self, other: &Selection) -> usize {
        let pairs = self.words().iter().zip(other.words());
        pairs.map(|(a, b)| (a & !b).count_ones() as usize).sum()
    }

    /// Keeps the triangles for which `keep(cluster, bit)` is true.
    #[inline(always)]
    pub fn retain(&mut self, mut keep: impl FnMut(usize, usize) -> bool) {
        for (cluster, word) in self.words_mut().iter_mut().enumerate() {
            let mut left = *word;
            while left != 0 {
                let bit = left.trailing_zeros() as usize;
                left &= left - 1;
                if !keep(cluster, bit) {
                    *word &= !(1 << bit);
                }
            }
        }
    }
}

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

/// The truth of this stage: triangles of `candidates` whose front the eye sees,
/// and all two-sided ones. Exact; one predicate per triangle, no shared structure.
pub fn facing(clusters: &Clusters, eye: &Eye, candidates: &Selection) -> Selection {
    let mut truth = candidates.clone();
    truth.retain(|cluster, bit| clusters.is_seen(eye, cluster, bit));
    truth
}

/// Triangles in and out of a stage.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
#[non_exhaustive]
pub struct Counts {
    /// Triangles that the stage was given.
    pub candidates: usize,
    /// Triangles that it delivered.
    pub delivered: usize,
    /// Triangles that it should have delivered.
    pub truth: usize,
    /// Delivered, but not in the truth.
    pub false_positives: usize,
    /// In the truth, but not delivered.
    pub false_negatives: usize,
}

impl Counts {
    /// Compares two selections of the same candidates.
    pub fn of(candidates: &Selection, delivered: &Selection, truth: &Selection) -> Counts {
        Counts {
            candidates: candidates.triangles(),
            delivered: delivered.triangles(),
            truth: truth.triangles(),
            false_positives: delivered.without(truth),
            false_negatives: truth.without(delivered),
        }
    }
}
