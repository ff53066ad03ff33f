//! `stress`: the rows it writes, the exit codes, other vectors than the
//! built-in ones, and files that are wrong.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde_json::{Value, json};

use super::process::*;

/// The file that is built in, as a user would find it.
fn vectors() -> Value {
    let path = datasets().join("vectors.json");
    json(&std::fs::read_to_string(path).expect("part of the repository"))
}

/// The same file with these vectors only.
fn subset(ids: &[&str]) -> Value {
    let mut file = vectors();
    let list = file["vectors"].as_array_mut().expect("an array");
    list.retain(|v| ids.contains(&v["id"].as_str().expect("an id")));
    assert_eq!(list.len(), ids.len());
    file["count"] = json!(ids.len());
    file
}

fn rows_of(text: &str) -> Vec<Value> {
    json(text).as_array().expect("an array").clone()
}

fn with_file(file: &Value) -> tempfile::TempDir {
    folder(&[("v.json", file.to_string().as_bytes())])
}

#[test]
fn every_built_in_vector_comes_out_as_declared_on_every_structure() {
    let text = works(Path::new("."), "stress --cases 0 --format json");
    let wanted = set("id level structure test status expected got");
    let mut of_vector: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut count = BTreeMap::new();
    for row in rows_of(&text) {
        assert_eq!(keys(&row), wanted);
        let field = |name: &str| row[name].as_str().expect("text").to_owned();
        assert!(
            ["planes", "camera"].contains(&field("level").as_str()),
            "{row}"
        );
        *count.entry(field("status")).or_insert(0) += 1;
        let vector = field("id").split('/').next().expect("a part").to_owned();
        of_vector
            .entry(vector)
            .or_default()
            .insert(field("structure"));
    }
    assert!(count["pass"] > 1000 && count["refused"] > 100, "{count:?}");
    assert_eq!(count.len(), 2, "{count:?}");
    let file = vectors();
    for vector in file["vectors"].as_array().expect("an array") {
        let found = &of_vector[vector["id"].as_str().expect("an id")];
        for name in structure_names() {
            assert!(found.contains(&name), "{} on {name}", vector["id"]);
        }
    }
    let table = works(Path::new("."), "stress --cases 0");
    assert!(
        table.contains("degenerate scene") && table.contains(" 0 failed"),
        "{table}"
    );
}

#[test]
fn extremes_are_generated_from_a_seed() {
    let line = "stress --cases 1 --seed 7 --structure linear,bvh --format json";
    let (first, again) = (works(Path::new("."), line), works(Path::new("."), line));
    assert!(first == again, "the same rows every time");
    let rows = rows_of(&first);
    for family in [
        "near-far/1e9",
        "fov/1e-3",
        "aspect/1e4",
        "offset/1e9",
        "scale/2^-140",
        "ties/8",
    ] {
        let of = |row: &&Value| row["id"].as_str().expect("an id").starts_with(family);
        assert!(rows.iter().any(|row| of(&row)), "{family}");
    }
    let table = works(Path::new("."), "stress --cases 1 --structure linear");
    let boxes = "151,552 boxes checked at camera level";
    assert!(
        table.contains(boxes)
            && unwrapped(&table).contains("no false negatives and no dropped boundary contacts"),
        "{table}"
    );
}

/// A point beside a shared face by less than f32 tells is in one of the boxes.
#[test]
fn points_are_compared_as_written() {
    for (holding, code) in [(json!(["b"]), 0), (json!(["a", "b"]), 1)] {
        let file = json!([{
            "id": "beside",
            "boxes": [
                {"id": "a", "lo": [0, 0, 0], "hi": [1, 1, 1]},
                {"id": "b", "lo": [1, 0, 0], "hi": [2, 1, 1]}
            ],
            "points": [{"id": "p", "p": [1.0000000001, 0.5, 0.5], "expected_containing": holding}]
        }]);
        let done = cullbench(with_file(&file).path(), "stress --vectors v.json");
        assert_eq!(done.code, Some(code), "{holding}: {done:?}");
    }
}

