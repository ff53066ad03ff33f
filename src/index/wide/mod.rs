//! The wide tree: sixteen children per node, no pointers.
//!
//! One block of 384 bytes for each node and each leaf. Layout, construction, queries, refit.

mod auto;
mod block_order;
mod level_traversal;
mod levels;
mod moving;
mod refit;
mod single_plane_buckets;

use std::borrow::Cow;
use std::cell::Cell;
use std::ops::ControlFlow;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use self::block_order::{SHARED_POINTS, block_ordered};
use self::level_traversal::LevelTraversal;
use self::levels::{Layer, Level};
use self::single_plane_buckets::SinglePlaneBuckets;
use super::frontier::{Frontier, NodeList, is_far, pass_run, put_back, take};
use super::items::{ABSENT, PaddedIds, Positions, indexable};
use super::linear::seen_by;
use super::{BuildError, Info, Input, Kind, MemoryUsage, RegionIndex, TreeCell};
use crate::geometry::{Aabb, BallBlocks, BoxBlock, LANES, LaneMask};
use crate::kernel::prefetch;
use crate::query::{Bits, Containment, Context, ItemId, QueryVolume, Recorder, Sink};
use crate::threads::share;

pub use self::auto::{Auto, AutoParams};
pub use self::block_order::BlockOrder;
pub use self::moving::Moving;

/// Parameters: `wide:order=median`.
#[derive(Clone, Copy, Default, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WideParams {
    /// The order of the items: `median` or `morton`.
    pub order: BlockOrder,
}

/// Levels of a tree over 2^32 items.
const MOST_LEVELS: usize = 8;

/// An implicit tree of sixteen-fold blocks over items in tree order.
///
/// Level 0 holds the items, sixteen per block. Lane `l` of block `b` on level `k` bounds block
/// `16 b + l` of level `k - 1`, and with it the items from `(16 b + l) 16^k` on. Per item: 25.6
/// bytes of blocks, 4 of id, 0.13 of lanes.
#[derive(Default)]
pub struct Wide {
    blocks: Vec<BoxBlock>,
    /// The lanes of each leaf that hold an item.
    occupied: Vec<LaneMask>,
    /// Item ids in tree order.
    ids: PaddedIds,
    /// Lowest level first.
    levels: Vec<Level>,
    /// Lanes of leaves without an item; their id is [`ABSENT`].
    vacant: usize,
    /// Bounds of all items, or more.
    root: Aabb,
    positions: Positions,
    /// Spheres of the leaves, where the items are [spheres](Input::spheres).
    balls: Option<BallBlocks>,
}

/// The memory of a traversal: frontiers, kept between queries.
#[derive(Default)]
struct Scratch {
    here: Frontier,
    below: Frontier,
    whole: NodeList,
    buckets: SinglePlaneBuckets,
}

thread_local! {
    static SCRATCH: Cell<Option<Box<Scratch>>> = const { Cell::new(None) };
}

/// Distance of prefetches while leaves are filled, in blocks of items.
const FILL_AHEAD: usize = 2;

/// Leaves that one thread fills at a time: whole grandparents.
const SHARED_BLOCKS: usize = LANES * LANES;

/// Fills consecutive leaves, from leaf `first` on, with the boxes of their items.
fn fill(items: &[Aabb], ids: &[ItemId], first: usize, leaves: &mut [BoxBlock]) {
    let ids = &ids[first * LANES..];
    for (i, (block, here)) in leaves.iter_mut().zip(ids.chunks(LANES)).enumerate() {
        // Items are scattered over memory.
        for &id in ids.iter().skip((i + FILL_AHEAD) * LANES).take(LANES) {
            prefetch(&items[id as usize].min);
            prefetch(&items[id as usize].max);
        }
        for (lane, &id) in here.iter().enumerate() {
            block.set(lane, &items[id as usize]);
        }
    }
}

/// Items, an absent one in the box of the item before, and ids of the absent.
///
/// Without [`Input::come_and_go`] items are unchanged.
fn with_lanes<'a>(input: &Input<'a>) -> (Cow<'a, [Aabb]>, Vec<ItemId>) {
    let items = input.items;
    // The build refuses bounds that are not numbers.
    let is_gone = |b: &Aabb| input.come_and_go && b.is_empty() && b.is_finite();
    let ids = (0..).zip(items).filter(|(_, b)| is_gone(b));
    let gone: Vec<ItemId> = ids.map(|(id, _)| id).collect();
    match items.iter().find(|b| !b.is_empty()) {
        Some(mut last) if !gone.is_empty() => {
            let held = items.iter().map(|b| {
                last = if is_gone(b) { last } else { b };
                *last
            });
            (held.collect(), gone)
        }
        _ => (items.into(), Vec::new()),
    }
}

