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
mod selection;

pub use clusters::{Clusters, MOST_TRIANGLES};
pub use cones::{Cones, SafeCones};
pub use contract::{TriangleCull, TriangleRow};
pub use exact::{faces, normal};
pub use eye::Eye;
pub use metrics::{Counts, facing};
pub use normal_cone::Cone;
pub use selection::Selection;

/// All back ends of this stage.
pub const TRIANGLE_ROWS: &[TriangleRow] = &[
    contract::NONE,
    per_triangle::ROW,
    cones::ROW,
    cones::ROW_SEVERAL,
];

#[cfg(test)]
mod tests;
