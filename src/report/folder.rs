//! The folder of a run.
//!
//! stream.jsonl and samples.csv are appended to during the run; report.json and summary.csv are
//! made from them at its end. Those two are written under temporary names and renamed, so that
//! readers and crashes never leave half a file.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::NamedTempFile;

use super::reading::read_stream;
use super::stream::{Header, Line, StoredPart, Stream};
use super::writing::{self, PAGE, REPORT, SAMPLE_COLUMNS, SAMPLES, STREAM, SUMMARY};
use super::writing::{locked_temporary_in, replace_atomically, sweep};
use super::{Report, ReportCell};
use crate::input::InputError;
use crate::measure::{METRICS, Part, TaskSamples};
use crate::shown::lines;

/// The folder of a run that is being measured, locked against others.
pub struct RunFolder {
    /// The folder that is written to.
    pub path: PathBuf,
    /// Holds the lock as long as it is open.
    stream: File,
    samples: File,
}

impl RunFolder {
    /// Creates the folder of a new run.
    ///
    /// # Errors
    /// The folder contains a file of a run already.
    pub fn create(path: &Path, header: &Header) -> Result<RunFolder, InputError> {
        let io = writing::io(path);
        let is_new = !path.exists();
        fs::create_dir_all(path).map_err(io)?;
        refuse_taken(path)?;
        // The stream gets its name together with its first line.
        let begin = || -> io::Result<NamedTempFile> {
            let (mut stream, is_locked) = locked_temporary_in(path)?;
            stream.write_all(&Line::Run(header).to_json()?)?;
            is_locked?;
            Ok(stream)
        };
        let file = path.join(STREAM);
        let begun = begin().map_err(|error| {
            if is_new {
                let _ = fs::remove_dir(path);
            }
            io(error)
        })?;
        let named = begun.persist_noclobber(&file);
        let stream = named.map_err(|error| match error.error.kind() {
            io::ErrorKind::AlreadyExists => writing::taken(path),
            _ => io(error.error),
        })?;
        let mut folder = RunFolder {
            path: path.to_owned(),
            stream,
            samples: open(&path.join(SAMPLES))?,
        };
        if let Err(error) = folder.begin_samples() {
            folder.discard();
            return Err(error);
        }
        Ok(folder)
    }

    /// Resets the samples to the line of column names.
    fn begin_samples(&mut self) -> Result<(), InputError> {
        let mut write = || {
            self.samples.set_len(0)?;
            self.samples.write_all(SAMPLE_COLUMNS.as_bytes())
        };
        write().map_err(writing::io(&self.path.join(SAMPLES)))
    }

    /// Appends a line, whole or not at all as far as a reader can tell.
    ///
    /// # Errors
    /// I/O errors.
    pub fn append(&mut self, line: Line) -> Result<(), InputError> {
        let written = line.to_json().and_then(|text| self.stream.write_all(&text));
        written.map_err(writing::io(&self.path.join(STREAM)))
    }

    /// Appends a part: its samples first, then the line that refers to them.
    ///
    /// # Errors
    /// I/O errors.
    pub fn keep(&mut self, part: Part, samples: &[TaskSamples]) -> Result<StoredPart, InputError> {
        let (key, path) = (&part.key, part.key.samples_path());
        let mut rows = BTreeMap::new();
        let mut write = || -> Result<Vec<u8>, csv::Error> {
            let mut csv = csv::Writer::from_writer(Vec::new());
            for (label, task, samples) in samples {
                let names = [&key.scene, &path, &key.cache, label, &key.test];
                let names = names.map(|name| lines(name));
                for s in samples {
                    let at = (part.process, s.round, s.frame, s.queries);
                    let [cpu_ns, wall_ns] = [s.cpu_ns, s.wall_ns].map(|ns| format!("{ns:.3}"));
                    csv.serialize((&names, task.name(), at, cpu_ns, wall_ns, s.returned))?;
                    *rows.entry(label.clone()).or_insert(0) += 1;
                }
            }
            Ok(csv.into_inner().map_err(csv::IntoInnerError::into_error)?)
        };
        let file = self.path.join(SAMPLES);
        let io = writing::io(&file);
        let text = write().map_err(|error| io(error.into()))?;
        self.samples.write_all(&text).map_err(io)?;
        let samples_end = self.samples.metadata().map_err(io)?.len();
        let kept = StoredPart {
            part,
            rows,
            samples_end,
        };
        self.append(Line::Part(&kept))?;
        Ok(kept)
    }

    /// Removes the folder of a run that ended before its first part.
    pub fn discard(self) {
        for name in [STREAM, SAMPLES] {
            let _ = fs::remove_file(self.path.join(name));
        }
        // Fails if the folder has other files.
        let _ = fs::remove_dir(&self.path);
    }
}

