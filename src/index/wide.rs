//! The wide tree: sixteen children a node, no pointers, one block of 384 bytes
//! for each node and each leaf. It owns the layout and the traversal, level by
//! level; the order of the items is made next door (`block_order`), and the
//! tests of a block are the view's.

use std::cell::Cell;
use std::ops::ControlFlow;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::block_order::{BlockOrder, block_ordered};
use super::by_plane::ByPlane;
use super::frontier::{Frontier, Merger, NodeList, is_far, put_back, take};
use super::id_rows::IdRows;
use super::pass::{Layer, Level, Pass};
use super::{BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex, indexable};
use crate::geometry::{Aabb, BoxBlock, LANES};
use crate::kernel::{Isa, prefetch};
use crate::query::{Context, ItemId, QueryVolume, Recorder, Sink};
use crate::threads::share;

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
    ids: IdRows,
    /// Lowest level first.
    levels: Vec<Level>,
    /// Place of each item in tree order, made when first needed.
    place_of: Vec<u32>,
}

/// The memory of a traversal: frontiers, kept between queries.
#[derive(Default)]
struct Scratch {
    here: Frontier,
    below: Frontier,
    whole: NodeList,
    by_plane: ByPlane,
}

thread_local! {
    static SCRATCH: Cell<Option<Box<Scratch>>> = const { Cell::new(None) };
}

/// Blocks of items whose memory is asked for ahead while the tree is filled.
const GATHERED_AHEAD: usize = 2;

/// Leaves that are filled in one go, by one thread: whole parents of parents.
const SHARED_BLOCKS: usize = LANES * LANES;

/// Fills consecutive leaves, the first of which is number `first`, with the
/// boxes of their items.
fn fill(items: &[Aabb], ids: &[ItemId], first: usize, leaves: &mut [BoxBlock]) {
    let ids = &ids[first * LANES..];
    for (i, (block, here)) in leaves.iter_mut().zip(ids.chunks(LANES)).enumerate() {
        // The items lie all over memory.
        for &id in ids.iter().skip((i + GATHERED_AHEAD) * LANES).take(LANES) {
            prefetch(&items[id as usize].min);
            prefetch(&items[id as usize].max);
        }
        for (lane, &id) in here.iter().enumerate() {
            block.set(lane, &items[id as usize]);
        }
    }
}

/// Fills blocks with the bounds of the blocks below them.
fn unite(children: &[BoxBlock], parents: &mut [BoxBlock]) {
    for (parent, children) in parents.iter_mut().zip(children.chunks(LANES)) {
        for (lane, child) in children.iter().enumerate() {
            parent.set(lane, &child.union());
        }
    }
}

