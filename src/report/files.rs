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
#[non_exhaustive]
pub enum FolderError {
    /// The system refused to read or write it.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// `place` is a line with a column, and the path of the value there.
    #[error("{}, {place}: {found}; expected the report of a run{wanted}", path.display())]
    Json {
        /// File that was read.
        path: PathBuf,
        /// Line with a column, and the path of the value.
        place: String,
        /// What is there.
        found: String,
        /// `, here ` with what was expected in that place, where it is known.
        wanted: String,
    },
    /// A report of another schema.
    #[error("{}: schema version {found}; expected {SCHEMA_VERSION}", path.display())]
    Version {
        /// File that was read.
        path: PathBuf,
        /// Its schema version.
        found: u32,
    },
    /// There is a run already.
    #[error("{} already holds a run; expected an empty or new folder (continue it with --resume)", path.display())]
    Taken {
        /// Folder of the run.
        path: PathBuf,
    },
    /// A run is being written there.
    #[error("{}: another run is writing here; expected a folder of its own for each run", path.display())]
    Locked {
        /// Folder of the run.
        path: PathBuf,
    },
    /// A line of the stream that cannot be read or does not belong there.
    #[error("{}, line {line}: {reason}; expected the stream of a run", path.display())]
    Line {
        /// File of the stream.
        path: PathBuf,
        /// From 1.
        line: usize,
        /// What is wrong with it.
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
