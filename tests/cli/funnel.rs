//! `funnel`: a scene with an obvious answer, fields of JSON and CSV, guarantees.
//!
//! Errors are tested as well. The guarantees are checked on generated scenes. No test depends on a time.

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use serde_json::Value;

use super::process::*;
use super::{BOXES, EYE_LOOK};

/// A wall, and boxes behind it, beside it, behind the camera and around the camera.
const SCENE: &str = "\
10,-5,-1,11,5,10
20,-1,0,21,1,2
20,12,0,21,13,2
-9,-1,0,-8,1,2
-1,-1,0,1,1,3
";

pub fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("scene.csv"), format!("{BOXES}\n{SCENE}")).expect("written");
    let cameras = format!("{EYE_LOOK},near,far\n0,0,1.7,1,0,1.7,0.1,100\n");
    fs::write(folder.path().join("cameras.csv"), cameras).expect("written");
    folder
}

/// The rows of a stage.
pub fn rows<'r>(report: &'r Value, stage: &'r str) -> impl Iterator<Item = &'r Value> {
    let rows = array(report, "stages").iter();
    rows.filter(move |row| row["stage"] == stage)
}

pub fn row<'r>(report: &'r Value, stage: &'r str, name: &str) -> &'r Value {
    let mut found = rows(report, stage).filter(|row| row["name"] == name);
    found.next().unwrap_or_else(|| panic!("{stage} {name}"))
}

/// A test of the fragment stage, and one of its counts.
pub fn counted(report: &Value, test: &str, count: &str) -> f64 {
    number(&row(report, "fragment", test)["fragments"], count)
}

pub const LINE: &str = "funnel --scene scene.csv --path cameras.csv --processes 1 --format json";

/// The report of [`LINE`] on [`folder`], from one run for all tests.
pub fn plain_report() -> &'static Value {
    static REPORT: LazyLock<Value> = LazyLock::new(|| json(&works(folder().path(), LINE)));
    &REPORT
}

#[test]
fn a_wall_hides_what_is_behind_it_and_nothing_else() {
    let report = plain_report();
    assert_eq!((&report["items"], &report["views"]), (&5.into(), &1.into()));
    let object = rows(report, "object").find(|row| row["structure"] == "wide");
    let object = object.expect("the structure of the chain");
    // All but the one behind the camera.
    assert_eq!(number(object, "output_count"), 4.0);
    for name in ["masked-inner", "masked"] {
        let row = row(report, "occlusion", name);
        // The box around the eye stays, though nothing of it is seen from within.
        assert_eq!(number(row, "output_count"), 3.0, "{name}");
        assert_eq!(number(row, "truth_count"), 2.0, "{name}");
        assert_eq!(number(row, "false_negative_count"), 0.0, "{name}");
        assert_eq!(number(row, "false_positive_count"), 1.0, "{name}");
    }
    // Of each box at most three sides face an eye outside of it.
    let triangles = row(report, "triangle", "per-triangle");
    assert!(number(triangles, "output_count") <= 12.0);
    assert_eq!(number(triangles, "false_positive_count"), 0.0);
    let gains = array(report, "gains");
    let occlusion = gains.iter().find(|gain| gain["stage"] == "occlusion");
    let occlusion = occlusion.expect("a stage of the chain");
    assert_eq!(number(occlusion, "with_count"), 3.0);
    assert_eq!(number(occlusion, "without_count"), 4.0);
}

#[test]
fn what_promises_to_lose_nothing_loses_nothing() {
    for scene in ["city:n=1500", "rooms:n=1500", "forest:n=1500"] {
        let line = format!(
            "funnel --scene {scene} --path street:frames=6 --samples 96x54 --processes 1 \
             --format json"
        );
        let report = json(&works(Path::new("."), &line));
        for row in array(&report, "stages") {
            let what = format!("{scene} {} {}", row["stage"], row["name"]);
            if row["guarantee"] != "unproven" {
                assert_eq!(number(row, "false_negative_count"), 0.0, "{what}");
            }
            let [input, output] = ["input_count", "output_count"].map(|name| number(row, name));
            assert!(output <= input, "{what}: {output} of {input}");
            let removed = input - output;
            if let (Some(ns), Some(per)) =
                (row["stage_ns"].as_f64(), row["ns_per_removed"].as_f64())
            {
                assert!((per * removed / ns - 1.0).abs() < 1e-9, "{what}");
            }
        }
        let chosen = |stage| {
            rows(&report, stage)
                .filter(|row| row["is_chosen"] == true)
                .count()
        };
        for stage in ["region", "object", "occlusion", "triangle", "fragment"] {
            assert_eq!(chosen(stage), 1, "{scene} {stage}");
        }
        assert_eq!(
            rows(&report, "region").count() > 1,
            scene.starts_with("rooms"),
            "{scene}"
        );
        assert!(!array(&report, "conclusions").is_empty());
    }
}

/// No line of a table or a sentence is wider than a terminal of 80 columns.
fn assert_fits(text: &str) {
    for line in text.lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
}

