//! A query on its way through the wide tree: one level as it is met, and what is
//! done with each of its blocks. In which order the levels and blocks come, and
//! for whom, is decided by the traversals.

use std::ops::{ControlFlow, Range};

use super::by_plane::{ByPlane, LISTED};
use super::frontier::{AHEAD, Frontier, Merger, NodeList, first_ahead, hand_over};
use super::id_rows::IdRows;
use crate::geometry::{ALL_ROWS, BoxBlock, LANES, LaneMask, PlaneMask};
use crate::kernel::{Isa, pairs, prefetch};
use crate::query::{ItemId, Planes, QueryVolume, Recorder, Sink, Tests, runs};

/// Where a level lies among the blocks.
#[derive(Clone, Copy, Debug)]
pub struct Level {
    pub first: usize,
    pub blocks: usize,
    /// Boxes in these blocks; only the last block has lanes without one.
    pub boxes: usize,
}

impl Level {
    /// The lanes of a block that hold a box.
    #[inline(always)]
    pub fn lanes(&self, block: usize) -> LaneMask {
        if block + 1 < self.blocks {
            LaneMask::MAX
        } else {
            LaneMask::MAX >> (self.blocks * LANES - self.boxes)
        }
    }
}

/// One level as a traversal meets it.
pub struct Layer<'t> {
    pub blocks: &'t [BoxBlock],
    pub place: Level,
    /// Items below one lane.
    pub span: usize,
    /// Whether memory is to be asked for ahead: not in trees that are near.
    pub far: bool,
}

impl Layer<'_> {
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

    /// Asks for the memory of an entry of the frontier ahead of its turn, if
    /// there is such an entry.
    #[inline(always)]
    pub fn fetch(&self, places: &[u32], i: usize) {
        if self.far
            && let Some(&place) = places.get(i)
            && let Some(block) = self.blocks.get(place as usize)
        {
            block.prefetch();
        }
    }
}

/// A query on its way through the tree, block by block: what is done with a
/// block, in whatever order they come.
pub struct Pass<'a, I, V, S, R> {
    pub ids: &'a IdRows,
    pub isa: I,
    pub volume: &'a V,
    pub sink: &'a mut S,
    pub recorder: &'a mut R,
}

