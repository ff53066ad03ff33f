//! Reading what users give: the error that names the place, files and pipes, and
//! CSV tables with a header. The formats themselves belong to `scene` and `path`.

mod error;
mod file;
mod note;
mod table;

pub(crate) use error::gigabytes;
pub use error::{InputError, bare};
pub use file::{held_files, hold_files, is_readable, pipes, read_file, stand_in};
pub(crate) use note::{note, warn};
pub use note::{tell_notes, tell_warnings};
pub(crate) use table::finite;
pub use table::{Row, TableReader};
