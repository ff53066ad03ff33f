//! The triangles that a stage takes and returns: a word per cluster, a bit per
//! triangle.

use super::clusters::Clusters;
use crate::kernel::LANES;

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