/// Longest wait for the lock of a run.
///
/// A worker just started by a killed run holds the lock until it has executed its program.
const PATIENCE: Duration = Duration::from_secs(1);

/// The folder of a stopped run: locked, and otherwise unchanged.
pub struct StoppedRun {
    /// The folder that is read.
    pub path: PathBuf,
    /// Number of parts whose samples are missing, to be measured again.
    pub lost: usize,
    stream: File,
    /// Length of the stream up to the last complete line with its samples.
    length: u64,
}

impl StoppedRun {
    /// Opens the folder of a stopped run, with the contents of its stream.
    ///
    /// An incomplete last line is ignored, and parts whose samples are missing are measured again.
    ///
    /// # Errors
    /// No stream, not a stream, another schema version, or another process writing there.
    pub fn open(path: &Path) -> Result<(StoppedRun, Stream), InputError> {
        let file = path.join(STREAM);
        let io = writing::io(&file);
        fs::metadata(&file).map_err(io)?;
        let lock = open(&file)?;
        let begin = Instant::now();
        loop {
            match lock.try_lock() {
                Ok(()) => break,
                Err(fs::TryLockError::WouldBlock) if begin.elapsed() < PATIENCE => {
                    thread::sleep(PATIENCE / 50);
                }
                Err(fs::TryLockError::WouldBlock) => {
                    let found = "another run is writing here; expected a folder of its own for \
                                 each run";
                    return Err(writing::at(path, found));
                }
                Err(fs::TryLockError::Error(source)) => return Err(io(source)),
            }
        }
        let (mut stream, ends) = read_stream(&file)?;
        let samples = length_of_samples(&path.join(SAMPLES)).unwrap_or(0);
        let all = stream.parts.len();
        let mut parts = stream.parts.iter();
        let kept = parts.position(|kept| kept.samples_end > samples);
        if let Some(kept) = kept {
            stream.parts.truncate(kept);
            stream.finished_at = None;
        }
        let stopped = StoppedRun {
            path: path.to_owned(),
            stream: lock,
            length: ends[kept.unwrap_or(ends.len() - 1)],
            lost: all - stream.parts.len(),
        };
        Ok((stopped, stream))
    }

    /// Truncates stream and samples to their complete part, to append to them.
    ///
    /// # Errors
    /// I/O errors.
    pub fn go_on(self, stream: &Stream) -> Result<RunFolder, InputError> {
        let mut folder = RunFolder {
            samples: open(&self.path.join(SAMPLES))?,
            path: self.path,
            stream: self.stream,
        };
        let path = folder.path.clone();
        let io = writing::io(&path);
        folder.stream.set_len(self.length).map_err(io)?;
        match stream.parts.last() {
            Some(kept) => folder.samples.set_len(kept.samples_end).map_err(io)?,
            None => folder.begin_samples()?,
        }
        sweep(&path);
        Ok(folder)
    }
}

/// Refuses a folder that contains a file of a run.
///
/// # Errors
/// An error that names the folder.
pub(super) fn refuse_taken(path: &Path) -> Result<(), InputError> {
    let files = [REPORT, SUMMARY, SAMPLES, STREAM, PAGE];
    // A dangling link counts too.
    let is_there = |file| fs::symlink_metadata(path.join(file)).is_ok();
    match files.into_iter().any(is_there) {
        true => Err(writing::taken(path)),
        false => Ok(()),
    }
}

/// Opens or creates a file to append to.
///
/// A link is refused: its target is not the run's.
fn open(file: &Path) -> Result<File, InputError> {
    if fs::symlink_metadata(file).is_ok_and(|found| !found.is_file()) {
        let found = io::Error::other("a link or a device; expected a file of the run's own");
        return Err(writing::io(file)(found));
    }
    let mut options = OpenOptions::new();
    let options = options.read(true).append(true).create(true);
    options.open(file).map_err(writing::io(file))
}

/// Bytes of samples.csv up to the first NUL; 0 without its first line.
///
/// A power cut leaves NULs for data that never reached the disk.
pub(super) fn length_of_samples(file: &Path) -> io::Result<u64> {
    // Opening a pipe would wait for its writer.
    if !fs::metadata(file)?.is_file() {
        return Ok(0);
    }
    let mut reader = BufReader::new(File::open(file)?);
    let mut head = [0; SAMPLE_COLUMNS.len()];
    if reader.read_exact(&mut head).is_err() || head != *SAMPLE_COLUMNS.as_bytes() {
        return Ok(0);
    }
    // An appended NUL ends a file that has none.
    let sound = reader.chain(&b"\0"[..]).skip_until(0)? - 1;
    Ok((head.len() + sound) as u64)
}

