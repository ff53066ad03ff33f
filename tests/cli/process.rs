//! Starting the program, judging how it ended, and the small things that all
//! of these tests need: folders of files, CSV and JSON, random numbers.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::time::Duration;

use serde_json::Value;
use tempfile::TempDir;

use super::{BOXES, EYE_LOOK, PROGRAM};

/// Exit code and output of a command.
#[derive(Debug)]
pub struct Done {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

/// The words of a command line: separated by spaces, `''` is an empty one.
fn words(line: &str) -> impl Iterator<Item = &str> {
    let words = line.split(' ').filter(|word| !word.is_empty());
    words.map(|word| if word == "''" { "" } else { word })
}

/// A command in a folder, to be started.
pub fn command(folder: &Path, line: &str) -> std::process::Command {
    let mut command = std::process::Command::new(PROGRAM);
    command.args(words(line)).current_dir(folder);
    command
}

/// Runs the program in a folder.
pub fn cullbench(folder: &Path, line: &str) -> Done {
    let output = assert_cmd::Command::from_std(command(folder, line))
        .timeout(Duration::from_secs(300))
        .output()
        .expect("the program starts");
    Done {
        code: output.status.code(),
        out: String::from_utf8(output.stdout).expect("UTF-8 on stdout"),
        err: String::from_utf8(output.stderr).expect("UTF-8 on stderr"),
    }
}

/// Text of stderr without first lines about cameras and the amount of work.
pub fn besides_work(mut err: &str) -> &str {
    while let Some((first, rest)) = err.split_once('\n')
        && (first.starts_with("at work: ") || first.starts_with("warning: "))
    {
        err = rest;
    }
    err
}

/// Text in one line, as it was before it was wrapped.
pub fn unwrapped(text: &str) -> String {
    text.replace('\n', " ")
}

/// Runs a command that must succeed, and returns its output.
///
/// Nothing but warnings and lines about the amount of work may be on stderr.
pub fn works(folder: &Path, line: &str) -> String {
    let done = cullbench(folder, line);
    let err = besides_work(&done.err);
    assert_eq!((done.code, err), (Some(0), ""), "{line}");
    done.out
}

/// Exit code 2 and one line on stderr that holds all of `wanted` (parts are
/// separated by ` | `).
pub fn assert_refused(done: &Done, wanted: &str, what: &str) {
    assert_eq!(done.code, Some(2), "{what}: {done:?}");
    assert_eq!(done.out, "", "{what}");
    let line = done.err.strip_suffix('\n').unwrap_or_default();
    let kinds = [
        "expected",
        "did you mean",
        "known: ",
        "available: ",
        "built in: ",
        "see --help",
    ];
    let is_helpful = kinds.iter().any(|kind| line.contains(kind));
    assert!(is_helpful, "{what}: no way out of: {line}");
    assert!(
        line.starts_with("error: ") && !line.contains(['\n', '\r']),
        "{what}: not one error line: {:?}",
        done.err
    );
    assert!(!line.contains("panicked"), "{what}: {line}");
    let told: Vec<&str> = line.split(": ").filter(|part| part.len() > 12).collect();
    let distinct: BTreeSet<&&str> = told.iter().collect();
    assert_eq!(told.len(), distinct.len(), "{what}: told twice: {line}");
    for part in wanted.split(" | ") {
        assert!(line.contains(part), "{what}: no '{part}' in: {line}");
    }
}

/// Every file below a folder with its bytes, and every folder.
pub fn contents(folder: &Path) -> BTreeMap<String, Option<Vec<u8>>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).expect("readable") {
        let path = entry.expect("readable").path();
        let name = path.display().to_string();
        if path.is_dir() {
            found.insert(name, None);
            found.extend(contents(&path));
        } else if path.is_file() {
            found.insert(name, Some(fs::read(&path).expect("readable")));
        }
    }
    found
}

/// A folder with the given files.
pub fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, bytes) in files {
        fs::write(folder.path().join(name), bytes).expect("writable");
    }
    folder
}

/// The folder of the real scenes. Nothing is written there.
pub fn datasets() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/datasets"))
}

pub fn map12() -> Vec<u8> {
    fs::read(datasets().join("freedm_map12.wad")).expect("part of the repository")
}

/// CSV with a header as one map per row.
pub fn rows(csv: &str) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let rows = reader.deserialize().collect::<Result<_, _>>();
    rows.expect("CSV with a header")
}

pub fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

/// A field that is an array.
pub fn array<'a>(of: &'a Value, name: &str) -> &'a Vec<Value> {
    of[name].as_array().expect(name)
}

/// A field that is a number.
pub fn number(of: &Value, name: &str) -> f64 {
    of[name]
        .as_f64()
        .unwrap_or_else(|| panic!("{name} in {of}"))
}

pub fn keys(object: &Value) -> BTreeSet<&str> {
    let object = object.as_object().expect("an object");
    object.keys().map(String::as_str).collect()
}

pub fn set(names: &str) -> BTreeSet<&str> {
    names.split_whitespace().collect()
}

/// The names of all structures, as the program lists them.
pub fn structure_names() -> Vec<String> {
    names_of_structures(|_| true)
}

/// Those that a run of the quick suite takes by itself.
pub fn timed_names() -> Vec<String> {
    names_of_structures(|row| row["timed"] == "by default")
}

fn names_of_structures(is_meant: fn(&Value) -> bool) -> Vec<String> {
    let list = works(Path::new("."), "list structures --format json");
    let list = json(&list);
    let rows = list.as_array().expect("an array").iter();
    let names: Vec<String> = rows
        .filter(|row| is_meant(row))
        .map(|row| row["name"].as_str().expect("a name").to_owned())
        .collect();
    let scan = "linear".to_owned();
    assert!(names.len() >= 2 && names.contains(&scan), "{names:?}");
    names
}

/// A small generator of its own (Marsaglia 2003, xorshift64), so that no test
/// depends on the library's.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    pub fn below(&mut self, count: usize) -> usize {
        (self.next() >> 11) as usize % count
    }

    pub fn between(&mut self, low: i64, high: i64) -> i64 {
        low + self.below((high - low + 1) as usize) as i64
    }
}

/// Files that every command must find in order, next to a bad one.
pub fn with_good_files(bad: &[(&str, &[u8])]) -> TempDir {
    let scene = format!("{BOXES}\n0,0,0,1,1,1\n5,0,0,6,1,1\n");
    let cameras = format!("{EYE_LOOK}\n-9,0.5,0.5,0,0.5,0.5\n");
    let folder = folder(&[
        ("scene.csv", scene.as_bytes()),
        ("cameras.csv", cameras.as_bytes()),
        ("points.csv", b"x,y,z\n0.5,0.5,0.5\n"),
        ("kept.csv", b"not to be touched\n"),
    ]);
    for (name, bytes) in bad {
        fs::write(folder.path().join(name), bytes).expect("writable");
    }
    fs::create_dir(folder.path().join("folder.csv")).expect("writable");
    folder
}

/// Runs commands that must all be refused and leave the folder as it was.
pub fn all_refused(folder: &TempDir, commands: &[impl AsRef<str>], wanted: &str) {
    let before = contents(folder.path());
    for line in commands.iter().map(AsRef::as_ref) {
        assert_refused(&cullbench(folder.path(), line), wanted, line);
        assert!(contents(folder.path()) == before, "{line} left traces");
    }
}
