//! Calls of code that may panic, with the panic as a verdict.

use super::{Status, Verdict};
use crate::index::caught;

/// Runs code of a structure; a panic becomes [`Status::Panicked`] with its message.
pub fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, Verdict> {
    caught(work).map_err(|text| Verdict::new(Status::Panicked, format!("panicked: {text}")))
}
