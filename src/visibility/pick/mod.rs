//! Picking, the selection under the cursor: the first item that a ray meets, the
//! nearest few, and everything through a cursor's frustum. One file a back end;
//! what a ray meets is said where [`Solids`](super::Solids) are, and for triangles where
//! [`Facets`] are.

mod contract;
mod cursor;
mod exactly;
mod facets;
mod linear;
mod obvhs;
mod rounded;
mod solid_surfaces;
mod wide_ray;

#[cfg(test)]
mod tests;

pub use contract::{BackEnd, BuildBoxes, BuildTriangles, Hit, NotBuilt, Pick};
pub use cursor::CursorRectangle;
pub use facets::{Facet, Facets};
pub use linear::Linear;
pub use solid_surfaces::SolidSurfaces;
pub use wide_ray::WideRay;

/// All back ends, the reference first.
pub const BACK_ENDS: &[BackEnd] = &[linear::ROW, wide_ray::ROW, obvhs::ROW, obvhs::ROW_WIDE];
