//! `run`: the files of a run against the contract, runs that must not be
//! written over, and what may and may not be resumed.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::Value;

use super::process::*;
use super::run_tables::prose;
use super::{BOXES, FULL_CAMERA};

pub fn report(run: &Path) -> Value {
    json(&fs::read_to_string(run.join("report.json")).expect("a report"))
}

pub fn cells(report: &Value) -> &Vec<Value> {
    report["cells"].as_array().expect("an array")
}

/// Metrics that every cell of these scenes has.
const METRICS: &str = "query_ns ns_per_visible visible_count cull_rate speedup \
    nodes_tested items_tested build_ms memory_bytes_per_item \
    locate_ns locate_batched_ns comparisons regions_found";

/// Checks the files of a run, finished or not.
///
/// The report has the documented fields and every path with all structures; samples are
/// where the cells say.
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
    let mut referred = 0u64;
    for (cell, row) in cells(&report).iter().zip(&summary) {
        let fields = "scene path structure kind origin params test status reason rank times metrics error \
            answers left_out samples_ref";
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
        // The rows that have the cell's names.
        let own = samples.iter().filter(|sample| {
            let names = ["scene", "path", "cache", "structure", "test"];
            names.iter().all(|name| sample[*name] == row[*name])
        });
        let mut count = 0;
        for sample in own {
            let time: f64 = sample["cpu_ns"].parse().expect("a number");
            assert!(
                time >= 0.0
                    && ["query", "locate", "locate_batched"].contains(&sample["task"].as_str())
            );
            count += 1;
        }
        assert!(count > 0);
        assert_eq!(place["rows"].as_u64(), Some(count));
        referred += count;
    }
    // The rest are those of the twins and of the bounds.
    let rest = samples.iter().filter(|row| {
        let name = &row["structure"];
        name.ends_with("#twin") || name.starts_with("bound-")
    });
    assert_eq!(referred as usize + rest.count(), samples.len());
    check_bounds(&report);
    let names: Vec<String> = timed_names();
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

pub const TINY: &str = "run --scene uniform:n=200 --path orbit:frames=16 --out out/run";

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
    assert_eq!(cells(&report).len(), timed_names().len());
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
    let others = [
        ("--seed 2", "--seed is '2'"),
        ("--no-bounds", "--no-bounds is"),
        ("--structure linear", "--structure is 'linear'"),
        ("--planes frame-f32", "--planes is 'frame-f32'"),
        ("--path spin:frames=16", "spin:frames=16"),
    ];
    for (other, wanted) in others {
        let done = cullbench(folder.path(), &format!("{TINY} --resume {other}"));
        assert_refused(&done, &format!("out/run | {wanted} | expected"), wanted);
        assert!(contents(&run) == before, "{other:?} changed files");
    }
}

#[test]
fn bounds_can_be_left_out_of_a_run() {
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
    // What was recorded is continued with.
    works(folder.path(), &format!("{bare} --resume"));
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
        assert_eq!(of_state.count(), timed_names().len());
    }
}

#[test]
fn a_scene_without_items_ranks_nothing_and_counts_are_words() {
    let none = format!("{BOXES}\n");
    let one = format!("{BOXES}\n0,0,0,1,1,1\n");
    let folder = folder(&[("none.csv", none.as_bytes()), ("one.csv", one.as_bytes())]);
    let run = "--path outside:frames=1 --no-bounds --out";
    let table = works(
        folder.path(),
        &format!("run --scene none.csv --structure linear,bvh {run} none"),
    );
    assert!(
        table.contains("none.csv: no items, no regions, z up, no unit stated; nothing is ranked")
            && table.contains("Nothing is ranked: the scene has no items.")
            && !table.contains("\nnext "),
        "{table}"
    );
    let told = prose(&table);
    assert!(
        told.contains(" linear - ") && told.contains(" bvh - "),
        "{table}"
    );
    let text = works(folder.path(), "report none");
    assert!(
        text.contains("no items, no regions, z up, no unit stated; nothing is ranked"),
        "{text}"
    );
    assert!(
        text.contains("| linear | - |") && text.contains("| bvh | - |"),
        "{text}"
    );
    all_refused(
        &folder,
        &["compare none none"],
        "nothing can be judged: of 2 cells in common",
    );
    for study in ["precision", "advise", "funnel"] {
        let line = format!("{study} --scene none.csv --path outside:frames=1");
        let told = works(folder.path(), &line);
        let left_out = "none.csv: left out: the scene has no items: there is nothing to time\n";
        assert_eq!(told, left_out, "{study}");
        let document = json(&works(folder.path(), &format!("{line} --format json")));
        assert_eq!(document["status"], "left_out", "{study}");
    }
    let line = "funnel --scene none.csv --path outside:frames=1 --csv t --svg t.svg";
    let done = cullbench(folder.path(), line);
    let notes = "note: t: not written\nnote: t.svg: not written\n";
    assert_eq!((done.code, done.err.as_str()), (Some(0), notes));
    let table = works(
        folder.path(),
        &format!("run --scene one.csv --structure linear {run} one"),
    );
    assert!(
        table.contains("one.csv: 1 item, 1 region, z up, no unit stated\n"),
        "{table}"
    );
    assert!(table.contains("\n1 cell in "), "{table}");
    let alone = "per query; no other structure has a time.";
    assert!(table.contains(alone), "{table}");
    let compared = works(folder.path(), "compare one one");
    assert!(compared.contains(", 1 cell\n"), "{compared}");
    let verdict = "0 slower, 1 inconclusive, 0 faster, 0 same of 1 cell\n";
    assert!(compared.ends_with(verdict), "{compared}");
}

