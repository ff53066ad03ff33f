//! Spatial index structures, the contract that all satisfy, and their registry.
//!
//! Read `contract` first, then `linear`, the smallest structure. The other files:
//!
//! | files | contents |
//! |---|---|
//! | `contract`, `info` | [`RegionIndex`] and its input; the declaration [`Info`] |
//! | `registry`, `erased` | a row per structure; the same structures without their types |
//! | `cells` | nested cells of a structure, for pictures |
//! | `linear`, `grid` | the two scans, the uniform grid |
//! | `wide/` | the 16-ary implicit tree; a pair of them for items that move; `auto` |
//! | `tree/` | the packed tree of `bvh`, `bsp`, `octree` and `quadtree`, with its queries |
//! | `build/` | a builder of packed trees per file: `bvh`, `bsp`, `cells` (octree, quadtree) |
//! | `textbook/`, `peers/` | plain forms for comparison; structures of other crates |
//! | `items` | non-empty items, their records, positions, and rows of ids |
//! | `frontier` | for queries of trees: open nodes |
//! | `shared_query` | one query shared among threads |
//! | `box_test`, `centre_bounds` | for the grid, textbook forms and peers: one box at a time |
//!
//! To add a structure, write a file beside this one and a row in [`Registry::builtin`], or
//! in a crate of your own call [`Registry::with`]; list, run, query, verify, benches and
//! conformance tests read the registry.

/// `Debug` of structures: memory only, since their arrays would fill pages.
macro_rules! debug_by_memory {
    ($([$($generics:tt)*] $structure:ty),*) => {$(
        impl<$($generics)*> std::fmt::Debug for $structure {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                let mut shown = f.debug_struct(std::any::type_name::<Self>());
                shown.field("memory", &self.memory()).finish_non_exhaustive()
            }
        }
    )*};
}
debug_by_memory!([] LinearScalar, [] Linear, [] UniformGrid, [] Wide, [] Moving, [] Auto,
    [] dyn DynIndex, [B: TreeBuilder] Tree<B>, [D: textbook::Division] textbook::Textbook<D>);

mod box_test;
mod build;
mod cells;
mod centre_bounds;
mod contract;
mod erased;
mod frontier;
mod grid;
mod info;
mod items;
mod linear;
#[cfg(feature = "peers")]
pub mod peers;
mod registry;
mod shared_query;
mod textbook;
mod tree;
mod wide;

pub use crate::spec::SpecError;
pub use crate::threads::Pool;
pub use build::bsp::{Bsp, BspParams, PlaneSource};
pub(crate) use build::bsp_split_planes::by_surface_area;
pub use build::bvh::{Bvh, BvhParams, BvhPreset};
pub use build::cells::{CellParams, Octree, Quadtree};
pub(crate) use build::ploc;
pub use cells::TreeCell;
pub(crate) use cells::verdicts;
pub(crate) use contract::check_range;
pub use contract::{BuildError, FrustumQuery, Input, MemoryUsage, NoParams, Query, RegionIndex};
pub use erased::{DynIndex, Execution, UpdatePolicy, caught};
pub(crate) use erased::{QueryMany, WithKernel};
pub use grid::UniformGrid;
pub use info::{Info, Kind, Origin};
pub(crate) use items::Record;
pub use items::{IdSet, indexable};
pub use linear::{Linear, LinearParams, LinearScalar};
pub(crate) use registry::{DEFAULT, MOTION};
pub use registry::{Registry, Row, StructureSpec};
pub use textbook::{BspTextbook, BvhTextbook, OctreeTextbook, QuadtreeTextbook, TextbookParams};
pub use tree::Tree;
use tree::TreeBuilder;
pub(crate) use tree::node::{NEAR, Stack};
pub use wide::{Auto, AutoParams, BlockOrder, Moving, Wide, WideParams};
