//! Answers to many region searches at once: the sink that takes them point by
//! point, and the collector that keeps them in two flat lists. How a structure
//! overlaps the searches is its own business.

use std::ops::ControlFlow;

use super::ItemId;
use crate::kernel::extend;

/// Where the answers to a batch of points go: one call for every point, in
/// ascending order of the points, with all its ids in one slice (empty where
/// nothing holds the point). `Break` ends the batch.
pub trait ManySink {
    /// Takes the answer of the point with this index in the batch.
    fn accept(&mut self, point: u32, ids: &[ItemId]) -> ControlFlow<()>;

    /// The answers to several points at once, the first of them `first`: all
    /// their ids, and for each point where its own end. By default, one call of
    /// [`ManySink::accept`] a point.
    #[inline(always)]
    fn accept_rows(&mut self, first: u32, ids: &[ItemId], ends: &[u32]) -> ControlFlow<()> {
        let mut from = 0;
        for (&end, point) in ends.iter().zip(first..) {
            self.accept(point, &ids[from..end as usize])?;
            from = end as usize;
        }
        ControlFlow::Continue(())
    }
}

/// Collects the answers as compressed rows: all ids in one list, point after
/// point, and where each point's ids end.
#[derive(Clone, Default, PartialEq, Eq, Debug)]
pub struct Located {
    ids: Vec<ItemId>,
    /// Per point; a point's ids begin where those of the one before it end.
    ends: Vec<usize>,
}

impl Located {
    /// Forgets the answers and keeps the memory.
    pub fn clear(&mut self) {
        self.ids.clear();
        self.ends.clear();
    }

    /// Number of points that were answered.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether no point was answered.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The ids of all points, point after point.
    pub fn ids(&self) -> &[ItemId] {
        &self.ids
    }

    /// For each point where its ids end in [`Located::ids`].
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
            // On a tiling nearly all: no call to copy four bytes.
            [id] => self.ids.push(*id),
            _ => extend(&mut self.ids, ids),
        }
        self.ends.push(self.ids.len());
        ControlFlow::Continue(())
    }

    #[inline(always)]
    fn accept_rows(&mut self, first: u32, ids: &[ItemId], ends: &[u32]) -> ControlFlow<()> {
        debug_assert_eq!(first as usize, self.ends.len(), "every point, in order");
        let before = self.ids.len();
        self.ids.extend_from_slice(ids);
        self.ends
            .extend(ends.iter().map(|&end| before + end as usize));
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Leaves rows to the default.
    struct OneByOne(Located);

    impl ManySink for OneByOne {
        fn accept(&mut self, point: u32, ids: &[ItemId]) -> ControlFlow<()> {
            self.0.accept(point, ids)
        }
    }

    #[test]
    fn rows_end_where_they_should_and_may_be_empty() {
        let mut located = Located::default();
        for (point, ids) in [&[][..], &[5], &[], &[7, 3, 9], &[]].iter().enumerate() {
            assert!(located.accept(point as u32, ids).is_continue());
        }
        assert_eq!(located.ends(), [0, 1, 1, 4, 4]);
        let rows: Vec<&[ItemId]> = located.iter().collect();
        assert_eq!(rows, [&[][..], &[5], &[], &[7, 3, 9], &[]]);
        let rows = located.clone();
        located.clear();
        assert!(located.accept_rows(0, &[5], &[0, 1]).is_continue());
        assert!(located.accept_rows(2, &[7, 3, 9], &[0, 3, 3]).is_continue());
        assert_eq!(located, rows);
        let mut one_by_one = OneByOne(Located::default());
        assert!(one_by_one.accept_rows(0, &[5], &[0, 1]).is_continue());
        assert!(
            one_by_one
                .accept_rows(2, &[7, 3, 9], &[0, 3, 3])
                .is_continue()
        );
        assert_eq!(one_by_one.0, rows);
        located.clear();
        assert!(located.is_empty() && located.ids().is_empty());
    }
}
