//! The builders of packed trees, a file each; octree and quadtree share one.

pub mod bsp;
pub mod bsp_split_planes;
pub mod bvh;
pub mod cells;
pub mod ploc;
