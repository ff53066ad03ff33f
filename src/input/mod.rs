//! Reading what users give: the error that names the place, and CSV tables
//! with a header. The formats themselves belong to `scene` and `path`.

mod error;
mod table;

pub use error::InputError;
pub use table::{Row, TableReader};
