//! Code of others, which may panic: a panic becomes a value here, so that one
//! structure's end is not everybody's.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs it; of a panic, what it says. What the work has changed by then is left
/// as it is, and not to be relied upon.
pub fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let text = panic
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| panic.downcast_ref::<&str>().copied());
        text.unwrap_or("no message").to_owned()
    })
}
