//! A query on its way through the wide tree: one level as it is met, and what is
//! done with each of its blocks. In which order the levels and blocks come, and
//! for whom, is decided by the traversals.

use std::ops::{ControlFlow, Range};

use super::TreeOrder;
use super::frontier::{AHEAD, Frontier, Merger, hand_over};
use super::wide::{Level, Wide};
use crate::geometry::{ALL_ROWS, BoxBlock, LANES, LaneMask, PlaneMask};
use crate::kernel::{Isa, prefetch};
use crate::query::{Recorder, Sink, View, runs};

/// A level of so many blocks (192 KiB) is taken to lie in the cache nearest but
/// one to the processor; asking ahead for it costs more than it gains.
const NEAR: usize = 512;

/// One level as a traversal meets it.
pub struct Layer<'t> {
    pub blocks: &'t [BoxBlock],
    pub place: Level,
    /// Items below one lane.
    pub span: usize,
}

impl Layer<'_> {
    #[inline(always)]
    pub fn block(&self, at: usize) -> (&BoxBlock, LaneMask) {
        (&self.blocks[at], self.place.lanes(at))
    }

    /// The places of the items below some lanes of a block, run by run; there
    /// are `count` items in all.
    #[inline(always)]
    pub fn places_of(
        &self,
        at: usize,
        lanes: LaneMask,
        count: usize,
    ) -> impl Iterator<Item = Range<usize>> {
        let (first, span) = (at * LANES, self.span);
        runs(lanes).map(move |run| {
            let end = ((first + run.end) * span).min(count);
            (first + run.start) * span..end
        })
    }

    /// Asks for the memory of a block ahead of its turn.
    #[inline(always)]
    pub fn fetch(&self, block: u32) {
        if self.blocks.len() > NEAR
            && let Some(block) = self.blocks.get(block as usize)
        {
            block.prefetch();
        }
    }
}

/// A query on its way through the tree, block by block: what is done with a
/// block, in whatever order they come.
pub struct Pass<'a, I, V, S, R> {
    pub tree: &'a Wide,
    pub isa: I,
    pub view: &'a V,
    pub sink: &'a mut S,
    pub recorder: &'a mut R,
}

impl<I: Isa, V: View, S: Sink, R: Recorder> Pass<'_, I, V, S, R> {
    /// [`Pass::sort_block`] for all blocks of a frontier.
    #[inline(always)]
    pub fn sort_level(
        &mut self,
        layer: &Layer,
        here: &Frontier,
        below: &mut Frontier,
        run: &mut Merger,
    ) -> ControlFlow<()> {
        let (places, masks) = here.entries();
        for (i, (&at, &mask)) in places.iter().zip(masks).enumerate() {
            if let Some(&next) = places.get(i + AHEAD) {
                layer.fetch(next);
            }
            self.sort_block(layer, (at, mask), below, run)?;
        }
        ControlFlow::Continue(())
    }

    /// [`Pass::test_leaf`] for all leaves of a frontier.
    #[inline(always)]
    pub fn test_leaves(&mut self, leaves: &Layer, here: &Frontier) -> ControlFlow<()> {
        let (places, masks) = here.entries();
        for (i, (&at, &mask)) in places.iter().zip(masks).enumerate() {
            if let (Some(&next), Some(&mask)) = (places.get(i + AHEAD), masks.get(i + AHEAD)) {
                self.fetch_leaf(leaves, next, mask);
            }
            self.test_leaf(leaves, (at, mask))?;
        }
        ControlFlow::Continue(())
    }

    /// Sorts the lanes of a block: what is undecided goes to the frontier
    /// `below`, what is inside joins `run` or, if it cannot, takes its place.
    #[inline(always)]
    fn sort_block(
        &mut self,
        layer: &Layer,
        (at, mask): (u32, PlaneMask),
        below: &mut Frontier,
        run: &mut Merger,
    ) -> ControlFlow<()> {
        let at = at as usize;
        let lanes = layer.place.lanes(at);
        self.recorder.nodes_tested(lanes.count_ones());
        self.recorder
            .planes_tested(lanes.count_ones() * mask.count_ones());
        self.recorder.block_read(layer.place.first + at, ALL_ROWS);
        let (kept, open) = self.view.sorted_lanes(self.isa, &layer.blocks[at], mask);
        let kept = kept & lanes;
        self.recorder
            .subtrees_rejected((lanes & !kept).count_ones());
        let inside = self.isa.zeros(open) & kept;
        let undecided = kept & !inside;
        let first = at * LANES;
        below.push(self.isa, self.isa.counting(first as u32), open, undecided);
        for places in layer.places_of(at, inside, self.tree.ids().len()) {
            if let Some(ended) = run.join(places) {
                self.hand_over(ended)?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Hands over a run of items that are wholly inside.
    #[inline(always)]
    pub fn hand_over(&mut self, places: Range<usize>) -> ControlFlow<()> {
        let ids = self.tree.ids();
        hand_over(self.isa, places, ids, self.sink, self.recorder)
    }

    /// Asks for what [`Pass::test_leaf`] will read.
    #[inline(always)]
    fn fetch_leaf(&self, leaves: &Layer, at: u32, mask: PlaneMask) {
        if leaves.blocks.len() <= NEAR {
            return;
        }
        if let Some(block) = leaves.blocks.get(at as usize) {
            self.view.prefetch(block, mask);
        }
        if let Some(id) = self.tree.ids().get(at as usize * LANES) {
            prefetch(id);
        }
    }

    /// Hands over the items of a leaf that no open plane drops.
    #[inline(always)]
    fn test_leaf(&mut self, leaves: &Layer, (at, mask): (u32, PlaneMask)) -> ControlFlow<()> {
        let at = at as usize;
        let lanes = leaves.place.lanes(at);
        self.recorder.items_tested(lanes.count_ones());
        let tests = lanes.count_ones() * mask.count_ones();
        self.recorder.planes_tested(tests);
        let rows = self.view.rows_read(mask);
        self.recorder.block_read(leaves.place.first + at, rows);
        let kept = self.view.kept_lanes(self.isa, &leaves.blocks[at], mask) & lanes;
        let ids = self.tree.ids();
        self.sink.accept_lanes(self.isa, ids, at * LANES, kept)
    }
}
