//! Item ids in rows of sixteen, a cache line each: the ids of one block of boxes
//! are read with one access to memory.

use std::ops::Deref;

use bytemuck::{Pod, Zeroable};

use crate::geometry::LANES;
use crate::query::ItemId;

#[derive(Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([ItemId; LANES]);

/// Ids, the last row of which is padded with zeros.
#[derive(Clone, Default, PartialEq)]
pub struct PaddedIds {
    lines: Vec<Line>,
    len: usize,
}

impl From<&[ItemId]> for PaddedIds {
    /// O(ids).
    fn from(ids: &[ItemId]) -> Self {
        let mut lines = vec![Line::zeroed(); ids.len().div_ceil(LANES)];
        bytemuck::cast_slice_mut(&mut lines)[..ids.len()].copy_from_slice(ids);
        PaddedIds {
            lines,
            len: ids.len(),
        }
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
