//! Numbers of regions, and sets of them.

/// Number of a region in its graph.
pub type RegionId = u32;

/// A set of numbers below a bound, listed in ascending order.
#[derive(Clone, Default, Debug)]
pub struct Marks {
    words: Vec<u64>,
}

impl Marks {
    /// The empty set of numbers below `bound`.
    pub fn clear(&mut self, bound: usize) {
        self.words.clear();
        self.words.resize(bound.div_ceil(64), 0);
    }

    /// Whether the number was not in it.
    pub fn insert(&mut self, number: u32) -> bool {
        let (word, bit) = (&mut self.words[number as usize / 64], 1 << (number % 64));
        let fresh = *word & bit == 0;
        *word |= bit;
        fresh
    }

    /// Whether the number is in it.
    pub fn holds(&self, number: u32) -> bool {
        self.words[number as usize / 64] >> (number % 64) & 1 != 0
    }

    /// Adds the numbers whose bits are set.
    pub fn insert_all(&mut self, set: &[u64]) {
        self.words
            .iter_mut()
            .zip(set)
            .for_each(|(word, more)| *word |= more);
    }

    /// Replaces `out` by the numbers, ascending.
    pub fn list(&self, out: &mut Vec<u32>) {
        out.clear();
        decode(&self.words, out);
    }
}

/// Appends the numbers of the set bits, ascending. O(words + bits).
pub fn decode(words: &[u64], out: &mut Vec<u32>) {
    for (first, &word) in (0u32..).step_by(64).zip(words) {
        let mut rest = word;
        while rest != 0 {
            out.push(first + rest.trailing_zeros());
            rest &= rest - 1;
        }
    }
}
