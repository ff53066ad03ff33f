//! The files of a run's folder, and what can be wrong with them.

use std::io;
use std::path::{Path, PathBuf};

use super::SCHEMA_VERSION;
use crate::json::JsonError;

pub(super) const REPORT: &str = "report.json";
pub(super) const SUMMARY: &str = "summary.csv";
pub(super) const SAMPLES: &str = "samples.csv";
pub(super) const STREAM: &str = "stream.jsonl";

/// The first line of samples.csv.
pub(super) const SAMPLE_COLUMNS: &str = "scene,path,cache,structure,test,task,process,round,frame,\
                                         queries,cpu_ns,wall_ns,returned\n";

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
    /// Not the report or the stream of a run.
    #[error("{}, {}: {}; expected {}", path.display(), error.place(), error.found, error.expected_of(whole))]
    Json {
        /// File that was read.
        path: PathBuf,
        /// Where, and what is there.
        error: Box<JsonError>,
        /// What the file should be.
        whole: &'static str,
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
    /// A line of the stream that does not belong there.
    #[error("{}, line {line}: {found}; expected {expected}", path.display())]
    Line {
        /// File of the stream.
        path: PathBuf,
        /// From 1.
        line: usize,
        /// What is there.
        found: String,
        /// The rule.
        expected: &'static str,
    },
}

impl FolderError {
    /// What the file system says of a path.
    pub(super) fn io(path: &Path) -> impl Fn(io::Error) -> FolderError + Copy {
        move |source| FolderError::Io {
            path: path.to_owned(),
            source: bare(source),
        }
    }
}

/// What the system says, without the name of a temporary file that was wrapped around it.
pub fn bare(error: io::Error) -> io::Error {
    // `tempfile` wraps it so, and hands on no more of it than its kind and text.
    match error.to_string().split_once(" at path \"") {
        Some((said, _)) if error.get_ref().is_some() => io::Error::new(error.kind(), said),
        _ => error,
    }
}
