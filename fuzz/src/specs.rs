//! Readers of typed text: scenes, paths, structures, suites and their specs.

use std::sync::LazyLock;

use cullbench::index::Registry;
use cullbench::scene::{FAMILIES, MESHES, Scene};
use cullbench::spec::{Spec, nearest, parse_number};
use cullbench::visibility::fragment::CutOuts;
use cullbench::{path, scene};

use crate::read;

static CITY: LazyLock<Scene> =
    LazyLock::new(|| scene::load("city:n=40", &Default::default()).expect("a scene"));

/// Most items of a scene, frames of a path, and any other number of theirs.
const MOST: f64 = 200.0;

pub fn specs(bytes: &[u8]) {
    let Ok(text) = str::from_utf8(bytes) else {
        return;
    };
    // Files are read by other readers.
    for line in text.lines().filter(|line| !line.contains(['/', '\\'])) {
        nearest(line, ["linear", "bvh"]);
        read(CutOuts::parse(line));
        structures(line);
        if let Some(spec) = small(line) {
            let named = |name: &str| name == spec.name();
            let is_made = FAMILIES.iter().any(|f| named(f.name)) || line.starts_with("mesh:");
            let (key, sized) = match is_made || MESHES.iter().any(|m| named(m.name)) {
                true => ("n", with(line, "n=40")),
                false => ("frames", with(line, "frames=3")),
            };
            let typed = match spec.given().any(|(given, _)| given == key) {
                true => line,
                false => &sized,
            };
            read(scene::load(typed, &Default::default()));
            read(path::load(typed, &CITY, &Default::default()));
        }
    }
}

fn structures(list: &str) {
    for text in Spec::split_list(list) {
        read(Spec::parse(&text));
    }
    for structure in read(Registry::builtin().structures(list)).unwrap_or_default() {
        read(structure.build(&CITY.items));
    }
}

/// Parses a spec; `None` if one of its numbers makes a large scene or a long path.
///
/// Text with control characters is skipped, as error messages print names of files as
/// they are.
fn small(line: &str) -> Option<Spec> {
    let spec = read(Spec::parse_behind("mesh:", line))?;
    if line.contains(char::is_control) {
        return None;
    }
    let is_small = |(key, value)| key == "seed" || parse_number(value).is_none_or(|n| n <= MOST);
    let all_are = spec.given().all(is_small);
    all_are.then_some(spec)
}

fn with(line: &str, parameter: &str) -> String {
    let between = if line.trim_start_matches("mesh:").contains(':') {
        ","
    } else {
        ":"
    };
    format!("{line}{between}{parameter}")
}
