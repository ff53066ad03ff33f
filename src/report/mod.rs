//! Reports: the versioned model that other tools read, the folder of a run in
//! which every finished cell is on disk before the next begins, and what can be
//! read off a report. It owns the formats; the figures come from `measure`.

mod folder;
mod growth;
mod model;
mod ranking;
mod surface;

pub use folder::{FolderError, RunFolder, read_report, write_atomically};
pub use growth::{Growth, growths};
pub use model::{Noise, Report, ReportCell, RunInfo, SCHEMA_VERSION, SamplesRef, TwinEntry};
pub use ranking::{Comparison, Ranked, comparisons, times_as_fast};
pub use surface::{Crossing, Place, Surface, surfaces};
