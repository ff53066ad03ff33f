//! One level of a query of the wide tree.
//!
//! The test of its blocks, and of the leaves at the end.

use std::ops::{ControlFlow, Range};

use super::levels::Layer;
use super::single_plane_buckets::SinglePlaneBuckets;
use crate::geometry::{BoxBlock, LANES, LaneMask, PlaneMask};
use crate::index::frontier::{AHEAD, Frontier, Merger, NodeList, first_ahead, pass_run};
use crate::index::items::PaddedIds;
use crate::kernel::{Isa, pairs, prefetch};
use crate::query::{Context, ItemId, Planes, QueryVolume, Recorder, Sink, Tests};

/// A query in progress.
pub struct LevelTraversal<'a, V, C> {
    pub ids: &'a PaddedIds,
    /// The lanes of each leaf that hold an item.
    pub occupied: &'a [LaneMask],
    /// True if lanes before the last item hold none.
    pub has_vacant: bool,
    pub volume: &'a V,
    pub cx: &'a mut C,
}

impl<V: QueryVolume, C: Context> LevelTraversal<'_, V, C> {
    /// Sorts all blocks of a frontier.
    ///
    /// Straddling children go to the frontier `below`, runs of items wholly inside to the
    /// sink.
    #[inline(always)]
    pub fn sort_level(
        &mut self,
        layer: &Layer,
        here: &Frontier,
        below: &mut Frontier,
    ) -> ControlFlow<()> {
        let (blocks, masks) = here.entries();
        let mut run = Merger::default();
        for i in first_ahead(layer.far) {
            layer.prefetch(blocks, i);
        }
        for (i, (&block, &mask)) in pairs(blocks, masks).enumerate() {
            layer.prefetch(blocks, i + AHEAD);
            let inside = self.sort_lanes(layer, (block, mask), below);
            for items in layer.items_of(block as usize, inside, self.ids.len()) {
                if let Some(ended) = run.join(items) {
                    self.pass_run(ended)?;
                }
            }
        }
        self.pass_run(run.take())
    }

    /// [`LevelTraversal::sort_level`] for the level above the leaves.
    ///
    /// Leaves wholly inside are collected in `whole` and passed to the sink afterwards, one row of
    /// prefetched ids each. Run ends are unpredictable branches, so they are not tested.
    #[inline(always)]
    pub fn sort_last_level(
        &mut self,
        layer: &Layer,
        leaves: &Layer,
        here: &Frontier,
        below: &mut Frontier,
        whole: &mut NodeList,
    ) -> ControlFlow<()> {
        let isa = self.cx.isa();
        let (blocks, masks) = here.entries();
        for i in first_ahead(layer.far) {
            layer.prefetch(blocks, i);
        }
        for (i, (&block, &mask)) in pairs(blocks, masks).enumerate() {
            layer.prefetch(blocks, i + AHEAD);
            let inside = self.sort_lanes(layer, (block, mask), below);
            whole.push(isa, isa.iota(block * LANES as u32), inside);
        }
        if whole.entries().is_empty() {
            return ControlFlow::Continue(());
        }
        self.test_listed(leaves, whole.entries(), SamePlanes(WhollyInside, None))
    }

    /// Passes the items of a frontier's leaves that no open plane drops to the sink.
    ///
    /// If there are many leaves, those with a single open plane come first, plane by plane.
    #[inline(always)]
    pub fn test_leaves(
        &mut self,
        leaves: &Layer,
        here: &Frontier,
        buckets: &mut SinglePlaneBuckets,
    ) -> ControlFlow<()> {
        let isa = self.cx.isa();
        let mut rest = here;
        if here.len() >= WORTH_BUCKETS {
            buckets.distribute(isa, here);
            for (plane, bucket) in buckets.buckets.iter().enumerate() {
                let listed = bucket.entries();
                if listed.is_empty() {
                    continue;
                }
                let plane = plane as u32;
                let open = Some(V::planes_open(1 << plane));
                let test = SamePlanes(self.volume.one_plane(isa, plane), open);
                self.test_listed(leaves, listed, test)?;
            }
            rest = &buckets.rest;
        }
        let (listed, masks) = rest.entries();
        let volume = self.volume;
        self.test_listed(leaves, listed, OpenPlanes { volume, masks })
    }

    /// Tests listed leaves in order and passes their items to the sink.
    #[inline(always)]
    fn test_listed<T: LeafTest<C::Isa>>(
        &mut self,
        leaves: &Layer,
        listed: &[u32],
        test: T,
    ) -> ControlFlow<()> {
        let isa = self.cx.isa();
        let (sink, recorder) = self.cx.parts();
        let tests = ListedLeaves {
            leaves,
            listed,
            test,
            ids: self.ids.rows(),
            occupied: self.occupied,
            recorder,
        };
        for i in first_ahead(leaves.far) {
            tests.prefetch(i);
        }
        sink.accept_tested(isa, self.ids.rows(), tests)
    }

    /// Sorts the lanes of a block; returns those that are inside.
    ///
    /// Straddling lanes go to the frontier `below`.
    #[inline(always)]
    fn sort_lanes(
        &mut self,
        layer: &Layer,
        (block, mask): (u32, PlaneMask),
        below: &mut Frontier,
    ) -> LaneMask {
        let at = block as usize;
        let lanes = layer.level.lanes(at);
        let (isa, recorder) = (self.cx.isa(), self.cx.recorder());
        recorder.nodes_tested(lanes.count_ones());
        recorder.planes_tested(lanes.count_ones() * V::planes_open(mask));
        let (kept, open) = self.volume.sorted_lanes(isa, &layer.blocks[at], mask);
        let kept = kept & lanes;
        recorder.subtrees_rejected((lanes & !kept).count_ones());
        let inside = isa.equal(open, 0) & kept;
        let undecided = kept & !inside;
        let first = at * LANES;
        below.push(isa, isa.iota(first as u32), open, undecided);
        inside
    }

    /// Passes the items of a run of lanes, which starts with a leaf.
    #[inline(always)]
    pub fn pass_run(&mut self, items: Range<usize>) -> ControlFlow<()> {
        if self.has_vacant {
            let ids = self.ids.rows().as_flattened();
            let isa = self.cx.isa();
            let (sink, recorder) = self.cx.parts();
            for leaf in items.start / LANES..items.end.div_ceil(LANES) {
                let lanes = self.occupied[leaf];
                recorder.subtree_accepted(lanes.count_ones() as usize);
                if lanes != 0 {
                    sink.accept_lanes(isa, ids, leaf * LANES, lanes)?;
                }
            }
            return ControlFlow::Continue(());
        }
        pass_run(items, self.ids, self.cx)
    }
}

