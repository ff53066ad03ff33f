//! What a back end of picking is: the questions it answers and what it declares
//! of itself.

use crate::geometry::Aabb;
use crate::index::Origin;
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

/// What a back end declares of itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub struct About {
    /// As typed on the command line; no table has it twice.
    pub name: &'static str,
    /// One line for tables and help.
    pub summary: &'static str,
    /// Whose code answers.
    pub origin: Origin<&'static str>,
    /// What it promises of its answers: [`Guarantee::Exact`] is the answer of
    /// exact arithmetic, ties included.
    pub guarantee: Guarantee,
}

/// Items of a scene that rays are asked about, as solids: which of them a ray
/// meets is said where [`Solids`] are.
pub trait Pick: Send + Sync {
    /// What it declares of itself.
    fn about(&self) -> About;

    /// The first item that the ray meets; of several at the same depth the one
    /// with the lowest id.
    fn first(&self, ray: &Ray) -> Option<Hit>;

    /// The `count` items that the ray meets first, in the order of depth and at
    /// the same depth of ids, put into `hits` in place of what it held. All
    /// items at the depth of the last of them are among them, so there may be
    /// more.
    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>);

    /// Heap bytes.
    fn memory(&self) -> usize;
}

/// A row of the table of back ends.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct BackEnd {
    /// What it declares of itself.
    pub about: About,
    /// Builds it over the items. Deterministic.
    ///
    /// # Errors
    /// As [`NotBuilt`] says.
    pub build: fn(&Solids) -> Result<Box<dyn Pick>, NotBuilt>,
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
    /// Its builder needs quadratic time for these items.
    #[error(
        "'{name}' needs quadratic time for {alike} items with the same bounds; expected at most {most}"
    )]
    Alike {
        /// The back end.
        name: &'static str,
        /// How many items have the same bounds.
        alike: usize,
        /// How many may.
        most: usize,
    },
}

/// Sorts what was found in f32 or rounded, by depth and id, and keeps the first
/// `count` with all that are as deep as the last of them.
pub(super) fn keep_nearest(hits: &mut Vec<Hit>, count: usize) {
    hits.sort_unstable_by(|a, b| a.depth.total_cmp(&b.depth).then(a.item.cmp(&b.item)));
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

/// Most items with the very same bounds for a builder that needs quadratic time
/// for them.
const MOST_ALIKE: usize = 50_000;

/// Refuses more than [`MOST_ALIKE`] items with the same bounds. O(n log n) if
/// there are that many items at all.
pub(super) fn refuse_stacks(name: &'static str, boxes: &[Aabb]) -> Result<(), NotBuilt> {
    if boxes.len() <= MOST_ALIKE {
        return Ok(());
    }
    let key = |b: &Aabb| [b.min, b.max].map(|corner| corner.to_array().map(f32::to_bits));
    let mut keys: Vec<_> = boxes.iter().map(key).collect();
    keys.sort_unstable();
    let alike = keys.chunk_by(|a, b| a == b).map(<[_]>::len).max();
    match alike {
        Some(alike) if alike > MOST_ALIKE => Err(NotBuilt::Alike {
            name,
            alike,
            most: MOST_ALIKE,
        }),
        _ => Ok(()),
    }
}
