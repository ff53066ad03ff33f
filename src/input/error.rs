//! Errors in files and texts of users, each one line: where, found, expected.

use std::path::PathBuf;

use crate::shown::expected_by;
use crate::spec::SpecError;

/// Why a file or text cannot be used: where, what was found, what was expected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// The system refused to read it.
    #[error("{}: {source}{}", path.display(), expected_by(source, "file"))]
    Io {
        /// File that was to be read.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// A file that has changed since it was read ([`hold_files`](super::hold_files)).
    #[error("{}: has changed since it was first read; expected the same file until the end", path.display())]
    Changed {
        /// Name of the file.
        path: PathBuf,
    },
    /// A text file: `line` counts from 1 and includes the header.
    #[error("{file}, line {line}: {found}; expected {expected}")]
    Line {
        /// Name of the file.
        file: String,
        /// From 1, the header included.
        line: u64,
        /// Text that was found.
        found: String,
        /// The rule.
        expected: String,
    },
    /// A structured file, by the path of the value in it.
    #[error("{file}, {place}: {found}; expected {expected}")]
    Value {
        /// Name of the file.
        file: String,
        /// Path of the value, `cases[3].near`.
        place: String,
        /// Text that was found.
        found: String,
        /// The rule.
        expected: String,
    },
    /// A binary file.
    #[error("{file}, byte {offset}: {found}; expected {expected}")]
    Byte {
        /// Name of the file.
        file: String,
        /// Bytes before it.
        offset: u64,
        /// Bytes that were found.
        found: String,
        /// The rule.
        expected: String,
    },
    /// Several items of a file are bad; the first is named.
    #[error(
        "{first} ({count} bad items in all; --skip-bad-items leaves them out and reports the count)"
    )]
    BadItems {
        /// The first of them.
        first: Box<InputError>,
        /// How many there are, the first included.
        count: usize,
    },
    /// A scene that would not fit into memory; sizes in bytes.
    #[error(
        "{scene}: needs about {}{}, {} are free; expected fewer items{}",
        gigabytes(*needed),
        match structures {
            0 => String::new(),
            1 => " with 1 structure".to_owned(),
            more => format!(" with {more} structures"),
        },
        gigabytes(*available),
        if *structures > 1 { " or fewer structures" } else { "" }
    )]
    TooLarge {
        /// Name of the scene.
        scene: String,
        /// Structures that are to be built at once; 0 for the scene alone.
        structures: u64,
        /// Bytes that are needed.
        needed: u64,
        /// Bytes that are free.
        available: u64,
    },
    /// An item of a scene that was not read from a file.
    #[error("scene '{scene}', item {item}: {reason}")]
    BadItem {
        /// Name of the scene.
        scene: String,
        /// Index of the item.
        item: usize,
        /// Text found and text expected.
        reason: String,
    },
    /// The name or a parameter is wrong.
    #[error("{0}")]
    Spec(#[from] SpecError),
}

impl InputError {
    /// An error in a line of a text file; `line` counts from 1.
    pub fn line(
        file: &str,
        line: u64,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> InputError {
        InputError::Line {
            file: file.to_owned(),
            line,
            found: found.into(),
            expected: expected.into(),
        }
    }
}

pub(crate) fn gigabytes(bytes: u64) -> String {
    match bytes {
        0..1_000_000_000 => format!("{:.0} MB", bytes as f64 / 1e6),
        _ => format!("{:.1} GB", bytes as f64 / 1e9),
    }
}
