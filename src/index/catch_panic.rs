//! Panics as values, so that a structure that panics fails alone.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs a closure; returns the message of a panic. The state that the closure has
/// changed by then stays as it is and must not be relied upon.
pub fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let text = panic
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| panic.downcast_ref::<&str>().copied());
        text.unwrap_or("no message").to_owned()
    })
}
