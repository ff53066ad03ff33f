//! Positions of items in the order of a structure, for structures that refit.

use crate::geometry::Aabb;
use crate::kernel::prefetch;
use crate::query::ItemId;

/// Position of each item, computed at the first refit.
#[derive(Default)]
pub struct Positions(Vec<u32>);

/// Position of an item that the structure does not hold; also the id of no item.
pub const ABSENT: u32 = u32::MAX;

/// Distance of prefetches in a list of moved items.
pub const MOVED_AHEAD: usize = 24;

impl Positions {
    /// Computes the positions of the ids in `order`, at the first call. O(items), once.
    pub fn prepare(&mut self, order: &[ItemId], items: usize) {
        let is_first = self.0.is_empty();
        if self.0.len() < items {
            self.0.resize(items, ABSENT);
        }
        if is_first {
            for (&id, position) in order.iter().zip(0..) {
                self.0[id as usize] = position;
            }
        }
    }

    /// Position of an item that the structure holds.
    #[inline(always)]
    pub fn of(&self, id: ItemId) -> Option<usize> {
        let position = self.0[id as usize];
        (position != ABSENT).then_some(position as usize)
    }

    /// Replaces the position of an item.
    #[inline(always)]
    pub fn set(&mut self, id: ItemId, position: u32) {
        self.0[id as usize] = position;
    }

    /// Prefetches positions and bounds of the moved item two distances ahead of the
    /// i-th; returns the position of the one a single distance ahead.
    #[inline(always)]
    pub fn ahead(&self, items: &[Aabb], moved: &[ItemId], i: usize) -> Option<usize> {
        if let Some(&id) = moved.get(i + 2 * MOVED_AHEAD)
            && let (Some(position), Some(b)) = (self.0.get(id as usize), items.get(id as usize))
        {
            prefetch(position);
            prefetch(&b.min);
            prefetch(&b.max);
        }
        self.of(*moved.get(i + MOVED_AHEAD)?)
    }

    /// Heap bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.0[..])
    }
}

/// Set of nodes whose bounds have changed, a bit each.
#[derive(Default)]
pub struct Dirty(Vec<u64>);

impl Dirty {
    /// None of `nodes` nodes.
    pub fn none(nodes: usize) -> Dirty {
        Dirty(vec![0; nodes.div_ceil(64)])
    }

    /// Adds a node; returns whether it is new.
    #[inline(always)]
    pub fn mark(&mut self, node: usize) -> bool {
        let (word, bit) = (&mut self.0[node / 64], 1 << (node % 64));
        let is_new = *word & bit == 0;
        *word |= bit;
        is_new
    }

    /// Number of words of 64 nodes.
    pub fn words(&self) -> usize {
        self.0.len()
    }

    /// Nodes of a word, ascending; none of a word that does not exist.
    #[inline(always)]
    pub fn of_word(&self, word: usize) -> impl DoubleEndedIterator<Item = usize> + use<> {
        Ones(self.0.get(word).copied().unwrap_or(0)).map(move |bit| word * 64 + bit)
    }
}

/// Indices of the bits of a word.
struct Ones(u64);

impl Iterator for Ones {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let bit = (self.0 != 0).then(|| self.0.trailing_zeros() as usize)?;
        self.0 &= self.0 - 1;
        Some(bit)
    }
}

impl DoubleEndedIterator for Ones {
    #[inline(always)]
    fn next_back(&mut self) -> Option<usize> {
        let bit = self.0.checked_ilog2()? as usize;
        self.0 &= !(1 << bit);
        Some(bit)
    }
}
