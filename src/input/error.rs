//! What can be wrong with a scene or a camera file, each as one line that
//! says where, what was found and what was expected.

use std::path::PathBuf;

use crate::spec::SpecError;

#[derive(Debug, thiserror::Error)]
pub enum InputError {
    #[error("{}: {source}", path.display())]
    Io {
        path: PathBuf,
        source: std::io::Error,
    },
    /// A text file: `line` counts from 1 and includes the header.
    #[error("{file}, line {line}: {found}; expected {expected}")]
    Line {
        file: String,
        line: u64,
        found: String,
        expected: String,
    },
    /// A structured file, by the path of the value in it.
    #[error("{file}, {place}: {found}; expected {expected}")]
    Value {
        file: String,
        place: String,
        found: String,
        expected: String,
    },
    /// A binary file.
    #[error("{file}, byte {offset}: {found}; expected {expected}")]
    Byte {
        file: String,
        offset: u64,
        found: String,
        expected: String,
    },
    /// Several items of a file are bad; the first is named.
    #[error(
        "{first} ({count} bad items in all; --skip-bad-items leaves them out and reports the count)"
    )]
    BadItems {
        first: Box<InputError>,
        count: usize,
    },
    /// A scene that would not fit into memory; sizes in bytes.
    #[error(
        "{scene}: needs about {}{}, {} are free; expected a smaller n{}",
        gigabytes(*needed),
        if *structures > 0 { format!(" with {structures} structures") } else { String::new() },
        gigabytes(*available),
        if *structures > 1 { " or fewer structures" } else { "" }
    )]
    TooLarge {
        scene: String,
        structures: u64,
        needed: u64,
        available: u64,
    },
    #[error("scene '{scene}', item {item}: {reason}")]
    BadItem {
        scene: String,
        item: usize,
        reason: String,
    },
    #[error("{0}")]
    Spec(#[from] SpecError),
}

fn gigabytes(bytes: u64) -> String {
    format!("{:.1} GB", bytes as f64 / 1e9)
}
