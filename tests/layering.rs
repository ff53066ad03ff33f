//! Holds the code to the table of layers in docs/ARCHITECTURE.md: a module
//! imports only from the modules that its row names. Reads the `crate::` paths
//! of every source file, tests included.

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

#[test]
fn every_file_says_what_it_owns() {
    let mut files = Vec::new();
    for folder in ["src", "tests", "benches", "examples"] {
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