/// The lanes of a row that hold the id of an item.
fn occupied(row: &[ItemId]) -> LaneMask {
    let held = row.iter().enumerate().filter(|(_, id)| **id != ABSENT);
    held.fold(0, |lanes, (lane, _)| lanes | 1 << lane)
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
    /// A tree over ids, [`ABSENT`] for a vacant lane; all boxes are empty.
    fn unfilled(ids: &[ItemId]) -> Wide {
        let levels = Level::over(ids.len());
        Wide {
            blocks: vec![BoxBlock::EMPTY; levels.last().map_or(0, Level::end)],
            occupied: ids.chunks(LANES).map(occupied).collect(),
            ids: ids.into(),
            levels,
            vacant: ids.iter().filter(|&&id| id == ABSENT).count(),
            ..Wide::default()
        }
    }

    fn over(items: &[Aabb], ids: &[ItemId], threads: usize) -> Wide {
        let mut tree = Wide::unfilled(ids);
        if ids.is_empty() {
            return tree;
        }
        let (leaves, inner) = tree.blocks.split_at_mut(tree.levels[0].blocks);
        // Blocks are united while they are still in the cache.
        let parents = inner.chunks_mut(SHARED_BLOCKS / LANES);
        let jobs = leaves
            .chunks_mut(SHARED_BLOCKS)
            .zip(parents.chain(std::iter::once(&mut [][..])));
        let threads = threads.min(ids.len() / SHARED_POINTS);
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
        tree.root = tree.top();
        tree
    }

    /// Bounds of the highest block.
    fn top(&self) -> Aabb {
        self.blocks.last().map_or(Aabb::EMPTY, BoxBlock::union)
    }

    /// Compares two trees bit for bit: ids and blocks.
    pub fn same_as(&self, other: &Wide) -> bool {
        self.ids == other.ids && self.blocks == other.blocks
    }

    /// A level for a traversal; level 0 are the leaves.
    #[inline(always)]
    fn layer(&self, index: usize) -> Layer<'_> {
        let level = self.levels[index];
        Layer {
            blocks: &self.blocks[level.first..level.end()],
            level,
            span: 1 << (index * LANES.ilog2() as usize),
            far: is_far(self.ids.len()),
            balls: None,
        }
    }

    /// Passes every item that the volume sees to the sink, level by level.
    ///
    /// Runs of items wholly inside come first, then the tested items of leaves. Each block is
    /// sorted into outside, inside and straddling children; straddling ones go to the next level's
    /// frontier with their open planes. Level by level, the next blocks are known and can be
    /// prefetched.
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
        let leaves = Layer {
            balls: seen_by(self.balls.as_ref(), volume),
            ..self.layer(0)
        };
        let (mut here, mut below) = (&mut scratch.here, &mut scratch.below);
        let mut traversal = LevelTraversal {
            ids: &self.ids,
            occupied: &self.occupied,
            has_vacant: self.vacant > 0,
            volume,
            cx,
        };
        if volume.mask() == 0 {
            return traversal.pass_run(0..self.ids.len());
        }
        here.start(traversal.cx.isa(), volume.mask());
        for level in (1..=top).rev() {
            below.clear(here.len());
            let layer = self.layer(level);
            if level == 1 {
                let whole = &mut scratch.whole;
                whole.clear(here.len());
                traversal.sort_last_level(&layer, &leaves, here, below, whole)?;
            } else {
                traversal.sort_level(&layer, here, below)?;
            }
            std::mem::swap(&mut here, &mut below);
        }
        traversal.test_leaves(&leaves, here, &mut scratch.buckets)
    }

    /// Answers a query that the bounds of all items decide.
    ///
    /// Finds nothing or, without vacant lanes, everything, in the order of `ids`. `None` for a
    /// query that counts its work, which is that of blocks.
    #[inline(always)]
    fn query_root<Q: QueryVolume, C: Context>(
        &self,
        volume: &Q,
        ids: &PaddedIds,
        cx: &mut C,
    ) -> Option<ControlFlow<()>> {
        let is_counted = size_of::<C::Recorder>() > 0;
        match self.root_verdict(volume) {
            _ if is_counted => None,
            Containment::Outside => Some(ControlFlow::Continue(())),
            Containment::Inside if self.vacant == 0 => Some(pass_run(0..ids.len(), ids, cx)),
            _ => None,
        }
    }

    /// Classifies the root by the planes up to the first that does not contain it.
    // Not inlined, so that the loops of a query keep their registers.
    #[inline(never)]
    fn root_verdict<Q: QueryVolume>(&self, volume: &Q) -> Containment {
        let open = Bits(volume.mask().into()).find(|&plane| !volume.contains(plane, &self.root));
        match open {
            _ if self.vacant == self.ids.len() => Containment::Outside,
            None => Containment::Inside,
            Some(plane) if volume.excludes(plane, &self.root) => Containment::Outside,
            _ => Containment::Straddles,
        }
    }

    /// Region search: descends from the root, one block at a time.
    #[inline(always)]
    fn descend<C: Context>(&self, p: Vec3, cx: &mut C) -> ControlFlow<()> {
        let isa = cx.isa();
        let (sink, recorder) = cx.parts();
        // Depth first: on a tiling at most one lane of each level stays open.
        let Some(top) = self.levels.len().checked_sub(1) else {
            return ControlFlow::Continue(());
        };
        let mut open = [(0, 0); MOST_LEVELS];
        let (mut level, mut block) = (top, 0);
        loop {
            // One code path for all levels, inlined once and compiled for the instruction set.
            let lanes = if level == 0 {
                recorder.items_tested(self.occupied[block].count_ones());
                self.occupied[block]
            } else {
                let lanes = self.levels[level].lanes(block);
                recorder.nodes_tested(lanes.count_ones());
                lanes
            };
            let held = self.blocks[self.levels[level].first + block].holding(p) & lanes;
            open[level] = (block, held);
            if level == 0 {
                sink.accept_lanes(isa, &self.ids, block * LANES, held)?;
                open[0].1 = 0;
            }
            while open[level].1 == 0 {
                if level == top {
                    return ControlFlow::Continue(());
                }
                level += 1;
            }
            let (parent, left) = open[level];
            open[level].1 &= left - 1;
            level -= 1;
            block = parent * LANES + left.trailing_zeros() as usize;
        }
    }

    /// Adds a cell per lane of a block above the leaves, parents first.
    fn add_cells<'a>(&'a self, level: usize, block: usize, cells: &mut Vec<TreeCell<'a>>) {
        let Level { first, boxes, .. } = self.levels[level];
        if level == 0 {
            return;
        }
        for lane in block * LANES..boxes.min((block + 1) * LANES) {
            let items = match level {
                1 => &self.ids[lane * LANES..self.ids.len().min((lane + 1) * LANES)],
                _ => &[],
            };
            cells.push(TreeCell {
                level: (self.levels.len() - 1 - level) as u32,
                bounds: self.blocks[first + block].get(lane % LANES),
                half_space: None,
                items,
            });
            self.add_cells(level - 1, lane, cells);
        }
    }
}

