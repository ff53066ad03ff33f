//! The folder of a run: report.json, summary.csv and samples.csv, brought up
//! to date after every scene and path. Files are written beside their place
//! and renamed into it, so that a reader or a crash never meets half a file.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use tempfile::NamedTempFile;

use super::{Report, ReportCell, SCHEMA_VERSION, SamplesRef};
use crate::measure::{METRICS, Sample, Task};

const REPORT: &str = "report.json";
const SUMMARY: &str = "summary.csv";
const SAMPLES: &str = "samples.csv";
const SAMPLE_COLUMNS: [&str; 12] = [
    "scene",
    "path",
    "cache",
    "structure",
    "test",
    "task",
    "round",
    "frame",
    "queries",
    "cpu_ns",
    "wall_ns",
    "returned",
];

#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    #[error("{}: {source}; expected the report of a run", path.display())]
    Json {
        path: PathBuf,
        source: serde_json::Error,
    },
    #[error("{}: schema version {found}; expected {SCHEMA_VERSION}", path.display())]
    Version { path: PathBuf, found: u32 },
    #[error("{}: {found} rows; expected {rows} that report.json refers to", path.display())]
    Samples {
        path: PathBuf,
        found: u64,
        rows: u64,
    },
    #[error("{} already holds a run; expected an empty or new folder (--resume goes on with it)", path.display())]
    Taken { path: PathBuf },
}

/// Writes a file whole or not at all. A link stays one, and its target is
/// what is replaced; an existing file keeps its permissions. What is no file
/// (a terminal, a pipe, `/dev/null`) is written to and never replaced.
///
/// # Errors
/// What the file system says, with the path.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), FolderError> {
    let attempt = || -> io::Result<()> {
        let old = fs::metadata(path).ok();
        if old
            .as_ref()
            .is_some_and(|old| !old.is_file() && !old.is_dir())
        {
            let mut stream = BufWriter::new(OpenOptions::new().write(true).open(path)?);
            write(&mut stream)?;
            return stream.flush();
        }
        let target = match &old {
            Some(_) => fs::canonicalize(path)?,
            None => path.to_owned(),
        };
        let folder = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        // A missing folder is reported by its own name, not by a temporary one.
        fs::metadata(folder)?;
        let mut file = temporary_beside(folder)?;
        {
            let mut buffered = BufWriter::new(&mut file);
            write(&mut buffered)?;
            buffered.flush()?;
        }
        if let Some(old) = old.filter(fs::Metadata::is_file) {
            file.as_file().set_permissions(old.permissions())?;
        }
        file.persist(target)?;
        Ok(())
    };
    attempt().map_err(|source| FolderError::Io {
        path: path.to_owned(),
        source,
    })
}

