//! `run`: the files of a run against the contract, runs that must not be
//! written over, and what may and may not be resumed.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::Value;

use super::process::*;
use super::{BOXES, EYE_LOOK};

pub fn report(run: &Path) -> Value {
    json(&fs::read_to_string(run.join("report.json")).expect("a report"))
}

pub fn cells(report: &Value) -> &Vec<Value> {
    report["cells"].as_array().expect("an array")
}

/// Metrics that every cell of these scenes has.
const METRICS: &str = "query_ns ns_per_visible visible_count cull_rate ratio_to_linear \
    nodes_tested items_tested build_ms memory_bytes_per_item \
    locate_ns locate_batched_ns comparisons regions_found";

/// What holds for the files of every run, finished or not: the fields of the
/// contract, every path with all structures, samples where the cells say.
pub fn check_run(run: &Path) -> Value {
    let report = report(run);
    let top = "schema_version run machine toolchain source noise cells bounds";
    assert_eq!(keys(&report), set(top));
    for (part, fields) in [
        ("run", "id started_at command seed suite"),
        (
            "machine",
            "cpu features cores caches memory_bytes kernel load",
        ),
        ("toolchain", "rustc flags profile features lock_digest"),
        ("source", "commit dirty"),
        ("noise", "aa_ratio"),
    ] {
        let missing: Vec<_> = set(fields)
            .difference(&keys(&report[part]))
            .copied()
            .collect();
        assert!(missing.is_empty(), "{part} lacks {missing:?}");
    }
    let summary = rows(&fs::read_to_string(run.join("summary.csv")).expect("summary.csv"));
    let samples = rows(&fs::read_to_string(run.join("samples.csv")).expect("samples.csv"));
    assert_eq!(summary.len(), cells(&report).len());
    let mut structures: BTreeMap<[&str; 3], Vec<&str>> = BTreeMap::new();
    let mut referred = 0;
    for (cell, row) in cells(&report).iter().zip(&summary) {
        let fields =
            "scene path structure params test status reason metrics error left_out samples_ref";
        assert_eq!(keys(cell), set(fields));
        let text = |value: &Value| value.as_str().expect("text").to_owned();
        assert_eq!(cell["status"], "ok", "{cell}");
        for (column, value) in [
            ("scene", &cell["scene"]["name"]),
            ("path", &cell["path"]["name"]),
            ("cache", &cell["path"]["cache"]),
            ("structure", &cell["structure"]),
            ("test", &cell["test"]),
            ("status", &cell["status"]),
        ] {
            assert_eq!(row[column], text(value), "{column}");
        }
        let error = |name: &str| cell["error"][name].as_f64().expect(name);
        assert!(error("judged_queries") >= 1.0, "{cell}");
        assert_eq!(
            error("false_negative_count") + error("touch_dropped_count"),
            0.0
        );
        let excess = cell["metrics"]["excess"]["value"].as_f64().expect("excess");
        let wanted = error("false_positive_count") / error("visible_count");
        assert!((excess - wanted).abs() <= 1e-12, "{excess} {wanted}");
        let metrics = cell["metrics"].as_object().expect("an object");
        for name in set(METRICS) {
            assert_eq!(
                keys(&metrics[name]),
                set("value lower upper unit"),
                "{name}"
            );
            let value = metrics[name]["value"].as_f64().expect(name);
            assert_eq!(row[name].parse(), Ok(value), "{name}");
        }
        let of_path = ["scene", "path", "cache"].map(|column| row[column].as_str());
        structures
            .entry(of_path)
            .or_default()
            .push(&row["structure"]);
        let place = &cell["samples_ref"];
        assert_eq!(place["file"], "samples.csv");
        let [first, count] = ["first_row", "rows"].map(|k| place[k].as_u64().expect(k) as usize);
        assert!(count > 0);
        for sample in &samples[first..first + count] {
            for column in ["scene", "path", "cache", "structure"] {
                assert_eq!(sample[column], row[column]);
            }
            let time: f64 = sample["cpu_ns"].parse().expect("a number");
            assert!(
                time >= 0.0
                    && ["query", "locate", "locate_batched"].contains(&sample["task"].as_str())
            );
        }
        referred += count;
    }
    // The rest are those of the twins and of the bounds.
    let rest = samples.iter().filter(|row| {
        let name = &row["structure"];
        name.ends_with("#twin") || name.starts_with("bound-")
    });
    assert_eq!(referred + rest.count(), samples.len());
    check_bounds(&report);
    let names: Vec<String> = structure_names();
    for (path, found) in structures {
        assert_eq!(found, names, "{path:?}");
    }
    let left: Vec<String> = contents(run)
        .into_keys()
        .filter(|name| name.ends_with(".tmp"))
        .collect();
    assert!(left.is_empty(), "{left:?}");
    report
}

