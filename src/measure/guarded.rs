//! Code of structures, which may panic: here a panic becomes a status of the cell.

use super::{Status, Verdict};
use crate::index::caught;

/// Runs foreign code; a panic becomes a verdict with its message.
pub fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, Verdict> {
    caught(work).map_err(|text| Verdict::new(Status::Panicked, format!("panicked: {text}")))
}
