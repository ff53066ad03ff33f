//! Names of the files in a run's folder, and errors of reading and writing them.

use std::fmt::Display;
use std::io;
use std::path::Path;

use super::SCHEMA_VERSION;
use crate::input::InputError;
use crate::json::JsonError;

pub(super) const REPORT: &str = "report.json";
pub(super) const SUMMARY: &str = "summary.csv";
pub(super) const SAMPLES: &str = "samples.csv";
pub(super) const PAGE: &str = "report.html";
pub(super) const STREAM: &str = "stream.jsonl";

/// The first line of samples.csv.
pub(super) const SAMPLE_COLUMNS: &str = "scene,path,cache,structure,test,task,process,round,frame,\
                                         queries,cpu_ns,wall_ns,returned\n";

/// An error in a file or folder: the text says what was found and expected.
pub(super) fn at(path: &Path, text: impl Display) -> InputError {
    InputError::new(format_args!("{}: {text}", path.display()))
}

/// An error of the file system about a path.
pub(super) fn io(path: &Path) -> impl Fn(io::Error) -> InputError + Copy {
    InputError::io(path, "file or folder")
}

/// Text that is not the JSON of `whole`, such as "the report of a run".
pub(super) fn json(path: &Path, error: &JsonError, whole: &str) -> InputError {
    let expected = error.expected_of(whole);
    InputError::at(path.display(), error.place(), &error.found, expected)
}

/// A file of another schema version.
pub(super) fn version(path: &Path, found: u32) -> InputError {
    at(
        path,
        format_args!("schema version {found}; expected {SCHEMA_VERSION}"),
    )
}

/// A folder that holds a run already.
pub(super) fn taken(path: &Path) -> InputError {
    InputError::new(format_args!(
        "{} already holds a run; expected an empty or new folder (continue it with --resume)",
        path.display()
    ))
}
