//! Answers to many region searches at once: their sink, and a collector.

use std::ops::ControlFlow;

use super::ItemId;
use crate::kernel::extend;

/// Destination of the answers to a batch of points.
///
/// One call for every point, in ascending order of the points, with all its ids in one
/// slice (empty if no item contains the point). `Break` ends the batch.
pub trait ManySink {
    /// Takes the answer of the point with this index in the batch.
    fn accept(&mut self, point: u32, ids: &[ItemId]) -> ControlFlow<()>;
}

/// Collects answers as compressed rows: all ids, and the end of each point's ids.
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

    /// The end of each point's ids in [`Located::ids`].
    pub fn ends(&self) -> &[usize] {
        &self.ends
    }

    /// The ids of a point, in the order of
    /// [`query`](crate::index::RegionIndex::query).
    ///
    /// # Panics
    /// No such point was answered.
    pub fn of(&self, point: usize) -> &[ItemId] {
        let first = point.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.ids[first..self.ends[point]]
    }

    /// The answers in the order of the points.
    pub fn iter(&self) -> impl Iterator<Item = &[ItemId]> {
        (0..self.len()).map(|point| self.of(point))
    }
}

impl ManySink for Located {
    #[inline(always)]
    fn accept(&mut self, point: u32, ids: &[ItemId]) -> ControlFlow<()> {
        debug_assert_eq!(point as usize, self.ends.len(), "every point, in order");
        match ids {
            // The usual case on a tiling, without a call to copy four bytes.
            [id] => self.ids.push(*id),
            _ => extend(&mut self.ids, ids),
        }
        self.ends.push(self.ids.len());
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_end_where_they_should_and_may_be_empty() {
        let mut located = Located::default();
        for (point, ids) in [&[][..], &[5], &[], &[7, 3, 9], &[]].iter().enumerate() {
            assert!(located.accept(point as u32, ids).is_continue());
        }
        assert_eq!(located.ends(), [0, 1, 1, 4, 4]);
        let rows: Vec<&[ItemId]> = located.iter().collect();
        assert_eq!(rows, [&[][..], &[5], &[], &[7, 3, 9], &[]]);
        located.clear();
        assert!(located.is_empty() && located.ids().is_empty());
    }
}
