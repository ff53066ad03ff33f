//! The triangle stage: the triangles of the remaining items that can be seen.
//!
//! One file per back end, all of them in one table.

mod clusters;
mod cones;
mod exact;
mod per_triangle;
mod selection;

pub use clusters::{Clusters, MOST_TRIANGLES};
pub use cones::{Cone, Cones, SafeCones};
pub use exact::{Eye, faces, normal};
pub use selection::{Counts, Selection, TriangleCull, TriangleRow, facing};

/// All back ends of this stage.
pub const TRIANGLE_ROWS: &[TriangleRow] = &[
    selection::NONE,
    per_triangle::ROW,
    cones::ROW,
    cones::ROW_SEVERAL,
];

#[cfg(test)]
mod tests;
