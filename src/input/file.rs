//! Bytes of a file, a pipe or standard input, which is named `-`.
//!
//! A pipe can be read only once, so its bytes are kept and read again like a file.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::{InputError, Result};

/// Bytes of pipes, by their names.
static PIPES: Mutex<BTreeMap<PathBuf, Arc<[u8]>>> = Mutex::new(BTreeMap::new());

/// SHA-256 of files, by their names, if they are held.
static HELD: Mutex<Option<BTreeMap<String, String>>> = Mutex::new(None);

/// Returns true if there is a file, a pipe or a device of that name.
pub fn is_readable(path: &Path) -> bool {
    let pipes = PIPES.lock().unwrap_or_else(PoisonError::into_inner);
    is_stdin(path)
        || pipes.contains_key(path)
        || fs::metadata(path).is_ok_and(|found| !found.is_dir())
}

/// Returns true if a file has that name, or nothing else could.
///
/// A name with parameters has neither a slash nor a dot before them.
pub fn names_file(source: &str) -> bool {
    let name = source.split(':').next().unwrap_or_default();
    let is_path = source.ends_with(".csv") || name.contains(['/', '\\', '.']);
    is_path || is_readable(Path::new(source))
}

/// Returns true for the name of standard input.
fn is_stdin(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// All bytes. Those of a pipe are kept: a command may look at its input before
/// it works on it.
///
/// # Errors
/// I/O errors, with the path.
pub fn read_file(path: &Path) -> Result<Arc<[u8]>> {
    let io = InputError::io(path, "file");
    let mut pipes = PIPES.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(bytes) = pipes.get(path) {
        return Ok(bytes.clone());
    }
    let is_file = !is_stdin(path) && fs::metadata(path).map_err(io)?.is_file();
    let mut bytes = Vec::new();
    let read = match is_stdin(path) {
        true => io::stdin().lock().read_to_end(&mut bytes).map(drop),
        false => fs::read(path).map(|read| bytes = read),
    };
    read.map_err(io)?;
    let mut held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(held) = held.as_mut().filter(|_| is_file) {
        hold(held, path, &bytes)?;
    }
    drop(held);
    // To be shared they are copied: room that is not there would end the program.
    let room = Vec::<u8>::new().try_reserve_exact(bytes.len());
    room.map_err(|_| io(std::io::ErrorKind::OutOfMemory.into()))?;
    let bytes: Arc<[u8]> = Arc::from(bytes);
    if !is_file {
        pipes.insert(path.to_owned(), bytes.clone());
    }
    Ok(bytes)
}

/// From now on a file that is read again must be what it was: what is measured in
/// several processes is one scene. `known` has the SHA-256 of those read before.
pub fn hold_files(known: BTreeMap<String, String>) {
    *HELD.lock().unwrap_or_else(PoisonError::into_inner) = Some(known);
}

/// SHA-256 of the files that are held, by their names.
pub fn held_files() -> BTreeMap<String, String> {
    let held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
    held.clone().unwrap_or_default()
}

/// Keeps a file's digest, or compares it with the one that is kept.
fn hold(held: &mut BTreeMap<String, String>, path: &Path, bytes: &[u8]) -> Result<()> {
    let digest = crate::shown::hex(&hmac_sha256::Hash::hash(bytes));
    let own = held.entry(path.display().to_string());
    let first = own.or_insert_with(|| digest.clone());
    match *first == digest {
        true => Ok(()),
        false => Err(InputError::new(format_args!(
            "{}: has changed since it was first read; expected the same file until the end",
            path.display()
        ))),
    }
}

/// Lets a file stand for what is no file: the bytes of a pipe that another
/// process has read.
///
/// # Errors
/// The errors of [`read_file`].
pub fn stand_in(source: &str, file: &Path) -> Result<()> {
    let bytes = read_file(file)?;
    let mut pipes = PIPES.lock().unwrap_or_else(PoisonError::into_inner);
    pipes.insert(PathBuf::from(source), bytes);
    Ok(())
}

/// The pipes that were read, with their bytes.
pub fn pipes() -> Vec<(String, Arc<[u8]>)> {
    let pipes = PIPES.lock().unwrap_or_else(PoisonError::into_inner);
    let named = pipes.iter();
    let named = named.map(|(path, bytes)| (path.display().to_string(), bytes.clone()));
    named.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_changes_is_refused_once_files_are_held() {
        let (mut held, path) = (BTreeMap::new(), Path::new("held.csv"));
        let mut read = |text: &str| hold(&mut held, path, text.as_bytes()).is_ok();
        assert!(read("one") && read("one"));
        assert!(!read("two") && !read("two"));
        assert!(read("one"));
    }
}