/// The box beside the corner of the view is behind none of its planes.
#[test]
fn returned_items_that_are_all_false_positives_are_not_called_visible() {
    let boxes = format!("{BOXES}\n9.2,-9.4,0,12,-8.6,1\n500,500,0,501,501,1\n");
    let camera = format!("{FULL_CAMERA}\n0,0,0,0,-1,0,0,0,1,90,1,1,9\n");
    let folder = folder(&[("b.csv", boxes.as_bytes()), ("c.csv", camera.as_bytes())]);
    let what = "--scene b.csv --path c.csv --structure linear,wide --processes 1";
    let wanted = "50 % of the items are returned, none visible in 1 checked view\n";
    for command in ["run", "advise", "report"] {
        let line = match command {
            "run" => format!("run {what} --out one"),
            "report" => "report one".to_owned(),
            _ => format!("{command} {what}"),
        };
        let told = works(folder.path(), &line);
        assert!(told.contains(wanted), "{command}: {told}");
    }
}

/// Beside the camera, where f32 has steps of 8 km: stored they are seen, written
/// they are not.
#[test]
fn what_storage_returns_too_much_is_told_only_where_there_is_any() {
    let far = format!(
        "{BOXES}\n100000000005,-40,0,100000000006,-39,1\n\
         100000000005,30,0,100000000006,31,1\n100000000005,0,0,100000000006,1,1\n\
         0,0,0,1,1,1\n"
    );
    let near = format!("{BOXES}\n0,0,0,1,1,1\n");
    let camera = |x: u64| {
        format!(
            "eye_x,eye_y,eye_z,forward_x,forward_y,forward_z,near,far\n{x},0.5,0.5,1,0,0,1,100\n"
        )
    };
    let (beside, before, away) = (
        camera(100_000_000_000),
        "eye_x,eye_y,eye_z,forward_x,forward_y,forward_z,near,far\n-3,0.5,0.5,1,0,0,1,100\n",
        camera(100_000_000_007),
    );
    let folder = folder(&[
        ("far.csv", far.as_bytes()),
        ("near.csv", near.as_bytes()),
        ("beside.csv", beside.as_bytes()),
        ("before.csv", before.as_bytes()),
        ("away.csv", away.as_bytes()),
    ]);
    let run = |scene: &str, path: &str, out: &str| {
        let line = format!("run --scene {scene} --path {path} --structure linear --no-bounds");
        let table = works(folder.path(), &format!("{line} --processes 1 --out {out}"));
        (
            prose(&table),
            works(folder.path(), &format!("report {out}")),
        )
    };
    let (table, text) = run("far.csv", "beside.csv", "one");
    let wanted = ", 200 % false positives (2/0/0 by storage/planes/test) structure ";
    assert!(table.contains(wanted), "{table}");
    let wanted = ", 200 % false positives (2/0/0 by storage/planes/test)\n";
    assert!(text.contains(wanted), "{text}");
    // Nothing is visible, and something is returned.
    let (table, text) = run("far.csv", "away.csv", "two");
    let wanted = ", false positives 3/0/0 by storage/planes/test structure ";
    assert!(table.contains(wanted), "{table}");
    let wanted = ", false positives 3/0/0 by storage/planes/test\n";
    assert!(text.contains(wanted), "{text}");
    let (table, text) = run("near.csv", "before.csv", "three");
    assert!(!table.contains("by storage"), "{table}");
    assert!(
        text.contains(", no false positives in 1 checked view\n"),
        "{text}"
    );
}
