//! What is really visible: exact along the rays of a sample grid (`sample`, kept on
//! disk by `cache`; of triangles `surface_sample`), and for all rays of a view where a
//! witness or a cover proves it (`certificate`, held against the items by `check`,
//! which uses no code of the search; the search asks it about plans of maps). It knows
//! boxes, triangles, cameras and rays, not the back ends that it judges.

mod cache;
mod certificate;
mod certify;
mod check;
mod class;
mod cover;
mod entry;
#[cfg(test)]
pub(super) mod judge;
mod ray_index;
mod ray_tree;
mod ray_triangle;
mod sample;
mod sight;
mod surface_index;
mod surface_sample;

pub use cache::{TruthCache, digest_of};
pub use certificate::{
    CameraOf, Cell, Certificates, Corners, Edge, Except, Hiders, PlanWall, Proof, View,
};
pub use certify::{Ends, certify};
pub use check::{Counts, Facts, Rejected, check};
pub use class::Class;
pub use cover::Prover;
pub use entry::{Crossing, Probe};
pub use ray_index::{Front, RayIndex};
pub use ray_triangle::{Meeting, TriangleProbe};
pub use sample::{NO_ITEM, SampleTruth, visible_by_random_rays};
pub use surface_index::{SurfaceFront, SurfaceIndex};
pub use surface_sample::visible_surfaces_by_random_rays;
