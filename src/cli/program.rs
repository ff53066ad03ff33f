//! Name and version of the program, which may be another crate's.

use std::env;
use std::path::Path;
use std::sync::OnceLock;

/// Name and version of the program.
static PROGRAM: OnceLock<(String, String)> = OnceLock::new();

const OWN: (&str, &str) = (env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"));

/// Names the program, once; `None` takes the name of its file and no version.
pub fn set(program: Option<(&str, &str)>) {
    let file = env::args_os().next().unwrap_or_default();
    let of_file = Path::new(&file).file_stem().unwrap_or_default();
    let of_file = of_file.to_string_lossy();
    let (name, version) = program.unwrap_or((&of_file, ""));
    let version = match (name, version) == OWN {
        true => version.to_owned(),
        false => format!("{version} ({} {})", OWN.0, OWN.1),
    };
    PROGRAM.get_or_init(|| (name.to_owned(), version.trim_start().to_owned()));
}

/// Name of the program in messages and commands.
pub fn name() -> &'static str {
    PROGRAM.get().map_or(OWN.0, |(name, _)| name)
}

/// Version of the program; beside another crate's own, that of this one.
pub fn version() -> &'static str {
    PROGRAM.get().map_or(OWN.1, |(_, version)| version)
}

/// A help text with commands of this program.
pub fn named(text: &str) -> String {
    text.replace(OWN.0, name())
}
