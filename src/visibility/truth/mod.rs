//! The visible items, exact along the rays of a sample grid: `sample` for boxes,
//! `surface_sample` for triangles. Knows boxes, triangles, cameras and rays, not the back
//! ends that are judged by it.

mod entry;
#[cfg(test)]
pub(super) mod judge;
mod ray_index;
mod ray_tree;
mod ray_triangle;
mod sample;
mod surface_index;
mod surface_sample;

pub use entry::{Crossing, Probe};
pub use ray_index::{Front, RayIndex};
pub use ray_triangle::{Meeting, TriangleProbe};
pub use sample::{NO_ITEM, SampleTruth, visible_by_random_rays};
pub use surface_index::{SurfaceFront, SurfaceIndex};
pub use surface_sample::visible_surfaces_by_random_rays;