/// Wide tables: times with intervals, counts of large scenes, and long names.
#[test]
fn tables_of_many_items_with_intervals_fit() {
    let more = "--path street:frames=2 --samples 32x18 --processes 3";
    let lines = [
        format!("funnel --scene city:n=10000 {more} --all"),
        format!(
            "funnel --scene rooms:n=2000,seed=12345678901234567890 {more} --region portal-rect \
             --occlusion masked-inner"
        ),
    ];
    for line in lines {
        let text = works(Path::new("."), &line);
        assert!(text.contains(['±', '[']), "{text}");
        assert_fits(&text);
    }
}

/// The fields of a JSON row that hold something, by the names of their columns.
fn fields(row: &Value, before: &str, found: &mut Vec<(String, String)>) {
    for (name, value) in row.as_object().expect("a row") {
        let name = match (before, &name[..]) {
            ("", name) => name.to_owned(),
            (before, "value") => before.to_owned(),
            (before, name) => format!("{before}_{name}"),
        };
        match value {
            _ if name == "summary" => {}
            Value::Null => {}
            Value::Object(_) => fields(value, &name, found),
            Value::String(text) => found.push((name, text.clone())),
            plain => found.push((name, plain.to_string())),
        }
    }
}

#[test]
fn csv_has_every_field_of_every_table_of_the_json() {
    let more = "--path street:frames=2 --samples 32x18 --processes 1";
    let lines = [
        format!("funnel --scene rooms:n=500 {more}"),
        format!("funnel --scene city:n=500 {more} --cut-out fence"),
        format!("funnel --scene freedm-map12 {more}"),
        format!("funnel --scene mesh:forest:n=2k {more}"),
    ];
    let wanted = [
        "level",
        "cut_outs",
        "inner_boxes",
        "ground",
        "solid_blocks",
        "stages",
        "picks",
        "gains",
    ];
    let mut headers = std::collections::BTreeMap::new();
    let mut tables = std::collections::BTreeSet::new();
    let folder = tempfile::tempdir().expect("a folder");
    for line in lines {
        let line = format!("{line} --format json --csv tables");
        let report = json(&works(folder.path(), &line));
        for table in wanted {
            let file = folder.path().join(format!("tables/{table}.csv"));
            let mut read = csv::Reader::from_path(file).expect("a file");
            let header = read.headers().expect("a header").clone();
            let mut records = read.records().map(|record| record.expect("a row"));
            let rows = match &report[table] {
                Value::Array(rows) => &rows[..],
                Value::Null => &[],
                row => std::slice::from_ref(row),
            };
            for row in rows {
                tables.insert(table);
                let record = records.next().expect("a row");
                let cell = |name: &str| {
                    let place = header.iter().position(|column| column == name);
                    &record[place.unwrap_or_else(|| panic!("no column {name} of {table}"))]
                };
                assert_eq!(cell("scene"), report["scene"]);
                let mut found = Vec::new();
                fields(row, "", &mut found);
                for (name, value) in found {
                    assert_eq!(cell(&name), value, "{table} {name}");
                }
            }
            assert!(records.next().is_none(), "more rows than the JSON has");
            let same = headers.entry(table).or_insert(header.clone());
            assert_eq!(*same, header, "{table}");
        }
    }
    // No table went unseen.
    assert_eq!(tables, wanted.into());
}

#[test]
fn triangles_and_fragments_are_gained_too() {
    let (folder, report) = (folder(), plain_report());
    let gain = |stage: &str| {
        let mut gains = array(report, "gains").iter();
        gains.find(|gain| gain["stage"] == stage).expect("a gain")
    };
    let [triangle, fragment] = ["triangle", "fragment"].map(gain);
    let faces = row(
        report,
        "triangle",
        triangle["back_end"].as_str().expect("a name"),
    );
    for (of_gain, of_row) in [
        ("with_count", "output_count"),
        ("without_count", "input_count"),
    ] {
        assert_eq!(number(triangle, of_gain), number(faces, of_row));
    }
    assert_eq!(triangle["unit"], "triangles");
    // Only the stage itself is between the two times.
    let spent = number(triangle, "with_ns") - number(triangle, "without_ns");
    assert!(
        (spent / number(faces, "stage_ns") - 1.0).abs() < 1e-6,
        "{triangle}"
    );
    assert_eq!(fragment["unit"], "fragments");
    assert_eq!(
        number(fragment, "with_count"),
        counted(report, "z-test", "shaded_count")
    );
    let every = counted(report, "z-test", "fragment_count");
    assert_eq!(number(fragment, "without_count"), every);
    let spent = number(fragment, "with_ns") - number(fragment, "without_ns");
    let own = number(row(report, "fragment", "z-test"), "stage_ns");
    assert!(own > 0.0 && (spent / own - 1.0).abs() < 1e-6, "{fragment}");
    let table = works(folder.path(), &LINE.replace("--format json", "--all"));
    assert!(table.contains("fragment (z-test)"), "{table}");
    let none = format!("{LINE} --triangle none --fragment none");
    let report = json(&works(folder.path(), &none));
    assert!(
        array(&report, "gains")
            .iter()
            .all(|gain| gain["unit"] == "items")
    );
}

