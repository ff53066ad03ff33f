//! The wide tree: sixteen children a node, no pointers, one block of 384 bytes
//! for each node and each leaf. It owns the layout and the traversal, level by
//! level; the order of the items is made next door (`block_order`), and the
//! tests of a block are the view's.

use std::cell::Cell;
use std::ops::{ControlFlow, Range};

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::block_order::{BlockOrder, block_ordered};
use super::{BuildError, FrustumQuery, MemoryUsage, RegionIndex, TreeOrder, indexable};
use crate::geometry::{ALL_ROWS, Aabb, BoxBlock, LANES, LaneMask, PlaneMask, PlaneTree};
use crate::kernel::{BASELINE, Isa, prefetch};
use crate::query::{ItemId, NoRecorder, Ranges, Recorder, Region, Sink, View, runs};

/// Parameters: `wide:order=median`.
#[derive(Clone, Copy, Default, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WideParams {
    /// How items come into tree order: `median` or `morton`.
    pub order: BlockOrder,
}

/// Levels of a tree over 2^32 items.
const MOST_LEVELS: usize = 8;

/// An implicit tree of sixteen-fold blocks over items in tree order.
///
/// Level 0 are the items themselves, sixteen a block; lane `l` of block `b` on
/// level `k` bounds block `16 b + l` of level `k - 1`, and with it the items
/// from `(16 b + l) 16^k` on. 25.6 bytes of blocks and 4 of id an item.
#[derive(Default)]
pub struct Wide {
    blocks: Vec<BoxBlock>,
    /// Item ids in tree order.
    ids: Vec<ItemId>,
    /// Lowest level first.
    levels: Vec<Level>,
    /// Place of each item in tree order, made when first needed.
    place_of: Vec<u32>,
}

/// Where a level lies among the blocks.
#[derive(Clone, Copy, Debug)]
struct Level {
    first: usize,
    blocks: usize,
    /// Boxes in these blocks; only the last block has lanes without one.
    boxes: usize,
}

impl Level {
    /// The lanes of a block that hold a box.
    #[inline(always)]
    fn lanes(&self, block: usize) -> LaneMask {
        if block + 1 < self.blocks {
            LaneMask::MAX
        } else {
            LaneMask::MAX >> (self.blocks * LANES - self.boxes)
        }
    }
}

/// Blocks of one level that are still to be looked at, each with the planes
/// that its ancestors have left open.
#[derive(Default)]
pub(super) struct Frontier {
    /// Longer than what is used, so that sixteen lanes can always be stored.
    blocks: Vec<u32>,
    open: Vec<PlaneMask>,
    used: usize,
}

impl Frontier {
    /// Empties it and makes room for the children of so many blocks.
    pub(super) fn clear(&mut self, blocks: usize) {
        self.used = 0;
        let room = (blocks + 1) * LANES;
        if self.blocks.len() < room {
            self.blocks.resize(room, 0);
            self.open.resize(room, 0);
        }
    }

    /// The root alone, all planes of the mask open.
    #[inline(always)]
    pub(super) fn start<I: Isa>(&mut self, isa: I, mask: PlaneMask) {
        self.clear(1);
        self.push(isa, 0, isa.splat_word(mask), 1);
    }

    /// Adds those lanes of a block, whose first has the number `first`.
    #[inline(always)]
    pub(super) fn push<I: Isa>(&mut self, isa: I, first: u32, open: I::Words, lanes: LaneMask) {
        let places = (
            self.blocks[self.used..].first_chunk_mut(),
            self.open[self.used..].first_chunk_mut(),
        );
        if let (Some(blocks), Some(masks)) = places {
            isa.pack(blocks, isa.counting(first), lanes);
            isa.pack(masks, open, lanes);
            self.used += lanes.count_ones() as usize;
        }
    }

    #[inline(always)]
    pub(super) fn entries(&self) -> (&[u32], &[PlaneMask]) {
        (&self.blocks[..self.used], &self.open[..self.used])
    }
}

/// The memory of a traversal: two frontiers, kept between queries.
#[derive(Default)]
struct Scratch {
    here: Frontier,
    below: Frontier,
}

thread_local! {
    static SCRATCH: Cell<Option<Box<Scratch>>> = const { Cell::new(None) };
}

