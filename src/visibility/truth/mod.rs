//! The visible items, exact along the rays of a sample grid.
//!
//! No back end shares this code but for the bodies and their exact tests.

mod body;
mod ray_box;
mod ray_index;
mod ray_triangle;
mod sample;
#[cfg(test)]
pub(super) mod tests;

pub use super::rays::Along;
pub use body::{Bodies, Body, Boxes, Facet, Facets, SolidBox};
pub use ray_box::{Crossing, Probe};
pub use ray_index::{BodyIndex, Front, RayIndex, SurfaceIndex};
pub use ray_triangle::{Meeting, TriangleProbe};
pub use sample::{NO_ITEM, SampleTruth, visible_by_random_rays};

#[cfg(test)]
pub(super) use tests::judge;
