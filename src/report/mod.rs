//! Reports: the versioned model that other tools read, the folder of a run in
//! which every finished cell is on disk before the next begins, and what can be
//! read off a report. It owns the formats; the figures come from `measure`.

mod changes;
mod folder;
mod growth;
mod judging;
mod matching;
mod model;
mod ranking;
mod setting;
mod surface;

pub use changes::{Changes, Drift, Lone, MeanRatio, changes};
pub use folder::{FolderError, RunFolder, read_report, write_atomically};
pub use growth::{Growth, growths};
pub use judging::{Bar, Change, Decider, Figure, Outcome, TRACKED, Tracked};
pub use matching::CellName;
pub use model::{Noise, Report, ReportCell, RunInfo, SCHEMA_VERSION, SamplesRef, TwinEntry};
pub use ranking::{Comparison, Ranked, comparisons, times_as_fast};
pub use setting::{Setting, settings};
pub use surface::{Crossing, Place, Surface, surfaces};
