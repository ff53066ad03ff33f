//! The suites of the main job: scenes, camera paths, and times.
//!
//! Built-in ones are in `suites.toml`; a user's file replaces a name.

use std::fmt::Display;
use std::path::Path;
use std::sync::LazyLock;

use serde::Deserialize;

use crate::input::{InputError, read_file};
use crate::json::in_words;
use crate::measure::{Effort, PlannedScene};
use crate::path::DEFAULT_PATH;
use crate::scene::every_part;
use crate::shown::plain;
use crate::spec::SpecError;

/// A named set of scenes and paths with the time to spend on them.
#[derive(Clone, Deserialize)]
pub struct Suite {
    /// Value of `--suite`.
    pub name: String,
    /// One line for `cullbench list scenes`.
    pub summary: String,
    /// The list of structures if none are named.
    pub structures: String,
    /// Processes, rounds and times.
    pub effort: Effort,
    /// Scenes with their paths, in the order in which they are measured.
    pub scenes: Vec<PlannedScene>,
}

/// A suite as a user writes it; unknown fields are refused.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    /// The suite that provides rounds and structures if these are missing.
    like: Option<String>,
    structures: Option<String>,
    processes: Option<u32>,
    scenes: Vec<PlannedScene>,
}

/// All suites; the first one is the default of `cullbench run`.
pub static SUITES: LazyLock<Vec<Suite>> = LazyLock::new(|| {
    #[derive(Deserialize)]
    struct All {
        suites: Vec<Suite>,
    }
    let all: Result<All, _> = toml::from_str(include_str!("suites.toml"));
    all.expect("the suites of the program").suites
});

/// The suite that fetched scenes join.
pub const REAL: &str = "real";

/// The paths through a fetched scene in that suite.
pub const REAL_PATHS: &[&str] = &["flythrough:frames=128", "outside:frames=64"];

impl Suite {
    /// The suite of a name or a TOML file.
    ///
    /// If given, `default` replaces the structures of a built-in suite, and of a file that names
    /// none.
    ///
    /// # Errors
    /// An unknown name; a file that cannot be read or is not a suite, with its line.
    pub fn of(text: &str, default: Option<&str>) -> Result<Suite, InputError> {
        let mut suite = match text.ends_with(".toml") {
            true => return written(text, default),
            false => named(text, Some("FILE.toml"))?,
        };
        if let Some(default) = default {
            default.clone_into(&mut suite.structures);
        }
        Ok(suite)
    }

    /// True if it is built in.
    pub fn is_built_in(&self) -> bool {
        !self.name.ends_with(".toml")
    }
}

fn named(name: &str, or: Option<&str>) -> Result<Suite, SpecError> {
    let known = SUITES.iter().map(|suite| suite.name.as_str()).chain(or);
    let suite = SUITES.iter().find(|suite| suite.name == name).cloned();
    suite.ok_or_else(|| SpecError::unknown("suite", name, known))
}

fn written(file: &str, default: Option<&str>) -> Result<Suite, InputError> {
    let bytes = read_file(Path::new(file))?;
    let text = str::from_utf8(&bytes).map_err(|error| {
        InputError::byte(file, error.valid_up_to(), "not UTF-8", "a suite in TOML")
    })?;
    let written: Written = toml::from_str(text).map_err(|error| {
        let begin = error.span().map_or(0, |span| span.start);
        let line = 1 + text.bytes().take(begin).filter(|b| *b == b'\n').count();
        let said = error.message().replace('\n', ", ").replace('`', "'");
        let found = match in_words(error.message().lines().next().unwrap_or_default()) {
            (found, Some(wanted)) if said.starts_with("invalid ") => {
                format!("{found}; expected {wanted}")
            }
            _ => said,
        };
        let expected = "; expected a suite: [[scenes]], each with a scene and its paths";
        let expected = [expected, ""][usize::from(found.contains("expected"))];
        InputError::new(format_args!("{file}, line {line}: {found}{expected}"))
    })?;
    let bad = |found: &dyn Display| InputError::new(format_args!("{file}: {found}"));
    let like = written.like.as_deref().unwrap_or(&SUITES[0].name);
    let mut suite = named(like, None).map_err(|error| bad(&error))?;
    suite.name = file.to_owned();
    suite.effort.processes = written.processes.unwrap_or(suite.effort.processes);
    if !(1..=1000).contains(&suite.effort.processes) {
        let processes = suite.effort.processes;
        let expected = "expected a whole number from 1 to 1000";
        return Err(bad(&format_args!("processes is {processes}; {expected}")));
    }
    let structures = written.structures.or(default.map(str::to_owned));
    suite.structures = structures.unwrap_or(suite.structures);
    suite.scenes.clear();
    for row in written.scenes {
        if row.paths.is_empty() {
            let scene = plain(&row.source);
            return Err(bad(&format_args!(
                "'{scene}' has no paths; expected one or more, or no line 'paths' for {DEFAULT_PATH}"
            )));
        }
        let parts = every_part(&row.source)?.into_iter();
        suite.scenes.extend(parts.map(|source| PlannedScene {
            source,
            ..row.clone()
        }));
    }
    if suite.scenes.is_empty() {
        return Err(bad(
            &"no scenes; expected [[scenes]] with a scene and its paths",
        ));
    }
    Ok(suite)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::PATHS;
    use crate::scene::{FAMILIES, SAMPLES};
    use crate::spec::Spec;

    #[test]
    fn every_suite_names_what_exists_and_those_that_rank_have_the_real_scenes() {
        // One suite is about growth, one about a change between two programs.
        let ranks = |name: &str| !["growth", "compare"].contains(&name);
        for suite in SUITES.iter() {
            for row in &suite.scenes {
                let scene = Spec::parse(&row.source).unwrap();
                let families = FAMILIES.iter().map(|f| f.name);
                assert!(
                    families
                        .chain(SAMPLES.iter().map(|s| s.name))
                        .any(|n| n == scene.name())
                );
                for path in &row.paths {
                    let path = Spec::parse(path).unwrap();
                    assert!(PATHS.iter().any(|p| p.name == path.name()));
                }
            }
            for sample in SAMPLES.iter().filter(|_| ranks(&suite.name)) {
                assert!(
                    suite.scenes.iter().any(|row| row.source == sample.name),
                    "{}",
                    suite.name
                );
            }
        }
    }
}
