//! The triangles that a stage takes and returns: a word per cluster, a bit per
//! triangle.

use super::clusters::Clusters;

/// Some of the triangles of clusters.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Selection {
    words: Vec<u64>,
}

impl Selection {
    /// All triangles.
    pub fn all(clusters: &Clusters) -> Selection {
        let words = (0..clusters.len()).map(|cluster| clusters.word(cluster));
        Selection {
            words: words.collect(),
        }
    }

    /// All triangles of these items: what the object stage left.
    pub fn of_items(clusters: &Clusters, items: impl IntoIterator<Item = u32>) -> Selection {
        let mut words = vec![0; clusters.len()];
        for item in items {
            for cluster in clusters.of_item[item as usize].clone() {
                words[cluster as usize] = clusters.word(cluster as usize);
            }
        }
        Selection { words }
    }

    /// One word per cluster; bit `i` is the `i`-th of [`Clusters::triangles_of`].
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// To take triangles away. Bits beyond the triangles of a cluster stay zero.
    pub fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }

    /// How many triangles there are.
    pub fn triangles(&self) -> usize {
        self.words
            .iter()
            .map(|word| word.count_ones() as usize)
            .sum()
    }

    /// How many of these triangles are not in another selection.
    pub fn without(&self, other: &Selection) -> usize {
        let pairs = self.words.iter().zip(&other.words);
        pairs.map(|(a, b)| (a & !b).count_ones() as usize).sum()
    }

    /// Keeps the triangles that a rule keeps: `(cluster, bit)`.
    #[inline(always)]
    pub fn retain(&mut self, mut keep: impl FnMut(usize, usize) -> bool) {
        for (cluster, word) in self.words.iter_mut().enumerate() {
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