/// Failures by another instruction set are rows of their own; the oracle has none.
#[test]
fn failures_are_counted_once() {
    let file = json!([{
        "id": "behind",
        "camera": {"eye": [0, 0, 0], "look": [0, 0, -1], "up": [0, 1, 0], "fovy_deg": 60,
                   "aspect": 1, "near": 1, "far": 9},
        "boxes": [{"id": "a", "lo": [0, 0, 5], "hi": [1, 1, 6]}],
        "expected_visible_camera": ["a"]
    }]);
    let folder = with_file(&file);
    let run = |more: &str| {
        let line = format!("stress --vectors v.json --structure linear{more}");
        let done = cullbench(folder.path(), &line);
        assert_eq!(done.code, Some(1), "{done:?}");
        done.out
    };
    let rows = rows_of(&run(" --format json"));
    let of = |row: &&Value| row["structure"] == "oracle" && row["id"] == "behind/a";
    assert_eq!(rows.iter().filter(of).count(), 1, "{rows:?}");
    let one = rows_of(&run(" --kernel portable --format json")).len();
    let table = unwrapped(&run(""));
    let number_before = |word: &str| -> usize {
        let (before, _) = table.split_once(word).unwrap_or_else(|| panic!("{table}"));
        before.rsplit([' ', '\n']).next().unwrap().parse().unwrap()
    };
    // By each kernel that this machine has: portable, AVX2, AVX-512.
    let has_more = table.contains(" more by");
    let more = has_more.then(|| number_before(" more by"));
    let made = number_before(" checks in") + more.unwrap_or(0);
    let kernels = [1, 2, 3].map(|kernels| kernels * one);
    assert!(kernels.contains(&made), "{made} of {one}: {table}");
    // One failure of all tests and instruction sets.
    let alike = table.matches("got dropped, 6e0 away").count();
    assert_eq!(alike, 1, "{table}");
}

#[test]
fn other_vectors_run_alone() {
    let folder = with_file(&subset(&["A01-basic", "F04-nan-inf", "I01-point-location"]));
    let text = works(
        folder.path(),
        "stress --vectors v.json --structure bvh --format json",
    );
    let ids: BTreeSet<String> = rows_of(&text)
        .iter()
        .map(|row| row["id"].as_str().expect("an id").to_owned())
        .collect();
    for id in [
        "A01-basic",
        "F04-nan-inf/nan",
        "F04-nan-inf/inf",
        "I01-point-location/ulp_left",
    ] {
        assert!(ids.contains(id), "{id} is not among {ids:?}");
    }
    assert!(ids.iter().all(|id| !id.starts_with('B')), "{ids:?}");
    // An array by itself is such a file as well; both may be given.
    let bare = subset(&["B12-fov-180"])["vectors"].to_string();
    let more = super::process::folder(&[
        ("a.json", bare.as_bytes()),
        (
            "b.json",
            subset(&["A02-touch-integer-planes"]).to_string().as_bytes(),
        ),
    ]);
    let text = works(
        more.path(),
        "stress --vectors a.json --vectors b.json --format json",
    );
    assert!(text.contains("B12-fov-180") && text.contains("A02-touch"));
    // The second file with an id is named beside it.
    let twice = super::process::folder(&[("a.json", bare.as_bytes()), ("b.json", bare.as_bytes())]);
    let text = works(
        twice.path(),
        "stress --vectors a.json --vectors b.json --format json",
    );
    assert!(text.contains("\"B12-fov-180\"") && text.contains("\"b.json: B12-fov-180\""));
}

