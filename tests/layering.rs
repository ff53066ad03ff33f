//! Holds the code to the table of layers in docs/ARCHITECTURE.md: a module
//! imports only from the modules that its row names. Reads the `crate::` paths
//! of every source file, tests included. Kernels call nothing that may stay outside of them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The rows of the table: "| `index` | `geometry`, `query`, ... | ...".
fn table() -> BTreeMap<String, BTreeSet<String>> {
    let text = fs::read_to_string("docs/ARCHITECTURE.md").expect("docs/ARCHITECTURE.md");
    let quoted = |cell: &str| -> Vec<String> {
        let names = cell.split('`').skip(1).step_by(2);
        names.map(str::to_owned).collect()
    };
    let rows = text.lines().filter(|line| line.starts_with("| `"));
    rows.filter_map(|line| {
        let cells: Vec<&str> = line.split('|').collect();
        let module = quoted(cells.get(1)?).into_iter().next()?;
        Some((module, quoted(cells.get(2)?).into_iter().collect()))
    })
    .collect()
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("src is readable") {
        let path = entry.expect("src is readable").path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// `array::from_fn` and `map` are functions of their own: a build without link-time
/// optimisation leaves them outside of the kernel, compiled without its instructions, and
/// a scan takes 65 times as long.
#[test]
fn kernels_call_no_functions_that_may_stay_outside() {
    let x86 = ["avx2.rs", "avx512.rs", "mod.rs"].map(|file| format!("x86/{file}"));
    for file in x86.iter().map(String::as_str).chain(["plain.rs"]) {
        let text = fs::read_to_string(format!("src/kernel/{file}")).expect(file);
        let code = text
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"));
        for line in code.take_while(|line| *line != "#[cfg(test)]") {
            let is_called = ["from_fn", ".map("].iter().any(|name| line.contains(name));
            assert!(!is_called, "{file}: {line}");
        }
    }
}

/// Top-level modules named after `prefix` ("crate::"). Comments do not count.
fn imports(text: &str, prefix: &str) -> BTreeSet<String> {
    let code: String = text
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .flat_map(|line| [line, "\n"])
        .collect();
    let mut found = BTreeSet::new();
    for (at, _) in code.match_indices(prefix) {
        let rest = &code[at + prefix.len()..];
        let word = |text: &str| -> String {
            let name = text.trim_start().chars();
            name.take_while(|c| c.is_alphanumeric() || *c == '_')
                .collect()
        };
        assert!(
            !rest.starts_with('{'),
            "write one `use {prefix}` line per module"
        );
        let name = word(rest);
        // A macro of the whole crate (`crate::conformance!`) is no module.
        if !rest[name.len()..].starts_with('!') {
            found.insert(name);
        }
    }
    found
}

#[test]
fn modules_import_only_what_the_table_allows() {
    let table = table();
    let mut files = Vec::new();
    rust_files(Path::new("src"), &mut files);
    let mut modules_seen = BTreeSet::new();
    for file in files {
        let inside = file.strip_prefix("src").expect("under src");
        let first = inside.iter().next().expect("a name").to_string_lossy();
        let module = first.trim_end_matches(".rs").to_owned();
        if module == "lib" || module == "main" {
            continue;
        }
        let allowed = table
            .get(&module)
            .unwrap_or_else(|| panic!("`{module}` has no row in docs/ARCHITECTURE.md"));
        modules_seen.insert(module.clone());
        let text = fs::read_to_string(&file).expect("readable source");
        for used in imports(&text, "crate::") {
            assert!(
                used == module || allowed.contains(&used),
                "{} imports `{used}`, which the row of `{module}` does not allow",
                file.display()
            );
        }
    }
    let rows: BTreeSet<String> = table.into_keys().collect();
    assert_eq!(
        rows, modules_seen,
        "the table names exactly the modules there are"
    );
}

/// A file's code: without comments and without its tests.
fn code(file: &Path) -> String {
    let text = fs::read_to_string(file).expect("readable source");
    let lines = text
        .lines()
        .map(|line| line.split("//").next().unwrap_or(""));
    let code = lines.collect::<Vec<_>>().join("\n");
    let end = code.find("#[cfg(test)]\nmod ").unwrap_or(code.len());
    code[..end].to_owned()
}

/// The paths of a `use` tree, one for each leaf.
fn leaves(tree: &str, found: &mut Vec<String>) {
    let Some((prefix, rest)) = tree.split_once('{') else {
        let path = tree.split(" as ").next().unwrap_or("");
        return found.push(path.split_whitespace().collect());
    };
    let body = &rest[..rest.rfind('}').expect("braces match")];
    let mut depth = 0;
    let parts = body.split(|c| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        c == ',' && depth == 0
    });
    for part in parts.filter(|part| !part.trim().is_empty()) {
        leaves(&format!("{prefix}{part}"), found);
    }
}

/// Paths of this crate that a module uses, each with `true` for a `pub use`.
///
/// The paths begin at the root of the crate.
fn named(module: &str, code: &str, modules: &BTreeMap<String, PathBuf>) -> Vec<(String, bool)> {
    let mut found = Vec::new();
    for statement in code.split(';') {
        let Some(at) = statement.find("use ") else {
            continue;
        };
        let mut paths = Vec::new();
        leaves(&statement[at + 4..], &mut paths);
        let is_public = statement[..at].trim_end().ends_with("pub")
            || statement[..at].trim_end().ends_with(')');
        found.extend(paths.into_iter().map(|path| (path, is_public)));
    }
    let absolute = |(path, is_public): (String, bool)| {
        let mut inside: Vec<&str> = module.split("::").filter(|name| !name.is_empty()).collect();
        let mut names: Vec<&str> = path.split("::").collect();
        let child = [&inside[..], &names[..1]].concat().join("::");
        match names[0] {
            "crate" => inside.clear(),
            "super" => {}
            _ if modules.contains_key(&child) => names.insert(0, "self"),
            _ => return None,
        }
        while names.first() == Some(&"super") {
            inside.pop();
            names.remove(0);
        }
        if ["crate", "self"].contains(&names[0]) {
            names.remove(0);
        }
        Some(([inside, names].concat().join("::"), is_public))
    };
    found.into_iter().filter_map(absolute).collect()
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let mut files = Vec::new();
    rust_files(Path::new("src"), &mut files);
    let module = |file: &Path| {
        let inside = file
            .strip_prefix("src")
            .expect("under src")
            .with_extension("");
        let names: Vec<_> = inside.iter().map(|name| name.to_string_lossy()).collect();
        let names = names
            .into_iter()
            .filter(|name| name != "mod" && name != "lib");
        names.collect::<Vec<_>>().join("::")
    };
    let modules: BTreeMap<String, PathBuf> = files
        .into_iter()
        .map(|file| (module(&file), file))
        .collect();
    let used: BTreeMap<&String, Vec<(String, bool)>> = modules
        .iter()
        .map(|(name, file)| (name, named(name, &code(file), &modules)))
        .collect();
    // A re-exported name belongs to the module that defines it.
    let exported: BTreeMap<(&String, &str), &String> = used
        .iter()
        .flat_map(|(module, paths)| paths.iter().map(move |path| (*module, path)))
        .filter(|(_, (_, is_public))| *is_public)
        .map(|(module, (path, _))| ((module, path.rsplit("::").next().unwrap_or("")), path))
        .collect();
    let owner = |path: &str| {
        let mut path = path.to_owned();
        loop {
            let names: Vec<&str> = path.split("::").collect();
            let known = (0..=names.len()).rev().find_map(|n| {
                let module = names[..n].join("::");
                modules
                    .get_key_value(&module)
                    .map(|(module, _)| (module, &names[n..]))
            });
            let (module, rest) = known.expect("the root is a module");
            let next = rest.first().and_then(|name| exported.get(&(module, name)));
            match next {
                Some(next) if **next != path => {
                    path = [&[&next[..]], &rest[1..]].concat().join("::")
                }
                _ => return module.clone(),
            }
        }
    };
    let mut imports: BTreeMap<&String, BTreeSet<String>> = used
        .iter()
        .map(|(module, paths)| {
            let own = paths.iter().filter(|(_, is_public)| !is_public);
            let owners = own.map(|(path, _)| owner(path));
            (*module, owners.filter(|owner| owner != *module).collect())
        })
        .collect();
    assert!(
        imports.values().map(BTreeSet::len).sum::<usize>() > 500,
        "{imports:?}"
    );
    // What imports nothing that is left, or is imported by nothing, is in no circle.
    loop {
        let left: BTreeSet<String> = imports.keys().map(|module| (*module).clone()).collect();
        let imported: BTreeSet<String> = imports.values().flatten().cloned().collect();
        imports.retain(|module, owners| {
            imported.contains(*module) && owners.iter().any(|owner| left.contains(owner))
        });
        if imports.len() == left.len() {
            break;
        }
    }
    assert!(imports.is_empty(), "in a circle: {:?}", imports.keys());
}

#[test]
fn every_file_says_what_it_owns() {
    let mut files = Vec::new();
    for folder in ["src", "tests", "benches", "examples", "scripts"] {
        rust_files(Path::new(folder), &mut files);
    }
    assert!(files.len() > 40, "{} files", files.len());
    for file in files {
        let text = fs::read_to_string(&file).expect("readable source");
        assert!(
            text.starts_with("//! "),
            "{} does not open with //!",
            file.display()
        );
    }
}
