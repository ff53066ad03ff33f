//! Reading what users give: errors, files and pipes, CSV tables.
//!
//! Errors name the place; tables have a header. The formats themselves belong to `scene` and
//! `path`.

mod error;
mod file;
mod note;
mod table;

pub(crate) use error::gigabytes;
pub use error::{InputError, Result, bare};
pub use file::{held_files, hold_files, is_readable, names_file, pipes, read_file, stand_in};
#[cfg(feature = "cli")]
pub(crate) use note::unheard;
pub(crate) use note::{note, note_counted, warn};
pub use note::{tell_notes, tell_warnings};
pub use table::{Row, TableReader};

/// A finite f64, or what was expected.
pub(crate) fn finite(text: &str) -> Result<f64, &'static str> {
    let number = |text: &str| text.parse::<f64>().ok();
    let is_comma = || text.contains(',') && number(&text.replacen(',', ".", 1)).is_some();
    match number(text) {
        Some(value) if value.is_finite() => Ok(value),
        None if is_comma() => Err("a decimal point, not a decimal comma"),
        _ => Err("a finite number"),
    }
}