/// A file whose expectations are wrong fails, and the vector and box are named.
#[test]
fn a_wrong_answer_fails_and_names_the_box() {
    let without = |field: &str, name: &str| {
        let (field, name) = (field.to_owned(), name.to_owned());
        move |vector: &mut Value| {
            let list = vector[&field].as_array_mut().expect("an array");
            let before = list.len();
            list.retain(|n| *n != name.as_str());
            assert_eq!(list.len(), before - 1, "{name}");
        }
    };
    let with = |field: &str, value: Value| {
        let field = field.to_owned();
        move |vector: &mut Value| match vector[&field].as_array_mut() {
            Some(list) => list.push(value.clone()),
            None => vector[&field] = value.clone(),
        }
    };
    type Change = Box<dyn Fn(&mut Value)>;
    let cases: Vec<(&str, Change, &str, &str)> = vec![
        (
            "A01-basic",
            Box::new(without("observed_f32_pvertex_mul_add", "in")),
            "A01-basic/in",
            "planes",
        ),
        (
            "A01-basic",
            Box::new(without("expected_visible_planes", "in")),
            "A01-basic/in",
            "planes",
        ),
        (
            "A04-one-ulp-outside",
            Box::new(with("expected_visible_planes", json!("R"))),
            "A04-one-ulp-outside/R",
            "planes",
        ),
        (
            "A01-basic",
            Box::new(with("expected_visible_camera", json!("ghost"))),
            "A01-basic/ghost",
            "camera",
        ),
        (
            "A02-touch-integer-planes",
            Box::new(|v: &mut Value| v["touch_camera"] = json!([])),
            "A02-touch-integer-planes/",
            "camera",
        ),
        (
            "A01-basic",
            Box::new(|v: &mut Value| {
                v["expect_camera_error"] = json!("no such camera");
                v["expected_visible_camera"] = json!([]);
            }),
            "A01-basic",
            "camera",
        ),
        (
            "A01-basic",
            Box::new(with("expect_planes_error", json!("no such planes"))),
            "A01-basic",
            "planes",
        ),
        (
            "A01-basic",
            Box::new(with("expect_rejected_at_load", json!(["in"]))),
            "A01-basic/in",
            "planes",
        ),
        (
            "F04-nan-inf",
            Box::new(without("expect_rejected_at_load", "inf")),
            "F04-nan-inf",
            "planes",
        ),
        (
            "B12-fov-180",
            Box::new(|v: &mut Value| v["camera"]["fovy_deg"] = json!(179)),
            "B12-fov-180",
            "camera",
        ),
        (
            "B05-ratio-1e9-gh",
            Box::new(|v: &mut Value| {
                for field in ["planes", "planes_f32_hex"] {
                    v[field][5] = v[field][4].clone();
                }
            }),
            "B05-ratio-1e9-gh",
            "planes",
        ),
        (
            "A01-basic",
            Box::new(|v: &mut Value| v["camera"]["far"] = json!(1.25)),
            "A01-basic/",
            "camera",
        ),
        (
            "I01-point-location",
            Box::new(|v: &mut Value| v["points"][0]["expected_containing"] = json!(["a"])),
            "I01-point-location/face",
            "planes",
        ),
        (
            "F03-inverted",
            Box::new(|v: &mut Value| {
                v["boxes"][0]["lo"][0] = json!(-1.0);
                v["boxes"][0]["hi"][0] = json!(1.0);
            }),
            "F03-inverted/",
            "planes",
        ),
    ];
    for (id, change, named, level) in cases {
        let mut file = subset(&[id]);
        change(&mut file["vectors"][0]);
        let folder = with_file(&file);
        let done = cullbench(folder.path(), "stress --vectors v.json --format json");
        assert_eq!((done.code, done.err.as_str()), (Some(1), ""), "{named}");
        let failed = rows_of(&done.out);
        let failed: Vec<&Value> = failed.iter().filter(|r| r["status"] == "fail").collect();
        let right = |row: &&&Value| {
            row["id"].as_str().expect("an id").starts_with(named) && row["level"] == level
        };
        assert!(failed.iter().any(|row| right(&row)), "{named}: {failed:?}");
        let by_kernel = failed
            .iter()
            .find(|row| row["test"].to_string().contains(" by "));
        assert!(by_kernel.is_none(), "{by_kernel:?} is no name of a test");
        let table = cullbench(folder.path(), "stress --vectors v.json");
        assert_eq!(table.code, Some(1), "{named}");
        assert!(table.out.contains(named), "{named}: {}", table.out);
        assert!(
            table.out.contains("expected") && table.out.contains("got"),
            "{named}"
        );
    }
}

#[test]
fn a_file_that_is_wrong_is_refused_in_one_line() {
    let cases: [(&str, &[u8], &str); 13] = [
        ("empty.json", b"", "empty.json, line 1 | expected JSON"),
        ("cut.json", b"{\"vectors\": [{\"id\": \"a\",\n \"boxes\": [", "cut.json, line 2"),
        ("bytes.json", b"\xff\xfe\x00", "bytes.json, line 1"),
        ("nan.json", b"{\"vectors\": [NaN]}", "line 1, column 14 | no JSON"),
        ("text.json", b"\"vectors\"", "line 1, column 9: the text 'vectors'; expected an object"),
        ("none.json", b"{\"vectors\": []}", "no vector | expected at least one"),
        ("format.json", b"{\"format\": 9, \"vectors\": []}", "format: '9.0'; expected format 1"),
        ("id.json", b"[{\"boxes\": []}]", "id.json, line 1, column 14, [0]: no field 'id'"),
        (
            "box.json",
            b"[{\"id\": \"q\", \"boxes\": [{\"id\": \"b\", \"lo\": [0, 0, \"\\n\"], \"hi\": [1, 1, 1]}]}]",
            "box.json | [0].boxes[0].lo[2] | expected a number",
        ),
        (
            "hex.json",
            b"[{\"id\": \"q\", \"planes_f32_hex\": [[\"0x1\", \"0\", \"0\", \"0\"]]}]",
            "[0].planes_f32_hex[0][0] | 0x3f800000",
        ),
        (
            "camera.json",
            b"[{\"id\": \"q\", \"camera\": {\"eye\": [0, 0, 0]}}]",
            "[0].camera: no field 'look'",
        ),
        (
            "names.json",
            b"[{\"id\": \"q\", \"expected_visible_camera\": [[]]}]",
            "expected_visible_camera[0]: a list; expected a name",
        ),
        ("nothing.json", b"[{\"id\": \"q\", \"boxes\": []}]", "nothing to check | expected"),
    ];
    for (name, bytes, wanted) in cases {
        let folder = folder(&[(name, bytes)]);
        for format in ["table", "json"] {
            let line = format!("stress --vectors {name} --format {format}");
            assert_refused(&cullbench(folder.path(), &line), wanted, &line);
        }
    }
    let folder = folder(&[]);
    let missing = cullbench(folder.path(), "stress --vectors missing.json");
    assert_refused(&missing, "missing.json | No such file", "missing");
    let unknown = cullbench(folder.path(), "stress --structure bhv");
    assert_refused(&unknown, "bhv | did you mean 'bvh'", "structure");
}
