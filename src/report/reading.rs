//! Reading what runs have left: a report, or the stream behind it, whole or
//! stopped at any moment. Every error says where, what was found and what was
//! expected.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::files::{FolderError, REPORT, STREAM};
use super::stream::{Line, Stream};
use super::{Report, SCHEMA_VERSION};

/// Reads a report from its file, or from the folder of a run, finished or not.
/// Fields that it does not know are ignored.
///
/// # Errors
/// What the file system says, not a report, or one of another schema version.
pub fn read_report(path: &Path) -> Result<Report, FolderError> {
    let stream = path.join(STREAM);
    if !path.is_dir() || !stream.is_file() {
        return read_json(match path.is_dir() {
            true => path.join(REPORT),
            false => path.to_owned(),
        });
    }
    // What was derived last may lack what has been measured since.
    match read_json(path.join(REPORT)) {
        Ok(report) if report.run.finished_at.is_some() => Ok(report),
        _ => Ok(read_stream(&stream)?.0.report()),
    }
}

fn read_json(path: PathBuf) -> Result<Report, FolderError> {
    /// Read first: another version has other fields, and that is no damage.
    #[derive(Deserialize)]
    struct Versioned {
        schema_version: u32,
    }
    let bytes = fs::read(&path).map_err(FolderError::io(&path))?;
    let text = std::str::from_utf8(&bytes).map_err(|error| {
        let (good, bad) = bytes.split_at(error.valid_up_to());
        let line = good.iter().filter(|byte| **byte == b'\n').count() + 1;
        let column = good.iter().rev().take_while(|byte| **byte != b'\n').count() + 1;
        FolderError::Json {
            path: path.clone(),
            place: format!("line {line}, column {column}"),
            found: format!("byte {:#04x}, which is no UTF-8", bad.first().unwrap_or(&0)),
            wanted: String::new(),
        }
    })?;
    let Versioned { schema_version } = from_json(text, &path)?;
    if schema_version != SCHEMA_VERSION {
        return Err(FolderError::Version {
            path,
            found: schema_version,
        });
    }
    from_json(text, &path)
}

/// Reads JSON; an error names line, column and the path of the value.
fn from_json<'t, T: Deserialize<'t>>(text: &'t str, path: &Path) -> Result<T, FolderError> {
    let mut json = serde_json::Deserializer::from_str(text);
    let read = serde_path_to_error::deserialize(&mut json);
    let (value_path, error) = match read {
        Ok(value) => match json.end() {
            Ok(()) => return Ok(value),
            Err(error) => (String::new(), error),
        },
        Err(error) => match error.path().to_string() {
            top if top == "." => (String::new(), error.into_inner()),
            inside => (format!(", {inside}"), error.into_inner()),
        },
    };
    let told = error.to_string();
    let told = told.split(" at line ").next().unwrap_or_default();
    let (found, wanted) = match told.rsplit_once(", expected ") {
        Some((found, wanted)) => (found, format!(", here {wanted}")),
        None => (told, String::new()),
    };
    Err(FolderError::Json {
        path: path.to_owned(),
        place: format!(
            "line {}, column {}{value_path}",
            error.line(),
            error.column()
        ),
        found: found.to_owned(),
        wanted,
    })
}

/// Reads the stream of a run, and how long it is without half a line at its end.
///
/// # Errors
/// What the file system says; a line that is none (by its number); another
/// schema version.
pub fn read_stream(path: &Path) -> Result<(Stream, u64), FolderError> {
    let bytes = fs::read(path).map_err(FolderError::io(path))?;
    let whole = bytes
        .iter()
        .rposition(|b| *b == b'\n')
        .map_or(0, |at| at + 1);
    let bad = |line: usize, reason: String| FolderError::Line {
        path: path.to_owned(),
        line: line + 1,
        reason,
    };
    let mut header = None;
    let (mut parts, mut finished_at) = (Vec::new(), None);
    for (n, text) in bytes[..whole].split(|b| *b == b'\n').enumerate() {
        if text.is_empty() {
            continue;
        }
        match serde_json::from_slice(text).map_err(|e| bad(n, e.to_string()))? {
            Line::Run(found) if found.schema_version != SCHEMA_VERSION => {
                return Err(FolderError::Version {
                    path: path.to_owned(),
                    found: found.schema_version,
                });
            }
            Line::Run(found) => header = Some(*found),
            Line::Part(kept) => {
                finished_at = None;
                parts.push(*kept);
            }
            Line::Finished { at } => finished_at = Some(at),
        }
    }
    let header = header.ok_or_else(|| bad(0, "no run begins here".to_owned()))?;
    let stream = Stream {
        header,
        parts,
        finished_at,
    };
    Ok((stream, whole as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_version_is_told_from_something_else() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |text: &[u8]| {
            fs::write(folder.path().join(REPORT), text).unwrap();
            // The folder or the file in it: the same.
            let error = read_report(folder.path()).unwrap_err().to_string();
            let again = read_report(&folder.path().join(REPORT)).unwrap_err();
            assert_eq!(error, again.to_string());
            assert!(!error.contains('\n'), "{error}");
            error
        };
        for (text, wanted) in [
            (
                "{\"schema_version\": 3, \"cells\": 7}",
                "version 3; expected 2",
            ),
            ("{\"schema_version\": 2}", "missing field `run`"),
            ("{}", "missing field `schema_version`"),
            ("[1, 2]", "expected the report of a run"),
            ("", "expected the report of a run"),
        ] {
            assert!(refused(text.as_bytes()).contains(wanted), "{text}");
        }
        assert!(refused(&[0xFF; 9]).contains("UTF-8"));
    }
}
