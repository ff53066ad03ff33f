//! Occlusion stage: removes items in the view that other items hide.
//!
//! Back ends are depth buffers into which occluders are drawn ([`OcclusionBuffer`]), one per file;
//! [`Interleaved`] draws and tests front to back, with its own tree.
//!
//! Semantics are those of [`Solids`](super::Solids): a ray meets a box where it enters the box,
//! between near and far. A box that some ray enters before the near plane is not drawn. An occluder
//! does not hide items at the same depth. The occluders of a mesh are boxes inside its items
//! ([`OccluderTree::with_inner_boxes`]): a ray that enters one has met the surface of the item
//! before, unless that was before the near plane. The occluders of a map are boxes in its solid
//! space, those of a terrain boxes below the ground; neither are items.

mod buffer;
mod interleaved;
mod masked;
mod outline;
mod rect;
mod scene;
#[cfg(test)]
mod tests;
mod view;

pub use buffer::{CullStats, OcclusionBuffer};
pub use interleaved::Interleaved;
pub use masked::{Masked, MaskedCentre, MaskedInner};
pub use outline::Outline;
pub use rect::{Candidate, Rect, Rects};
pub use scene::{Faces, Occluder, OccluderTree};
pub use view::{LinearFunction, Projection, View};

#[cfg(test)]
pub use tests::{NoOcclusion, TwoPass, ZBuffer};
