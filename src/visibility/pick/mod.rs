//! Picking, the selection under the cursor. One file per back end.
//!
//! Queries are the first item that a ray meets, the nearest few, and everything in the
//! cursor's frustum.

mod contract;
mod cursor;
mod exactly;
mod linear;
mod obvhs;
mod rounded;
mod wide_ray;

#[cfg(test)]
mod tests;

pub use contract::{BackEnd, Build, Hit, NotBuilt, Pick};
pub use cursor::CursorRectangle;
pub use linear::Linear;
pub use wide_ray::WideRay;

/// All back ends, the reference first.
pub const BACK_ENDS: &[BackEnd] = &[linear::ROW, wide_ray::ROW, obvhs::ROW, obvhs::ROW_WIDE];
