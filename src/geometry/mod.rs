//! Boxes, planes, convex volumes and the plane test that all structures share.

mod aabb;
mod balls;
mod box_block;
mod broadcast;
mod convex_volume;
mod plane;
mod plane_rows;
mod relative_volume;
mod spheres;
#[cfg(test)]
pub mod tests_arbitrary;

pub use aabb::Aabb;
pub use balls::{BallBlock, BallBlocks, Balls};
pub use box_block::{BoxBlock, BoxBlocks};
pub(crate) use box_block::{LANES, LaneMask};
pub use broadcast::Planes;
pub(crate) use broadcast::{BallFrustum, BallPlane, BroadcastPlane, BroadcastPlanes, Sorted};
pub use convex_volume::{
    ConvexVolume, ConvexVolumeF64, FrustumPlane, MAX_PLANES, PlaneMask, VolumeError,
};
pub use plane::{BoxCorner, Plane, PlaneF64, PlaneTree, PlaneTreeNode};
pub use plane_rows::{PlaneRows, ROW_LANES};
pub use relative_volume::RelativeVolume;
pub use spheres::{Ball, SphereMargin, Spheres, sphere_cube};
