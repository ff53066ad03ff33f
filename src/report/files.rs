//! Names of the files in a run's folder, and errors of reading and writing them.

use std::fmt::Display;
use std::io;
use std::path::Path;

use super::SCHEMA_VERSION;
use crate::json::JsonError;
use crate::shown::expected_by;

pub(super) const REPORT: &str = "report.json";
pub(super) const SUMMARY: &str = "summary.csv";
pub(super) const SAMPLES: &str = "samples.csv";
pub(super) const PAGE: &str = "report.html";
pub(super) const STREAM: &str = "stream.jsonl";

/// The first line of samples.csv.
pub(super) const SAMPLE_COLUMNS: &str = "scene,path,cache,structure,test,task,process,round,frame,\
                                         queries,cpu_ns,wall_ns,returned\n";

/// Error of reading, writing or joining runs: one line that names the place.
#[derive(Debug, thiserror::Error)]
#[error("{text}")]
pub struct FolderError {
    text: String,
    source: Option<io::Error>,
}

impl FolderError {
    pub(super) fn new(text: String) -> FolderError {
        FolderError { text, source: None }
    }

    /// An error in a file or folder: the text says what was found and expected.
    pub(super) fn at(path: &Path, text: impl Display) -> FolderError {
        FolderError::new(format!("{}: {text}", path.display()))
    }

    /// An error of the file system about a path.
    pub(super) fn io(path: &Path) -> impl Fn(io::Error) -> FolderError + Copy {
        move |source| {
            let source = bare(source);
            let expected = expected_by(&source, "file or folder");
            let text = format!("{}: {source}{expected}", path.display());
            FolderError {
                text,
                source: Some(source),
            }
        }
    }

    /// Text that is not the JSON of `whole`, such as "the report of a run".
    pub(super) fn json(path: &Path, error: &JsonError, whole: &str) -> FolderError {
        let (place, expected) = (error.place(), error.expected_of(whole));
        let (path, found) = (path.display(), &error.found);
        FolderError::new(format!("{path}, {place}: {found}; expected {expected}"))
    }

    /// A line that does not belong into a stream; `line` counts from 1.
    pub(super) fn line(path: &Path, line: usize, found: &str, expected: &str) -> FolderError {
        let path = path.display();
        FolderError::new(format!("{path}, line {line}: {found}; expected {expected}"))
    }

    /// A file of another schema version.
    pub(super) fn version(path: &Path, found: u32) -> FolderError {
        let text = format!("schema version {found}; expected {SCHEMA_VERSION}");
        FolderError::at(path, text)
    }

    /// A folder that holds a run already.
    pub(super) fn taken(path: &Path) -> FolderError {
        FolderError::new(format!(
            "{} already holds a run; expected an empty or new folder (continue it with --resume)",
            path.display()
        ))
    }
}

/// The error of the system, without the name of a temporary file.
pub fn bare(error: io::Error) -> io::Error {
    // `tempfile` wraps it so, and passes no more of it than its kind and text.
    match error.to_string().split_once(" at path \"") {
        Some((said, _)) if error.get_ref().is_some() => io::Error::new(error.kind(), said),
        _ => error,
    }
}
