//! One level of a query of the wide tree: the test of its blocks, and of the leaves
//! at the end.

use std::ops::{ControlFlow, Range};

use super::levels::Layer;
use super::single_plane_buckets::{BUCKETS, SinglePlaneBuckets};
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
    /// Sorts all blocks of a frontier: straddling children go to the frontier
    /// `below`, runs of items wholly inside to the sink.
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

    /// [`LevelTraversal::sort_level`] for the level above the leaves: leaves wholly
    /// inside are collected in `whole` and passed to the sink afterwards, a row of
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
        self.test_listed(leaves, whole.entries(), WhollyInside)
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
            for plane in 0..BUCKETS {
                let listed = buckets.bucket(plane);
                if listed.is_empty() {
                    continue;
                }
                let plane = plane as u32;
                let test = SinglePlane {
                    volume: self.volume,
                    plane: self.volume.one_plane(isa, plane),
                    mask: 1 << plane,
                };
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

    /// Sorts the lanes of a block: straddling ones go to the frontier `below`; returns
    /// the lanes that are inside.
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
        let inside = isa.zeros(open) & kept;
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

/// Fewest leaves that are distributed over buckets.
const WORTH_BUCKETS: usize = 48;

/// The test of one leaf after another: its index in the list, and its block.
trait LeafTest<I: Isa> {
    /// True if the test reads spheres where there are any.
    const SPHERES: bool = false;

    /// Prefetches the rows of the i-th leaf that its test reads.
    fn prefetch(&self, block: &BoxBlock, i: usize);

    /// The lanes of a leaf that are answers, if they hold an item.
    fn kept(&self, isa: I, leaves: &Layer, leaf: (usize, usize)) -> LaneMask;

    /// Records the test of the i-th leaf, which holds `items` items.
    fn record<R: Recorder>(&self, recorder: &mut R, i: usize, items: u32);
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
                Some(balls) if T::SPHERES => balls.blocks[leaf as usize].prefetch(),
                _ => self.test.prefetch(block, i),
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
        let kept = self.test.kept(isa, self.leaves, (i, at));
        let items = self.occupied[at];
        self.test.record(self.recorder, i, items.count_ones());
        (at, kept & items)
    }
}

/// Records the test of a leaf against the planes of a mask.
#[inline(always)]
fn record<V: QueryVolume, R: Recorder>(recorder: &mut R, _: &V, mask: PlaneMask, items: u32) {
    recorder.items_tested(items);
    recorder.planes_tested(items * V::planes_open(mask));
}

/// Nothing to test: the leaves are wholly inside.
struct WhollyInside;

impl<I: Isa> LeafTest<I> for WhollyInside {
    #[inline(always)]
    fn prefetch(&self, _: &BoxBlock, _: usize) {}

    #[inline(always)]
    fn kept(&self, _: I, _: &Layer, _: (usize, usize)) -> LaneMask {
        LaneMask::MAX
    }

    #[inline(always)]
    fn record<R: Recorder>(&self, recorder: &mut R, _: usize, items: u32) {
        recorder.subtree_accepted(items as usize);
    }
}

/// The same single plane for all leaves.
struct SinglePlane<'a, V, P> {
    volume: &'a V,
    plane: P,
    mask: PlaneMask,
}

impl<I: Isa, V: QueryVolume, P: Planes<I>> LeafTest<I> for SinglePlane<'_, V, P> {
    const SPHERES: bool = V::SPHERES;

    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock, _: usize) {
        self.plane.prefetch(block);
    }

    #[inline(always)]
    fn kept(&self, isa: I, leaves: &Layer, (_, at): (usize, usize)) -> LaneMask {
        match &leaves.balls {
            Some(balls) if V::SPHERES => {
                (self.plane).kept_balls(isa, balls, (at, &leaves.blocks[at]))
            }
            _ => self.plane.kept(isa, &leaves.blocks[at]),
        }
    }

    #[inline(always)]
    fn record<R: Recorder>(&self, recorder: &mut R, _: usize, items: u32) {
        record(recorder, self.volume, self.mask, items);
    }
}

/// Open planes of each leaf.
struct OpenPlanes<'a, V> {
    volume: &'a V,
    masks: &'a [PlaneMask],
}

impl<I: Isa, V: QueryVolume> LeafTest<I> for OpenPlanes<'_, V> {
    const SPHERES: bool = V::SPHERES;

    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock, i: usize) {
        self.volume.prefetch(block, self.masks[i]);
    }

    #[inline(always)]
    fn kept(&self, isa: I, leaves: &Layer, (i, at): (usize, usize)) -> LaneMask {
        let mask = self.masks[i];
        let block = (at, &leaves.blocks[at]);
        match &leaves.balls {
            Some(balls) if V::SPHERES => self.volume.kept_balls(isa, balls, block, mask),
            _ => self.volume.kept_lanes(isa, block.1, mask),
        }
    }

    #[inline(always)]
    fn record<R: Recorder>(&self, recorder: &mut R, i: usize, items: u32) {
        record(recorder, self.volume, self.masks[i], items);
    }
}
