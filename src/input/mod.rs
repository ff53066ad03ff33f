//! Reading what users give: errors, files and pipes, CSV tables.
//!
//! Errors name the place; tables have a header. The formats themselves belong to `scene` and
//! `path`.

mod error;
mod file;
mod note;
mod table;

pub use error::{InputError, Result, bare, gigabytes};
pub use file::{held_files, hold_files, is_readable, names_file, pipes, read_file, stand_in};
pub use note::{note, note_counted, tell_notes, tell_warnings, unheard, warn, warnings};
pub use table::{Row, TableReader};

/// A finite f64, or what was expected.
pub fn finite(text: &str) -> Result<f64, &'static str> {
    let number = |text: &str| text.parse::<f64>().ok();
    let is_comma = || text.contains(',') && number(&text.replacen(',', ".", 1)).is_some();
    match number(text) {
        Some(value) if value.is_finite() => Ok(value),
        None if is_comma() => Err("a decimal point, not a decimal comma"),
        _ => Err("a finite number"),
    }
}
