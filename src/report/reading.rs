//! Reads the results of runs: a report, or the stream it is made from.
//!
//! The stream may be complete or cut off at any byte. Every error names the place, what was found
//! and what was expected.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::ranking::without_false_ranks;
use super::stream::{Header, StoredPart, Stream};
use super::writing::{self, REPORT, SAMPLE_COLUMNS, SAMPLES, STREAM};
use super::{Report, ReportCell, SCHEMA_VERSION};
use crate::input::InputError;
use crate::json::{JsonError, from_json};
use crate::measure::{GroupKey, Part, TaskKind};
use crate::shown::{lines, plain};
use crate::statistics::median;

/// Reads a report from its file, or from the folder of a run, finished or not.
///
/// Unknown fields are ignored.
///
/// # Errors
/// I/O errors, a file that is not a report, or another schema version.
pub fn read_report(path: &Path) -> Result<Report, InputError> {
    if !path.is_dir() {
        return read_json(path.to_owned());
    }
    let stream = path.join(STREAM);
    // An unfinished report may lack results that the stream has.
    match read_json(path.join(REPORT)) {
        Ok(report) if report.run.finished_at.is_some() => Ok(report),
        read if !stream.is_file() => read,
        _ => Ok(read_stream(&stream)?.0.report()),
    }
}

fn read_json(path: PathBuf) -> Result<Report, InputError> {
    /// Read first: another version has other fields, and that is not damage.
    #[derive(Deserialize)]
    struct Versioned {
        schema_version: u32,
    }
    let bytes = fs::read(&path).map_err(writing::io(&path))?;
    let bad = |error| writing::json(&path, &error, "the report of a run");
    let Versioned { schema_version } = from_json(&bytes).map_err(bad)?;
    if schema_version != SCHEMA_VERSION {
        return Err(writing::version(&path, schema_version));
    }
    let mut report: Report = from_json(&bytes).map_err(bad)?;
    without_false_ranks(&mut report.cells);
    let mut seen = BTreeSet::new();
    let mut keys = report.cells.iter().map(ReportCell::key);
    if let Some(twice) = keys.find(|key| !seen.insert((key.group.id(), key.structure.clone()))) {
        let (file, group) = (path.display().to_string(), twice.group);
        let found = format!("{} on {} a second time", twice.structure, group.path);
        return Err(InputError::at(&file, group.scene, found, "each cell once"));
    }
    Ok(report)
}

