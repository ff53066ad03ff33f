//! The triangle stage: which triangles of the items that are left can be seen. One
//! file a back end; the table names them all.

mod clusters;
mod cone_block;
mod cone_f32;
mod cone_safe;
mod contract;
mod exact;
mod eye;
#[cfg(feature = "peers")]
mod meshopt;
mod metrics;
mod none;
mod normal_cone;
mod per_triangle;
mod plane_blocks;
mod selection;
mod several_cones;

pub use clusters::{Clusters, MOST_TRIANGLES};
pub use cone_f32::PlainCones;
pub use cone_safe::SafeCones;
pub use contract::{TriangleCull, TriangleRow};
pub use exact::{faces, normal};
pub use eye::Eye;
#[cfg(feature = "peers")]
pub use meshopt::MeshoptCones;
pub use metrics::{Counts, facing};
pub use normal_cone::Cone;
pub use selection::Selection;

/// All back ends of this stage.
pub const TRIANGLE_ROWS: &[TriangleRow] = &[
    none::ROW,
    per_triangle::ROW,
    cone_f32::ROW,
    cone_safe::ROW,
    several_cones::ROW,
    #[cfg(feature = "peers")]
    meshopt::ROW,
];

#[cfg(test)]
mod tests;
