//! Lists, help texts and their JSON; every entry of a list can be used.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::BOXES;
use super::process::*;
use super::queries::query;

fn names(list: &Value) -> impl Iterator<Item = &str> {
    let rows = list.as_array().expect("an array").iter();
    rows.map(|row| row["name"].as_str().expect("a name"))
}

#[test]
fn json_outputs_are_json() {
    let folder = with_good_files(&[]);
    let ask = |line: &str| json(&works(folder.path(), &format!("{line} --format json")));
    let list = ask("list");
    assert_eq!(
        keys(&list),
        set("structures scenes paths tests metrics motions")
    );
    for topic in keys(&list) {
        assert_eq!(ask(&format!("list {topic}")), list[topic]);
        // The table says the same, for people.
        let table = works(folder.path(), &format!("list {topic}"));
        for name in names(&list[topic]) {
            assert!(!name.is_empty() && table.contains(name), "{topic} {name}");
        }
        let rows = list[topic].as_array().expect("an array");
        assert!(!rows.is_empty() && rows.iter().all(|row| row["summary"].is_string()));
    }
    let env = ask("env");
    let facts = set("machine toolchain source");
    assert_eq!(keys(&env), facts);
    let verify = ask("verify --scene scene.csv --path orbit:frames=4 --cases 50");
    assert_eq!(verify["ok"], true);
    assert_eq!(verify["mismatches"], 0);
    let checks = verify["checks"].as_array().expect("an array");
    assert_eq!(checks.len(), 2 * structure_names().len());
    let info = ask("scene info scene.csv");
    assert_eq!(info["total_count"], 2);
    assert_eq!(info["bounds_max"], json("[6.0, 1.0, 1.0]"));
}

#[test]
fn names_in_tables_are_explained() {
    let here = Path::new(".");
    let metrics = works(here, "list metrics");
    let run = works(here, "run --help");
    for name in ["bound-read", "bound-memcpy"] {
        assert!(metrics.contains(name) && run.contains(name), "{name}");
    }
}

/// Three digits for people, all of them for programs.
#[test]
fn scenes_are_described_with_three_digits() {
    let here = Path::new(".");
    let told = works(here, "scene info city:n=200");
    for part in [
        "(-143, -143, 0) to (145, 143, 39.9)\n",
        "min 1 m, median 4.2 m, p99 ",
        ", max 39.9 m\n",
        "extent   288 x 286 x 39.9 m\n",
    ] {
        assert!(told.contains(part), "{told}");
    }
    let info = json(&works(here, "scene info city:n=200 --format json"));
    assert_eq!(number(&info, "size_max"), 39.881_315_048_394_27);
}

#[test]
fn the_manual_has_every_command_and_completions_no_hidden_one() {
    let folder = tempfile::tempdir().unwrap();
    let manual = works(folder.path(), "man");
    works(folder.path(), "man pages/man1");
    for (command, option) in [
        ("run", "no\\-bounds"),
        ("compare", "against"),
        ("scene-draw", "depth"),
    ] {
        let page = folder
            .path()
            .join(format!("pages/man1/cullbench-{command}.1"));
        let page = std::fs::read_to_string(page).unwrap();
        assert!(
            page.contains(option) && manual.contains(option),
            "{command}"
        );
    }
    assert!(!folder.path().join("pages/man1/cullbench-worker.1").exists());
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = works(folder.path(), &format!("completions {shell}"));
        assert!(
            script.contains("advise") && !script.contains("worker"),
            "{shell}"
        );
    }
}

#[test]
fn help_lists_and_scenes_fit_eighty_columns_of_a_pipe() {
    let fits = |line: &str| {
        let told = works(Path::new("."), line);
        let long = told.lines().find(|line| line.chars().count() > 80);
        assert!(
            long.is_none() && told.lines().count() > 1,
            "{line}: {long:?}"
        );
    };
    for command in "run merge report compare query locate verify precision funnel advise drift \
                    stress scene env completions man licences list"
        .split_whitespace()
    {
        fits(&format!("{command} --help"));
    }
    for line in [
        "--help",
        "scene info --help",
        "scene generate --help",
        "scene convert --help",
        "list",
        "scene info helsinki",
        "scene info uniform:n=20,offset=1e9",
    ] {
        fits(line);
    }
}

#[test]
fn every_scene_and_path_of_the_list_can_be_used() {
    let here = Path::new(".");
    let list = json(&works(here, "list --format json"));
    let real = set("freedm-map12 freedm-map20 helsinki us-counties");
    let told = works(here, "list scenes");
    assert!(told.contains(" licence ") && !told.contains("params real"));
    // Files are there only if they were fetched.
    let scenes = names(&list["scenes"]);
    for name in scenes.filter(|name| !name.contains('/')) {
        let size = if real.contains(name) { "" } else { ":n=60" };
        let rows = query(here, &format!("{name}{size}"), "orbit:frames=2", "");
        assert_eq!(rows.len(), 2 * structure_names().len(), "{name}");
    }
    // An animated camera is in glTF only.
    for name in names(&list["paths"]).filter(|name| *name != "animation") {
        let rows = query(here, "freedm-map12", name, "");
        assert!(rows.len() >= 21 * structure_names().len(), "{name}");
    }
}

