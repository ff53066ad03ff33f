//! Destinations of answers: lists, ranges, counts, closures.

use std::ops::{ControlFlow, Range};

use super::ItemId;
use crate::kernel::{Append, Isa, LANES, LaneMask, Piece, extend, extend_from_range};

/// Destination of answers. `Break` ends the query.
///
/// A structure passes slices: a subtree that is wholly inside is one call.
pub trait Sink {
    /// False if positions suffice: ids are neither gathered nor read.
    const READS_IDS: bool = true;

    /// Takes ids of answers, none of them twice in a query.
    fn accept(&mut self, ids: &[ItemId]) -> ControlFlow<()>;

    /// Takes the items `ids[places]`, by their positions in a structure's order.
    ///
    /// Same as `accept(&ids[places])`, for sinks that do not need the ids ([`Sink::READS_IDS`]).
    #[inline(always)]
    fn accept_range<I: Isa>(
        &mut self,
        _: I,
        ids: &[ItemId],
        places: Range<usize>,
    ) -> ControlFlow<()> {
        self.accept(&ids[places])
    }

    /// Takes the items at `start + lane` of all set lanes, lowest lane first.
    ///
    /// The default passes run by run.
    #[inline(always)]
    fn accept_lanes<I: Isa>(
        &mut self,
        isa: I,
        ids: &[ItemId],
        start: usize,
        lanes: LaneMask,
    ) -> ControlFlow<()> {
        for run in runs(lanes) {
            self.accept_range(isa, ids, start + run.start..start + run.end)?;
        }
        ControlFlow::Continue(())
    }

    /// Takes the answers of many blocks of items, in the order of the blocks.
    ///
    /// `ids` has a row per block. The default gathers some hundred ids for each call of `accept`; after a
    /// `Break` no further block is tested.
    fn accept_tested<I: Isa, T: Tests<I>>(
        &mut self,
        isa: I,
        ids: &[[ItemId; LANES]],
        tests: T,
    ) -> ControlFlow<()> {
        let sink = self;
        isa.run_outlined(Pass { sink, ids, tests })
    }
}

/// The answers of blocks, gathered and passed to a sink.
struct Pass<'a, S: ?Sized, T> {
    sink: &'a mut S,
    ids: &'a [[ItemId; LANES]],
    tests: T,
}

impl<I: Isa, S: Sink + ?Sized, T: Tests<I>> Piece<I> for Pass<'_, S, T> {
    type Output = ControlFlow<()>;

    #[inline(always)]
    fn run(self, isa: I) -> ControlFlow<()> {
        // By value: planes behind a reference would be read again for each block.
        let mut tests = self.tests;
        let (mut held, mut end) = ([0; HELD + LANES], 0);
        for i in 0..tests.count() {
            let (block, lanes) = tests.test(isa, i);
            if !S::READS_IDS {
                let ids = self.ids.as_flattened();
                self.sink.accept_lanes(isa, ids, block * LANES, lanes)?;
                continue;
            }
            if let Some(place) = held[end..].first_chunk_mut() {
                isa.compress(place, isa.words(&self.ids[block]), lanes);
            }
            end += lanes.count_ones() as usize;
            if end > HELD {
                self.sink.accept(&held[..end])?;
                end = 0;
            }
        }
        match end {
            0 => ControlFlow::Continue(()),
            _ => self.sink.accept(&held[..end]),
        }
    }
}

/// Ids that are gathered before a call; those of one more block may come on top.
const HELD: usize = 16 * LANES;

/// Blocks of items, tested one by one when the sink requests it.
pub trait Tests<I: Isa> {
    /// True if most blocks are expected to hold no answer: their ids are not read.
    const SPARSE: bool;

    /// Number of blocks.
    fn count(&self) -> usize;
    /// The index of the i-th block, and its lanes that are answers.
    fn test(&mut self, isa: I, i: usize) -> (usize, LaneMask);
}

/// The runs of set lanes, lowest first.
#[inline(always)]
pub fn runs(lanes: LaneMask) -> impl Iterator<Item = Range<usize>> {
    let mut left = u32::from(lanes);
    std::iter::from_fn(move || {
        if left == 0 {
            return None;
        }
        let from = left.trailing_zeros();
        let length = (!(left >> from)).trailing_zeros();
        left &= !(((1 << length) - 1) << from);
        Some(from as usize..(from + length) as usize)
    })
}

/// Collects all ids, in the structure's own order.
impl Sink for Vec<ItemId> {
    #[inline(always)]
    fn accept(&mut self, ids: &[ItemId]) -> ControlFlow<()> {
        match ids {
            // Frequent; a call to copy four bytes would cost more than the copy.
            [id] => self.push(*id),
            _ => extend(self, ids),
        }
        ControlFlow::Continue(())
    }

    /// Copies short runs inline: a call of memcpy would cost more.
    #[inline(always)]
    fn accept_range<I: Isa>(
        &mut self,
        _: I,
        ids: &[ItemId],
        places: Range<usize>,
    ) -> ControlFlow<()> {
        extend_from_range(self, ids, places);
        ControlFlow::Continue(())
    }

    /// Reads all sixteen ids and compresses those of the lanes.
    #[inline(always)]
    fn accept_lanes<I: Isa>(
        &mut self,
        isa: I,
        ids: &[ItemId],
        start: usize,
        lanes: LaneMask,
    ) -> ControlFlow<()> {
        if let Some(block) = ids.get(start..).and_then(|ids| ids.first_chunk()) {
            isa.append(self, block, lanes);
            return ControlFlow::Continue(());
        }
        for run in runs(lanes) {
            self.extend_from_slice(&ids[start + run.start..start + run.end]);
        }
        ControlFlow::Continue(())
    }

