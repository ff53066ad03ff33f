//! Name and version of the program, which may be another crate's, and its messages.

use std::env;
use std::error::Error;
use std::path::Path;
use std::sync::OnceLock;

use clap::error::{ContextKind, ContextValue, ErrorKind};

use super::text::quoted;
use crate::measure::Source;
use crate::spec::{SpecError, nearest};

/// Name and version of the program.
static PROGRAM: OnceLock<(String, String)> = OnceLock::new();

const OWN: (&str, &str) = (env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"));

/// Sets name and version, once; `None` takes the name of its file and no version.
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

/// Version of the program; for another crate's, also that of this crate.
pub fn version() -> &'static str {
    PROGRAM.get().map_or(OWN.1, |(_, version)| version)
}

/// Source of the build, with the version of the program.
pub fn source() -> Source {
    Source {
        version: version().to_owned(),
        ..Source::capture()
    }
}

/// A help text with the name of this program in its commands.
pub fn named(text: &str) -> String {
    text.replace(OWN.0, name())
}

/// Message of one of our own parsers about a value.
fn value(error: &clap::Error) -> Option<String> {
    let said = error.source()?.downcast_ref::<SpecError>()?.to_string();
    let told = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => text.as_str(),
        _ => "",
    };
    let found = told(ContextKind::InvalidValue);
    let option = told(ContextKind::InvalidArg).split(' ').next();
    let option = option.unwrap_or_default();
    Some(match said.starts_with("expected") {
        true => format!("{option} is '{found}'; {said}"),
        false => said,
    })
}

/// The error on one line.
///
/// `None` for requested help or version, and for the help in place of a missing command.
pub fn one_line(error: &clap::Error) -> Option<String> {
    let no_command = ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand;
    if !error.use_stderr() || error.kind() == no_command {
        return None;
    }
    if let Some(line) = value(error) {
        return Some(line);
    }
    if error.kind() == ErrorKind::InvalidUtf8 {
        let mut found = env::args_os().filter(|arg| arg.to_str().is_none());
        let found = found.next().unwrap_or_default();
        return Some(format!("{found:?} is not UTF-8; expected UTF-8 names"));
    }
    let text = error.render().to_string();
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let first = lines.next().unwrap_or_default();
    let mut found = first.strip_prefix("error: ").unwrap_or(first).to_owned();
    let mut expected = None;
    let mut missing = Vec::new();
    let mut usage = None;
    for line in lines {
        let tip = line.strip_prefix("tip: ");
        let similar = tip.filter(|tip| tip.contains("similar"));
        let values = line.strip_prefix("[possible values: ");
        if let Some((_, names)) = similar.and_then(|tip| tip.split_once(": ")) {
            // clap's own suggestions may be dissimilar.
            let word = found.split('\'').nth(1).unwrap_or_default();
            if let Some(name) = nearest(word, names.split('\'').skip(1).step_by(2)) {
                expected.get_or_insert(format!("; did you mean '{name}'?"));
            }
        } else if let Some(tip) = tip {
            expected.get_or_insert(format!("; {tip}"));
        } else if let Some(values) = values {
            let values = values.trim_end_matches(']');
            expected = Some(format!("; expected one of {values}"));
        } else if let Some(line) = line.strip_prefix("Usage: ") {
            // Optional parts may not be valid together with the rest.
            let words = line.split(' ');
            let words = words.filter(|word| !word.starts_with('[') || *word == "[OPTIONS]");
            usage = Some(words.collect::<Vec<_>>().join(" "));
        } else if !line.starts_with("For more information") && usage.is_none() {
            missing.push(line.to_owned());
        }
    }
    if !missing.is_empty() {
        found = format!("{found} {}", missing.join(", "));
    }
    let word = found.split('\'').nth(1).unwrap_or_default();
    let is_run = env::args().nth(1).as_deref() == Some("run");
    let is_bare = error.kind() == ErrorKind::UnknownArgument && Path::new(word).is_file();
    if is_run && is_bare && env::args().all(|arg| !arg.starts_with("--scene")) {
        expected = Some(format!("; did you mean '--scene {}'?", quoted(word)));
    }
    let usage = usage.map(|usage| format!("; expected {usage}"));
    let help = "; see --help".to_owned();
    Some(found + &expected.or(usage).unwrap_or(help))
}
