//! Readers of typed text: scenes, paths, structures, suites and their specs.

use std::sync::LazyLock;

use cullbench::index::Registry;
use cullbench::scene::{FAMILIES, MESHES, Scene};
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
        read(CutOuts::parse(line));
        structures(line);
        if let Some((name, keys)) = small(line) {
            let named = |known: &str| known == name;
            let is_made = FAMILIES.iter().any(|f| named(f.name)) || line.starts_with("mesh:");
            let (key, sized) = match is_made || MESHES.iter().any(|m| named(m.name)) {
                true => ("n", with(line, "n=40")),
                false => ("frames", with(line, "frames=3")),
            };
            let typed = match keys.contains(&key) {
                true => line,
                false => &sized,
            };
            read(scene::load(typed, &Default::default()));
            read(path::load(typed, &CITY, &Default::default()));
        }
    }
}

fn structures(list: &str) {
    for structure in read(Registry::builtin().structures(list)).unwrap_or_default() {
        read(structure.build(&CITY.items));
    }
}

/// Name and keys of a spec; `None` if a number makes a large scene or a long path.
///
/// Text with control characters is skipped, as error messages print names of files as
/// they are.
fn small(line: &str) -> Option<(&str, Vec<&str>)> {
    if line.contains(char::is_control) {
        return None;
    }
    let text = line.strip_prefix("mesh:").unwrap_or(line);
    let (name, given) = text.split_once(':').unwrap_or((text, ""));
    let given = given.split(',').filter_map(|pair| pair.split_once('='));
    let given: Vec<_> = given.map(|(k, v)| (k.trim(), v.trim())).collect();
    let all_are = given.iter().all(|&(k, v)| k == "seed" || !is_large(v));
    all_are.then(|| (name.trim(), given.iter().map(|pair| pair.0).collect()))
}

/// Returns true for numbers above [`MOST`], and for all with `k` or `M`.
fn is_large(value: &str) -> bool {
    let value = value.replace('_', "");
    let number = value.strip_suffix('%').unwrap_or(&value).parse();
    value.ends_with(['k', 'M']) || number.is_ok_and(|n: f64| n > MOST)
}

fn with(line: &str, parameter: &str) -> String {
    let between = if line.trim_start_matches("mesh:").contains(':') {
        ","
    } else {
        ":"
    };
    format!("{line}{between}{parameter}")
}
