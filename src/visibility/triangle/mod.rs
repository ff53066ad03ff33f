//! The triangle stage: which triangles of the items that are left can be seen. One
//! file a back end; the table names them all.

mod clusters;
mod cone_block;
mod cone_f32;
mod cone_s8;
mod cone_safe;
mod contract;
mod exact;
mod eye;
mod image;
mod locals;
mod masks;
#[cfg(feature = "peers")]
mod meshopt;
mod metrics;
mod none;
mod normal_cone;
mod outcode;
mod per_triangle;
mod per_triangle_f32;
mod plane_blocks;
mod screen;
mod selection;
mod several_cones;
mod small;
mod view;

pub use clusters::{Clusters, MOST_TRIANGLES};
pub use cone_f32::PlainCones;
pub use cone_s8::ByteCones;
pub use cone_safe::SafeCones;
pub use contract::{Criterion, TriangleCull, TriangleRow};
pub use exact::{faces, normal};
pub use eye::Eye;
pub use image::Image;
#[cfg(feature = "peers")]
pub use meshopt::MeshoptCones;
pub use metrics::{Counts, facing, truth};
pub use normal_cone::Cone;
pub use screen::Screen;
pub use selection::Selection;
pub use view::{View, Window};

/// All back ends of this stage.
pub const TRIANGLE_ROWS: &[TriangleRow] = &[
    none::ROW,
    per_triangle::ROW,
    per_triangle_f32::ROW,
    cone_f32::ROW,
    cone_safe::ROW,
    cone_s8::ROW,
    several_cones::ROW,
    masks::ROW,
    outcode::ROW,
    small::ROW,
    #[cfg(feature = "peers")]
    meshopt::ROW,
];

#[cfg(test)]
mod tests;