impl RegionIndex for Wide {
    const INFO: Info = Info::ours(
        "wide",
        "16-ary implicit tree of blocks, level by level with plane masks and prefetch",
        Kind::Tree,
    )
    .refits()
    .ranges()
    .threaded_build();
    type Params = WideParams;

    /// O(n log n) by medians; O(n) and a sort by Morton codes.
    fn build(input: &Input<'_>, params: &WideParams) -> Result<Self, BuildError> {
        let threads = input.threads();
        let (items, gone) = with_lanes(input);
        let ids = block_ordered(&items, indexable(&items)?, params.order, threads);
        let cubes = || BallBlocks::of(ids.iter().map(|&id| items[id as usize]));
        let mut tree = Wide {
            balls: input.spheres.then(cubes),
            ..Wide::over(&items, &ids, threads)
        };
        if !gone.is_empty() {
            tree.take_over(input.items, &gone);
        }
        Ok(tree)
    }

    fn memory(&self) -> MemoryUsage {
        let leaves = self.occupied.len();
        MemoryUsage {
            node_bytes: (self.blocks.len() - leaves) * size_of::<BoxBlock>(),
            item_bytes: leaves * size_of::<BoxBlock>()
                + size_of_val(&self.occupied[..])
                + self.ids.bytes()
                + self.positions.bytes()
                + self.balls.as_ref().map_or(0, BallBlocks::bytes),
        }
    }

    #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        if Q::IS_POINT {
            return match volume.as_point() {
                Some(p) => self.descend(p, cx),
                None => ControlFlow::Continue(()),
            };
        }
        if let Some(flow) = self.query_root(volume, &self.ids, cx) {
            return flow;
        }
        let mut scratch = take(&SCRATCH);
        let flow = self.search(volume, cx, &mut scratch);
        put_back(&SCRATCH, scratch);
        flow
    }

    /// O(moved * depth). Items of the build may become empty and reappear.
    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        self.take_over(items, moved)
    }

    fn cells(&self) -> Vec<TreeCell<'_>> {
        let mut cells = Vec::new();
        // The slices of a cell cannot skip vacant lanes.
        if let Some(top) = self.levels.len().checked_sub(1)
            && self.vacant == 0
        {
            self.add_cells(top, 0, &mut cells);
        }
        cells
    }

    fn tree_order(&self) -> Option<&[ItemId]> {
        Some(&self.ids)
    }
}
