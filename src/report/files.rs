//! The files of a run's folder, and what can be wrong with them.

use std::io;
use std::path::{Path, PathBuf};

use super::SCHEMA_VERSION;

pub(super) const REPORT: &str = "report.json";
pub(super) const SUMMARY: &str = "summary.csv";
pub(super) const SAMPLES: &str = "samples.csv";
pub(super) const STREAM: &str = "stream.jsonl";

/// Why the folder of a run cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    /// `place` is a line with a column, and the path of the value there.
    #[error("{}, {place}: {found}; expected the report of a run{wanted}", path.display())]
    Json {
        path: PathBuf,
        place: String,
        found: String,
        wanted: String,
    },
    #[error("{}: schema version {found}; expected {SCHEMA_VERSION}", path.display())]
    Version { path: PathBuf, found: u32 },
    #[error("{} already holds a run; expected an empty or new folder (continue it with --resume)", path.display())]
    Taken { path: PathBuf },
    #[error("{}: another run is writing here; expected a folder of its own for each run", path.display())]
    Locked { path: PathBuf },
    #[error("{}, line {line}: {reason}; expected the stream of a run", path.display())]
    Line {
        path: PathBuf,
        line: usize,
        reason: String,
    },
}

impl FolderError {
    /// What the file system says of a path.
    pub(super) fn io(path: &Path) -> impl Fn(io::Error) -> FolderError + Copy {
        move |source| FolderError::Io {
            path: path.to_owned(),
            source,
        }
    }
}
