//! Files of a run and their names; files that appear whole or not at all.
//!
//! Files are written under a temporary name in the same folder, then renamed. A process locks its
//! temporary names while it runs; an unlocked one is left over from a killed process, and the next
//! write into the same folder removes it.

use std::fmt::Display;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile, TempDir};

use super::SCHEMA_VERSION;
use crate::input::InputError;
use crate::json::JsonError;

/// Prefix and suffix of temporary names.
const TEMPORARY: (&str, &str) = (".cullbench-", ".tmp");

/// Writes a file whole or not at all.
///
/// A link is kept, and its target is replaced; an existing file keeps its permissions. A terminal,
/// a pipe or a device is written to and never replaced.
///
/// # Errors
/// I/O errors, with the path.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), InputError> {
    let attempt = || -> io::Result<()> {
        if let Some(target) = target(path)? {
            return replace(&target, write);
        }
        let mut stream = BufWriter::new(OpenOptions::new().write(true).open(path)?);
        write(&mut stream)?;
        stream.flush()
    };
    attempt().map_err(io(path))
}

/// The file that a path refers to; `None` for a terminal, a pipe or a device.
fn target(path: &Path) -> io::Result<Option<PathBuf>> {
    match fs::metadata(path) {
        Ok(found) if !found.is_file() && !found.is_dir() => Ok(None),
        Ok(_) => fs::canonicalize(path).map(Some),
        Err(_) => Ok(Some(path.to_owned())),
    }
}

/// Replaces a file in a folder of the program's own.
///
/// Whatever has its name is replaced, a link too.
pub(super) fn replace_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), InputError> {
    replace(path, write).map_err(io(path))
}

fn replace(target: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let folder = folder_of(target);
    // A missing folder is reported by its own name instead of a temporary one.
    fs::metadata(folder)?;
    let mut file = temporary_in(folder)?;
    {
        let mut buffered = BufWriter::new(&mut file);
        write(&mut buffered)?;
        buffered.flush()?;
    }
    if let Ok(old) = fs::symlink_metadata(target)
        && old.is_file()
    {
        file.as_file().set_permissions(old.permissions())?;
    }
    file.persist(target)?;
    Ok(())
}

/// The folder of a file.
pub fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Tries to write into the folder of a future file, and leaves nothing there.
///
/// Detects a read-only or full folder before the work.
///
/// # Errors
/// I/O errors, with the path.
pub fn try_place(path: &Path) -> Result<(), InputError> {
    // A pipe or a device has no folder; opening a pipe would wait for its reader.
    let target = target(path).map_err(io(path))?;
    let tried = target.map_or(Ok(()), |target| try_writing(folder_of(&target)));
    tried.map_err(io(path))
}

/// [`try_place`] for a folder that exists or will be created.
///
/// # Errors
/// I/O errors, with the path.
pub fn try_folder(path: &Path) -> Result<(), InputError> {
    let folder = path.ancestors().find(|folder| folder.exists());
    try_writing(folder.unwrap_or(Path::new("."))).map_err(io(path))
}

/// Writes a block and removes it.
fn try_writing(folder: &Path) -> io::Result<()> {
    temporary_in(folder)?.write_all(&[0; 4096])
}

/// Creates a file removed at the end of this process or the next write beside it.
///
/// # Errors
/// I/O errors.
pub fn temporary_in(folder: &Path) -> io::Result<NamedTempFile> {
    Ok(locked_temporary_in(folder)?.0)
}

/// [`temporary_in`], with the reason if a file system has no locks.
pub(super) fn locked_temporary_in(
    folder: &Path,
) -> io::Result<(NamedTempFile, Result<(), TryLockError>)> {
    sweep(folder);
    loop {
        let made = named(0o666).tempfile_in(folder)?;
        match made.as_file().try_lock() {
            // Another process has removed it between the two calls.
            Err(TryLockError::WouldBlock) => {}
            Ok(()) if !made.path().exists() => {}
            locked => return Ok((made, locked)),
        }
    }
}

/// Creates a folder removed at the end of this process or the next write beside it.
///
/// Locked as long as the file is open.
pub(super) fn temporary_folder_in(folder: &Path) -> io::Result<(TempDir, Option<File>)> {
    sweep(folder);
    loop {
        let made = named(0o777).tempdir_in(folder)?;
        // Not every system opens folders.
        let Ok(lock) = File::open(made.path()) else {
            return Ok((made, None));
        };
        match lock.try_lock() {
            Err(TryLockError::WouldBlock) => {}
            Ok(()) if !made.path().exists() => {}
            _ => return Ok((made, Some(lock))),
        }
    }
}

