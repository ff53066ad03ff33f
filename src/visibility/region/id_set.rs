//! Ids of regions, and sets of ids.

use crate::query::Bits;

/// Id of a region: its index in the graph.
pub type RegionId = u32;

/// A set of ids below a bound, listed in ascending order.
#[derive(Clone, Default, PartialEq, Eq, Debug)]
pub struct IdSet {
    words: Vec<u64>,
}

impl IdSet {
    /// Makes it the empty set of ids below `bound`.
    pub fn clear(&mut self, bound: usize) {
        self.words.clear();
        self.words.resize(bound.div_ceil(64), 0);
    }

    /// Adds an id; returns `true` if it was not in the set.
    pub fn insert(&mut self, id: u32) -> bool {
        let (word, bit) = (&mut self.words[id as usize / 64], 1 << (id % 64));
        let fresh = *word & bit == 0;
        *word |= bit;
        fresh
    }

    /// Tests whether the id is in the set.
    pub fn holds(&self, id: u32) -> bool {
        self.words[id as usize / 64] >> (id % 64) & 1 != 0
    }

    /// Replaces `out` by the ids, ascending. O(bound / 64 + ids).
    pub fn list(&self, out: &mut Vec<u32>) {
        out.clear();
        for (first, &word) in (0u32..).step_by(64).zip(&self.words) {
            out.extend(Bits(word).map(|bit| first + bit));
        }
    }
}
