//! Feeds arbitrary bytes to a reader.
//!
//! Readers must not panic or hang, and errors have one line. Data that was read can be
//! used, and is the same after writing and reading it again. All readers are in one
//! program to link once; `FUZZ_READER` selects the reader.
#![no_main]

mod maps;
mod runs;
mod specs;
mod tables;
mod wad;

use std::fmt::Display;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;

type Reader = fn(&[u8]);

/// Readers by the name of their corpus.
const READERS: [(&str, Reader); 14] = [
    ("boxes", tables::boxes),
    ("cameras", tables::cameras),
    ("gltf", tables::gltf),
    ("ibsp", maps::ibsp),
    ("obj", tables::obj),
    ("points", tables::points),
    ("report", runs::report),
    ("samples", runs::samples),
    ("sought", tables::sought),
    ("specs", specs::specs),
    ("stream", runs::stream),
    ("vectors", tables::vectors),
    ("wad", wad::wad),
    ("zip", maps::zip),
];

static READER: LazyLock<Reader> = LazyLock::new(|| {
    let name = std::env::var("FUZZ_READER").unwrap_or_default();
    let row = READERS.iter().find(|row| row.0 == name);
    let known = READERS.map(|row| row.0).join(", ");
    row.unwrap_or_else(|| panic!("FUZZ_READER is '{name}'; expected one of {known}"))
        .1
});

fuzz_target!(init: LazyLock::force(&READER), |bytes: &[u8]| READER(bytes));

/// Returns the value; an error must be one line without control characters.
fn read<T, E: Display>(result: Result<T, E>) -> Option<T> {
    let error = match result {
        Ok(value) => return Some(value),
        Err(error) => error.to_string(),
    };
    assert!(
        !error.is_empty() && !error.contains(char::is_control),
        "{error:?}"
    );
    None
}