/// So many blocks ahead their memory is asked for: enough to hide a cache
/// miss, and not so many that lines are gone before their turn.
pub(super) const AHEAD: usize = 12;

/// Blocks of items whose memory is asked for ahead while the tree is filled.
const GATHERED_AHEAD: usize = 2;

impl Wide {
    fn over(items: &[Aabb], ids: Vec<ItemId>) -> Wide {
        let mut tree = Wide {
            ids,
            ..Wide::default()
        };
        let count = tree.ids.len();
        if count == 0 {
            return tree;
        }
        let mut boxes = count;
        loop {
            let blocks = boxes.div_ceil(LANES);
            let first = tree.levels.last().map_or(0, |l: &Level| l.first + l.blocks);
            tree.levels.push(Level {
                first,
                blocks,
                boxes,
            });
            if blocks == 1 {
                break;
            }
            boxes = blocks;
        }
        let total = tree.levels.iter().map(|l| l.blocks).sum();
        tree.blocks = Vec::with_capacity(total);
        for (i, ids) in tree.ids.chunks(LANES).enumerate() {
            // The items lie all over memory.
            let ahead = (i + GATHERED_AHEAD) * LANES;
            for &id in tree.ids.iter().skip(ahead).take(LANES) {
                prefetch(&items[id as usize].min);
                prefetch(&items[id as usize].max);
            }
            let mut block = BoxBlock::EMPTY;
            for (lane, &id) in ids.iter().enumerate() {
                block.set(lane, &items[id as usize]);
            }
            tree.blocks.push(block);
        }
        for level in 1..tree.levels.len() {
            let below = tree.levels[level - 1];
            for first in (0..below.blocks).step_by(LANES) {
                let mut block = BoxBlock::EMPTY;
                for (lane, child) in (first..below.blocks.min(first + LANES)).enumerate() {
                    block.set(lane, &tree.blocks[below.first + child].union());
                }
                tree.blocks.push(block);
            }
        }
        tree
    }

    /// Levels of blocks; 0 for no items.
    pub fn depth(&self) -> usize {
        self.levels.len()
    }

    /// All blocks, leaves first.
    #[inline(always)]
    pub(super) fn blocks(&self) -> &[BoxBlock] {
        &self.blocks
    }

    /// A level for a traversal, leaves first.
    #[inline(always)]
    pub(super) fn layer(&self, level: usize) -> Layer<'_> {
        let place = self.levels[level];
        Layer {
            blocks: &self.blocks[place.first..place.first + place.blocks],
            place,
            span: 1 << (level * LANES.ilog2() as usize),
        }
    }

    /// Hands every item that the view sees to the sink: level by level, runs of
    /// items that are wholly inside first, then what is left of the leaves.
    ///
    /// A block at a time: its children are sorted into outside, inside and
    /// undecided; what is undecided comes into the next level's frontier with
    /// the planes that are left. Level by level, so that the blocks to come are
    /// known and can be fetched ahead.
    #[inline(always)]
    fn search<I: Isa, V: View, S: Sink, R: Recorder>(
        &self,
        isa: I,
        view: &V,
        sink: &mut S,
        recorder: &mut R,
        scratch: &mut Scratch,
    ) -> ControlFlow<()> {
        let Scratch { here, below } = scratch;
        if self.levels.is_empty() {
            return ControlFlow::Continue(());
        }
        if view.mask() == 0 {
            recorder.subtree_accepted(self.ids.len());
            return sink.accept_places(isa, &self.ids, 0..self.ids.len());
        }
        here.start(isa, view.mask());
        let mut pass = Pass {
            tree: self,
            isa,
            view,
            sink,
            recorder,
        };
        for layer in (1..self.levels.len()).rev().map(|level| self.layer(level)) {
            below.clear(here.used);
            let mut run = 0..0;
            pass.sort_level(&layer, here, below, &mut run)?;
            pass.hand_over(run)?;
            std::mem::swap(here, below);
        }
        pass.test_leaves(&self.layer(0), here)
    }

    /// All of a query but its leaves: appends the runs that are wholly inside,
    /// in their order, and leaves behind the leaves that are undecided.
    pub(super) fn above_leaves<V: View>(&self, view: &V, runs: &mut Vec<Range<u32>>) -> Frontier {
        let (mut here, mut below) = (Frontier::default(), Frontier::default());
        here.start(BASELINE, view.mask());
        let mut pass = Pass {
            tree: self,
            isa: BASELINE,
            view,
            sink: &mut Ranges(runs),
            recorder: &mut NoRecorder,
        };
        for layer in (1..self.levels.len()).rev().map(|level| self.layer(level)) {
            below.clear(here.used);
            let mut run = 0..0;
            // This sink never breaks off.
            let _ = pass.sort_level(&layer, &here, &mut below, &mut run);
            let _ = pass.hand_over(run);
            std::mem::swap(&mut here, &mut below);
        }
        here
    }

    /// Bounds of the boxes of one block, as the lane above them holds them.
    fn fit(&mut self, level: usize, block: usize) {
        let bounds = self.blocks[self.levels[level].first + block].union();
        let above = self.levels[level + 1].first + block / LANES;
        self.blocks[above].set(block % LANES, &bounds);
    }
}

