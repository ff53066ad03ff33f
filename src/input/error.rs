//! Errors in files and texts of users, each one line: where, found, expected.

use std::fmt::Display;
use std::path::Path;
use std::{fs, io};

use crate::shown::{expected_by, kind_of, plain};
use crate::spec::{SpecError, nearest};

/// A result of reading a user's input.
pub type Result<T, E = InputError> = std::result::Result<T, E>;

/// Error of reading or writing a file or a text, in one line.
///
/// It says where, what was found and what was expected.
#[derive(Debug, thiserror::Error)]
#[error("{text}")]
pub struct InputError {
    text: String,
    source: Option<io::Error>,
}

impl InputError {
    /// An error that reads as this text.
    pub fn new(text: impl Display) -> InputError {
        InputError {
            text: text.to_string(),
            source: None,
        }
    }

    /// An error in a place of a file: `line 3`, `byte 17`, `cases[3].near`.
    pub fn at(
        file: &str,
        place: impl Display,
        found: impl Display,
        expected: impl Display,
    ) -> Self {
        InputError::new(format_args!(
            "{file}, {place}: {found}; expected {expected}"
        ))
    }

    /// An error in a line of a text file; `line` counts from 1, the header included.
    pub fn line(file: &str, line: u64, found: impl Display, expected: impl Display) -> Self {
        InputError::at(file, format_args!("line {line}"), found, expected)
    }

    /// An error in a binary file behind `offset` bytes.
    pub fn byte(file: &str, offset: usize, found: impl Display, expected: impl Display) -> Self {
        InputError::at(file, format_args!("byte {offset}"), found, expected)
    }

    /// An error of the system about a path, which is a "file" or a "file or folder".
    pub fn io(path: &Path, what: &str) -> impl Fn(io::Error) -> InputError + Copy {
        move |error| {
            let source = bare(error);
            let expected = expected_by(&source, what) + &alike(path, &source).unwrap_or_default();
            InputError {
                text: plain(&format!("{}: {source}{expected}", path.display())),
                source: Some(source),
            }
        }
    }
}

/// "; did you mean 'city.csv'?" where a folder has nearly that name.
fn alike(path: &Path, error: &io::Error) -> Option<String> {
    if kind_of(error) != io::ErrorKind::NotFound {
        return None;
    }
    let files = fs::read_dir(Path::new(".").join(path).parent()?).ok()?;
    let names = files.filter_map(|file| file.ok()?.file_name().into_string().ok());
    let (names, name) = (names.collect::<Vec<_>>(), path.file_name()?.to_str()?);
    let others = names.iter().map(String::as_str);
    let others = others.filter(|other| *other != name);
    let name = nearest(name, others)?;
    Some(format!("; did you mean '{name}'?"))
}

impl From<SpecError> for InputError {
    fn from(error: SpecError) -> InputError {
        InputError::new(error)
    }
}

/// The error of the system, without the name of a temporary file.
pub fn bare(error: io::Error) -> io::Error {
    // `tempfile` wraps it so, and passes no more of it than its kind and text.
    match error.to_string().split_once(" at path \"") {
        Some((said, _)) if error.get_ref().is_some() => io::Error::new(kind_of(&error), said),
        _ => error,
    }
}

pub fn gigabytes(bytes: u64) -> String {
    match bytes {
        0..1_000_000_000 => format!("{:.0} MB", bytes as f64 / 1e6),
        _ => format!("{:.1} GB", bytes as f64 / 1e9),
    }
}
