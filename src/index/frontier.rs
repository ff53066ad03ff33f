//! Parts of level-by-level traversals.
//!
//! The nodes still to be tested, the distance of prefetches, and the merging of accepted
//! neighbours into one run.

use std::cell::Cell;
use std::ops::{ControlFlow, Range};
use std::thread::LocalKey;

use crate::geometry::{LANES, LaneMask, PlaneMask};
use crate::kernel::{Isa, pairs};
use crate::query::{Context, ItemId, Recorder, Sink};

/// Distance of prefetches, in blocks.
///
/// Enough to hide a cache miss, and not enough to evict lines before their use.
pub const AHEAD: usize = 12;

/// Most items of a tree that is not prefetched (3 MiB of blocks).
///
/// Such a tree is expected to fit the nearest caches, where prefetches cost more than
/// they gain.
const NEAR: usize = 131_072;

/// Decides whether the blocks of a tree over `items` items are prefetched.
pub fn is_far(items: usize) -> bool {
    items > NEAR
}

/// The entries of a list that are prefetched before its first one is processed.
///
/// Most entries of a small view.
#[inline(always)]
pub fn first_ahead(far: bool) -> Range<usize> {
    0..if far { AHEAD } else { 0 }
}

/// Memory that a thread keeps between its queries.
pub type Kept<T> = LocalKey<Cell<Option<Box<T>>>>;

/// Takes the memory of the thread, or allocates it. (`LocalKey::take` is a call.)
#[inline(always)]
pub fn take<T: Default>(kept: &'static Kept<T>) -> Box<T> {
    match kept.try_with(|kept| kept.replace(None)) {
        Ok(Some(scratch)) => scratch,
        _ => Box::default(),
    }
}

/// Returns the memory for the next query.
#[inline(always)]
pub fn put_back<T>(kept: &'static Kept<T>, scratch: Box<T>) {
    // A thread that is ending keeps nothing.
    let _ = kept.try_with(|kept| kept.set(Some(scratch)));
}

/// Nodes still to be tested, each with the planes that its ancestors straddle.
#[derive(Default)]
pub struct Frontier {
    /// Longer than `used`, so that a store of sixteen lanes always fits.
    nodes: Vec<u32>,
    open: Vec<PlaneMask>,
    used: usize,
}

impl Frontier {
    /// Clears the list and reserves room for the children of `parents` nodes.
    #[inline(always)]
    pub fn clear(&mut self, parents: usize) {
        self.used = 0;
        self.make_room(parents);
    }

    /// Reserves room for the children of `parents` more nodes.
    #[inline(always)]
    pub fn make_room(&mut self, parents: usize) {
        let room = self.used + (parents + 1) * LANES;
        if self.nodes.len() < room {
            self.nodes.resize(room, 0);
            self.open.resize(room, 0);
        }
    }

    /// Node 0 alone, with all planes of the mask open.
    #[inline(always)]
    pub fn start<I: Isa>(&mut self, isa: I, mask: PlaneMask) {
        self.clear(1);
        self.push(isa, isa.iota(0), isa.splat_word(mask), 1);
    }

    /// Number of nodes.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.used
    }

    /// Adds the nodes of those lanes. There must be room.
    #[inline(always)]
    pub fn push<I: Isa>(&mut self, isa: I, nodes: I::Words, open: I::Words, lanes: LaneMask) {
        let places = (
            self.nodes[self.used..].first_chunk_mut(),
            self.open[self.used..].first_chunk_mut(),
        );
        debug_assert!(places.0.is_some(), "no room was made");
        if let (Some(place), Some(masks)) = places {
            isa.compress(place, nodes, lanes);
            isa.compress(masks, open, lanes);
            self.used += lanes.count_ones() as usize;
        }
    }

    /// Rows of sixteen entries, and a mask of those that exist.
    #[inline(always)]
    pub fn rows(&self) -> impl Iterator<Item = (&[u32; LANES], &[PlaneMask; LANES], LaneMask)> {
        let (nodes, open) = (self.nodes.as_chunks().0, self.open.as_chunks().0);
        let used = self.used;
        let rows = pairs(nodes, open).take(used.div_ceil(LANES));
        rows.enumerate().map(move |(i, (nodes, open))| {
            let missing = ((i + 1) * LANES).saturating_sub(used);
            (nodes, open, LaneMask::MAX >> missing)
        })
    }

    /// The nodes and their planes, in the order of arrival.
    #[inline(always)]
    pub fn entries(&self) -> (&[u32], &[PlaneMask]) {
        (&self.nodes[..self.used], &self.open[..self.used])
    }
}

/// List of nodes that are inside all planes.
#[derive(Default)]
pub struct NodeList {
    /// Longer than `used`, so that a store of sixteen lanes always fits.
    nodes: Vec<u32>,
    used: usize,
}

impl NodeList {
    /// Clears the list and reserves room for the children of `parents` nodes.
    #[inline(always)]
    pub fn clear(&mut self, parents: usize) {
        self.used = 0;
        let room = (parents + 1) * LANES;
        if self.nodes.len() < room {
            self.nodes.resize(room, 0);
        }
    }

    /// Adds the nodes of those lanes. There must be room.
    #[inline(always)]
    pub fn push<I: Isa>(&mut self, isa: I, nodes: I::Words, lanes: LaneMask) {
        let place = self.nodes[self.used..].first_chunk_mut();
        debug_assert!(place.is_some(), "no room was made");
        if let Some(place) = place {
            isa.compress(place, nodes, lanes);
            self.used += lanes.count_ones() as usize;
        }
    }

    /// The nodes, in the order of arrival.
    #[inline(always)]
    pub fn entries(&self) -> &[u32] {
        &self.nodes[..self.used]
    }
}

/// Joins adjoining runs of items before they are passed to the sink.
#[derive(Clone, Default)]
pub struct Merger(Range<usize>);

impl Merger {
    /// Adds a run; returns the run before it, if that has ended.
    #[inline(always)]
    pub fn join(&mut self, places: Range<usize>) -> Option<Range<usize>> {
        if places.start == self.0.end {
            self.0.end = places.end;
            return None;
        }
        Some(std::mem::replace(&mut self.0, places))
    }

    /// The last run, which may be empty.
    #[inline(always)]
    pub fn take(&mut self) -> Range<usize> {
        std::mem::take(&mut self.0)
    }
}

/// Passes a run of items that are wholly inside to the sink, unless it is empty.
#[inline(always)]
pub fn pass_run<C: Context>(places: Range<usize>, ids: &[ItemId], cx: &mut C) -> ControlFlow<()> {
    if places.is_empty() {
        return ControlFlow::Continue(());
    }
    let isa = cx.isa();
    cx.recorder().subtree_accepted(places.len());
    cx.sink().accept_range(isa, ids, places)
}