/// One level as a traversal meets it.
pub(super) struct Layer<'t> {
    blocks: &'t [BoxBlock],
    place: Level,
    /// Items below one lane.
    span: usize,
}

impl Layer<'_> {
    #[inline(always)]
    pub(super) fn block(&self, at: usize) -> (&BoxBlock, LaneMask) {
        (&self.blocks[at], self.place.lanes(at))
    }

    /// The places of the items below some lanes of a block, run by run; there
    /// are `count` items in all.
    #[inline(always)]
    pub(super) fn places_of(
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
    pub(super) fn fetch(&self, block: u32) {
        if let Some(block) = self.blocks.get(block as usize) {
            block.prefetch(ALL_ROWS);
        }
    }
}

/// A query on its way through the tree, block by block: what is done with a
/// block, in whatever order they come.
pub(super) struct Pass<'a, I, V, S, R> {
    pub tree: &'a Wide,
    pub isa: I,
    pub view: &'a V,
    pub sink: &'a mut S,
    pub recorder: &'a mut R,
}

impl<I: Isa, V: View, S: Sink, R: Recorder> Pass<'_, I, V, S, R> {
    /// [`Pass::sort_block`] for all blocks of a frontier.
    #[inline(always)]
    pub(super) fn sort_level(
        &mut self,
        layer: &Layer,
        here: &Frontier,
        below: &mut Frontier,
        run: &mut Range<usize>,
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
    pub(super) fn test_leaves(&mut self, leaves: &Layer, here: &Frontier) -> ControlFlow<()> {
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
        run: &mut Range<usize>,
    ) -> ControlFlow<()> {
        let at = at as usize;
        let lanes = layer.place.lanes(at);
        count_nodes(self.recorder, lanes, mask);
        self.recorder.block_read(layer.place.first + at, ALL_ROWS);
        let (kept, open) = self.view.sorted_lanes(self.isa, &layer.blocks[at], mask);
        let kept = kept & lanes;
        let inside = self.isa.zeros(open) & kept;
        let undecided = kept & !inside;
        let first = at * LANES;
        below.push(self.isa, first as u32, open, undecided);
        for places in layer.places_of(at, inside, self.tree.ids.len()) {
            if places.start == run.end {
                run.end = places.end;
            } else {
                self.hand_over(std::mem::replace(run, places))?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Hands over a run of items that are wholly inside.
    #[inline(always)]
    pub(super) fn hand_over(&mut self, places: Range<usize>) -> ControlFlow<()> {
        if places.is_empty() {
            return ControlFlow::Continue(());
        }
        self.recorder.subtree_accepted(places.len());
        self.sink.accept_places(self.isa, &self.tree.ids, places)
    }

    /// Asks for what [`Pass::test_leaf`] will read.
    #[inline(always)]
    fn fetch_leaf(&self, leaves: &Layer, at: u32, mask: PlaneMask) {
        if let Some(block) = leaves.blocks.get(at as usize) {
            block.prefetch(self.view.rows_read(mask));
        }
        if let Some(id) = self.tree.ids.get(at as usize * LANES) {
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
        let ids = &self.tree.ids;
        self.sink.accept_lanes(self.isa, ids, at * LANES, kept)
    }
}

/// Every lane with a box is a node that is classified.
#[inline(always)]
fn count_nodes<R: Recorder>(recorder: &mut R, lanes: LaneMask, mask: PlaneMask) {
    for _ in 0..lanes.count_ones() {
        recorder.node_tested();
    }
    recorder.planes_tested(lanes.count_ones() * mask.count_ones());
}

impl RegionIndex for Wide {
    const NAME: &'static str = "wide";
    const SUMMARY: &'static str =
        "16-ary implicit tree of blocks, level by level with plane masks and prefetch";
    type Params = WideParams;

    /// O(n log n) by medians, O(n) but for the sort by Morton codes.
    fn build(
        items: &[Aabb],
        _: Option<&PlaneTree>,
        params: &WideParams,
    ) -> Result<Self, BuildError> {
        let ids = block_ordered(items, indexable(items)?, params.order);
        Ok(Wide::over(items, ids))
    }

    fn memory(&self) -> MemoryUsage {
        let leaves = self.levels.first().map_or(0, |l| l.blocks);
        MemoryUsage {
            node_bytes: (self.blocks.len() - leaves) * size_of::<BoxBlock>(),
            item_bytes: leaves * size_of::<BoxBlock>()
                + size_of_val(&self.ids[..])
                + size_of_val(&self.place_of[..]),
        }
    }

    #[inline(always)]
    fn locate<S: Sink, R: Recorder>(
        &self,
        p: Vec3,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        // Depth first: at most one lane of each level is left open on a tiling.
        let Some(top) = self.levels.len().checked_sub(1) else {
            return ControlFlow::Continue(());
        };
        let mut open = [(0, 0); MOST_LEVELS];
        let holding = |level: usize, block: usize, recorder: &mut R| {
            let lanes = self.levels[level].lanes(block);
            if level == 0 {
                recorder.items_tested(lanes.count_ones());
            } else {
                count_nodes(recorder, lanes, 0);
            }
            p.admit_lanes(BASELINE, &self.blocks[self.levels[level].first + block], ()) & lanes
        };
        let mut level = top;
        open[level] = (0, holding(level, 0, recorder));
        loop {
            let (block, left) = open[level];
            if level == 0 {
                sink.accept_lanes(BASELINE, &self.ids, block * LANES, left)?;
            }
            if level == 0 || left == 0 {
                if level == top {
                    return ControlFlow::Continue(());
                }
                level += 1;
                continue;
            }
            open[level].1 &= left - 1;
            level -= 1;
            let child = block * LANES + left.trailing_zeros() as usize;
            open[level] = (child, holding(level, child, recorder));
        }
    }

    /// O(moved * depth).
    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        const ABSENT: u32 = u32::MAX;
        if self.place_of.len() != items.len() {
            self.place_of = vec![ABSENT; items.len()];
            for (place, &id) in self.ids.iter().enumerate() {
                self.place_of[id as usize] = place as u32;
            }
        }
        let stays =
            |&id: &ItemId| (self.place_of[id as usize] == ABSENT) == items[id as usize].is_empty();
        if !moved.iter().all(stays) {
            return false;
        }
        let places = moved.iter().map(|&id| (id, self.place_of[id as usize]));
        let mut touched: Vec<usize> = Vec::with_capacity(moved.len());
        for (id, place) in places.filter(|&(_, place)| place != ABSENT) {
            let place = place as usize;
            self.blocks[place / LANES].set(place % LANES, &items[id as usize]);
            touched.push(place / LANES);
        }
        for level in 0..self.levels.len().saturating_sub(1) {
            touched.sort_unstable();
            touched.dedup();
            for block in &mut touched {
                self.fit(level, *block);
                *block /= LANES;
            }
        }
        true
    }
}

impl FrustumQuery for Wide {
    #[inline(always)]
    fn visible<V: View, S: Sink, R: Recorder>(
        &self,
        view: &V,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        self.visible_by(BASELINE, view, sink, recorder)
    }

    #[inline(always)]
    fn visible_by<I: Isa, V: View, S: Sink, R: Recorder>(
        &self,
        isa: I,
        view: &V,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let mut scratch = SCRATCH.take().unwrap_or_default();
        let flow = self.search(isa, view, sink, recorder, &mut scratch);
        SCRATCH.set(Some(scratch));
        flow
    }
}

impl TreeOrder for Wide {
    fn ids(&self) -> &[ItemId] {
        &self.ids
    }
}