/// Temporary files are private by themselves; results are meant to be read,
/// as far as the user's umask lets them.
fn temporary_beside(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".cullbench-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

/// Reads a report from its file, or from the folder of a run. Fields that it
/// does not know are ignored.
///
/// # Errors
/// What the file system says, not a report, or one of another schema version.
pub fn read_report(path: &Path) -> Result<Report, FolderError> {
    /// Read first: another version has other fields, and that is no damage.
    #[derive(Deserialize)]
    struct Versioned {
        schema_version: u32,
    }
    let path = match path.is_dir() {
        true => path.join(REPORT),
        false => path.to_owned(),
    };
    let json = |source| FolderError::Json {
        path: path.clone(),
        source,
    };
    let text = fs::read_to_string(&path).map_err(|source| FolderError::Io {
        path: path.clone(),
        source,
    })?;
    match serde_json::from_str(&text).map_err(json)? {
        Versioned { schema_version } if schema_version != SCHEMA_VERSION => {
            Err(FolderError::Version {
                path,
                found: schema_version,
            })
        }
        _ => serde_json::from_str(&text).map_err(json),
    }
}

/// An open run.
pub struct RunFolder {
    path: PathBuf,
    samples: File,
    rows: u64,
}

impl RunFolder {
    /// Makes the folder of a new run.
    ///
    /// # Errors
    /// [`FolderError::Taken`] if it holds a file of a run already.
    pub fn create(path: &Path) -> Result<RunFolder, FolderError> {
        let io = |source| FolderError::Io {
            path: path.to_owned(),
            source,
        };
        fs::create_dir_all(path).map_err(io)?;
        if [REPORT, SUMMARY, SAMPLES]
            .iter()
            .any(|f| path.join(f).exists())
        {
            return Err(FolderError::Taken {
                path: path.to_owned(),
            });
        }
        let mut samples = File::create(path.join(SAMPLES)).map_err(io)?;
        writeln!(samples, "{}", SAMPLE_COLUMNS.join(",")).map_err(io)?;
        Ok(RunFolder {
            path: path.to_owned(),
            samples,
            rows: 0,
        })
    }

    /// Opens the folder of a run that was stopped, with its report. Samples
    /// that no cell refers to (the stop came in between) are cut off.
    ///
    /// # Errors
    /// No report, not a report, one of another schema version, or fewer
    /// samples than the report refers to.
    pub fn resume(path: &Path) -> Result<(RunFolder, Report), FolderError> {
        let report = Self::read(path)?;
        let measured = report.cells.iter().chain(&report.bounds);
        let rows = measured.filter_map(|c| c.samples_ref.as_ref());
        let rows = rows
            .map(|r| r.first_row.saturating_add(r.rows))
            .max()
            .unwrap_or(0);
        let file = path.join(SAMPLES);
        let io = |source| FolderError::Io {
            path: file.clone(),
            source,
        };
        let text = fs::read(&file).map_err(io)?;
        let (mut length, mut found) = (0, 0);
        for line in text.split_inclusive(|b| *b == b'\n') {
            if found > rows {
                break;
            }
            length += line.len() as u64;
            found += 1;
        }
        if found <= rows {
            let found = found.saturating_sub(1);
            return Err(FolderError::Samples {
                path: file,
                found,
                rows,
            });
        }
        let mut samples = OpenOptions::new().write(true).open(&file).map_err(io)?;
        samples.set_len(length).map_err(io)?;
        samples.seek(SeekFrom::End(0)).map_err(io)?;
        Ok((
            RunFolder {
                path: path.to_owned(),
                samples,
                rows,
            },
            report,
        ))
    }

    /// Reads the report of a run from its folder.
    ///
    /// # Errors
    /// As [`RunFolder::resume`].
    pub fn read(path: &Path) -> Result<Report, FolderError> {
        read_report(&path.join(REPORT))
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Appends the samples of one contender; where they are.
    ///
    /// # Errors
    /// What the file system says.
    pub fn append<'s>(
        &mut self,
        cell: [&str; 5],
        samples: impl Iterator<Item = &'s (Task, Sample)>,
    ) -> Result<SamplesRef, FolderError> {
        let (first_row, path) = (self.rows, self.path.join(SAMPLES));
        let write = || -> Result<(), csv::Error> {
            let mut rows = csv::Writer::from_writer(&mut self.samples);
            for (task, s) in samples {
                let numbers = [
                    s.round.to_string(),
                    s.frame.to_string(),
                    s.queries.to_string(),
                    format!("{:.1}", s.cpu_ns),
                    format!("{:.1}", s.wall_ns),
                    s.returned.to_string(),
                ];
                let names = cell.into_iter().chain([task.name()]);
                rows.write_record(names.chain(numbers.iter().map(String::as_str)))?;
                self.rows += 1;
            }
            Ok(rows.flush()?)
        };
        write().map_err(|error| FolderError::Io {
            path,
            source: error.into(),
        })?;
        Ok(SamplesRef {
            file: SAMPLES.to_owned(),
            first_row,
            rows: self.rows - first_row,
        })
    }

    /// Writes report.json and summary.csv as they now are.
    ///
    /// # Errors
    /// What the file system says.
    pub fn save(&self, report: &Report) -> Result<(), FolderError> {
        write_atomically(&self.path.join(SUMMARY), |out| {
            write_summary(&report.cells, out)
        })?;
        write_atomically(&self.path.join(REPORT), |out| {
            serde_json::to_writer_pretty(&mut *out, report)?;
            writeln!(out)
        })
    }
}

/// One tidy row per cell; a metric that was not measured is an empty field.
fn write_summary(cells: &[ReportCell], out: &mut dyn Write) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    let mut header: Vec<String> = [
        "scene",
        "path",
        "cache",
        "structure",
        "test",
        "arithmetic",
        "planes",
        "epsilon",
        "status",
        "reason",
        "total_count",
    ]
    .map(str::to_owned)
    .into();
    let intervals = ["query_ns", "ratio_to_linear", "times_read", "times_memcpy"];
    for metric in METRICS {
        header.push(metric.name.to_owned());
        if intervals.contains(&metric.name) {
            header.push(format!("{}_lower", metric.name));
            header.push(format!("{}_upper", metric.name));
        }
    }
    csv.write_record(&header)?;
    for cell in cells {
        let mut row = vec![
            cell.scene.name.clone(),
            cell.path.name.clone(),
            cell.path.cache.clone(),
            cell.structure.clone(),
            cell.test.clone(),
            cell.path.arithmetic.clone(),
            cell.path.planes.clone(),
            cell.path.epsilon.to_string(),
            cell.status.name().to_owned(),
            cell.reason.clone().unwrap_or_default(),
            cell.scene.total_count.to_string(),
        ];
        let text = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
        for metric in METRICS {
            let found = cell.metrics.get(metric.name);
            row.push(text(found.map(|m| m.value)));
            if intervals.contains(&metric.name) {
                row.push(text(found.and_then(|m| m.lower)));
                row.push(text(found.and_then(|m| m.upper)));
            }
        }
        csv.write_record(&row)?;
    }
    csv.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(round: u32) -> (Task, Sample) {
        let sample = Sample {
            round,
            frame: 3,
            queries: 2,
            cpu_ns: 10.5,
            wall_ns: 11.0,
            returned: 7,
        };
        (Task::Query, sample)
    }

    #[test]
    fn samples_are_appended_and_cut_back_to_what_the_report_knows() {
        let temporary = tempfile::tempdir().unwrap();
        let path = temporary.path().join("new/run");
        let mut folder = RunFolder::create(&path).unwrap();
        let cell = ["a scene, with commas", "orbit", "warm", "bvh", "exact"];
        let known = folder.append(cell, [sample(0), sample(1)].iter()).unwrap();
        assert_eq!((known.first_row, known.rows), (0, 2));
        let unknown = folder.append(cell, [sample(2)].iter()).unwrap();
        assert_eq!(unknown.first_row, 2);
        let text = fs::read_to_string(path.join(SAMPLES)).unwrap();
        assert_eq!(text.lines().count(), 4);
        assert!(
            text.contains("\"a scene, with commas\",orbit,warm,bvh,exact,query,0,3,2,10.5,11.0,7")
        );
        // No report yet: nothing to resume, and one error line.
        let error = RunFolder::resume(&path).err().unwrap().to_string();
        assert!(
            error.contains("report.json") && !error.contains('\n'),
            "{error}"
        );
    }

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
                "{\"schema_version\": 2, \"cells\": 7}",
                "version 2; expected 1",
            ),
            ("{\"schema_version\": 1}", "missing field `run`"),
            ("{}", "missing field `schema_version`"),
            ("[1, 2]", "expected the report of a run"),
            ("", "expected the report of a run"),
        ] {
            assert!(refused(text.as_bytes()).contains(wanted), "{text}");
        }
        assert!(refused(&[0xFF; 9]).contains("UTF-8"));
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_rubbish() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file.txt");
        write_atomically(&path, |out| out.write_all(b"old")).unwrap();
        let failed = write_atomically(&path, |out| {
            out.write_all(b"half of the new")?;
            Err(io::Error::other("disk full"))
        });
        assert!(failed.unwrap_err().to_string().contains("disk full"));
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        let nowhere = folder.path().join("no/file.txt");
        let error = write_atomically(&nowhere, |_| Ok(())).unwrap_err();
        assert!(!error.to_string().contains(".cullbench-"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn links_and_permissions_stay() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, "old").unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
        symlink("file", &link).unwrap();
        write_atomically(&link, |out| out.write_all(b"new")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read_to_string(&file).unwrap(), "new");
        assert_eq!(
            fs::metadata(&file).unwrap().permissions().mode() & 0o777,
            0o600
        );
    }
}
