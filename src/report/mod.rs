//! Reports: the model that other tools read, and the folder of a run.
//!
//! The model is versioned; in the folder every finished cell is on disk before the next begins.
//! Also evaluations of a report. Defines the formats; the figures come from `measure`.

mod changes;
mod experiment;
mod folder;
mod judging;
mod merge;
mod model;
mod ranking;
mod reading;
mod stream;
mod surface;
mod writing;

pub use crate::measure::{ReportCell, SamplesRef, TwinEntry};
pub use crate::statistics::{Change, Estimate, Judgement, Trimmed};
pub(crate) use changes::FEW_OTHERS;
pub use changes::{Basis, Setting, built_differently, changes, settings};
pub use experiment::Experiment;
pub(crate) use folder::save_page;
pub use folder::{RunFolder, StoppedRun, save_report};
pub(crate) use judging::WORK;
pub use judging::{Changes, CommonShift, JUDGED_METRICS, JudgedRow, Outcome, Unpaired, WorkChange};
pub use merge::{Merged, merge};
pub use model::{Noise, Report, RunInfo, SCHEMA_VERSION};
pub use ranking::{Comparison, comparisons};
pub(crate) use ranking::{Mean, Overall, times_as_fast};
pub(crate) use ranking::{answer_difference, grouped, query_difference, unique, work_difference};
pub use reading::{Reading, Views, read_report, read_stream, views};
pub use stream::{Header, Line, StoredPart, Stream};
pub(crate) use stream::{digits, utc};
pub use surface::{Crossing, Growth, Place, Surface, growths, surfaces};
pub(crate) use writing::{folder_of, temporary_in, try_folder, try_place, write_atomically};
