//! Builders of packed trees.
//!
//! Each implements [`TreeBuilder`](super::tree::TreeBuilder): `bvh` (clustering in `ploc`), `bsp`
//! (planes chosen in `bsp_split_planes`), and `cells` for octree and quadtree.

pub mod bsp;
pub mod bsp_split_planes;
pub mod bvh;
pub mod cells;
pub mod ploc;
