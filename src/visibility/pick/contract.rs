//! What a back end of picking is: the questions it answers and what it declares
//! of itself.

use std::cmp::Ordering;

use super::facets::Facets;
use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::visibility::{Guarantee, Ray, Solids};

/// An item that a ray meets, and where.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Hit {
    /// The item.
    pub item: ItemId,
    /// Depth at which the ray enters it, rounded.
    pub depth: f64,
}

impl Hit {
    /// Itself, if its item is among the first so many.
    #[inline(always)]
    pub(super) fn counted(self, items: usize) -> Option<Hit> {
        ((self.item as usize) < items).then_some(self)
    }

    /// By depth, then by id.
    pub(super) fn order(&self, other: &Hit) -> Ordering {
        let by_depth = self.depth.total_cmp(&other.depth);
        by_depth.then(self.item.cmp(&other.item))
    }
}

/// Items of a scene that rays are asked about: which of them a ray meets is said where
/// [`Solids`] are, and for triangles where [`Facets`] are.
pub trait Pick: Send + Sync {
    /// The first item that the ray meets; of several at the same depth the one
    /// with the lowest id.
    fn first(&self, ray: &Ray) -> Option<Hit>;

    /// The `count` items that the ray meets first, in the order of depth and at
    /// the same depth of ids, put into `hits` in place of what it held. All
    /// items at the depth of the last of them are among them, so there may be
    /// more.
    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>);
}

/// Builds a back end over the items of a scene.
pub type BuildBoxes = fn(&Solids, Kernel) -> Result<Box<dyn Pick>, NotBuilt>;

/// Builds a back end over the triangles of a scene.
pub type BuildTriangles = fn(&Facets, Kernel) -> Result<Box<dyn Pick>, NotBuilt>;

/// A row of the table of back ends.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct BackEnd {
    /// As typed on the command line; no table has it twice.
    pub name: &'static str,
    /// One line for tables and help.
    pub summary: &'static str,
    /// What it promises of its answers: [`Guarantee::Exact`] is the answer of
    /// exact arithmetic, ties included.
    pub guarantee: Guarantee,
    /// Builds it over the items, to answer by an instruction set if it has a choice.
    /// Deterministic.
    ///
    /// # Errors
    /// As [`NotBuilt`] says.
    pub build: BuildBoxes,
    /// Builds it over triangles, if it takes them, in the same way.
    ///
    /// # Errors
    /// As [`NotBuilt`] says.
    pub build_triangles: Option<BuildTriangles>,
}

/// A back end that cannot hold the items.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NotBuilt {
    /// More items than there are ids.
    #[error("{count} items; expected at most {most}")]
    TooMany {
        /// How many there are.
        count: usize,
        /// How many there may be.
        most: usize,
    },
    /// A tree with more levels than its walks can take.
    #[error("the tree of '{name}' has {levels} levels; expected at most {most}")]
    TooDeep {
        /// The back end.
        name: &'static str,
        /// How many levels it has.
        levels: usize,
        /// How many it may have.
        most: usize,
    },
    /// A back end that panics, when it is built or when it answers.
    #[error("'{name}' panicked: {message}")]
    Panicked {
        /// The back end.
        name: &'static str,
        /// The panic's message.
        message: String,
    },
}

/// Sorts what was found in f32 or rounded, by depth and id, and keeps the first
/// `count` with all that are as deep as the last of them.
pub(super) fn keep_nearest(hits: &mut Vec<Hit>, count: usize) {
    hits.sort_unstable_by(Hit::order);
    if let Some(last) = count
        .checked_sub(1)
        .and_then(|last| hits.get(last))
        .copied()
    {
        let kept = hits.partition_point(|hit| hit.depth <= last.depth);
        hits.truncate(kept);
    } else if count == 0 {
        hits.clear();
    }
}

/// As [`keep_nearest`], of hits of which an item may have several: the first of each.
pub(super) fn keep_nearest_items(hits: &mut Vec<Hit>, count: usize) {
    hits.sort_unstable_by(|a, b| a.item.cmp(&b.item).then(Hit::order(a, b)));
    hits.dedup_by_key(|hit| hit.item);
    keep_nearest(hits, count);
}