/// Reads the stream of a run, and the ends of its lines in bytes.
///
/// The ends of the header and of each part, then the end of the last complete line.
///
/// # Errors
/// I/O errors; a line that is invalid or out of place (by its number); another schema version.
pub fn read_stream(path: &Path) -> Result<(Stream, Vec<u64>), InputError> {
    /// Read first: the kind of the line.
    #[derive(Deserialize)]
    struct Tag {
        line: String,
        schema_version: Option<u32>,
    }
    #[derive(Deserialize)]
    struct Finished {
        at: String,
    }
    let bytes = fs::read(path).map_err(writing::io(path))?;
    let file = path.display().to_string();
    let mut stream: Option<Stream> = None;
    let (mut seen, mut groups) = (BTreeSet::new(), BTreeMap::new());
    let (mut ends, mut end) = (Vec::new(), 0);
    let lines = (1..).zip(bytes.split_inclusive(|b| *b == b'\n'));
    for (n, text) in lines.take_while(|(_, text)| text.ends_with(b"\n")) {
        end += text.len() as u64;
        if text == b"\n" {
            continue;
        }
        let text = &text[..text.len() - 1];
        let no_json = |error| {
            let error = JsonError { line: n, ..error };
            writing::json(path, &error, "the stream of a run")
        };
        let bad = |found: &str, expected| Err(InputError::line(&file, n as u64, found, expected));
        let tag: Tag = from_json(text).map_err(no_json)?;
        match (tag.line.as_str(), &mut stream) {
            ("run", None) => {
                let version = tag.schema_version.unwrap_or(SCHEMA_VERSION);
                if version != SCHEMA_VERSION {
                    return Err(writing::version(path, version));
                }
                let header: Header = from_json(text).map_err(no_json)?;
                groups.extend(header.groups.iter().map(GroupKey::id).zip(0_usize..));
                stream = Some(Stream::of(header));
                ends.push(end);
            }
            ("run", Some(_)) => return bad("a second header", "one, in the first line"),
            ("part", Some(stream)) => {
                let kept: StoredPart = from_json(text).map_err(no_json)?;
                let Part { key, process, .. } = &kept.part;
                let (scene, way, test) = (&key.scene, &key.path, &key.test);
                let number = u64::from(*process) + 1;
                let found = format!("process {number} of {scene}, {way}, {test}");
                let group = groups.get(&key.id());
                let group = group.filter(|_| *process < stream.header.run.processes);
                let Some(group) = group else {
                    return bad(&found, "a part of the plan in the first line");
                };
                // Counted twice, it would add a process that did not exist.
                if !seen.insert((*group, *process)) {
                    return bad(&format!("{found} a second time"), "each part once");
                }
                // Only the first has the answers and the plan.
                if !seen.contains(&(*group, 0)) {
                    return bad(&found, "the part of its process 1 before it");
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
    let none = || InputError::line(&file, 1, "no run begins here", "the stream of a run");
    Ok((stream.ok_or_else(none)?, ends))
}

/// A clock reading along a path: the median over all rounds.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Reading {
    /// Middle of the views, as an index of the path; for a motion the frame.
    pub frame: f64,
    /// Number of views in the reading.
    pub queries: u32,
    /// CPU time per query; for a motion per frame, update and all queries.
    pub ns: f64,
}

/// The views of one group.
#[derive(Clone, Default, PartialEq, Debug)]
pub struct Views {
    /// Visible items of each view of the path.
    pub visible: Vec<u64>,
    /// Readings of each structure, in the order of the path.
    pub times: BTreeMap<String, Vec<Reading>>,
}

/// Times of each reading, by its first view and the number of views.
type Readings = BTreeMap<(u32, u32), Vec<f64>>;

/// A row of samples.csv up to the CPU time.
///
/// Six names, then process, round, frame and queries.
type SampleRow = ([String; 6], [u32; 4], f64);

/// The views of a report in its folder, by the text of their keys.
///
/// Empty without the stream of the same run.
pub fn views(folder: &Path, report: &Report) -> BTreeMap<String, Views> {
    let stream = read_stream(&folder.join(STREAM));
    let Some((stream, _)) = stream.ok().filter(|s| s.0.header.run.id == report.run.id) else {
        return BTreeMap::new();
    };
    let mut cells: BTreeMap<[String; 6], Readings> = BTreeMap::new();
    let samples = csv::Reader::from_path(folder.join(SAMPLES));
    for row in samples.into_iter().flat_map(csv::Reader::into_deserialize) {
        let Ok((names, [_, _, frame, queries], ns)): Result<SampleRow, _> = row else {
            break;
        };
        let readings = cells.entry(names).or_default();
        readings.entry((frame, queries)).or_default().push(ns);
    }
    let mut all = BTreeMap::new();
    for kept in stream.parts.iter().map(|kept| &kept.part) {
        let Some(known) = kept.known.as_ref().filter(|_| kept.process == 0) else {
            continue;
        };
        let schedule = known.query.as_ref().map(|query| &query.schedule.cameras);
        let own = |label: &str| {
            let key = &kept.key;
            let path = key.samples_path();
            let task = match key.motion.is_empty() {
                true => TaskKind::Query.name(),
                false => TaskKind::Frame.name(),
            };
            let names = [&key.scene, &path, &key.cache, label, &key.test, task];
            let readings = cells.get(&names.map(lines))?;
            let reading = |(&(frame, queries), ns): (&(u32, u32), &Vec<f64>)| {
                let mut last = frame;
                if key.motion.is_empty() {
                    let cameras = schedule?;
                    let first = cameras.iter().position(|camera| *camera == frame)?;
                    last = *cameras.get(first + (queries as usize).max(1) - 1)?;
                }
                let frame = (f64::from(frame) + f64::from(last)) / 2.0;
                let ns = median(ns)?;
                Some(Reading { frame, queries, ns })
            };
            let readings = readings.iter().filter_map(reading).collect();
            Some((label.to_owned(), readings))
        };
        let labels = kept.subjects.iter().map(|subject| subject.label.as_str());
        let visible = known.visible.iter().map(|answer| answer.count).collect();
        let times = labels.filter_map(own).collect();
        all.insert(kept.key.id(), Views { visible, times });
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_version_is_told_from_something_else() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |text: &[u8]| {
            fs::write(folder.path().join(REPORT), text).unwrap();
            // The folder or the file in it: the same result.
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
        assert!(refused(b"\x1f\x8b\x08").contains("gzip, which has to be unpacked first"));
    }
}
