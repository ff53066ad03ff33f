//! The back ends of the triangle stage that the funnel compares.

use super::stage::{BackEnd, NONE, StageKind};
use crate::visibility::triangle::{TRIANGLE_ROWS, TriangleRow};

/// What the chain takes.
pub const DEFAULT: &str = "per-triangle";

/// The rows of the table that remove something.
pub fn rows() -> impl Iterator<Item = &'static TriangleRow> {
    TRIANGLE_ROWS.iter().filter(|row| row.name != NONE)
}

/// Every back end that removes something.
pub fn back_ends() -> impl Iterator<Item = BackEnd> {
    rows().map(|row| BackEnd::of(StageKind::Triangle, [row.name, row.summary], row.guarantee))
}
