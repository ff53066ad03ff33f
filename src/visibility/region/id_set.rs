//! Ids of regions, sets of ids, and lists of lists.

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
            let mut rest = word;
            while rest != 0 {
                out.push(first + rest.trailing_zeros());
                rest &= rest - 1;
            }
        }
    }
}

/// Lists that lie one behind the other.
#[derive(Clone, Debug)]
pub struct Csr<T> {
    /// Start of each list; one more at the end.
    starts: Vec<u32>,
    pub all: Vec<T>,
}

impl<T: Clone> Csr<T> {
    /// Joins lists. O(entries).
    pub fn of(lists: &[Vec<T>]) -> Csr<T> {
        let ends = lists.iter().scan(0, |end, list| {
            *end += list.len() as u32;
            Some(*end)
        });
        Csr {
            starts: std::iter::once(0).chain(ends).collect(),
            all: lists.concat(),
        }
    }

    /// Number of lists.
    pub fn count(&self) -> usize {
        self.starts.len() - 1
    }

    /// A list. O(1).
    #[inline]
    pub fn list(&self, at: u32) -> &[T] {
        let at = at as usize;
        &self.all[self.starts[at] as usize..self.starts[at + 1] as usize]
    }
}
