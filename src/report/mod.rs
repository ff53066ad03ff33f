//! Reports: the versioned model that other tools read, and the folder of a
//! run in which every finished cell is on disk before the next begins. It
//! owns the formats; the figures come from `measure`.

mod folder;
mod model;
mod ranking;

pub use folder::{FolderError, RunFolder, read_report, write_atomically};
pub use model::{Noise, Report, ReportCell, RunInfo, SCHEMA_VERSION, SamplesRef, TwinEntry};
pub use ranking::{Comparison, Ranked, comparisons, times_as_fast};
