//! Which of the items in the view are hidden by others.
//!
//! Back ends are buffers that occluders are drawn into ([`OcclusionBuffer`]), each
//! in a file of its own, under two couplings: [`TwoPass`] (all occluders, then all
//! candidates) and [`Interleaved`] (front to back on a tree of its own).
//!
//! Semantics are those of [`Solids`](super::Solids): a ray meets a box where it
//! enters it, between near and far; a box that some ray enters before the near
//! plane is not drawn; items as near as an occluder are not hidden by it. Of a mesh
//! what is drawn are boxes inside the items ([`OccluderScene::among`]): a ray that enters
//! one has met the item's surface before, unless that was before the near plane. Of a map
//! they are boxes of its solid, below the ground of a mesh boxes too, which are no items.

mod buffer;
mod hierarchical_z;
mod interleaved;
mod masked;
mod outline;
mod rect;
mod scene;
#[cfg(test)]
mod tests;
mod trace;
mod two_pass;
mod view;
mod zbuffer;

pub use buffer::{CullStats, OcclusionBuffer};
pub use hierarchical_z::HierarchicalZ;
pub use interleaved::Interleaved;
pub use masked::{Masked, MaskedCentre, MaskedInner};
pub use outline::{Coverage, Outline};
pub use rect::{Candidate, Rect, Rects};
pub use scene::{Faces, Occluder, OccluderScene};
#[cfg(test)]
pub use tests::NoOcclusion;
pub use trace::FrameTrace;
pub use two_pass::{OccluderChoice, TwoPass};
pub use view::{Linear, Projection, View};
pub use zbuffer::ZBuffer;