    /// Reserves room for all blocks at once.
    #[inline(always)]
    fn accept_tested<I: Isa, T: Tests<I>>(
        &mut self,
        isa: I,
        ids: &[[ItemId; LANES]],
        tests: T,
    ) -> ControlFlow<()> {
        let out = self;
        isa.run_outlined(Gather { out, ids, tests });
        ControlFlow::Continue(())
    }
}

/// The inner loop in which most of a query is spent.
struct Gather<'a, T> {
    out: &'a mut Vec<ItemId>,
    ids: &'a [[ItemId; LANES]],
    tests: T,
}

impl<I: Isa, T: Tests<I>> Piece<I> for Gather<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self, isa: I) {
        let mut tests = self.tests;
        let count = tests.count();
        let mut appender = I::Appender::onto(self.out, count * LANES);
        if !T::SPARSE || count <= FEW {
            for i in 0..count {
                let (block, lanes) = tests.test(isa, i);
                appender.push(isa, &self.ids[block], lanes);
            }
            return;
        }
        // All tests first, then the blocks with answers: a branch per block would be
        // unpredictable.
        let mut held = [0; TESTED_AHEAD];
        let mut blocks = [0; TESTED_AHEAD];
        let mut hits = [0; TESTED_AHEAD + LANES];
        for first in (0..count).step_by(TESTED_AHEAD) {
            let tested = TESTED_AHEAD.min(count - first);
            for i in 0..tested {
                let (block, lanes) = tests.test(isa, first + i);
                held[i] = u32::from(lanes);
                blocks[i] = block;
            }
            held[tested..].fill(0);
            let mut found = 0;
            let rows = &held.as_chunks().0[..tested.div_ceil(LANES)];
            for (i, row) in rows.iter().enumerate() {
                let some = !isa.equal(isa.words(row), 0);
                if let Some(place) = hits[found..].first_chunk_mut() {
                    isa.compress(place, isa.iota((i * LANES) as u32), some);
                }
                found += some.count_ones() as usize;
            }
            for &i in &hits[..found] {
                let (block, lanes) = (blocks[i as usize], held[i as usize]);
                appender.push(isa, &self.ids[block], lanes as LaneMask);
            }
        }
    }
}

/// Blocks that are tested before the first of them is copied, if most hold nothing.
const TESTED_AHEAD: usize = 16 * LANES;

/// Most blocks that are copied one by one; below, testing ahead would cost more.
const FEW: usize = 48;

/// Positions of the answers in the structure's own order.
///
/// Adjoining ranges are one. Only for structures that pass positions.
#[derive(Debug)]
pub struct Ranges<'a> {
    out: &'a mut Vec<Range<u32>>,
    /// Number of ranges in the list before the query.
    first: usize,
}

impl<'a> Ranges<'a> {
    /// A sink that appends to a list.
    #[inline(always)]
    pub fn onto(out: &'a mut Vec<Range<u32>>) -> Self {
        let first = out.len();
        Ranges { out, first }
    }
}

impl Sink for Ranges<'_> {
    const READS_IDS: bool = false;

    fn accept(&mut self, _: &[ItemId]) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    #[inline(always)]
    fn accept_range<I: Isa>(
        &mut self,
        _: I,
        _: &[ItemId],
        places: Range<usize>,
    ) -> ControlFlow<()> {
        let (start, end) = (places.start as u32, places.end as u32);
        match self.out[self.first..].last_mut() {
            Some(last) if last.end == start => last.end = end,
            _ => self.out.push(start..end),
        }
        ControlFlow::Continue(())
    }
}

/// Counts the answers without keeping them.
#[derive(Clone, Copy, Default, Debug)]
pub struct Count(pub u64);

impl Sink for Count {
    const READS_IDS: bool = false;

    #[inline(always)]
    fn accept(&mut self, ids: &[ItemId]) -> ControlFlow<()> {
        self.0 += ids.len() as u64;
        ControlFlow::Continue(())
    }

    #[inline(always)]
    fn accept_lanes<I: Isa>(
        &mut self,
        _: I,
        _: &[ItemId],
        _: usize,
        lanes: LaneMask,
    ) -> ControlFlow<()> {
        self.0 += u64::from(lanes.count_ones());
        ControlFlow::Continue(())
    }
}

/// A closure that gets ids of answers, slice by slice; `Break` ends the query.
impl<F: FnMut(&[ItemId]) -> ControlFlow<()>> Sink for F {
    #[inline(always)]
    fn accept(&mut self, ids: &[ItemId]) -> ControlFlow<()> {
        self(ids)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Plain;

    /// Blocks that are full; none may be tested after a buffer of them.
    struct Full;

    impl<I: Isa> Tests<I> for Full {
        const SPARSE: bool = false;

        fn count(&self) -> usize {
            1000
        }

        fn test(&mut self, _: I, i: usize) -> (usize, LaneMask) {
            assert!(i * LANES <= HELD, "tested after the end");
            (i, LaneMask::MAX)
        }
    }

    #[test]
    fn a_break_leaves_at_most_one_buffer_of_tests_in_vain() {
        let (ids, mut calls) = (vec![[7; LANES]; 1000], 0);
        let mut sink = |ids: &[ItemId]| {
            calls += 1;
            assert!(ids.len() <= HELD + LANES);
            ControlFlow::Break(())
        };
        let flow = sink.accept_tested(Plain, &ids, Full);
        assert!(flow.is_break() && calls == 1);
    }
}
