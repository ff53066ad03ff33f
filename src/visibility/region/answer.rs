//! What a back end of the region stage answers with.

use std::sync::Arc;

use super::graph::RegionGraph;
use crate::visibility::{Guarantee, Rays};

/// Number of a region in its graph.
pub type RegionId = u32;

/// Where the eye of an answer is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum EyePlace {
    /// In regions: the answer is what they let it see.
    Inside,
    /// Not wholly in regions (or the lens is orthographic): all regions are listed.
    Outside,
}

/// A back end of the region stage: which regions can be seen at all.
#[allow(clippy::wrong_self_convention)] // What is seen from an eye, not a conversion.
pub trait RegionRow: Send + Sync {
    /// As it is typed.
    fn name(&self) -> &'static str;

    /// One line of what it does.
    fn summary(&self) -> &'static str;

    /// What it promises of its answers from an eye, in the world of regions and
    /// openings (what items hide is not asked here).
    fn guarantee(&self) -> Guarantee;

    /// The graph that it searches.
    fn graph(&self) -> &Arc<RegionGraph>;

    /// Replaces `out` by the regions that a camera may see, ascending.
    fn from_eye(&self, rays: &Rays, scratch: &mut Scratch, out: &mut Vec<RegionId>) -> EyePlace;

    /// Replaces `out` by the regions that may be seen from any point of a region,
    /// ascending; itself is one of them.
    fn from_region(&self, region: RegionId, out: &mut Vec<RegionId>) {
        self.graph().component(region, out);
    }
}

/// Memory that queries use again and again.
#[derive(Clone, Default, Debug)]
pub struct Scratch {
    pub(super) homes: Vec<RegionId>,
    pub(super) seen: Marks,
    pub(super) queue: Vec<RegionId>,
    pub(super) rectangles: super::portal_rect::Search,
    pub(super) windows: super::portal_clip::Search,
}

/// A set of numbers below a bound, listed in ascending order.
#[derive(Clone, Default, Debug)]
pub struct Marks {
    words: Vec<u64>,
}

impl Marks {
    /// The empty set of numbers below `bound`.
    pub fn clear(&mut self, bound: usize) {
        self.words.clear();
        self.words.resize(bound.div_ceil(64), 0);
    }

    /// Whether the number was not in it.
    pub fn insert(&mut self, number: u32) -> bool {
        let (word, bit) = (&mut self.words[number as usize / 64], 1 << (number % 64));
        let fresh = *word & bit == 0;
        *word |= bit;
        fresh
    }

    /// Adds the numbers whose bits are set.
    pub fn insert_all(&mut self, set: &[u64]) {
        self.words
            .iter_mut()
            .zip(set)
            .for_each(|(word, more)| *word |= more);
    }

    /// Replaces `out` by the numbers, ascending.
    pub fn list(&self, out: &mut Vec<u32>) {
        out.clear();
        decode(&self.words, out);
    }
}

/// Appends the numbers of the set bits, ascending. O(words + bits).
pub fn decode(words: &[u64], out: &mut Vec<u32>) {
    for (first, &word) in (0u32..).step_by(64).zip(words) {
        let mut rest = word;
        while rest != 0 {
            out.push(first + rest.trailing_zeros());
            rest &= rest - 1;
        }
    }
}