/// Writes the page of a run and its pictures into its folder; replaces links.
///
/// A picture is its name without `.svg`, and its contents.
///
/// # Errors
/// I/O errors.
pub fn save_page(
    folder: &Path,
    page: &str,
    pictures: &[(String, String)],
) -> Result<(), InputError> {
    let save = |name: &str, text: &str| {
        replace_atomically(&folder.join(name), |out| out.write_all(text.as_bytes()))
    };
    for (name, svg) in pictures {
        save(&format!("{name}.svg"), svg)?;
    }
    save(PAGE, page)
}

/// Writes report.json and summary.csv into a folder; replaces links.
///
/// # Errors
/// I/O errors.
pub fn save_report(folder: &Path, report: &Report) -> Result<(), InputError> {
    replace_atomically(&folder.join(SUMMARY), |out| {
        write_summary(&report.cells, out)
    })?;
    replace_atomically(&folder.join(REPORT), |out| {
        serde_json::to_writer_pretty(&mut *out, report)?;
        writeln!(out)
    })
}

/// Columns of summary.csv before and after those of the metrics.
///
/// `name=field`, with `/` between a field and its subfield, or the name of the field alone.
const COLUMNS: [&str; 2] = [
    "scene=scene/name path=path/name cache=path/cache structure test arithmetic=path/arithmetic \
     planes=path/planes epsilon=path/epsilon status reason rank processes=times/processes \
     rounds=times/rounds cameras_timed=times/cameras_timed cameras_checked=times/cameras_checked \
     total_count=scene/total_count",
    "up=scene/up unit=scene/unit fovy_deg_min=path/lens/fovy_deg/0 \
     fovy_deg_max=path/lens/fovy_deg/1 ortho_height_min=path/lens/ortho_height/0 \
     ortho_height_max=path/lens/ortho_height/1 aspect_min=path/lens/aspect/0 \
     aspect_max=path/lens/aspect/1 near_min=path/lens/near/0 near_max=path/lens/near/1 \
     far_min=path/lens/far/0 far_max=path/lens/far/1 \
     matrix_convention=path/lens/matrix/convention matrix_depth_near=path/lens/matrix/depth/0 \
     matrix_depth_far=path/lens/matrix/depth/1 matrix_eye_x=path/lens/matrix/eye/0 \
     matrix_eye_y=path/lens/matrix/eye/1 matrix_eye_z=path/lens/matrix/eye/2 \
     matrix_is_mirrored=path/lens/matrix/is_mirrored motion=path/motion \
     views_per_frame=path/views_per_frame chose skipped_items=scene/skipped_items",
];

/// The metrics whose intervals are in summary.csv.
const WITH_INTERVALS: &str = "query_ns speedup times_read times_memcpy locate_ns build_ms frame_ns";

/// Names of the columns of summary.csv, and the paths of their fields in a cell.
fn columns() -> Vec<[String; 2]> {
    let [before, behind] = COLUMNS.map(|columns| {
        let columns = columns.split(' ');
        columns.map(|column| column.split_once('=').unwrap_or((column, column)))
    });
    let own = |(name, field): (&str, &str)| [name.to_owned(), format!("/{field}")];
    let mut all: Vec<[String; 2]> = before.map(own).collect();
    for name in METRICS.iter().map(|metric| metric.name) {
        all.push([name.to_owned(), format!("/metrics/{name}/value")]);
        if WITH_INTERVALS.split(' ').any(|with| with == name) {
            let end = |end| [format!("{name}_{end}"), format!("/metrics/{name}/{end}")];
            all.extend(["lower", "upper"].map(end));
        }
    }
    all.extend(behind.map(own));
    all
}

/// Text of a field; empty if it is missing.
fn text(field: Option<&Value>) -> String {
    match field {
        None | Some(Value::Null) => String::new(),
        Some(Value::String(text)) => lines(text),
        Some(Value::Number(number)) if number.is_f64() => {
            number.as_f64().unwrap_or(f64::NAN).to_string()
        }
        Some(other) => other.to_string(),
    }
}

/// One tidy row per cell; the field of a metric that was not measured is empty.
fn write_summary(cells: &[ReportCell], out: &mut dyn Write) -> io::Result<()> {
    let (mut csv, columns) = (csv::Writer::from_writer(out), columns());
    csv.write_record(columns.iter().map(|[name, _]| name))?;
    for cell in cells {
        let cell = serde_json::to_value(cell)?;
        csv.write_record(columns.iter().map(|[_, field]| {
            match (field.starts_with("/path/lens/far/"), cell.pointer(field)) {
                (true, Some(Value::Null)) => f64::INFINITY.to_string(),
                (_, found) => text(found),
            }
        }))?;
    }
    csv.flush()
}
