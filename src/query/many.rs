//! Answers to many region searches at once.

use super::ItemId;
use crate::kernel::extend;

/// Answers as compressed rows: all ids, and the end of each point's ids.
#[derive(Clone, Default, PartialEq, Eq, Debug)]
pub struct Located {
    ids: Vec<ItemId>,
    /// End of each point's ids; they begin at the end of the point before.
    ends: Vec<usize>,
}

impl Located {
    /// Removes the answers and keeps the memory.
    pub fn clear(&mut self) {
        self.ids.clear();
        self.ends.clear();
    }

    /// Adds the answer of the next point: no ids if no item contains it.
    #[inline(always)]
    pub fn push(&mut self, ids: &[ItemId]) {
        match ids {
            // The usual case on a tiling: no call to copy four bytes.
            [id] => self.ids.push(*id),
            _ => extend(&mut self.ids, ids),
        }
        self.ends.push(self.ids.len());
    }

    /// Number of answered points.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Returns whether there is no answered point.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The ids of all points, point after point.
    pub fn ids(&self) -> &[ItemId] {
        &self.ids
    }

    /// The ids of a point.
    ///
    /// In the order of [`query`](crate::index::RegionIndex::query).
    ///
    /// # Panics
    /// If `point` is not below [`Located::len`].
    pub fn of(&self, point: usize) -> &[ItemId] {
        let first = point.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.ids[first..self.ends[point]]
    }

    /// The answers in the order of the points.
    pub fn iter(&self) -> impl Iterator<Item = &[ItemId]> {
        (0..self.len()).map(|point| self.of(point))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_end_where_they_should_and_may_be_empty() {
        let mut located = Located::default();
        for ids in [&[][..], &[5], &[], &[7, 3, 9], &[]] {
            located.push(ids);
        }
        assert_eq!(located.ids(), [5, 7, 3, 9]);
        let rows: Vec<&[ItemId]> = located.iter().collect();
        assert_eq!(rows, [&[][..], &[5], &[], &[7, 3, 9], &[]]);
        located.clear();
        assert!(located.is_empty() && located.ids().is_empty());
    }
}
