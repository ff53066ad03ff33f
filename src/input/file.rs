//! The bytes of a file or a pipe. A pipe can be read only once: its bytes are kept, so
//! that it may be read again like a file.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::InputError;

/// What came out of pipes, by their names.
static PIPES: Mutex<BTreeMap<PathBuf, Arc<[u8]>>> = Mutex::new(BTreeMap::new());

/// Whether there is a file, a pipe or a device of that name.
pub fn is_readable(path: &Path) -> bool {
    let pipes = PIPES.lock().unwrap_or_else(PoisonError::into_inner);
    pipes.contains_key(path) || fs::metadata(path).is_ok_and(|found| !found.is_dir())
}

/// All bytes. Those of a pipe are kept: a command may look at its input before
/// it works on it.
///
/// # Errors
/// What the file system says, with the path.
pub fn read_file(path: &Path) -> Result<Arc<[u8]>, InputError> {
    let io = |source| InputError::Io {
        path: path.to_owned(),
        source,
    };
    let mut pipes = PIPES.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(bytes) = pipes.get(path) {
        return Ok(bytes.clone());
    }
    let is_file = fs::metadata(path).map_err(io)?.is_file();
    let bytes = fs::read(path).map_err(io)?;
    // To be shared they are copied: room that is not there would end the program.
    let room = Vec::<u8>::new().try_reserve_exact(bytes.len());
    room.map_err(|_| io(std::io::ErrorKind::OutOfMemory.into()))?;
    let bytes = Arc::from(bytes);
    if is_file {
        return Ok(bytes);
    }
    pipes.insert(path.to_owned(), bytes.clone());
    Ok(bytes)
}

/// Lets a file stand for what is no file: the bytes of a pipe that another
/// process has read.
///
/// # Errors
/// As [`read_file`].
pub fn stand_in(source: &str, file: &Path) -> Result<(), InputError> {
    let bytes = read_file(file)?;
    let mut pipes = PIPES.lock().unwrap_or_else(PoisonError::into_inner);
    pipes.insert(PathBuf::from(source), bytes);
    Ok(())
}

/// The pipes that were read, with their bytes.
pub fn pipes() -> Vec<(String, Arc<[u8]>)> {
    let pipes = PIPES.lock().unwrap_or_else(PoisonError::into_inner);
    let named = pipes
        .iter()
        .map(|(path, bytes)| (path.display().to_string(), bytes.clone()));
    named.collect()
}
