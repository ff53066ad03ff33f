//! The triangle stage: the triangles of the remaining items that can be seen.
//!
//! One file per back end, all of them in one table.

mod clusters;
mod cones;
mod contract;
mod exact;
mod eye;
mod metrics;
mod normal_cone;
mod per_triangle;
mod plain_cones;
mod selection;

pub use clusters::{Clusters, MOST_TRIANGLES};
pub use cones::{Cones, SafeCones};
pub use contract::{TriangleCull, TriangleRow};
pub use exact::{faces, normal};
pub use eye::Eye;
pub use metrics::{Counts, facing};
pub use normal_cone::Cone;
pub use plain_cones::PlainCones;
pub use selection::Selection;

/// All back ends of this stage.
pub const TRIANGLE_ROWS: &[TriangleRow] = &[
    contract::NONE,
    per_triangle::ROW,
    plain_cones::ROW,
    cones::ROW,
    cones::ROW_SEVERAL,
    #[cfg(feature = "peers")]
    plain_cones::ROW_MESHOPT,
];

#[cfg(test)]
mod tests;