impl Wide {
    fn over(items: &[Aabb], ids: &[ItemId], threads: usize) -> Wide {
        let mut tree = Wide {
            ids: ids.into(),
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
        tree.blocks = vec![BoxBlock::EMPTY; total];
        let (leaves, inner) = tree.blocks.split_at_mut(tree.levels[0].blocks);
        // Blocks are united while they are still in the cache.
        let parents = inner.chunks_mut(SHARED_BLOCKS / LANES);
        let jobs = leaves
            .chunks_mut(SHARED_BLOCKS)
            .zip(parents.chain(std::iter::once(&mut [][..])));
        share(threads, jobs.enumerate(), |(i, (leaves, parents))| {
            fill(items, ids, i * SHARED_BLOCKS, leaves);
            unite(leaves, parents);
        });
        for level in 2..tree.levels.len() {
            let below = tree.levels[level - 1].first;
            let (children, parents) =
                tree.blocks[below..].split_at_mut(tree.levels[level - 1].blocks);
            unite(children, parents);
        }
        tree
    }

    /// [`RegionIndex::build`] on so many threads: the very same structure.
    ///
    /// # Errors
    /// As [`RegionIndex::build`].
    pub fn build_on(
        threads: usize,
        items: &[Aabb],
        params: &WideParams,
    ) -> Result<Wide, BuildError> {
        let ids = block_ordered(items, indexable(items)?, params.order, threads);
        Ok(Wide::over(items, &ids, threads))
    }

    /// Whether both are the same bit for bit: the ids, the blocks, the levels.
    pub fn same_as(&self, other: &Wide) -> bool {
        let depths = (self.depth(), other.depth());
        depths.0 == depths.1 && self.ids == other.ids && self.blocks == other.blocks
    }

    /// Levels of blocks; 0 for no items.
    pub fn depth(&self) -> usize {
        self.levels.len()
    }

    /// The ids of each leaf.
    #[inline(always)]
    pub(super) fn id_rows(&self) -> &[[ItemId; LANES]] {
        self.ids.rows()
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
            far: is_far(self.ids.len()),
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
    fn search<Q: QueryVolume, C: Context>(
        &self,
        volume: &Q,
        cx: &mut C,
        scratch: &mut Scratch,
    ) -> ControlFlow<()> {
        let Some(top) = self.levels.len().checked_sub(1) else {
            return ControlFlow::Continue(());
        };
        let isa = cx.isa();
        let (sink, recorder) = cx.parts();
        if volume.mask() == 0 {
            recorder.subtree_accepted(self.ids.len());
            return sink.accept_places(isa, &self.ids, 0..self.ids.len());
        }
        let Scratch {
            here,
            below,
            whole,
            by_plane,
        } = scratch;
        let (mut here, mut below) = (here, below);
        here.start(isa, volume.mask());
        let mut pass = Pass {
            ids: &self.ids,
            isa,
            volume,
            sink,
            recorder,
        };
        for height in (0..top).rev() {
            below.clear(here.len());
            let layer = self.layer(height + 1);
            if height == 0 {
                whole.clear(here.len());
                pass.sort_last_level(&layer, &self.layer(0), here, below, whole)?;
            } else {
                let mut run = Merger::default();
                pass.sort_level(&layer, here, below, &mut run)?;
                pass.hand_over(run.take())?;
            }
            std::mem::swap(&mut here, &mut below);
        }
        pass.test_leaves(&self.layer(0), here, by_plane)
    }

    /// Region search: from the root down, one block at a time.
    #[inline(always)]
    fn descend<I: Isa, S: Sink, R: Recorder>(
        &self,
        isa: I,
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
                recorder.nodes_tested(lanes.count_ones());
            }
            self.blocks[self.levels[level].first + block].holding(p) & lanes
        };
        let mut level = top;
        open[level] = (0, holding(level, 0, recorder));
        loop {
            let (block, left) = open[level];
            if level == 0 {
                sink.accept_lanes(isa, &self.ids, block * LANES, left)?;
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

    /// Bounds of the boxes of one block, as the lane above them holds them.
    fn fit(&mut self, level: usize, block: usize) {
        let bounds = self.blocks[self.levels[level].first + block].union();
        let above = self.levels[level + 1].first + block / LANES;
        self.blocks[above].set(block % LANES, &bounds);
    }
}

impl RegionIndex for Wide {
    const INFO: Info = Info::new(
        "wide",
        "16-ary implicit tree of blocks, level by level with plane masks and prefetch",
        Kind::Tree,
        Origin::Ours,
    )
    .refits()
    .ranges()
    .threaded_build();
    type Params = WideParams;

    /// O(n log n) by medians, O(n) but for the sort by Morton codes.
    fn build(input: &Input<'_>, params: &WideParams) -> Result<Self, BuildError> {
        Wide::build_on(input.threads(), input.items, params)
    }

    fn memory(&self) -> MemoryUsage {
        let leaves = self.levels.first().map_or(0, |l| l.blocks);
        MemoryUsage {
            node_bytes: (self.blocks.len() - leaves) * size_of::<BoxBlock>(),
            item_bytes: leaves * size_of::<BoxBlock>()
                + self.ids.bytes()
                + size_of_val(&self.place_of[..]),
        }
    }

    #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        if Q::IS_POINT {
            let isa = cx.isa();
            let (sink, recorder) = cx.parts();
            return match volume.as_point() {
                Some(p) => self.descend(isa, p, sink, recorder),
                None => ControlFlow::Continue(()),
            };
        }
        let mut scratch = take(&SCRATCH);
        let flow = self.search(volume, cx, &mut scratch);
        put_back(&SCRATCH, scratch);
        flow
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

    fn tree_order(&self) -> Option<&[ItemId]> {
        Some(&self.ids)
    }
}
