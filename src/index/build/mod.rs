//! Builders of packed trees.
//!
//! Each implements [`TreeBuilder`](super::tree::TreeBuilder).
//!
//! `bvh` (its clustering in `ploc`), `bsp` (its choice of planes in `bsp_split_planes`),
//! and `cells` with octree and quadtree.

pub mod bsp;
pub mod bsp_split_planes;
pub mod bvh;
pub mod cells;
pub mod ploc;
