//! Suites by their names, or written by a user: a TOML file in place of a name.

use std::fmt::Display;
use std::path::Path;

use serde::Deserialize;

use crate::input::{InputError, read_file};
use crate::measure::{Effort, PlannedScene};
use crate::scene::every_part;
use crate::shown::plain;
use crate::spec::SpecError;
use crate::suite::{DEFAULT_PATH, SUITES, Suite};

/// A suite as it is to be run.
pub struct ChosenSuite {
    /// Its name, or that of its file.
    pub name: String,
    /// True of one that comes with the program.
    pub is_built_in: bool,
    pub scenes: Vec<PlannedScene>,
    pub effort: Effort,
    pub structures: String,
}

/// A suite as it is written; a field that is not known is refused.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    /// The suite whose rounds and structures it takes where it states none.
    like: Option<String>,
    structures: Option<String>,
    processes: Option<u32>,
    scenes: Vec<WrittenScene>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenScene {
    scene: String,
    paths: Option<Vec<String>>,
    #[serde(default)]
    cold: bool,
}

/// The suite of a name or a TOML file, with structures where it states none.
///
/// # Errors
/// An unknown name; a file that cannot be read or is no suite, with its line.
pub fn suite(text: &str, default: Option<&str>) -> Result<ChosenSuite, InputError> {
    if text.ends_with(".toml") {
        return written(text, default);
    }
    let suite = named(text, Some("FILE.toml"))?;
    let paths = |paths: &[&str]| paths.iter().map(|&path| path.to_owned()).collect();
    let rows = suite.plan.iter();
    let rows = rows.map(|row| planned(row.scene.to_owned(), paths(row.paths), row.cold));
    Ok(ChosenSuite {
        name: suite.name.to_owned(),
        is_built_in: true,
        scenes: rows.collect(),
        effort: suite.effort,
        structures: default.unwrap_or(suite.structures).to_owned(),
    })
}

/// A scene with its ways, warm or both warm and cold.
pub fn planned(source: String, paths: Vec<String>, cold: bool) -> PlannedScene {
    PlannedScene {
        source,
        paths,
        caches: if cold { vec![false, true] } else { vec![false] },
    }
}

fn named(name: &str, or: Option<&'static str>) -> Result<&'static Suite, SpecError> {
    let known = SUITES.iter().map(|suite| suite.name).chain(or);
    let suite = SUITES.iter().find(|suite| suite.name == name);
    suite.ok_or_else(|| SpecError::unknown("suite", name, known))
}

fn written(file: &str, default: Option<&str>) -> Result<ChosenSuite, InputError> {
    let bytes = read_file(Path::new(file))?;
    let text = str::from_utf8(&bytes).map_err(|error| {
        InputError::byte(file, error.valid_up_to(), "not UTF-8", "a suite in TOML")
    })?;
    let suite: Written = toml::from_str(text).map_err(|error| {
        let begin = error.span().map_or(0, |span| span.start);
        let line = 1 + text.bytes().take(begin).filter(|b| *b == b'\n').count();
        let found = error.message().replace('\n', ", ").replace('`', "'");
        let expected = "; expected a suite: [[scenes]], each with a scene and its paths";
        let expected = [expected, ""][usize::from(found.contains("expected"))];
        InputError::new(format_args!("{file}, line {line}: {found}{expected}"))
    })?;
    let bad = |found: &dyn Display| InputError::new(format_args!("{file}: {found}"));
    let like = suite.like.as_deref().unwrap_or(SUITES[0].name);
    let like = named(like, None).map_err(|error| bad(&error))?;
    let mut effort = like.effort;
    effort.processes = suite.processes.unwrap_or(effort.processes);
    if !(1..=1000).contains(&effort.processes) {
        let (processes, expected) = (effort.processes, "expected a whole number from 1 to 1000");
        return Err(bad(&format_args!("processes is {processes}; {expected}")));
    }
    let mut scenes = Vec::new();
    for row in suite.scenes {
        let parts = every_part(&row.scene)?.into_iter();
        let paths = row.paths.unwrap_or_else(|| vec![DEFAULT_PATH.to_owned()]);
        if paths.is_empty() {
            let scene = plain(&row.scene);
            return Err(bad(&format_args!(
                "'{scene}' has no paths; expected one or more, or no line 'paths' for {DEFAULT_PATH}"
            )));
        }
        scenes.extend(parts.map(|source| planned(source, paths.clone(), row.cold)));
    }
    if scenes.is_empty() {
        let nothing = "no scenes; expected [[scenes]] with a scene and its paths";
        return Err(bad(&nothing));
    }
    let structures = default.unwrap_or(like.structures);
    Ok(ChosenSuite {
        name: file.to_owned(),
        is_built_in: false,
        scenes,
        effort,
        structures: suite.structures.unwrap_or_else(|| structures.to_owned()),
    })
}