/// Builder of temporary names.
///
/// Temporary files are private by default; results should be readable, as far as the user's umask
/// permits.
fn named(mode: u32) -> Builder<'static, 'static> {
    let mut builder = Builder::new();
    builder.prefix(TEMPORARY.0).suffix(TEMPORARY.1);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(mode));
    }
    #[cfg(not(unix))]
    let _ = mode;
    builder
}

/// Removes incomplete files of killed processes from a folder.
pub(super) fn sweep(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let (name, path) = (entry.file_name(), entry.path());
        let name = name.to_string_lossy();
        if name.starts_with(TEMPORARY.0)
            && name.ends_with(TEMPORARY.1)
            && let Ok(kind) = entry.file_type()
            && (kind.is_file() || kind.is_dir())
            // Locked until it is removed, so that its creator notices.
            && let Ok(lock) = File::open(&path)
            && !matches!(lock.try_lock(), Err(TryLockError::WouldBlock))
        {
            let _ = match kind.is_dir() {
                true => fs::remove_dir_all(path),
                false => fs::remove_file(path),
            };
        }
    }
}

pub(super) const REPORT: &str = "report.json";
pub(super) const SUMMARY: &str = "summary.csv";
pub(super) const SAMPLES: &str = "samples.csv";
pub(super) const PAGE: &str = "report.html";
pub(super) const STREAM: &str = "stream.jsonl";

/// The first line of samples.csv.
pub(super) const SAMPLE_COLUMNS: &str = "scene,path,cache,structure,test,task,process,round,frame,\
                                         queries,cpu_ns,wall_ns,returned\n";

/// An error in a file or folder; the text says what was found and expected.
pub(super) fn at(path: &Path, text: impl Display) -> InputError {
    InputError::new(format_args!("{}: {text}", path.display()))
}

/// An I/O error about a path.
pub(super) fn io(path: &Path) -> impl Fn(io::Error) -> InputError + Copy {
    InputError::io(path, "file or folder")
}

/// The error of a text that is not JSON of `whole`, such as "the report of a run".
pub(super) fn json(path: &Path, error: &JsonError, whole: &str) -> InputError {
    let expected = error.expected_of(whole);
    let file = path.display().to_string();
    InputError::at(&file, error.place(), &error.found, expected)
}

/// The error of a file with another schema version.
pub(super) fn version(path: &Path, found: u32) -> InputError {
    let text = format!("schema version {found}; expected {SCHEMA_VERSION}");
    at(path, text)
}

/// The error of a folder that contains a run already.
pub(super) fn taken(path: &Path) -> InputError {
    InputError::new(format_args!(
        "{} already holds a run; expected an empty or new folder (run --resume continues a run)",
        path.display()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn errors_do_not_name_temporary_files() {
        let error = temporary_in(Path::new("no/such")).unwrap_err();
        assert!(
            error.to_string().contains(TEMPORARY.0),
            "the premise: {error}"
        );
        let told = io(Path::new("no/such"))(error).to_string();
        assert!(
            told.starts_with("no/such: ") && !told.contains(TEMPORARY.0),
            "{told}"
        );
    }

    #[test]
    fn leftovers_of_the_killed_go_and_what_is_written_now_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let live = temporary_in(folder.path()).unwrap();
        let (live_folder, _lock) = temporary_folder_in(folder.path()).unwrap();
        fs::write(path(".cullbench-left.tmp"), "half").unwrap();
        fs::create_dir(path(".cullbench-leftfolder.tmp")).unwrap();
        fs::write(
            path(".cullbench-leftfolder.tmp").join("stream.jsonl"),
            "half",
        )
        .unwrap();
        fs::write(path(".cullbench-foreign"), "of another program").unwrap();
        write_atomically(&path("file"), |out| out.write_all(b"new")).unwrap();
        let mut left: Vec<_> = fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect();
        left.sort();
        let mut wanted = vec![
            live.path().to_owned(),
            live_folder.path().to_owned(),
            path(".cullbench-foreign"),
            path("file"),
        ];
        wanted.sort();
        assert_eq!(left, wanted);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_in_a_folder_of_ones_own_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, "another's").unwrap();
        std::os::unix::fs::symlink("file", &link).unwrap();
        replace_atomically(&link, |out| out.write_all(b"new")).unwrap();
        assert!(!fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read_to_string(&file).unwrap(), "another's");
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
