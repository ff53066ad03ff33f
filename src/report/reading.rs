//! Reading what runs have left: a report, or the stream behind it, whole or
//! stopped at any moment. Every error says where, what was found and what was
//! expected.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::files::{self, REPORT, SAMPLE_COLUMNS, STREAM};
use super::stream::{Header, KeptPart, Stream};
use super::{Report, SCHEMA_VERSION};
use crate::input::InputError;
use crate::json::{JsonError, from_json};
use crate::measure::{GroupKey, Part};
use crate::shown::plain;

/// Reads a report from its file, or from the folder of a run, finished or not.
/// Fields that it does not know are ignored.
///
/// # Errors
/// I/O errors, a file that is not a report, or another schema version.
pub fn read_report(path: &Path) -> Result<Report, InputError> {
    let stream = path.join(STREAM);
    if !path.is_dir() || !stream.is_file() {
        return read_json(match path.is_dir() {
            true => path.join(REPORT),
            false => path.to_owned(),
        });
    }
    // An unfinished report may lack results that the stream has.
    match read_json(path.join(REPORT)) {
        Ok(report) if report.run.finished_at.is_some() => Ok(report),
        _ => Ok(read_stream(&stream)?.0.report()),
    }
}

fn read_json(path: PathBuf) -> Result<Report, InputError> {
    /// Read first: another version has other fields, and that is no damage.
    #[derive(Deserialize)]
    struct Versioned {
        schema_version: u32,
    }
    let bytes = fs::read(&path).map_err(files::io(&path))?;
    let bad = |error| files::json(&path, &error, "the report of a run");
    let Versioned { schema_version } = from_json(&bytes).map_err(bad)?;
    match schema_version == SCHEMA_VERSION {
        true => from_json(&bytes).map_err(bad),
        false => Err(files::version(&path, schema_version)),
    }
}

/// Reads the stream of a run, and the ends of its lines in bytes: of the header,
/// of each part, and last of the whole without half a line at its end.
///
/// # Errors
/// Errors of the file system; a line that is none or does not belong there (by its
/// number); another schema version.
pub fn read_stream(path: &Path) -> Result<(Stream, Vec<u64>), InputError> {
    /// Read first: the kind of the rest of the line.
    #[derive(Deserialize)]
    struct Tag {
        line: String,
        schema_version: Option<u32>,
    }
    #[derive(Deserialize)]
    struct Finished {
        at: String,
    }
    let bytes = fs::read(path).map_err(files::io(path))?;
    let mut stream: Option<Stream> = None;
    let (mut seen, mut groups) = (BTreeSet::new(), BTreeMap::new());
    let (mut ends, mut end) = (Vec::new(), 0);
    let lines = bytes.split_inclusive(|b| *b == b'\n');
    for (n, text) in lines
        .enumerate()
        .take_while(|(_, text)| text.ends_with(b"\n"))
    {
        end += text.len() as u64;
        if text == b"\n" {
            continue;
        }
        let text = &text[..text.len() - 1];
        let no_json = |error| {
            let error = JsonError {
                line: n + 1,
                ..error
            };
            files::json(path, &error, "the stream of a run")
        };
        let bad = |found: &str, expected| {
            Err(InputError::line(
                path.display(),
                n as u64 + 1,
                found,
                expected,
            ))
        };
        let tag: Tag = from_json(text).map_err(no_json)?;
        match (tag.line.as_str(), &mut stream) {
            ("run", None) => {
                let version = tag.schema_version.unwrap_or(SCHEMA_VERSION);
                if version != SCHEMA_VERSION {
                    return Err(files::version(path, version));
                }
                let header: Header = from_json(text).map_err(no_json)?;
                groups.extend(header.groups.iter().map(GroupKey::id).zip(0_usize..));
                stream = Some(Stream::of(header));
                ends.push(end);
            }
            ("run", Some(_)) => return bad("a second header", "one, in the first line"),
            ("part", Some(stream)) => {
                let kept: KeptPart = from_json(text).map_err(no_json)?;
                let Part { key, process, .. } = &kept.part;
                let (scene, way, test) = (&key.scene, &key.path, &key.test);
                let number = u64::from(*process) + 1;
                let found = format!("process {number} of {scene}, {way}, {test}");
                let group = groups.get(&key.id());
                let group = group.filter(|_| *process < stream.header.run.processes);
                let Some(group) = group else {
                    return bad(&found, "a part of the plan in the first line");
                };
                // Counted twice, it would be a process more than there was.
                if !seen.insert((*group, *process)) {
                    return bad(&format!("{found} a second time"), "each part once");
                }
                let before = stream.parts.last().map(|kept| kept.samples_end);
                if kept.samples_end < before.unwrap_or(SAMPLE_COLUMNS.len() as u64) {
                    let found = format!("samples that end at byte {}", kept.samples_end);
                    return bad(&found, "an end behind that of the part before");
                }
                stream.finished_at = None;
                stream.parts.push(kept);
                ends.push(end);
            }
            ("finished", Some(stream)) => {
                let Finished { at } = from_json(text).map_err(no_json)?;
                stream.finished_at = Some(at);
            }
            (_, None) => break,
            (other, _) => {
                let found = format!("a line '{}'", plain(other));
                return bad(&found, "'part' or 'finished'");
            }
        }
    }
    ends.push(end);
    let none = || {
        InputError::line(
            path.display(),
            1,
            "no run begins here",
            "the stream of a run",
        )
    };
    Ok((stream.ok_or_else(none)?, ends))
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
