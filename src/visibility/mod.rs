//! Stages of visibility, and picking.
//!
//! Level, region, object, occlusion, triangle and fragment: one folder per stage, one file per back
//! end; the object stage is [`crate::index`]. Tests compare all of them with the exact answers of
//! `truth`. Nothing here is timed or printed.

pub mod fragment;
pub mod inner_boxes;
mod map_selection;
pub mod occluders;
pub mod occlusion;
pub mod pick;
mod rays;
pub mod region;
mod solids;
pub mod triangle;
pub mod truth;

use serde::Serialize;

pub use map_selection::MapSelection;
pub use rays::{Ray, RayProbe, Rays, SampleGrid};
pub use region::doom::surfaces_of;
pub use solids::Solids;

#[cfg(test)]
mod tests_extremes;

named! {
    /// Guarantee that a back end declares for its answers; tests check it.
    #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Debug, Serialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Guarantee {
        /// Exactly the visible set.
        Exact = "exact",
        /// A superset of the items visible along any ray.
        Conservative = "conservative",
        /// Exactly the set visible along the rays of a sample grid.
        SampleExact = "sample-exact",
        /// None: visible items may be missing.
        #[default]
        Unproven = "unproven",
    }
}

/// Row of a stage's table of back ends.
#[derive(Clone, Copy, Debug)]
pub struct Row<B> {
    /// Name on the command line and in tables, unique in the table.
    pub name: &'static str,
    /// One line for tables and help.
    pub summary: &'static str,
    /// Guarantee of its answers.
    pub guarantee: Guarantee,
    /// Function that builds it, or that tests whether a scene has what it needs.
    pub build: B,
}
