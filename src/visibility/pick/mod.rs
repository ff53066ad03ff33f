//! Picking, the selection under the cursor. One file per back end.
//!
//! Queries are the first item that a ray meets, the nearest few, and everything in the
//! cursor's frustum.

mod cursor;
mod exactly;
mod obvhs;
mod wide_ray;

use std::cmp::Ordering;

use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::visibility::truth::{Boxes, Facets};
use crate::visibility::{Guarantee, Ray};

pub use cursor::CursorRectangle;
pub use exactly::Linear;
pub use wide_ray::WideRay;

#[cfg(test)]
mod tests;

/// All back ends, the reference first.
pub const BACK_ENDS: &[BackEnd] = &[exactly::LINEAR, wide_ray::ROW, obvhs::ROW, obvhs::ROW_WIDE];

/// An item that a ray meets, and where.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Hit {
    /// The item.
    pub item: ItemId,
    /// Depth at which the ray enters it, rounded.
    pub depth: f64,
}

impl Hit {
    /// Order by depth, then by id.
    pub(super) fn order(&self, other: &Hit) -> Ordering {
        let by_depth = self.depth.total_cmp(&other.depth);
        by_depth.then(self.item.cmp(&other.item))
    }
}

/// The items of a scene, to be picked by rays.
///
/// Solid boxes are met as [`Solids`](crate::visibility::Solids) defines, triangles as
/// [`Facets::solid`] does.
pub trait Pick: Send + Sync {
    /// The first item that the ray meets; of several at the same depth the one
    /// with the lowest id.
    fn first(&self, ray: &Ray) -> Option<Hit>;

    /// Replaces `hits` by the `count` items that the ray meets first.
    ///
    /// Ordered by depth, then by id. All items at the depth of the last of them are included,
    /// so there may be more.
    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>);
}

/// Builds a back end over bodies, for an instruction set if it has a choice.
///
/// Deterministic.
///
/// # Errors
/// [`NotBuilt`].
pub type Build<Bodies> = fn(&Bodies, Kernel) -> Result<Box<dyn Pick>, NotBuilt>;

/// A row of the table of back ends.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct BackEnd {
    /// Name on the command line, unique.
    pub name: &'static str,
    /// One line for tables and help.
    pub summary: &'static str,
    /// Guarantee of its answers. [`Guarantee::Exact`]: those of exact arithmetic, ties
    /// included.
    pub guarantee: Guarantee,
    /// Builds it over boxes.
    pub boxes: Build<Boxes>,
    /// Builds it over triangles.
    pub facets: Build<Facets>,
}

/// A back end that cannot hold the items.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NotBuilt {
    /// More items than there are ids.
    #[error("{count} items; expected at most {most}")]
    TooMany {
        /// Number of items.
        count: usize,
        /// Largest number of items.
        most: usize,
    },
    /// A tree with more levels than its traversal supports.
    #[error("the tree of '{name}' has {levels} levels; expected at most {most}")]
    TooDeep {
        /// The back end.
        name: &'static str,
        /// Number of levels.
        levels: usize,
        /// Largest number of levels.
        most: usize,
    },
    /// A panic of a back end, when it is built or when it answers.
    #[error("'{name}' panicked: {message}")]
    Panicked {
        /// The back end.
        name: &'static str,
        /// The panic's message.
        message: String,
    },
}
