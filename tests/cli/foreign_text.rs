//! Names and labels from untrusted input, in every kind of output.
//!
//! They may contain control sequences of terminals, markup, or signs in front.

use std::fs;

use serde_json::json;

use super::BOXES;
use super::process::*;

/// A colour, a change of direction, a bell, and what is no XML.
const NASTY: &str = "\u{1b}[31m\u{202e}\u{7}\u{9b}\u{fffe}";

/// No character but line feeds that a terminal or XML would not print.
fn assert_harmless(text: &str, what: &str) {
    let harmful = |c: &char| {
        *c != '\n' && (c.is_control() || ('\u{202a}'..='\u{202e}').contains(c) || *c == '\u{fffe}')
    };
    let found = text.chars().find(harmful);
    assert_eq!(found, None, "{what}: {text:?}");
}

#[test]
fn control_characters_reach_no_terminal() {
    let header = format!("{BOXES},kind{NASTY}");
    let scene = format!("{header}\n0,0,0,1,1,1,hut{NASTY}\n5,0,0,6,1,1,\"a\nb\"\n");
    let bad = format!("{BOXES},{NASTY},{NASTY}\n");
    let worse = format!("{BOXES}\n0,0,0,{NASTY},1,1\n");
    let vectors = r#"{"vectors": [{"id": "\u001b\u202e", "planes": 3}]}"#;
    let name = format!("s{NASTY}.csv");
    let folder = with_good_files(&[
        (&name, scene.as_bytes()),
        ("twice.csv", bad.as_bytes()),
        ("number.csv", worse.as_bytes()),
        ("vectors.json", vectors.as_bytes()),
    ]);
    let run = "--path orbit:frames=2 --structure linear,bvh --no-bounds";
    for (line, code) in [
        (format!("scene info {name}"), 0),
        (format!("scene convert {name} new.csv"), 0),
        (format!("run --scene {name} {run} --out run"), 0),
        ("report run".to_owned(), 0),
        ("compare run run --all".to_owned(), 0),
        (
            format!("verify --scene {name} --path orbit:frames=2 --cases 1"),
            0,
        ),
        (format!("run --scene scene.csv {run} --out {NASTY}"), 0),
        ("scene info twice.csv".to_owned(), 2),
        ("scene info number.csv".to_owned(), 2),
        ("stress --vectors vectors.json".to_owned(), 2),
        (format!("scene info no{NASTY}.csv"), 2),
        (format!("query --scene scene.csv --cameras {NASTY}"), 2),
        (format!("list --{NASTY}"), 2),
        (format!("list {NASTY}"), 2),
    ] {
        let done = cullbench(folder.path(), &line);
        assert_eq!(done.code, Some(code), "{line:?}: {done:?}");
        assert_harmless(&done.out, &line);
        assert_harmless(&done.err, &line);
    }
    // Shown, and not left out: two names stay two.
    let info = works(folder.path(), &format!("scene info {name}"));
    assert!(
        info.contains("s\\u{1b}[31m\\u{202e}\\u{7}\\u{9b}\\u{fffe}.csv"),
        "{info}"
    );
    assert!(info.contains("a b 1"), "{info}");
}

#[test]
fn control_characters_leave_pictures_and_pages_well_formed() {
    let folder = folder(&[]);
    let run = "run --scene uniform:n=300 --scene uniform:n=900 --path outside:frames=4 \
        --structure linear,bvh --no-bounds --out run";
    works(folder.path(), run);
    let path = folder.path().join("run/report.json");
    let mut report = json(&fs::read_to_string(&path).expect("a report"));
    report["run"]["command"] = json!(NASTY);
    for cell in report["cells"].as_array_mut().expect("an array") {
        let name = cell["scene"]["name"].as_str().expect("text");
        cell["scene"]["name"] = json!(name.replace("uniform", &format!("u{NASTY}<&")));
        let name = cell["structure"].as_str().expect("text");
        cell["structure"] = json!(format!("{name}{NASTY}<&\n"));
        cell["reason"] = json!(NASTY);
    }
    fs::write(&path, report.to_string()).expect("writable");
    works(
        folder.path(),
        "report run --svg charts --html page.html --markdown page.md",
    );
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect(name);
    assert_harmless(&read("page.html"), "page");
    assert_harmless(&read("page.md"), "Markdown");
    let charts = contents(&folder.path().join("charts"));
    assert!(!charts.is_empty());
    for (name, bytes) in charts {
        let svg = String::from_utf8(bytes.expect("a file")).expect("UTF-8");
        assert_harmless(&svg, &name);
        assert!(svg.contains("\\u{1b}[31m") && !svg.contains("<&"), "{svg}");
    }
}

#[test]
fn text_stays_as_it_is_in_every_table() {
    let boxes = format!("{BOXES},=kind,level\n0,0,0,1,1,1,=1+1,-2\n5,0,0,6,1,1,@a,-x\n");
    let name = "=1+1\nb,c\u{1b}[2J.csv";
    let told = "=1+1\nb,c\\u{1b}[2J.csv";
    let folder = with_good_files(&[(name, boxes.as_bytes())]);
    let run = format!(
        "run --scene {name} --path orbit:frames=2 --structure linear --no-bounds --out run"
    );
    works(folder.path(), &run);
    for file in ["run/summary.csv", "run/samples.csv"] {
        let text = fs::read_to_string(folder.path().join(file)).expect(file);
        let rows = rows(&text);
        assert!(!rows.is_empty());
        for row in rows {
            assert_eq!(row["scene"], told, "{file}");
            assert_eq!(row["structure"].trim_end_matches("#twin"), "linear");
        }
    }
    // The same as in the report, but for what steers a terminal.
    let report = fs::read_to_string(folder.path().join("run/report.json")).expect("a report");
    assert_eq!(json(&report)["cells"][0]["scene"]["name"], name);
    // Labels come back as they were; numbers are numbers.
    let once = works(folder.path(), &format!("scene convert {name}"));
    let wanted = format!("{BOXES},=kind,level\n0,0,0,1,1,1,=1+1,-2\n5,0,0,6,1,1,@a,-x\n");
    assert_eq!(once, wanted);
    fs::write(folder.path().join("once.csv"), &once).expect("writable");
    assert_eq!(works(folder.path(), "scene convert once.csv"), once);
    let labels = |scene: &str| {
        let info = works(folder.path(), &format!("scene info {scene} --format json"));
        json(&info)["labels"].clone()
    };
    assert_eq!(labels("once.csv"), labels(name));
    assert_eq!(labels(name)["=kind"]["=1+1"], 1);
}
