//! Non-empty items, which every structure holds: ids, records, positions.
//!
//! Records are for builds; positions and changed nodes for refits. A row of sixteen ids is one
//! cache line.

use std::ops::Deref;

use bytemuck::{Pod, Zeroable};

use super::BuildError;
use crate::geometry::{Aabb, LANES};
use crate::kernel::prefetch;
use crate::query::{Bits, ItemId};

/// Ids of all non-empty items, ascending, after a check of all bounds.
///
/// # Errors
/// An item with a NaN or infinite bound; more items than ids.
pub fn indexable(items: &[Aabb]) -> Result<Vec<ItemId>, BuildError> {
    // The top id is reserved as a mark of "none".
    let (count, most) = (items.len(), ItemId::MAX as usize - 1);
    if count > most {
        return Err(BuildError::TooManyItems { count, most });
    }
    // One pass over the items: large scenes do not fit the cache.
    let (mut count, mut all_finite) = (0, true);
    for b in items {
        count += usize::from(!b.is_empty());
        all_finite &= b.is_finite();
    }
    if !all_finite && let Some(item) = items.iter().position(|b| !b.is_finite()) {
        let bounds = items[item];
        return Err(BuildError::NonFiniteItem { item, bounds });
    }
    if count == items.len() {
        return Ok((0..count as ItemId).collect());
    }
    // The structure keeps this list, so it gets no spare capacity.
    let mut ids = Vec::with_capacity(count);
    let sound = items.iter().zip(0..).filter(|(b, _)| !b.is_empty());
    ids.extend(sound.map(|(_, id)| id));
    Ok(ids)
}

/// An item during a build: bounds and id together.
///
/// So a level of the build is one pass over memory.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Record {
    /// Bounds of the item.
    pub bounds: Aabb,
    /// Index of the item in the scene.
    pub id: ItemId,
}

impl Record {
    /// The items that a structure has to hold.
    ///
    /// # Errors
    /// The errors of [`indexable`].
    pub fn all(items: &[Aabb]) -> Result<Vec<Record>, BuildError> {
        let record = |id: ItemId| Record {
            bounds: items[id as usize],
            id,
        };
        Ok(indexable(items)?.into_iter().map(record).collect())
    }

    /// All boxes, numbered in their order.
    pub fn numbered(boxes: &[Aabb]) -> Vec<Record> {
        let records = boxes.iter().zip(0..);
        records.map(|(&bounds, id)| Record { bounds, id }).collect()
    }
}

/// Position of each item, computed at the first refit.
#[derive(Default)]
pub struct Positions(Vec<u32>);

/// Position of an item that is not held; also the id of a vacant lane.
pub const ABSENT: u32 = u32::MAX;

/// Distance of prefetches in a list of moved items.
pub const MOVED_AHEAD: usize = 24;

