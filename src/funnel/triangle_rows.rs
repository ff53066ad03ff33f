//! The back ends of the triangle stage that the funnel compares.

use super::stage::{BackEnd, NONE, StageKind};
use crate::visibility::Guarantee;
use crate::visibility::triangle::{TRIANGLE_ROWS, TriangleRow};

/// What the chain takes.
pub const DEFAULT: &str = "per-triangle";

/// The rows of the table that remove something.
pub fn rows() -> impl Iterator<Item = &'static TriangleRow> {
    TRIANGLE_ROWS.iter().filter(|row| row.name != NONE)
}

/// Every back end, the first of which leaves the stage out.
pub fn back_ends() -> impl Iterator<Item = BackEnd> {
    let declared = |name, summary, guarantee| BackEnd {
        stage: StageKind::Triangle,
        name,
        summary,
        guarantee,
        does_object_stage: false,
    };
    let none = declared(NONE, "the stage is left out", Guarantee::Conservative);
    let rows = rows().map(move |row| declared(row.name, row.summary, row.guarantee));
    std::iter::once(none).chain(rows)
}