/// Every path with all bounds, and every cell with its ratio to each of them;
/// the ratio is paired by round, so it is near the quotient, not equal to it.
fn check_bounds(report: &Value) {
    let bounds = report["bounds"].as_array().expect("an array");
    for cell in cells(report) {
        for (name, metric) in [
            ("bound-read", "times_read"),
            ("bound-memcpy", "times_memcpy"),
        ] {
            let of_cell = |b: &&Value| {
                b["structure"] == name && b["scene"] == cell["scene"] && b["path"] == cell["path"]
            };
            let found: Vec<_> = bounds.iter().filter(of_cell).collect();
            let tests = cells(report).iter().filter(|c| {
                ["scene", "path", "structure"]
                    .iter()
                    .all(|k| c[k] == cell[k])
            });
            assert_eq!(found.len(), tests.count(), "{name}");
            let value = |of: &Value, metric: &str| of["metrics"][metric]["value"].as_f64();
            let ratio = value(cell, metric).expect(metric);
            let spent = value(cell, "query_ns").expect("query_ns");
            let limit = value(found[0], "query_ns").expect("query_ns");
            let rough = spent / limit;
            assert!((0.1..10.0).contains(&(ratio / rough)), "{ratio} {rough}");
        }
    }
}

const TINY: &str = "run --scene uniform:n=200 --path orbit:frames=16 --out out/run";

#[test]
fn a_run_leaves_a_complete_report_and_is_not_written_over() {
    let folder = folder(&[]);
    let run = folder.path().join("out/run");
    let table = works(folder.path(), TINY);
    let report = check_run(&run);
    assert!(
        table.contains("uniform:n=200: 200 items") && table.contains("report.json"),
        "{table}"
    );
    assert_eq!(cells(&report).len(), structure_names().len());
    assert_eq!(
        (&report["run"]["suite"], &report["run"]["seed"]),
        (&Value::Null, &1.into())
    );
    assert!(report["run"]["finished_at"].is_string());
    assert_eq!(cells(&report)[0]["scene"]["total_count"], 200);
    assert_eq!(cells(&report)[0]["path"]["camera_count"], 16);
    let before = contents(&run);
    let again = cullbench(folder.path(), TINY);
    assert_refused(
        &again,
        "out/run already holds a run | expected",
        "run twice",
    );
    assert!(contents(&run) == before, "the refused run changed files");
    // Nothing is left to do, and nothing is done.
    works(folder.path(), &format!("{TINY} --resume"));
    assert!(
        contents(&run) == before,
        "resuming a finished run changed files"
    );
    // Another experiment does not belong into this report.
    let others: [(&str, &str); 4] = [
        ("--seed 2", "--seed 1"),
        ("--no-bounds", "holds bounds"),
        ("--structure linear", "expected linear"),
        ("--planes frame-f32", "other planes"),
    ];
    for (other, wanted) in others {
        let done = cullbench(folder.path(), &format!("{TINY} --resume {other}"));
        assert_refused(&done, &format!("out/run | {wanted} | expected"), wanted);
        assert!(contents(&run) == before, "{other:?} changed files");
    }
    // More of the same one does.
    works(
        folder.path(),
        &format!("{TINY} --resume --path spin:frames=16"),
    );
    let more = check_run(&run);
    assert_eq!(cells(&more)[..cells(&report).len()], cells(&report)[..]);
    assert_eq!(cells(&more).len(), 2 * cells(&report).len());
}

#[test]
fn bounds_can_be_left_out_for_a_whole_run_only() {
    let folder = folder(&[]);
    let bare = format!("{TINY} --structure linear,bvh");
    works(folder.path(), &format!("{bare} --no-bounds"));
    let report = report(&folder.path().join("out/run"));
    assert_eq!(report["bounds"].as_array().map(Vec::len), Some(0));
    assert!(
        cells(&report)
            .iter()
            .all(|c| c["metrics"]["times_read"].is_null())
    );
    let more = format!("{bare} --resume --path spin:frames=16");
    let done = cullbench(folder.path(), &more);
    assert_refused(&done, "out/run | with --no-bounds | expected", "bounds");
    works(folder.path(), &format!("{more} --no-bounds"));
}

