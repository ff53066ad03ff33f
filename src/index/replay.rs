//! Oracle replay: what a query of the wide tree read and copied, done again
//! without a single decision. A bound that no traversal of the same blocks can
//! beat; nobody answers queries with it.

use std::ops::{ControlFlow, Range};

use super::RegionIndex;
use super::frontier::AHEAD;
use super::wide::Wide;
use crate::geometry::{BoxBlock, LANES, LaneMask, ROWS, RowMask};
use crate::kernel::{BASELINE, Isa, Kernel, Work, prefetch};
use crate::query::{ItemId, QueryContext, QueryVolume, Recorder, Sink, Tests};

/// A block with those of its rows that were read; if they are fewer than six,
/// some come twice.
type Read = (u32, [u8; ROWS]);

/// What one query read and handed over, in its own order.
#[derive(Clone, Default, PartialEq, Eq, Debug)]
pub struct Trace {
    reads: Vec<Read>,
    runs: Vec<Range<u32>>,
    /// What was handed over of the leaves: of so many that were wholly inside, then
    /// of those that were tested, which are the last of the reads.
    leaves: Vec<(u32, LaneMask)>,
    whole: usize,
}

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

struct TraceSink<'a> {
    runs: &'a mut Vec<Range<u32>>,
    leaves: &'a mut Vec<(u32, LaneMask)>,
}

impl Sink for TraceSink<'_> {
    fn accept(&mut self, _: &[ItemId]) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
    fn accept_places<I: Isa>(
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
        let _ = tree.query(
            volume,
            &mut QueryContext::new(BASELINE, &mut sink, &mut reads),
        );
        let leaves = tree.id_rows().len();
        let tested = trace.reads.iter().filter(|read| (read.0 as usize) < leaves);
        trace.whole = trace.leaves.len() - tested.count();
        trace
    }

    /// Reads what the query read and appends what it answered.
    pub fn replay(&self, tree: &Wide, out: &mut Vec<ItemId>) {
        Kernel::best().run(Replay {
            trace: self,
            blocks: tree.blocks(),
            ids: tree.id_rows().as_flattened(),
            id_rows: tree.id_rows(),
            out,
        });
    }
}

struct Replay<'a> {
    trace: &'a Trace,
    blocks: &'a [BoxBlock],
    ids: &'a [ItemId],
    id_rows: &'a [[ItemId; LANES]],
    out: &'a mut Vec<ItemId>,
}

/// Asks for what one read will want, if there is such a read.
#[inline(always)]
fn fetch(blocks: &[BoxBlock], reads: &[Read], i: usize) {
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
        (0..AHEAD).for_each(|i| fetch(self.blocks, above, i));
        for (i, (block, rows)) in above.iter().enumerate() {
            fetch(self.blocks, above, i + AHEAD);
            seen |= self.blocks[*block as usize].touch(isa, rows);
        }
        for run in runs {
            let places = run.start as usize..run.end as usize;
            let _ = self.out.accept_places(isa, self.ids, places);
        }
        for (reads, leaves) in [(&[][..], whole), (below, tested)] {
            let tests = TracedLeaves {
                blocks: self.blocks,
                reads,
                leaves,
                id_rows: self.id_rows,
                seen: &mut seen,
            };
            (0..AHEAD).for_each(|i| tests.fetch(i));
            let _ = self.out.accept_tested(isa, self.id_rows, tests);
        }
        std::hint::black_box(seen);
    }
}

/// Leaves of which it is known what they hold, read all the same if they have
/// been.
struct TracedLeaves<'a> {
    blocks: &'a [BoxBlock],
    reads: &'a [Read],
    leaves: &'a [(u32, LaneMask)],
    id_rows: &'a [[ItemId; LANES]],
    seen: &'a mut LaneMask,
}

impl TracedLeaves<'_> {
    #[inline(always)]
    fn fetch(&self, i: usize) {
        fetch(self.blocks, self.reads, i);
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
        self.fetch(i + AHEAD);
        if let Some((block, rows)) = self.reads.get(i) {
            *self.seen |= self.blocks[*block as usize].touch(isa, rows);
        }
        let (start, lanes) = self.leaves[i];
        (start as usize / LANES, lanes)
    }
}