impl<I: Isa, V: QueryVolume, S: Sink, R: Recorder> Pass<'_, I, V, S, R> {
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
        for i in first_ahead(layer.far) {
            layer.fetch(places, i);
        }
        for (i, (&at, &mask)) in pairs(places, masks).enumerate() {
            layer.fetch(places, i + AHEAD);
            self.sort_block(layer, (at, mask), below, run)?;
        }
        ControlFlow::Continue(())
    }

    /// [`Pass::sort_level`] for the level above the leaves: those that are wholly
    /// inside are gathered in `whole` and handed over behind it, a row of ids each,
    /// which are on their way by then. Where their runs end could not be foretold,
    /// so nobody asks.
    #[inline(always)]
    pub fn sort_last_level(
        &mut self,
        layer: &Layer,
        leaves: &Layer,
        here: &Frontier,
        below: &mut Frontier,
        whole: &mut NodeList,
    ) -> ControlFlow<()> {
        let (places, masks) = here.entries();
        for i in first_ahead(layer.far) {
            layer.fetch(places, i);
        }
        for (i, (&at, &mask)) in pairs(places, masks).enumerate() {
            layer.fetch(places, i + AHEAD);
            let inside = self.sort_lanes(layer, (at, mask), below);
            whole.push(self.isa, self.isa.iota(at * LANES as u32), inside);
        }
        if whole.entries().is_empty() {
            return ControlFlow::Continue(());
        }
        let tests = InsideLeaves {
            leaves,
            places: whole.entries(),
            ids: self.ids.rows(),
            recorder: &mut *self.recorder,
        };
        for i in first_ahead(leaves.far) {
            tests.fetch(i);
        }
        self.sink.accept_tested(self.isa, self.ids.rows(), tests)
    }

    /// Hands over the items of all leaves of a frontier that no open plane
    /// drops. Where there are many, those come first that one plane alone is
    /// open for, plane by plane.
    #[inline(always)]
    pub fn test_leaves(
        &mut self,
        leaves: &Layer,
        here: &Frontier,
        by_plane: &mut ByPlane,
    ) -> ControlFlow<()> {
        let mut rest = here;
        if here.len() >= WORTH_PARTING {
            by_plane.part(self.isa, here);
            for plane in 0..LISTED {
                let places = by_plane.list(plane);
                if places.is_empty() {
                    continue;
                }
                let plane = plane as u32;
                let tests = SinglePlaneLeaves {
                    leaves,
                    view: self.volume,
                    plane: self.volume.one_plane(self.isa, plane),
                    mask: 1 << plane,
                    places,
                    ids: self.ids.rows(),
                    recorder: &mut *self.recorder,
                };
                for i in first_ahead(leaves.far) {
                    tests.fetch(i);
                }
                self.sink.accept_tested(self.isa, self.ids.rows(), tests)?;
            }
            rest = &by_plane.rest;
        }
        let tests = OpenLeaves {
            leaves,
            view: self.volume,
            entries: rest.entries(),
            recorder: &mut *self.recorder,
            ids: self.ids.rows(),
        };
        for i in first_ahead(leaves.far) {
            tests.fetch(i);
        }
        self.sink.accept_tested(self.isa, self.ids.rows(), tests)
    }

    /// Sorts the lanes of a block: what is undecided goes to the frontier
    /// `below`, what is inside joins `run` or, if it cannot, takes its place.
    #[inline(always)]
    fn sort_block(
        &mut self,
        layer: &Layer,
        entry: (u32, PlaneMask),
        below: &mut Frontier,
        run: &mut Merger,
    ) -> ControlFlow<()> {
        let inside = self.sort_lanes(layer, entry, below);
        for places in layer.places_of(entry.0 as usize, inside, self.ids.len()) {
            if let Some(ended) = run.join(places) {
                self.hand_over(ended)?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Sorts the lanes of a block: what is undecided goes to the frontier
    /// `below`; the lanes that are inside.
    #[inline(always)]
    fn sort_lanes(
        &mut self,
        layer: &Layer,
        (at, mask): (u32, PlaneMask),
        below: &mut Frontier,
    ) -> LaneMask {
        let at = at as usize;
        let lanes = layer.place.lanes(at);
        self.recorder.nodes_tested(lanes.count_ones());
        self.recorder
            .planes_tested(lanes.count_ones() * V::planes_open(mask));
        self.recorder
            .block_read(layer.place.first + at, || ALL_ROWS);
        let (kept, open) = self.volume.sorted_lanes(self.isa, &layer.blocks[at], mask);
        let kept = kept & lanes;
        self.recorder
            .subtrees_rejected((lanes & !kept).count_ones());
        let inside = self.isa.zeros(open) & kept;
        let undecided = kept & !inside;
        let first = at * LANES;
        below.push(self.isa, self.isa.iota(first as u32), open, undecided);
        inside
    }

    /// Hands over a run of items that are wholly inside.
    #[inline(always)]
    pub fn hand_over(&mut self, places: Range<usize>) -> ControlFlow<()> {
        hand_over(self.isa, places, self.ids, self.sink, self.recorder)
    }
}

/// So many leaves are worth parting by their planes.
const WORTH_PARTING: usize = 48;

/// What is counted where a leaf is tested.
#[inline(always)]
fn record<V: QueryVolume, R: Recorder>(
    recorder: &mut R,
    view: &V,
    leaves: &Layer,
    (at, mask): (usize, PlaneMask),
) {
    let items = leaves.place.lanes(at).count_ones();
    recorder.items_tested(items);
    recorder.planes_tested(items * V::planes_open(mask));
    recorder.block_read(leaves.place.first + at, || view.rows_read(mask));
}

/// Asks for the ids of a leaf.
#[inline(always)]
fn fetch_ids(ids: &[[ItemId; LANES]], leaf: u32) {
    if let Some(row) = ids.get(leaf as usize) {
        prefetch(row);
    }
}

/// Leaves that are wholly inside: nothing of theirs is tested.
struct InsideLeaves<'a, 't, R> {
    leaves: &'a Layer<'t>,
    places: &'a [u32],
    ids: &'a [[ItemId; LANES]],
    recorder: &'a mut R,
}

impl<R> InsideLeaves<'_, '_, R> {
    /// Asks for the ids of a leaf of the list ahead of its turn.
    #[inline(always)]
    fn fetch(&self, i: usize) {
        if let Some(&leaf) = self.places.get(i) {
            fetch_ids(self.ids, leaf);
        }
    }
}

impl<I: Isa, R: Recorder> Tests<I> for InsideLeaves<'_, '_, R> {
    const SPARSE: bool = false;

    #[inline(always)]
    fn count(&self) -> usize {
        self.places.len()
    }

    #[inline(always)]
    fn test(&mut self, _: I, i: usize) -> (usize, LaneMask) {
        if self.leaves.far {
            self.fetch(i + AHEAD);
        }
        let at = self.places[i] as usize;
        let lanes = self.leaves.place.lanes(at);
        self.recorder.subtree_accepted(lanes.count_ones() as usize);
        (at, lanes)
    }
}

/// Leaves that one plane is open for.
struct SinglePlaneLeaves<'a, 't, V, P, R> {
    leaves: &'a Layer<'t>,
    view: &'a V,
    plane: P,
    mask: PlaneMask,
    places: &'a [u32],
    ids: &'a [[ItemId; LANES]],
    recorder: &'a mut R,
}

impl<V: QueryVolume, P, R: Recorder> SinglePlaneLeaves<'_, '_, V, P, R> {
    /// Asks for the memory of a leaf of the list ahead of its turn.
    #[inline(always)]
    fn fetch<I: Isa>(&self, i: usize)
    where
        P: Planes<I>,
    {
        if let Some(&leaf) = self.places.get(i)
            && let Some(block) = self.leaves.blocks.get(leaf as usize)
        {
            self.plane.prefetch(block);
            fetch_ids(self.ids, leaf);
        }
    }
}

impl<I: Isa, V: QueryVolume, P: Planes<I>, R: Recorder> Tests<I>
    for SinglePlaneLeaves<'_, '_, V, P, R>
{
    const SPARSE: bool = false;

    #[inline(always)]
    fn count(&self) -> usize {
        self.places.len()
    }

    #[inline(always)]
    fn test(&mut self, isa: I, i: usize) -> (usize, LaneMask) {
        if self.leaves.far {
            self.fetch(i + AHEAD);
        }
        let at = self.places[i] as usize;
        record(self.recorder, self.view, self.leaves, (at, self.mask));
        let kept = self.plane.kept(isa, &self.leaves.blocks[at]) & self.leaves.place.lanes(at);
        (at, kept)
    }
}

/// Leaves that different planes are open for.
struct OpenLeaves<'a, 't, V, R> {
    leaves: &'a Layer<'t>,
    view: &'a V,
    entries: (&'a [u32], &'a [PlaneMask]),
    ids: &'a [[ItemId; LANES]],
    recorder: &'a mut R,
}

impl<V: QueryVolume, R: Recorder> OpenLeaves<'_, '_, V, R> {
    /// Asks for the memory of a leaf of the list ahead of its turn.
    #[inline(always)]
    fn fetch(&self, i: usize) {
        let (places, masks) = self.entries;
        if let (Some(&leaf), Some(&mask)) = (places.get(i), masks.get(i))
            && let Some(block) = self.leaves.blocks.get(leaf as usize)
        {
            self.view.prefetch(block, mask);
            fetch_ids(self.ids, leaf);
        }
    }
}

impl<I: Isa, V: QueryVolume, R: Recorder> Tests<I> for OpenLeaves<'_, '_, V, R> {
    const SPARSE: bool = false;

    #[inline(always)]
    fn count(&self) -> usize {
        self.entries.0.len()
    }

    #[inline(always)]
    fn test(&mut self, isa: I, i: usize) -> (usize, LaneMask) {
        if self.leaves.far {
            self.fetch(i + AHEAD);
        }
        let (places, masks) = self.entries;
        let (at, mask) = (places[i] as usize, masks[i]);
        record(self.recorder, self.view, self.leaves, (at, mask));
        let kept =
            self.view.kept_lanes(isa, &self.leaves.blocks[at], mask) & self.leaves.place.lanes(at);
        (at, kept)
    }
}