#[test]
fn a_generated_scene_reads_back_as_the_same() {
    let folder = folder(&[]);
    let digest = |scene: &str| {
        let info = works(folder.path(), &format!("scene info {scene} --format json"));
        json(&info)["digest"].as_str().expect("a digest").to_owned()
    };
    let specs = "uniform:n=50 uniform:n=1 city:n=50 forest:n=50,seed=9 freedm-map12 us-counties";
    for spec in specs.split(' ') {
        let printed = works(folder.path(), &format!("scene generate {spec}"));
        let done = cullbench(folder.path(), &format!("scene generate {spec} --out f.csv"));
        assert_eq!((done.code, done.out.as_str()), (Some(0), ""));
        let written = fs::read_to_string(folder.path().join("f.csv"));
        assert_eq!(written.expect("written"), printed);
        assert_eq!(digest("f.csv"), digest(spec), "{spec}");
    }
    // An existing file wins over a name.
    fs::copy(folder.path().join("f.csv"), folder.path().join("uniform")).expect("writable");
    assert_eq!(digest("uniform"), digest("us-counties"));
}

#[test]
fn labels_of_a_file_do_not_control_the_terminal() {
    let scene = format!("{BOXES},\"two\nlines\"\n0,0,0,1,1,1,\x1b[31mred\n");
    let folder = folder(&[("s.csv", scene.as_bytes())]);
    let table = works(folder.path(), "scene info s.csv");
    assert!(
        table.contains("two lines") && table.contains("[31mred 1"),
        "{table}"
    );
    assert!(!table.contains('\x1b'));
    // They are kept as they are where programs read them.
    let printed = works(folder.path(), "scene generate s.csv");
    assert_eq!(printed, scene);
}

/// The commands that a help text lists.
fn commands_of(help: &str) -> Vec<&str> {
    let lines = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let listed = lines.take_while(|line| line.starts_with("  "));
    let names = listed.filter(|line| !line.starts_with("   "));
    let names = names.filter_map(|line| line.split_whitespace().next());
    names.filter(|name| *name != "help").collect()
}

#[test]
fn every_command_has_help() {
    let here = Path::new(".");
    let top = works(here, "--help");
    let commands = commands_of(&top);
    for name in set("run compare query locate verify drift list scene env completions man licences")
    {
        assert!(commands.contains(&name), "{name}: {commands:?}");
    }
    for command in commands {
        let help = works(here, &format!("{command} --help"));
        let usage = format!("Usage: cullbench {command}");
        assert!(help.contains(&usage), "{command}: {help}");
        for below in commands_of(&help) {
            let help = works(here, &format!("{command} {below} --help"));
            assert!(help.contains(&format!("{usage} {below}")), "{help}");
        }
    }
    let version = concat!("cullbench ", env!("CARGO_PKG_VERSION"), "\n");
    assert_eq!(works(here, "--version"), version);
    for shell in ["bash", "zsh", "fish"] {
        let script = works(here, &format!("completions {shell}"));
        assert!(script.contains("cullbench"), "{shell}");
    }
    assert!(works(here, "man").contains("cullbench"));
    let licences = works(here, "licences");
    for owner in [
        "OpenStreetMap contributors",
        "Freedoom project",
        "Michael Bostock",
    ] {
        assert!(licences.contains(owner), "{owner}");
    }
}

#[test]
fn fetched_files_that_are_missing_or_damaged_are_told_and_recorded() {
    let folder = folder(&[]);
    let fetched = folder.path().join("datasets/fetched");
    fs::create_dir_all(&fetched).expect("a folder");
    for file in ["engine.glb", "cities.csv"] {
        fs::write(fetched.join(file), "garbage").expect("writable");
    }
    let list = json(&works(folder.path(), "list scenes --format json"));
    let rows = list.as_array().expect("rows").iter();
    let row = |name: &str| {
        let mut rows = rows.clone();
        let found = rows.find(|row| row["name"] == format!("datasets/fetched/{name}"));
        found.expect("a row")
    };
    assert_eq!(
        row("engine.glb")["state"],
        "missing, scripts/fetch.py engine"
    );
    let damaged = "missing, scripts/fetch.py cities";
    assert_eq!(row("cities.csv")["state"], damaged);
    assert_eq!(row("engine.glb")["licence"], "BSD-3-Clause");
    let done = cullbench(folder.path(), "run --suite real --path none.csv");
    assert_eq!(done.code, Some(2));
    for told in [
        "note: left out, as missing or damaged in datasets/fetched of the working directory (",
        "scripts/fetch.py fetches them): freedm freedoom2 engine cities stars sponza kitchen openarena\n",
        "none.csv: No such file",
    ] {
        assert!(done.err.contains(told), "{told}: {}", done.err);
    }
    let short = "--path orbit:frames=2 --structure linear --processes 1 --no-bounds --out r";
    let Done { code, out, .. } = cullbench(folder.path(), &format!("run --suite real {short}"));
    assert_eq!(code, Some(0));
    let read = |file| fs::read_to_string(folder.path().join("r").join(file)).expect("a file");
    let left_out = &json(&read("report.json"))["run"]["left_out"];
    let left_out = left_out.as_str().expect("a line");
    assert!(left_out.contains(": freedm freedoom2 engine cities "));
    let part = format!("run --suite real {short}/part --shard 1/1");
    assert_eq!(cullbench(folder.path(), &part).code, Some(0));
    let merged = works(folder.path(), "merge r/part --out merged");
    for out in [out, merged] {
        let told = "warning: left out, as missing or damaged";
        assert!(out.contains(told) && out.contains(" 0 wrong;"), "{out}");
    }
    assert!(read("report.html").contains(left_out));
}