#[test]
fn tables_fit_and_pictures_are_whole() {
    let folder = folder();
    let table = LINE.replace("--format json", "");
    let text = works(folder.path(), &table);
    for word in [
        "stage",
        "triangle",
        "occlusion",
        "masked-inner",
        "worth it from",
    ] {
        assert!(text.contains(word), "{word}: {text}");
    }
    assert_fits(&text);
    works(
        folder.path(),
        &format!("{table} --svg plan.svg --html page.html"),
    );
    let picture = fs::read_to_string(folder.path().join("plan.svg")).expect("a picture");
    assert!(picture.contains("behind others") && picture.trim_end().ends_with("</svg>"));
    let page = fs::read_to_string(folder.path().join("page.html")).expect("a page");
    assert!(page.contains("<svg") && page.contains("<table>"));
    // Its colours are text of the page too.
    assert!(page.contains("</svg>\n<figcaption><span><i style=\"background:#e4e4e4\"></i>region"));
}

#[test]
fn the_chain_is_shown_and_the_rest_is_asked_for() {
    let line = "funnel --scene city:n=200 --samples 32x18 --processes 1 --structure wide";
    let chain = works(Path::new("."), line);
    assert!(
        chain.contains("200 items; 8 of 32 views of 32 x 18 samples"),
        "{chain}"
    );
    let rest = ["masked?", "?: FN at these samples only", "Picking"];
    for name in rest {
        assert!(!chain.contains(&format!("{name} ")) && !chain.contains(&format!("{name}:")));
    }
    let all = works(Path::new("."), &format!("{line} --all --no-picks"));
    for name in rest {
        assert_eq!(all.contains(name), name != "Picking", "{name}: {all}");
    }
    assert!(
        all.contains("Left out (picks, all): not asked for: --no-picks."),
        "{all}"
    );
}

/// Checks that picking back ends with a guarantee are right, for every question.
pub fn picked_exactly(report: &Value) {
    let picks = array(report, "picks");
    for question in ["first item", "all within 4 pixels"] {
        let of = picks.iter().filter(|row| row["question"] == question);
        let sound = of.filter(|row| row["guarantee"] != "unproven");
        let sound: Vec<&Value> = sound.collect();
        assert!(!sound.is_empty(), "{question}");
        for row in sound {
            assert_eq!(number(row, "wrong_count"), 0.0, "{row}");
        }
    }
}

#[test]
fn stages_can_be_chosen_and_left_out() {
    let folder = folder();
    let without = json(&works(folder.path(), &format!("{LINE} --occlusion none")));
    assert_eq!(row(&without, "occlusion", "none")["is_chosen"], true);
    assert!(
        array(&without, "gains")
            .iter()
            .all(|gain| gain["stage"] != "occlusion")
    );
    let typed = format!("{LINE} --structure linear --triangle per-triangle --samples 64x36");
    let other = json(&works(folder.path(), &typed));
    assert_eq!(other["samples"], serde_json::json!([64, 36]));
    assert_eq!(row(&other, "triangle", "per-triangle")["is_chosen"], true);
}

#[test]
fn what_cannot_be_is_refused_in_a_line() {
    let folder = folder();
    let tables = folder.path().join("tables");
    fs::create_dir(&tables).unwrap();
    let scene = fs::read(folder.path().join("scene.csv")).unwrap();
    fs::write(tables.join("level.csv"), &scene).unwrap();
    let line = "funnel --scene tables/level.csv --path orbit:frames=1 --csv tables";
    let done = cullbench(folder.path(), line);
    assert_refused(&done, "level.csv | an input | --csv", line);
    assert_eq!(fs::read(tables.join("level.csv")).unwrap(), scene);
    for (more, wanted) in [
        (
            "--csv tables --svg tables/stages.csv",
            "stages.csv | another output",
        ),
        ("--occlusion maskd", "maskd | did you mean 'masked'"),
        ("--region portal-rect", "portal-rect"),
        ("--samples 0x4", "--samples | 0x4 | columns x rows"),
        ("--samples 320", "--samples | 320"),
        ("--structure nosuch", "nosuch"),
        ("--svg no/such/folder/x.svg", "--svg"),
        ("--html no/such/folder/x.html", "--html"),
        ("--html scene.csv", "scene.csv | input | --html"),
        ("--html x --svg ./x", "another output | --html"),
        ("--svg .", "--svg | a folder"),
        ("--cut-out fense", "fense | did you mean 'fence'"),
        (
            "--cut-out fence:share=2",
            "fence:share=2 | share=2 | at most 1",
        ),
    ] {
        let done = cullbench(folder.path(), &format!("{LINE} {more}"));
        assert_refused(&done, wanted, more);
    }
    assert_refused(
        &cullbench(folder.path(), "funnel --scene freedm-map12 --cut-out fence"),
        "freedm-map12 | walls | solid boxes | --cut-out",
        "a map with cut-outs",
    );
}
