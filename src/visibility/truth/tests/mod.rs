//! Samples of boxes and of triangles against a judge of its own.

mod boxes;
pub mod judge;
mod triangles;
