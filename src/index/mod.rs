//! The structures, their contract and the registry of all of them. Adding one is
//! a file beside this one and a row in [`Registry::builtin`], or in a crate of
//! one's own [`Registry::with`]; list, run, query, verify, benches and
//! conformance tests pick it up from there.

mod batch;
mod block_order;
mod box_by_box;
mod bsp;
mod bundles;
mod bvh;
mod by_plane;
mod by_tree;
mod cells;
mod centres;
mod contract;
mod erased;
mod execution;
mod foreign;
mod frontier;
mod grid;
mod id_rows;
mod info;
mod linear;
mod node;
mod octree;
mod partition;
mod pass;
#[cfg(feature = "peers")]
pub mod peers;
mod plane_choice;
pub(crate) mod ploc;
mod quadtree;
mod registry;
mod replay;
mod stack;
mod textbook;
mod tree;
mod treelets;
mod wide;

pub use block_order::BlockOrder;
pub use bsp::{Bsp, BspBuilder, BspParams};
#[cfg(feature = "cli")]
pub(crate) use bvh::scale_for;
pub use bvh::{Bvh, BvhParams, BvhPreset};
pub(crate) use contract::check_range;
pub use contract::{
    BuildError, FrustumQuery, Input, MemoryUsage, NoParams, Query, RegionIndex, indexable,
};
pub use erased::DynIndex;
pub use execution::{By, Execution};
pub use foreign::caught;
pub use grid::UniformGrid;
pub use info::{Capabilities, Info, Kind, Origin};
pub use linear::{Linear, LinearScalar};
pub use node::TreeNode;
pub use octree::{CellParams, Octree};
pub use partition::{Part, Record, Splitter, build_top_down};
pub use quadtree::Quadtree;
pub use registry::{Registry, Row, StructureSpec};
pub use replay::Trace;
pub use textbook::{BspTextbook, BvhTextbook, OctreeTextbook, QuadtreeTextbook, TextbookParams};
pub use tree::{PackedTree, TreeWriter};
pub use wide::{Wide, WideParams};
