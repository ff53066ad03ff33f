//! Replay of a query of the wide tree: its reads and copies again, without a single
//! decision. A lower bound for every traversal of the same blocks; not an index.

use std::ops::{ControlFlow, Range};

use super::Wide;
use crate::geometry::{BoxBlock, LANES, LaneMask, ROWS, RowMask};
use crate::index::RegionIndex;
use crate::index::frontier::AHEAD;
use crate::kernel::{Isa, Kernel, Plain, Work, prefetch};
use crate::query::{ItemId, QueryContext, QueryVolume, Recorder, Sink, Tests};

/// A block with the rows that were read; of fewer than six rows, some are repeated.
type Read = (u32, [u8; ROWS]);

/// Reads and answers of one query, in its own order.
#[derive(Clone, Default, PartialEq, Eq, Debug)]
pub struct Trace {
    reads: Vec<Read>,
    runs: Vec<Range<u32>>,
    /// First position and answers of each leaf: leaves wholly inside come first, then
    /// the tested ones, which are the last of the reads.
    leaves: Vec<(u32, LaneMask)>,
    /// Number of leaves wholly inside.
    whole: usize,
}

/// Records the blocks that are read.
struct Reads<'a>(&'a mut Vec<Read>);

impl Recorder for Reads<'_> {
    fn block_read(&mut self, block: usize, rows: impl FnOnce() -> RowMask) {
        let rows = rows();
        let wanted = (0..ROWS as u8).filter(|row| rows >> row & 1 == 1);
        let mut wanted = wanted.cycle();
        let rows = std::array::from_fn(|_| wanted.next().unwrap_or(0));
        self.0.push((block as u32, rows));
    }
}

/// Records the positions of the answers.
struct TraceSink<'a> {
    runs: &'a mut Vec<Range<u32>>,
    leaves: &'a mut Vec<(u32, LaneMask)>,
}

impl Sink for TraceSink<'_> {
    fn accept(&mut self, _: &[ItemId]) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
    fn accept_range<I: Isa>(
        &mut self,
        _: I,
        _: &[ItemId],
        places: Range<usize>,
    ) -> ControlFlow<()> {
        self.runs.push(places.start as u32..places.end as u32);
        ControlFlow::Continue(())
    }
    fn accept_lanes<I: Isa>(
        &mut self,
        _: I,
        _: &[ItemId],
        start: usize,
        lanes: LaneMask,
    ) -> ControlFlow<()> {
        self.leaves.push((start as u32, lanes));
        ControlFlow::Continue(())
    }
}

impl Trace {
    /// Records one query.
    pub fn of<Q: QueryVolume>(tree: &Wide, volume: &Q) -> Trace {
        let mut trace = Trace::default();
        let mut sink = TraceSink {
            runs: &mut trace.runs,
            leaves: &mut trace.leaves,
        };
        let mut reads = Reads(&mut trace.reads);
        // This sink never breaks off.
        let _ = tree.query(volume, &mut QueryContext::new(Plain, &mut sink, &mut reads));
        let leaves = tree.id_rows().len();
        let tested = trace.reads.iter().filter(|read| (read.0 as usize) < leaves);
        trace.whole = trace.leaves.len() - tested.count();
        trace
    }

    /// Repeats the reads of the query and appends its answers.
    pub fn replay(&self, tree: &Wide, out: &mut Vec<ItemId>) {
        Kernel::best().run(Replay {
            trace: self,
            blocks: tree.blocks(),
            id_rows: tree.id_rows(),
            out,
        });
    }
}

struct Replay<'a> {
    trace: &'a Trace,
    blocks: &'a [BoxBlock],
    id_rows: &'a [[ItemId; LANES]],
    out: &'a mut Vec<ItemId>,
}

/// Prefetches the rows of the i-th read, if there is such a read.
#[inline(always)]
fn prefetch_read(blocks: &[BoxBlock], reads: &[Read], i: usize) {
    if let Some((block, rows)) = reads.get(i)
        && let Some(block) = blocks.get(*block as usize)
    {
        for &row in rows {
            block.prefetch_row(row.into());
        }
    }
}

impl Work for Replay<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Trace {
            reads,
            runs,
            leaves,
            whole,
        } = self.trace;
        let (whole, tested) = leaves.split_at(*whole);
        let (above, below) = reads.split_at(reads.len() - tested.len());
        let mut seen: LaneMask = 0;
        (0..AHEAD).for_each(|i| prefetch_read(self.blocks, above, i));
        for (i, (block, rows)) in above.iter().enumerate() {
            prefetch_read(self.blocks, above, i + AHEAD);
            seen |= self.blocks[*block as usize].touch(isa, rows);
        }
        for run in runs {
            let items = run.start as usize..run.end as usize;
            let ids = self.id_rows.as_flattened();
            let _ = self.out.accept_range(isa, ids, items);
        }
        for (reads, leaves) in [(&[][..], whole), (below, tested)] {
            let tests = TracedLeaves {
                blocks: self.blocks,
                reads,
                leaves,
                id_rows: self.id_rows,
                seen: &mut seen,
            };
            (0..AHEAD).for_each(|i| tests.prefetch(i));
            let _ = self.out.accept_tested(isa, self.id_rows, tests);
        }
        std::hint::black_box(seen);
    }
}

/// Leaves with known answers; those that the query read are read again.
struct TracedLeaves<'a> {
    blocks: &'a [BoxBlock],
    reads: &'a [Read],
    leaves: &'a [(u32, LaneMask)],
    id_rows: &'a [[ItemId; LANES]],
    seen: &'a mut LaneMask,
}

impl TracedLeaves<'_> {
    #[inline(always)]
    fn prefetch(&self, i: usize) {
        prefetch_read(self.blocks, self.reads, i);
        if let Some(&(next, _)) = self.leaves.get(i)
            && let Some(row) = self.id_rows.get(next as usize / LANES)
        {
            prefetch(row);
        }
    }
}

impl<I: Isa> Tests<I> for TracedLeaves<'_> {
    const SPARSE: bool = false;

    #[inline(always)]
    fn count(&self) -> usize {
        self.leaves.len()
    }

    #[inline(always)]
    fn test(&mut self, isa: I, i: usize) -> (usize, LaneMask) {
        self.prefetch(i + AHEAD);
        if let Some((block, rows)) = self.reads.get(i) {
            *self.seen |= self.blocks[*block as usize].touch(isa, rows);
        }
        let (start, lanes) = self.leaves[i];
        (start as usize / LANES, lanes)
    }
}
