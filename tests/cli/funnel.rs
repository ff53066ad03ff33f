//! `funnel`: a scene whose answer is seen with the naked eye, the fields of its JSON
//! and CSV, promises that hold on generated scenes, and refusals. No time is judged.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::process::*;
use super::{BOXES, EYE_LOOK};

/// A wall, a box behind it, one beside it, one behind the camera, and one around it.
const SCENE: &str = "\
10,-5,-1,11,5,10
20,-1,0,21,1,2
20,12,0,21,13,2
-9,-1,0,-8,1,2
-1,-1,0,1,1,3
";

fn folder() -> tempfile::TempDir {
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

const LINE: &str = "funnel --scene scene.csv --path cameras.csv --processes 1 --format json";

#[test]
fn a_wall_hides_what_is_behind_it_and_nothing_else() {
    let folder = folder();
    let report = json(&works(folder.path(), LINE));
    assert_eq!((&report["items"], &report["views"]), (&5.into(), &1.into()));
    let object = rows(&report, "object").find(|row| row["structure"] == "wide");
    let object = object.expect("the structure of the chain");
    // All but the one behind the camera.
    assert_eq!(number(object, "output_count"), 4.0);
    for name in ["masked-inner", "masked-inner-two-pass", "masked"] {
        let row = row(&report, "occlusion", name);
        // The box around the eye stays, though nothing of it is seen from within.
        assert_eq!(number(row, "output_count"), 3.0, "{name}");
        assert_eq!(number(row, "truth_count"), 2.0, "{name}");
        assert_eq!(number(row, "false_negative_count"), 0.0, "{name}");
        assert_eq!(number(row, "false_positive_count"), 1.0, "{name}");
    }
    // Of each box at most three sides face an eye outside of it.
    let triangles = row(&report, "triangle", "per-triangle");
    assert!(number(triangles, "output_count") <= 12.0);
    assert_eq!(number(triangles, "false_positive_count"), 0.0);
    let gains = array(&report, "gains");
    let occlusion = gains.iter().find(|gain| gain["stage"] == "occlusion");
    let occlusion = occlusion.expect("a stage of the chain");
    assert_eq!(number(occlusion, "with_count"), 3.0);
    assert_eq!(number(occlusion, "without_count"), 4.0);
}

#[test]
fn what_promises_to_lose_nothing_loses_nothing() {
    for scene in ["city:n=1500", "rooms:n=1500", "forest:n=1500"] {
        let line = format!(
            "funnel --scene {scene} --path street:frames=6 --samples 96x54 --processes 2 \
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

/// No line of a table or a sentence is wider than a terminal of 100 columns.
fn assert_fits(text: &str) {
    for line in text.lines() {
        assert!(line.chars().count() <= 100, "{line}");
    }
}

/// Intervals make the times wide, large scenes the counts, and names are as long as they
/// are.
#[test]
fn tables_of_many_items_with_intervals_fit() {
    let more = "--path street:frames=2 --samples 64x36 --processes 3";
    let lines = [
        format!("funnel --scene city:n=10000 {more}"),
        format!(
            "funnel --scene rooms:n=2000,seed=12345678901234567890 {more} --region portal-clip \
             --occlusion masked-inner-two-pass"
        ),
    ];
    for line in lines {
        let text = works(Path::new("."), &line);
        assert!(text.contains('±'), "{text}");
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
            // Sentences, and how far another sample may be.
            _ if name == "summary" || name.ends_with("_elsewhere") => {}
            Value::Null => {}
            Value::Object(_) if name != "exceptions" => fields(value, &name, found),
            Value::Object(list) => found.push((name, list.len().to_string())),
            Value::Array(list) => found.push((name, list.len().to_string())),
            Value::String(text) => found.push((name, text.clone())),
            plain => found.push((name, plain.to_string())),
        }
    }
}

#[test]
fn csv_has_every_field_of_every_table_of_the_json() {
    let folder = folder();
    let more = "--path street:frames=2 --samples 32x18 --processes 3";
    let proofs = folder.path().join("proofs.jsonl");
    let lines = [
        format!(
            "funnel --scene rooms:n=500 {more} --certificates {}",
            proofs.display()
        ),
        format!("funnel --scene city:n=500 {more} --cut-out fence"),
        format!("funnel --scene city:n=500 {more} --mirror 7"),
        format!("funnel --scene freedm-map12 {more}"),
        format!("funnel --scene mesh:spheres:n=2000 {more}"),
    ];
    let mut headers = Vec::new();
    let mut tables = std::collections::BTreeSet::new();
    for line in lines {
        let report = json(&works(Path::new("."), &format!("{line} --format json")));
        let text = works(Path::new("."), &format!("{line} --format csv"));
        let mut read = csv::Reader::from_reader(text.as_bytes());
        let header = read.headers().expect("a header").clone();
        let records: Vec<csv::StringRecord> = read.records().map(|r| r.expect("a row")).collect();
        let mut records = records.iter();
        let wanted = [
            "level",
            "cut_outs",
            "inner_boxes",
            "mirror",
            "stages",
            "audits",
            "orders",
            "picks",
            "bounds",
            "gains",
        ];
        for table in wanted {
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
                assert_eq!(cell("table"), table);
                let mut found = Vec::new();
                fields(row, "", &mut found);
                for (name, value) in found {
                    // Times are of another run.
                    match name.contains("ns") || name.starts_with("ratio") {
                        true => assert!(!cell(&name).is_empty(), "{table} {name}"),
                        false => assert_eq!(cell(&name), value, "{table} {name}"),
                    }
                }
            }
        }
        assert!(records.next().is_none(), "more rows than the JSON has");
        headers.push(header);
    }
    assert!(headers.iter().all(|header| *header == headers[0]));
    assert_eq!(tables.len(), 10, "{tables:?}");
}

/// The wall as a mirror: what is behind the camera is seen in it, what is behind the wall
/// is not.
#[test]
fn a_mirror_shows_what_is_before_it_on_its_own_samples() {
    let folder = folder();
    // A wall, a box behind it, one before it whose image is beside it, one behind the camera.
    let scene = "10,-5,-1,11,5,10\n20,-1,0,21,1,2\n5,12,0,6,13,2\n-9,-1,0,-8,1,2\n";
    fs::write(folder.path().join("scene.csv"), format!("{BOXES}\n{scene}")).expect("written");
    let report = json(&works(folder.path(), &format!("{LINE} --mirror 0")));
    let mirror = &report["mirror"];
    assert_eq!(
        (&mirror["axis"], &mirror["view_count"]),
        (&"x".into(), &1.into())
    );
    assert_eq!(number(mirror, "shown_count"), 1.0, "{mirror}");
    assert_eq!(number(mirror, "wrong_sample_count"), 0.0);
    let [with, without] = ["with_stencil", "without_stencil"].map(|name| &mirror[name]);
    let marked = number(mirror, "marked_count");
    assert!(marked > 1000.0 && marked < 320.0 * 180.0, "{mirror}");
    for count in ["fragment_count", "covered_count"] {
        assert!(number(with, count) > 100.0, "{mirror}");
        assert!(number(with, count) <= number(without, count), "{mirror}");
    }
    // On the whole image the box before the plane is drawn too, beside the wall.
    assert!(number(with, "kept_out_count") > 0.0, "{mirror}");
    assert_eq!(number(without, "kept_out_count"), 0.0);
    // From behind the wall nothing of what is before it: the camera is at the other side.
    let behind = json(&works(folder.path(), &format!("{LINE} --mirror 3")));
    assert_eq!(number(&behind["mirror"], "view_count"), 0.0);
    assert!(json(&works(folder.path(), LINE))["mirror"].is_null());
    let table = works(folder.path(), &LINE.replace("--format json", "--mirror 0"));
    assert!(table.contains("What is seen in the mirror"), "{table}");
    assert!(
        table.contains("no samples are shown differently"),
        "{table}"
    );
    for (line, wanted) in [
        (
            format!("{LINE} --mirror 5"),
            "--mirror 5 | 4 items | from 0 to 3",
        ),
        (format!("{LINE} --mirror wall"), "--mirror | wall"),
        (
            format!("{LINE} --mirror 0 --cut-out fence"),
            "--mirror | --cut-out",
        ),
        (
            "funnel --scene freedm-map12 --mirror 0".to_owned(),
            "freedm-map12 | walls | --mirror",
        ),
    ] {
        assert_refused(&cullbench(folder.path(), &line), wanted, &line);
    }
}

#[test]
fn triangles_and_fragments_are_gained_too() {
    let folder = folder();
    let report = json(&works(folder.path(), LINE));
    let gain = |stage: &str| {
        let mut gains = array(&report, "gains").iter();
        gains.find(|gain| gain["stage"] == stage).expect("a gain")
    };
    let [triangle, fragment] = ["triangle", "fragment"].map(gain);
    let faces = row(
        &report,
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
        counted(&report, "z-test", "shaded_count")
    );
    let every = counted(&report, "z-test", "fragment_count");
    assert_eq!(number(fragment, "without_count"), every);
    assert!(fragment["with_ns"].is_null() && fragment["break_even_ns"].is_null());
    let table = works(folder.path(), &LINE.replace("--format json", ""));
    assert!(
        table.contains("fragment (z-test)") && table.contains("not timed"),
        "{table}"
    );
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
    for word in ["stage", "level", "occlusion", "masked-inner*", "pays above"] {
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
}

#[test]
fn lower_bounds_are_of_the_back_ends_beside_them() {
    let line = "funnel --scene rooms:n=500 --path street:frames=4 --processes 1 --format json";
    let report = json(&works(Path::new("."), line));
    let bounds = array(&report, "bounds");
    let of: Vec<_> = bounds
        .iter()
        .map(|b| b["back_end"].as_str().expect("a name"))
        .collect();
    let hiding = ["masked-inner"; 3];
    assert_eq!(of[..2], ["exact-pvs", "portal-clip"]);
    assert_eq!(of[2..5], hiding);
    assert_eq!(of[5..], ["cone-f32-safe", "z-test"]);
    for bound in bounds {
        let (stage, name) = (&bound["stage"], &bound["back_end"]);
        let mut rows = array(&report, "stages").iter();
        let row = rows.find(|row| row["stage"] == *stage && row["name"] == *name);
        let row = row.expect("the back end");
        let own = number(bound, "stage_ns");
        assert!(own > 0.0, "{bound}");
        // The ratio of the shown times; the z-test is not timed.
        match row["stage_ns"].as_f64() {
            Some(ns) => {
                let ratio = number(bound, "ratio");
                assert!((ratio / (ns / own) - 1.0).abs() < 1e-9, "{bound}: {ns}");
            }
            None => assert!(bound["ratio"].is_null() && name == "z-test", "{bound}"),
        }
    }
}

#[test]
fn a_map_has_regions_and_the_faces_of_its_walls() {
    let line = "funnel --scene freedm-map12 --path street:frames=4 --processes 1 --format json";
    let report = json(&works(Path::new("."), line));
    for name in ["flood", "portal-rect", "portal-clip", "reject", "exact-pvs"] {
        let row = row(&report, "region", name);
        assert_eq!(number(row, "false_negative_count"), 0.0, "{name}");
        assert!(
            number(row, "output_count") < number(row, "input_count"),
            "{name}"
        );
    }
    // Of a wall one side is seen, so about half of them face away.
    let faces = row(&report, "triangle", "per-triangle");
    let [given, left] = ["input_count", "output_count"].map(|count| number(faces, count));
    assert!(left > 0.1 * given && left < 0.9 * given, "{faces}");
    // Walls are two or four triangles, and no boxes of twelve.
    let items = number(row(&report, "occlusion", "none"), "output_count");
    assert!(given > items && given < 8.0 * items, "{given} of {items}");
    for row in rows(&report, "triangle") {
        let lost = number(row, "false_negative_count");
        assert!(lost == 0.0 || row["guarantee"] == "unproven", "{row}");
    }
    let gains = array(&report, "gains");
    assert!(gains.iter().any(|gain| gain["unit"] == "triangles"));
    let sweep = "precision --stage triangle --scene freedm-map12 --path street:frames=2 \
                 --processes 1 --format json";
    let sweep = json(&works(Path::new("."), sweep));
    assert!(array(&sweep, "points").len() > 5);
    assert!(array(&report, "orders").is_empty() && array(&report, "picks").is_empty());
    let exact = "funnel --scene rooms:n=500 --path street:frames=2 --processes 1 --format json";
    let report = json(&works(Path::new("."), exact));
    row(&report, "region", "exact-pvs");
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
    for (more, wanted) in [
        ("--occlusion maskd", "maskd | did you mean 'masked'"),
        ("--region portal-clip", "portal-clip"),
        ("--samples 0x4", "--samples | 0x4 | columns x rows"),
        ("--samples 320", "--samples | 320"),
        ("--structure nosuch", "nosuch"),
        ("--svg no/such/folder/x.svg", "--svg"),
        ("--html no/such/folder/x.html", "--html"),
        ("--certificates no/such/folder/x", "--certificates"),
        ("--html scene.csv", "scene.csv | input | --html"),
        (
            "--certificates x --svg ./x",
            "another output | --certificates",
        ),
        ("--svg .", "--svg | a folder"),
        ("--cut-out fense", "fense | did you mean 'fence'"),
        (
            "--cut-out fence:share=2",
            "fence:share=2 | share=2 | at most 1",
        ),
        (
            "--cut-out fence --certificates x",
            "--certificates | holes | --cut-out",
        ),
    ] {
        let done = cullbench(folder.path(), &format!("{LINE} {more}"));
        assert_refused(&done, wanted, more);
    }
    let matrix = "m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23,m30,m31,m32,m33\n\
                  1,0,0,0,0,1,0,0,0,0,-1.02,-0.2,0,0,-1,0\n";
    fs::write(folder.path().join("matrix.csv"), matrix).expect("written");
    let line = LINE.replace("cameras.csv", "matrix.csv --matrix-convention column-gl");
    assert_refused(
        &cullbench(folder.path(), &line),
        "camera 0 | matrix",
        "a matrix",
    );
    fs::write(folder.path().join("empty.csv"), format!("{BOXES}\n")).expect("written");
    let line = LINE.replace("scene.csv", "empty.csv");
    assert_refused(&cullbench(folder.path(), &line), "no items", "no items");
    assert_refused(
        &cullbench(folder.path(), "funnel --scene freedm-map12 --cut-out fence"),
        "freedm-map12 | walls | solid boxes | --cut-out",
        "a map with cut-outs",
    );
    for (scene, stage, wanted) in [
        ("freedm-map12", "occlusion", "freedm-map12 | solid boxes"),
        ("city:n=50", "region", "city:n=50 | rooms or sectors"),
    ] {
        let line = format!("precision --stage {stage} --scene {scene}");
        assert_refused(&cullbench(folder.path(), &line), wanted, &line);
    }
}

#[test]
fn proofs_are_checked_and_doctored_ones_rejected() {
    let folder = folder();
    let line = LINE.replace("--format json", "--certificates proofs.jsonl");
    works(folder.path(), &line);
    let done = works(folder.path(), "check proofs.jsonl --format json");
    let checked = json(&done);
    // The wall and the box beside it; the one behind the wall and the one around the eye.
    let counts = [
        "view_count",
        "visible_count",
        "hidden_count",
        "undecided_count",
    ];
    assert_eq!(
        counts.map(|name| number(&checked, name)),
        [1.0, 2.0, 1.0, 0.0],
        "{done}"
    );
    let proofs = fs::read_to_string(folder.path().join("proofs.jsonl")).expect("proofs");
    let mut told = 0;
    for (from, to) in [
        ("{\"behind\":0}", "{\"behind\":2}"),
        ("{\"behind\":0}", "\"empty\""),
        ("\"near\":0.1", "\"near\":15.0"),
    ] {
        let doctored = proofs.replace(from, to);
        assert_ne!(doctored, proofs, "{from} in {proofs}");
        fs::write(folder.path().join("doctored.jsonl"), doctored).expect("written");
        let done = cullbench(folder.path(), "check doctored.jsonl");
        assert_eq!(done.code, Some(1), "{to}: {done:?}");
        told += usize::from(done.out.contains("rejected"));
    }
    assert_eq!(told, 3);
    // A view of another camera proves nothing of this one, and one of no camera nothing
    // at all; nor do proofs of some of the items in question, or of one item twice.
    let other = proofs.replace("\"near\":0.1", "\"near\":0.0625");
    let (from, to) = (
        other.find("\"camera\"").expect("a camera"),
        other.find("\"view\""),
    );
    let mut bare = other.clone();
    bare.replace_range(from..to.expect("a view"), "");
    let first = proofs.find("\"proofs\":[").expect("proofs") + "\"proofs\":[".len();
    let mut none = proofs.clone();
    none.replace_range(first..proofs.trim_end().len() - 2, "");
    let mut twice = proofs.clone();
    let all = &proofs[first..proofs.trim_end().len() - 2];
    twice.insert_str(first, &format!("{all},"));
    for (content, wanted) in [
        (&other, "not that of its camera"),
        (&none, "0 proofs of 0 items"),
        (&twice, "expected one of each"),
    ] {
        fs::write(folder.path().join("other.jsonl"), content).expect("written");
        let done = cullbench(folder.path(), "check other.jsonl");
        assert_eq!(done.code, Some(1), "{content}: {done:?}");
        assert!(done.out.contains(wanted), "{content}: {done:?}");
    }
    for (content, wanted) in [
        (&bare[..], "line 1 | no camera | 'camera'"),
        (&format!("{proofs}{proofs}"), "line 2 | second time"),
        ("", "no certificate"),
        ("{}", "line 1 | certificates"),
        ("\u{7f}ELF", "line 1"),
        (
            &proofs.replace("\"boxes\":5", "\"boxes\":7"),
            "7 boxes | 5 of scene",
        ),
        (&proofs.replace("scene.csv", "gone.csv"), "gone.csv"),
        (
            &proofs.replace("\"index\":0", "\"index\":7"),
            "line 1 | camera 7",
        ),
        (&proofs[..proofs.len() / 2], "line 1"),
    ] {
        fs::write(folder.path().join("bad.jsonl"), content).expect("written");
        assert_refused(
            &cullbench(folder.path(), "check bad.jsonl"),
            wanted,
            content,
        );
    }
}

/// A number of a WAD file.
fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize
}

/// Where in its directory the table is: place, size and name follow each other.
fn reject_entry(bytes: &[u8]) -> usize {
    let [count, directory] = [4, 8].map(|at| word(bytes, at));
    let mut entries = (0..count).map(|entry| directory + 16 * entry);
    let found = entries.find(|at| bytes[at + 8..].starts_with(b"REJECT"));
    found.expect("a REJECT lump")
}

/// The map with a table that calls every pair of sectors invisible, a sector and itself too.
fn map_that_hides_everything() -> Vec<u8> {
    let mut bytes = fs::read("datasets/freedm_map12.wad").expect("a map");
    let entry = reject_entry(&bytes);
    let (place, size) = (word(&bytes, entry), word(&bytes, entry + 4));
    assert!(size > 0, "an empty REJECT lump");
    bytes[place..place + size].fill(0xff);
    bytes
}

#[test]
fn what_a_claim_hides_is_proven_to_be_seen() {
    let folder = folder();
    let at = folder.path();
    fs::write(at.join("dark.wad"), map_that_hides_everything()).expect("written");
    let line = "funnel --scene dark.wad --path street:frames=2 --processes 1 --format json \
                --certificates errors.jsonl";
    let done = cullbench(at, line);
    // The claim promises nothing, so what it loses is no failure.
    assert_eq!(done.code, Some(0), "{done:?}");
    let report = json(&done.out);
    let audits = array(&report, "audits");
    assert_eq!((audits.len(), &audits[0]["claim"]), (1, &"reject".into()));
    let lost = array(&audits[0], "false_negatives").len() as f64;
    assert!(lost > 100.0, "{lost}");
    let checked = json(&works(at, "check errors.jsonl --format json"));
    assert_eq!(number(&checked, "false_negative_count"), lost);
    assert_eq!(number(&checked, "claim_count"), 1.0);
    let errors = fs::read_to_string(at.join("errors.jsonl")).expect("errors");
    let doctored = errors.replacen("\"ends\":[[", "\"ends\":[[9", 1);
    assert_ne!(doctored, errors);
    fs::write(at.join("doctored.jsonl"), doctored).expect("written");
    let done = cullbench(at, "check doctored.jsonl");
    assert_eq!(done.code, Some(1), "{done:?}");
    assert!(done.out.contains("rejected, regions"), "{done:?}");
    // The true map's table does not say that.
    let true_map = "check errors.jsonl --scene freedm-map12";
    assert_eq!(cullbench(at, true_map).code, Some(1));

    // A map without a table claims nothing, and its items are walls.
    let mut bare = fs::read("datasets/freedm_map12.wad").expect("a map");
    let entry = reject_entry(&bare);
    bare[entry + 4..entry + 8].fill(0);
    fs::write(at.join("bare.wad"), bare).expect("written");
    let line = "funnel --scene bare.wad --path street:frames=2 --certificates none.jsonl";
    assert_refused(
        &cullbench(at, line),
        "bare.wad | walls | a claim",
        "no claim",
    );

    // The same by a file, of which stored-pvs is the back end.
    let regions = number(&json(errors.trim()), "regions");
    let none = format!("{{\"regions\": {regions}, \"sees\": []}}");
    fs::write(at.join("none.json"), none).expect("written");
    let line = "funnel --scene freedm-map12 --path street:frames=2 --processes 1 --format json \
                --pvs none.json --region stored-pvs --certificates stored.jsonl";
    let report = json(&works(at, line));
    let claims: Vec<_> = array(&report, "audits")
        .iter()
        .map(|a| &a["claim"])
        .collect();
    assert_eq!(claims, ["reject", "stored-pvs"]);
    assert!(number(row(&report, "region", "stored-pvs"), "false_negative_count") > 0.0);
    let checked = json(&works(
        at,
        "check stored.jsonl --pvs none.json --format json",
    ));
    assert_eq!(number(&checked, "false_negative_count"), lost);
    assert_refused(
        &cullbench(at, "check stored.jsonl"),
        "line 2 | --pvs FILE",
        "no claim",
    );
    for (content, wanted) in [
        (
            "{\"regions\": 3, \"sees\": []}",
            "3 regions | the scene's 49",
        ),
        (
            "{\"regions\": 3, \"sees\": [[0, 9]]}",
            "bad.json | region 9",
        ),
        ("[]", "bad.json | regions"),
        ("\u{7f}", "bad.json"),
    ] {
        fs::write(at.join("bad.json"), content).expect("written");
        let line = "funnel --scene freedm-map12 --path street:frames=2 --pvs bad.json";
        assert_refused(&cullbench(at, line), wanted, content);
    }
    let line = "funnel --scene city:n=50 --path street:frames=2 --pvs none.json";
    assert_refused(
        &cullbench(at, line),
        "city:n=50 | rooms or sectors | --pvs",
        "a city",
    );
}

#[test]
fn whole_pixels_lose_nothing_at_any_size_and_pixel_centres_do() {
    let line = "precision --scene city:n=4000 --stage occlusion --path street:frames=6 --processes 1 \
                --structure wide --format json";
    let sweep = json(&works(Path::new("."), line));
    let points = array(&sweep, "points");
    let of = |name: &str| {
        let own = points.iter().filter(|point| point["name"] == name);
        own.map(|point| number(point, "false_negative_count"))
            .collect::<Vec<_>>()
    };
    assert_eq!(of("masked-inner"), [0.0; 7]);
    assert_eq!(of("masked-inner-two-pass"), [0.0; 7]);
    assert!(of("z-buffer")[0] > 0.0 && of("rays").iter().sum::<f64>() > 0.0);
    let let_through = |name: &str| {
        let own = points.iter().filter(|point| point["name"] == name);
        own.map(|point| number(point, "output_count"))
            .collect::<Vec<_>>()
    };
    let inner = let_through("masked-inner");
    assert!(inner[0] > inner[6], "a larger buffer hides more: {inner:?}");
    assert!(points.iter().any(|point| point["on_front"] == true));
    let cones = json(&works(
        Path::new("."),
        &line.replace("occlusion", "triangle"),
    ));
    assert!(
        array(&cones, "points")
            .iter()
            .any(|point| point["name"] == "cone-f32-safe")
    );
    let rooms = line
        .replace("city:n=4000", "rooms:n=2000")
        .replace("occlusion", "region");
    for point in array(&json(&works(Path::new("."), &rooms)), "points") {
        assert_eq!(number(point, "false_negative_count"), 0.0, "{point}");
    }
    let done = cullbench(
        Path::new("."),
        &line.replace("--stage occlusion", "--stage fragment"),
    );
    assert_refused(&done, "unknown stage 'fragment'", "a stage without a sweep");
}

/// A test of the fragment stage, and one of its counts.
fn counted(report: &Value, test: &str, count: &str) -> f64 {
    number(&row(report, "fragment", test)["fragments"], count)
}

#[test]
fn through_the_holes_of_a_wall_is_seen_what_is_behind_it() {
    let folder = folder();
    let line = format!("{LINE} --cut-out foliage:share=1,tile=0.5");
    let report = json(&works(folder.path(), &line));
    let cut_outs = &report["cut_outs"];
    assert_eq!(cut_outs["mask"], "foliage");
    assert_eq!(number(cut_outs, "item_count"), 5.0);
    for row in rows(&report, "occlusion") {
        // Nothing hides, so nothing but what is behind the camera is removed.
        assert_eq!(number(row, "output_count"), 4.0, "{row}");
        assert_eq!(number(row, "truth_count"), 3.0, "{row}");
        assert_eq!(number(row, "false_negative_count"), 0.0, "{row}");
    }
    let [z, alpha] = ["z-test", "alpha-test"].map(|name| row(&report, "fragment", name));
    assert_eq!(
        (&z["guarantee"], &z["is_chosen"]),
        (&"unproven".into(), &false.into())
    );
    assert_eq!(number(z, "false_negative_count"), 1.0);
    assert_eq!(alpha["is_chosen"], true);
    for count in ["false_negative_count", "false_positive_count"] {
        assert_eq!(number(alpha, count), 0.0, "{count}");
    }
    let clear = ["z-test", "alpha-test"].map(|test| counted(&report, test, "clear_count"));
    assert!(clear[0] == 0.0 && clear[1] > 100.0, "{clear:?}");
    let covered = ["z-test", "alpha-test"].map(|test| counted(&report, test, "covered_count"));
    assert!(
        covered[1] < covered[0] && covered[1] > 0.5 * covered[0],
        "{covered:?}"
    );
    let table = works(folder.path(), &line.replace("--format json", ""));
    for words in [
        "5 of the items are cut out by a mask (foliage",
        "Samples and fragments",
        "z-test?",
    ] {
        assert!(table.contains(words), "{words}: {table}");
    }
    // Without holes there is no such test.
    let solid = json(&works(folder.path(), LINE));
    assert!(rows(&solid, "fragment").all(|row| row["name"] != "alpha-test"));
    assert!(solid["cut_outs"].is_null());
}

#[test]
fn what_promises_to_lose_nothing_sees_through_holes() {
    for (scene, mask) in [
        ("city:n=1500", "fence:share=0.3,tile=2"),
        ("rooms:n=1500", "foliage:share=1,tile=0.25"),
    ] {
        let line = format!(
            "funnel --scene {scene} --cut-out {mask} --path street:frames=8 --samples 96x54 \
             --processes 1 --format json"
        );
        let report = json(&works(Path::new("."), &line));
        // Walls of rooms are left whole.
        let share = number(&report["cut_outs"], "item_count") / number(&report, "items");
        assert!((0.1..0.8).contains(&share), "{scene}: {share}");
        for row in array(&report, "stages") {
            let what = format!("{scene} {} {}", row["stage"], row["name"]);
            if row["guarantee"] != "unproven" {
                assert_eq!(number(row, "false_negative_count"), 0.0, "{what}");
            }
        }
        let z = row(&report, "fragment", "z-test");
        assert!(number(z, "false_negative_count") > 0.0, "{scene}: {z}");
        let alpha = row(&report, "fragment", "alpha-test");
        assert_eq!(number(alpha, "false_positive_count"), 0.0, "{scene}");
    }
}

#[test]
fn a_stencil_of_portals_saves_samples_and_shows_the_same() {
    let line = "funnel --scene rooms:n=3000 --path street:frames=8 --samples 96x54 --processes 1 \
                --region none --occlusion none --format json";
    for more in ["", " --cut-out fence:share=0.5,tile=0.5"] {
        let report = json(&works(Path::new("."), &format!("{line}{more}")));
        let stencil = row(&report, "fragment", "stencil-test");
        for count in ["false_negative_count", "false_positive_count"] {
            assert_eq!(number(stencil, count), 0.0, "{count}");
        }
        let asked = ["z-test", "stencil-test"].map(|test| counted(&report, test, "asked_count"));
        assert!(asked[1] < 0.6 * asked[0], "{asked:?}");
        // What was not kept out was asked, and so were the samples of the portals.
        let kept_out = counted(&report, "stencil-test", "kept_out_count");
        assert!(asked[1] + kept_out > asked[0], "{asked:?} {kept_out}");
        let said = array(&report, "conclusions").iter();
        let said = said.filter_map(Value::as_str);
        assert_eq!(
            said.filter(|told| told.contains("stencil-test asks"))
                .count(),
            1
        );
    }
    let open = json(&works(Path::new("."), &line.replace("rooms", "city")));
    assert!(rows(&open, "fragment").all(|row| row["name"] != "stencil-test"));
}