#[test]
fn cold_runs_measure_both_states_and_every_answer() {
    let folder = folder(&[]);
    works(folder.path(), &format!("{TINY} --cold"));
    let report = check_run(&folder.path().join("out/run"));
    for cache in ["warm", "cold"] {
        let of_state = cells(&report)
            .iter()
            .filter(|c| c["path"]["cache"] == cache);
        assert_eq!(of_state.count(), structure_names().len());
    }
}

#[test]
fn damaged_runs_are_not_resumed() {
    let folder = folder(&[]);
    works(folder.path(), TINY);
    let run = folder.path().join("out/run");
    let whole = fs::read_to_string(run.join("report.json")).expect("a report");
    let samples = fs::read(run.join("samples.csv")).expect("samples");
    let swap = |from: &str, to: &str| {
        assert!(whole.contains(from), "{from}");
        whole.replace(from, to).into_bytes()
    };
    let damages: [(&str, Vec<u8>, &str); 7] = [
        ("report.json", vec![], "report.json"),
        (
            "report.json",
            whole.as_bytes()[..whole.len() / 2].to_vec(),
            "expected the report of a run",
        ),
        ("report.json", vec![0xFF; 64], "report.json"),
        (
            "report.json",
            swap("\"schema_version\": 1", "\"schema_version\": 9"),
            "schema version 9; expected 1",
        ),
        (
            "report.json",
            swap("\"rows\": ", "\"rows\": 1844674407370955"),
            "report.json refers to",
        ),
        (
            "samples.csv",
            samples[..samples.len() / 2].to_vec(),
            "samples.csv",
        ),
        ("samples.csv", vec![], "samples.csv: 0 rows; expected"),
    ];
    for (file, bytes, wanted) in damages {
        fs::write(run.join("report.json"), &whole).expect("writable");
        fs::write(run.join("samples.csv"), &samples).expect("writable");
        fs::write(run.join(file), bytes).expect("writable");
        let before = contents(&run);
        let done = cullbench(folder.path(), &format!("{TINY} --resume"));
        assert_refused(&done, &format!("out/run/ | {wanted}"), wanted);
        assert!(contents(&run) == before, "{wanted}");
    }
}

#[test]
fn a_scene_that_changes_between_stop_and_resume_is_noticed() {
    let folder = with_good_files(&[]);
    let run = "run --scene scene.csv --path orbit:frames=4 --out r";
    works(folder.path(), run);
    let other = format!("{BOXES}\n0,0,0,1,1,2\n");
    fs::write(folder.path().join("scene.csv"), other).expect("writable");
    let resume = format!("{run} --path spin:frames=4 --resume");
    all_refused(
        &folder,
        &[resume],
        "scene 'scene.csv' has changed | expected",
    );
}

#[test]
fn cameras_that_change_between_stop_and_resume_are_noticed() {
    let folder = with_good_files(&[]);
    let of_file = "run --scene scene.csv --path cameras.csv --structure linear,bvh --out r";
    works(folder.path(), of_file);
    let spin = "run --scene scene.csv --path spin:frames=4 --structure linear,bvh --out s";
    works(folder.path(), spin);
    let more = "--path orbit:frames=4 --resume";
    // The first has nothing left to do, and is refused all the same.
    let commands = [
        format!("{of_file} --resume --fovy 40"),
        format!("{of_file} {more} --far 50"),
    ];
    all_refused(
        &folder,
        &commands,
        "path 'cameras.csv' has other cameras | expected",
    );
    let commands = [format!("{spin} {more} --near 0.5")];
    all_refused(
        &folder,
        &commands,
        "path 'spin:frames=4' has other cameras | expected",
    );
    let cameras = folder.path().join("cameras.csv");
    let before = fs::read(&cameras).expect("cameras");
    fs::write(&cameras, format!("{EYE_LOOK}\n-9,0.5,0.5,0,0.5,0.25\n")).expect("writable");
    let commands = [format!("{of_file} {more}")];
    all_refused(
        &folder,
        &commands,
        "path 'cameras.csv' has other cameras | expected",
    );
    fs::write(&cameras, before).expect("writable");
    works(folder.path(), &format!("{of_file} {more}"));
    // A report from before there was a digest is taken as it is.
    let report = folder.path().join("s/report.json");
    let mut old = json(&fs::read_to_string(&report).expect("a report"));
    for cell in old["cells"].as_array_mut().expect("cells") {
        cell["path"]
            .as_object_mut()
            .expect("a path")
            .remove("digest");
    }
    fs::write(&report, old.to_string()).expect("writable");
    works(folder.path(), &format!("{spin} {more}"));
}
