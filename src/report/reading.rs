//! Reading what runs have left: a report, or the stream behind it, whole or
//! stopped at any moment. Every error says where, what was found and what was
//! expected.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::files::{FolderError, REPORT, SAMPLE_COLUMNS, STREAM};
use super::stream::{Header, KeptPart, Stream};
use super::{Report, SCHEMA_VERSION};
use crate::json::{JsonError, from_json};
use crate::measure::{GroupKey, Part};
use crate::shown::plain;

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
    let bad = |error| FolderError::Json {
        path: path.clone(),
        error: Box::new(error),
        whole: "the report of a run",
    };
    let Versioned { schema_version } = from_json(&bytes).map_err(bad)?;
    if schema_version != SCHEMA_VERSION {
        return Err(FolderError::Version {
            path,
            found: schema_version,
        });
    }
    from_json(&bytes).map_err(bad)
}

/// Reads the stream of a run, and how long it is without half a line at its end.
///
/// # Errors
/// What the file system says; a line that is none or does not belong there (by its
/// number); another schema version.
pub fn read_stream(path: &Path) -> Result<(Stream, u64), FolderError> {
    /// Read first: what the rest of the line is.
    #[derive(Deserialize)]
    struct Tag {
        line: String,
        schema_version: Option<u32>,
    }
    let bytes = fs::read(path).map_err(FolderError::io(path))?;
    let whole = bytes
        .iter()
        .rposition(|b| *b == b'\n')
        .map_or(0, |at| at + 1);
    let mut header: Option<Header> = None;
    let (mut parts, mut finished_at) = (Vec::new(), None);
    let mut seen = BTreeSet::new();
    let mut samples_end = SAMPLE_COLUMNS.len() as u64;
    // By their JSON: a key has a number that is no key of a map.
    let mut groups = BTreeMap::new();
    let name_of = |key: &GroupKey| serde_json::to_string(key).unwrap_or_default();
    for (n, text) in bytes[..whole].split(|b| *b == b'\n').enumerate() {
        if text.is_empty() {
            continue;
        }
        let no_json = |error| FolderError::Json {
            path: path.to_owned(),
            error: Box::new(JsonError {
                line: n + 1,
                ..error
            }),
            whole: "the stream of a run",
        };
        let bad = |found: String, expected| FolderError::Line {
            path: path.to_owned(),
            line: n + 1,
            found,
            expected,
        };
        let tag: Tag = from_json(text).map_err(no_json)?;
        match (tag.line.as_str(), &header) {
            ("run", None) => {
                let version = tag.schema_version.unwrap_or(SCHEMA_VERSION);
                if version != SCHEMA_VERSION {
                    return Err(FolderError::Version {
                        path: path.to_owned(),
                        found: version,
                    });
                }
                let found: Header = from_json(text).map_err(no_json)?;
                groups.extend(found.groups.iter().map(name_of).zip(0..));
                header = Some(found);
            }
            ("run", Some(_)) => {
                return Err(bad("a second header".to_owned(), "one, in the first line"));
            }
            ("part", Some(header)) => {
                let kept: KeptPart = from_json(text).map_err(no_json)?;
                let Part { key, process, .. } = &kept.part;
                let group: Option<usize> = groups.get(&name_of(key)).copied();
                let found = || {
                    let GroupKey {
                        scene, path, test, ..
                    } = key;
                    let process = u64::from(*process) + 1;
                    format!("process {process} of {scene}, {path}, {test}")
                };
                let Some(group) = group.filter(|_| *process < header.run.processes) else {
                    return Err(bad(found(), "a part of the plan in the first line"));
                };
                // Counted twice, it would be a process more than there was.
                if !seen.insert((group, *process)) {
                    return Err(bad(found() + " a second time", "each part once"));
                }
                if kept.samples_end < samples_end {
                    let found = format!("samples that end at byte {}", kept.samples_end);
                    return Err(bad(found, "an end behind that of the part before"));
                }
                samples_end = kept.samples_end;
                finished_at = None;
                parts.push(kept);
            }
            ("finished", Some(_)) => {
                let Finished { at } = from_json(text).map_err(no_json)?;
                finished_at = Some(at);
            }
            (_, None) => break,
            (other, _) => {
                let found = format!("a line '{}'", plain(other));
                return Err(bad(found, "'part' or 'finished'"));
            }
        }
    }
    let header = header.ok_or_else(|| FolderError::Line {
        path: path.to_owned(),
        line: 1,
        found: "no run begins here".to_owned(),
        expected: "the stream of a run",
    })?;
    let stream = Stream {
        header,
        parts,
        finished_at,
    };
    Ok((stream, whole as u64))
}

/// The last line, as it is read.
#[derive(Deserialize)]
struct Finished {
    at: String,
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
            ("{\"schema_version\": 2}", "no field 'run'"),
            ("{}", "no field 'schema_version'"),
            ("[1, 2]", "expected the report of a run"),
            ("", "expected the report of a run"),
        ] {
            assert!(refused(text.as_bytes()).contains(wanted), "{text}");
        }
        assert!(refused(&[0xFF; 9]).contains("UTF-8"));
    }
}