impl Positions {
    /// Computes the positions of the ids in `order`, at the first call. O(items), once.
    pub fn prepare<'a>(&mut self, order: impl IntoIterator<Item = &'a ItemId>, items: usize) {
        let is_first = self.0.is_empty();
        if self.0.len() < items {
            self.0.resize(items, ABSENT);
        }
        if is_first {
            for (&id, position) in order.into_iter().zip(0..) {
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

    /// Prefetches for the moved items after the i-th; returns one's position.
    ///
    /// Loads the position of the item [`MOVED_AHEAD`] ahead, which it returns, and prefetches the
    /// position and bounds of the one twice as far.
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

/// A set of numbers below a bound, ascending: ids, or nodes that changed.
#[derive(Clone, Default, PartialEq, Eq, Debug)]
pub struct IdSet(Vec<u64>);

/// The nodes whose bounds must be recomputed.
pub type Dirty = IdSet;

impl IdSet {
    /// The empty set, with room for `nodes` nodes.
    pub fn none(nodes: usize) -> IdSet {
        IdSet(vec![0; nodes.div_ceil(64)])
    }

    /// Empties the set and makes room for ids below `bound`.
    pub fn clear(&mut self, bound: usize) {
        self.0.clear();
        self.lengthen(bound);
    }

    /// Makes room for more nodes.
    pub fn lengthen(&mut self, nodes: usize) {
        self.0.resize(nodes.div_ceil(64), 0);
    }

    /// Adds a node; returns whether it was absent.
    #[inline(always)]
    pub fn mark(&mut self, node: usize) -> bool {
        let (word, bit) = (&mut self.0[node / 64], 1 << (node % 64));
        let is_new = *word & bit == 0;
        *word |= bit;
        is_new
    }

    /// Adds an id; returns `true` if it was not in the set.
    pub fn insert(&mut self, id: u32) -> bool {
        self.mark(id as usize)
    }

    /// Adds some ids.
    pub fn insert_all<'i>(&mut self, ids: impl IntoIterator<Item = &'i u32>) {
        ids.into_iter().for_each(|&id| _ = self.mark(id as usize));
    }

    /// Tests whether the id is in the set.
    pub fn holds(&self, id: u32) -> bool {
        self.0[id as usize / 64] >> (id % 64) & 1 != 0
    }

    /// Replaces `out` by the ids, ascending. O(bound / 64 + ids).
    pub fn list(&self, out: &mut Vec<u32>) {
        out.clear();
        for (first, &word) in (0u32..).step_by(64).zip(&self.0) {
            out.extend(Bits(word).map(|bit| first + bit));
        }
    }

    /// Number of words of 64 nodes.
    pub fn words(&self) -> usize {
        self.0.len()
    }

    /// Nodes of a word, ascending; none if the word does not exist.
    #[inline(always)]
    pub fn of_word(&self, word: usize) -> impl DoubleEndedIterator<Item = usize> + use<> {
        let bits = Bits(self.0.get(word).copied().unwrap_or(0));
        bits.map(move |bit| word * 64 + bit as usize)
    }
}

#[derive(Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([ItemId; LANES]);

/// Ids in rows of sixteen, the last row padded with zeros.
#[derive(Clone, Default, PartialEq)]
pub struct PaddedIds {
    lines: Vec<Line>,
    len: usize,
}

impl From<&[ItemId]> for PaddedIds {
    /// O(ids).
    fn from(ids: &[ItemId]) -> Self {
        let len = ids.len();
        let mut lines = vec![Line::zeroed(); len.div_ceil(LANES)];
        bytemuck::cast_slice_mut(&mut lines)[..len].copy_from_slice(ids);
        PaddedIds { lines, len }
    }
}

impl PaddedIds {
    /// Sixteen ids per row; zeros follow the last id.
    #[inline(always)]
    pub fn rows(&self) -> &[[ItemId; LANES]] {
        bytemuck::cast_slice(&self.lines)
    }

    /// Replaces the id at an index below the number of ids.
    #[inline(always)]
    pub fn set(&mut self, place: usize, id: ItemId) {
        self.lines[place / LANES].0[place % LANES] = id;
    }

    /// Appends an id.
    pub fn push(&mut self, id: ItemId) {
        if self.len.is_multiple_of(LANES) {
            self.lines.push(Line::zeroed());
        }
        self.len += 1;
        self.set(self.len - 1, id);
    }

    /// Removes the last id.
    pub fn pop(&mut self) -> Option<ItemId> {
        let last = *self.last()?;
        self.len -= 1;
        self.lines.truncate(self.len.div_ceil(LANES));
        Some(last)
    }

    /// Heap bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.lines[..])
    }
}

impl Deref for PaddedIds {
    type Target = [ItemId];

    #[inline(always)]
    fn deref(&self) -> &[ItemId] {
        &bytemuck::cast_slice(&self.lines)[..self.len]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_hold_the_ids_and_begin_cache_lines() {
        for len in [0, 1, 15, 16, 17, 40] {
            let ids: Vec<ItemId> = (7..7 + len).collect();
            let rows = PaddedIds::from(&ids[..]);
            assert_eq!(rows[..], ids);
            assert_eq!(rows.rows().len(), ids.len().div_ceil(LANES));
            assert!(rows.rows().as_flattened().starts_with(&ids));
            assert_eq!(rows.rows().as_ptr().align_offset(64), 0);
            assert_eq!(rows.bytes(), rows.rows().len() * 64);
        }
    }
}