/// Fewest leaves for which buckets pay.
const WORTH_BUCKETS: usize = 48;

/// The open planes of each leaf of a list.
trait LeafTest<I: Isa> {
    /// Planes of a leaf.
    type Planes: Planes<I>;

    /// The planes that the i-th leaf is tested with.
    fn planes(&self, i: usize) -> Self::Planes;

    /// Number of these planes; `None` if the leaf is wholly inside.
    fn open(&self, i: usize) -> Option<u32>;
}

/// Leaves of a list, tested when the sink requests them.
struct ListedLeaves<'a, 't, T, R> {
    leaves: &'a Layer<'t>,
    listed: &'a [u32],
    test: T,
    ids: &'a [[ItemId; LANES]],
    occupied: &'a [LaneMask],
    recorder: &'a mut R,
}

impl<T, R> ListedLeaves<'_, '_, T, R> {
    /// Prefetches the i-th leaf and its ids, if there is such a leaf.
    #[inline(always)]
    fn prefetch<I: Isa>(&self, i: usize)
    where
        T: LeafTest<I>,
    {
        if let Some(&leaf) = self.listed.get(i)
            && let Some(block) = self.leaves.blocks.get(leaf as usize)
        {
            match self.leaves.balls {
                Some(balls) if T::Planes::SPHERES => balls.blocks[leaf as usize].prefetch(),
                _ => self.test.planes(i).prefetch(block),
            }
            if let Some(row) = self.ids.get(leaf as usize) {
                prefetch(row);
            }
        }
    }
}

impl<I: Isa, T: LeafTest<I>, R: Recorder> Tests<I> for ListedLeaves<'_, '_, T, R> {
    const SPARSE: bool = false;

    #[inline(always)]
    fn count(&self) -> usize {
        self.listed.len()
    }

    #[inline(always)]
    fn test(&mut self, isa: I, i: usize) -> (usize, LaneMask) {
        if self.leaves.far {
            self.prefetch(i + AHEAD);
        }
        let at = self.listed[i] as usize;
        let (planes, block) = (self.test.planes(i), &self.leaves.blocks[at]);
        let kept = match &self.leaves.balls {
            Some(balls) if T::Planes::SPHERES => planes.kept_balls(isa, balls, (at, block)),
            _ => planes.kept(isa, block),
        };
        let items = self.occupied[at].count_ones();
        match self.test.open(i) {
            Some(planes) => {
                self.recorder.items_tested(items);
                self.recorder.planes_tested(items * planes);
            }
            None => self.recorder.subtree_accepted(items as usize),
        }
        (at, kept & self.occupied[at])
    }
}

/// The same planes for all leaves, and their number.
struct SamePlanes<P>(P, Option<u32>);

impl<I: Isa, P: Planes<I>> LeafTest<I> for SamePlanes<P> {
    type Planes = P;

    #[inline(always)]
    fn planes(&self, _: usize) -> P {
        self.0
    }

    #[inline(always)]
    fn open(&self, _: usize) -> Option<u32> {
        self.1
    }
}

/// No planes: leaves are wholly inside.
#[derive(Clone, Copy)]
struct WhollyInside;

impl<I: Isa> Planes<I> for WhollyInside {
    #[inline(always)]
    fn kept(&self, _: I, _: &BoxBlock) -> LaneMask {
        LaneMask::MAX
    }

    #[inline(always)]
    fn prefetch(&self, _: &BoxBlock) {}
}

/// Open planes of each leaf.
struct OpenPlanes<'a, V> {
    volume: &'a V,
    masks: &'a [PlaneMask],
}

impl<'a, I: Isa, V: QueryVolume> LeafTest<I> for OpenPlanes<'a, V> {
    type Planes = (&'a V, PlaneMask);

    #[inline(always)]
    fn planes(&self, i: usize) -> (&'a V, PlaneMask) {
        (self.volume, self.masks[i])
    }

    #[inline(always)]
    fn open(&self, i: usize) -> Option<u32> {
        Some(V::planes_open(self.masks[i]))
    }
}
