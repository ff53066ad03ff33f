//! Boxes, planes and convex volumes, and the one plane test that every
//! structure shares. Nothing here knows what an index, a camera or a file is.

mod aabb;
#[cfg(test)]
pub mod arbitrary;
mod blade;
mod box_block;
mod convex_volume;
mod corner;
mod plane;
mod plane_rows;
mod plane_tree;
mod relative_volume;
mod spheres;
mod wide_plane;
mod wide_volume;

pub use aabb::Aabb;
pub use blade::{Blade, Blades};
pub use box_block::{BoxBlock, BoxBlocks, LANES, LaneMask, ROWS, lanes_of};
pub use convex_volume::{ConvexVolume, FrustumPlane, MAX_PLANES, PlaneMask, VolumeError};
pub use corner::{ALL_ROWS, Corner, RowMask};
pub use plane::{Plane, Upper};
pub use plane_rows::{PlaneRows, ROW_LANES};
pub use plane_tree::{PlaneTree, PlaneTreeNode};
pub use relative_volume::RelativeVolume;
pub use spheres::{Ball, SphereMargin, Spheres, sphere_cube};
pub use wide_plane::WidePlane;
pub use wide_volume::WideVolume;
