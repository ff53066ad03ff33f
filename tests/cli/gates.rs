//! Comparisons in CI: gates, baselines, Bencher, and the commands of docs/CI.md.

use std::fs;

use serde_json::{Value, json};
use tempfile::TempDir;

use super::compare::{self, COMPARE, bvh, cells, compare, last_line, row_with, scale, with_change};
use super::process::*;

/// The bvh on the orbit with this many times the planes tested.
fn with_planes(factor: f64) -> TempDir {
    with_change(|new| {
        let planes = &mut bvh(new)["metrics"]["planes_tested"]["value"];
        *planes = json!(factor * planes.as_f64().expect("a count"));
        // No gate of the work judges times, on whatever machine.
        cells(new)
            .iter_mut()
            .for_each(|cell| scale(cell, "query_ns", 3.0));
        new["machine"]["cpu"] = json!("Another");
    })
}

#[test]
fn work_beyond_the_threshold_is_a_regression() {
    let more = with_planes(1.1);
    let text = compare(more.path(), "--gate work", 3);
    let verdict = "1 more work, 0 less work, 39 same of 40 figures of 10 cells";
    assert_eq!(last_line(&text), verdict, "{text}");
    let row = row_with(&text, "more work");
    assert!(
        row.contains("bvh") && row.contains("planes_tested"),
        "{row}"
    );
    assert!(row.contains(" +10.0 % "), "{row}");
    for absent in ["slower", "NEW takes", "different machines", "processes"] {
        assert!(!text.contains(absent), "'{absent}' in:\n{text}");
    }
    let text = compare(more.path(), "--gate work --threshold 11%", 0);
    assert!(!text.contains("work changed"), "{text}");
    compare(more.path(), "--gate work --threshold 0", 3);
    let done = json(&compare(more.path(), "--gate work --format json", 3));
    assert_eq!(done["verdict"], "regression");
    assert_eq!(
        (&done["gate"], &done["common_shifts"]),
        (&json!("work"), &json!([]))
    );
    let worst = &done["rows"][0];
    assert_eq!(worst["verdict"], "more_work");
    assert_eq!(number(worst, "new"), 1.1 * number(worst, "old"));
    // The times are the default's, and no gate of the work.
    compare(more.path(), "", 0);
    let less = with_planes(0.5);
    let text = compare(less.path(), "--gate work", 0);
    assert!(
        last_line(&text).starts_with("0 more work, 1 less work"),
        "{text}"
    );
    assert!(row_with(&text, "less work").contains(" -50.0 % "), "{text}");
    // From nothing to something is growth beyond every share.
    let from_none = with_change(|new| {
        assert_eq!(cells(new)[1]["structure"], "linear");
        cells(new)[1]["metrics"]["nodes_tested"]["value"] = json!(7);
    });
    compare(from_none.path(), "--gate work --threshold 900%", 3);
}

#[test]
fn the_gate_of_the_work_sees_lost_and_wrong_answers() {
    for (status, code) in [("refused", 3), ("wrong", 1)] {
        let folder = with_change(|new| bvh(new)["status"] = json!(status));
        compare(folder.path(), "--gate work", code);
    }
    let uncounted = with_change(|new| {
        for cell in cells(new) {
            let metrics = cell["metrics"].as_object_mut().expect("an object");
            metrics.retain(|name, _| !name.ends_with("_tested") && name != "comparisons");
        }
    });
    let work = format!("{COMPARE} --gate work");
    let wanted = "nothing can be judged | 10 without a figure | only in OLD";
    all_refused(&uncounted, std::slice::from_ref(&work), wanted);
    for (options, wanted) in [
        (
            "--gate work --metric build_ms",
            "--metric names times | expected none with --gate work",
        ),
        (
            "--gate work --fail-inconclusive",
            "--fail-inconclusive is of times | expected none with --gate work",
        ),
        ("--gate memory", "--gate | memory | expected | time, work"),
    ] {
        all_refused(&uncounted, &[format!("{COMPARE} {options}")], wanted);
    }
}

#[test]
fn inconclusive_fails_where_it_shall() {
    let few = with_change(|new| cells(new).retain(|cell| cell["structure"] == "bvh"));
    compare(few.path(), "", 0);
    let text = compare(few.path(), "--fail-inconclusive", 3);
    assert!(text.contains("2 inconclusive: "), "{text}");
    let done = json(&compare(few.path(), "--fail-inconclusive --format json", 3));
    assert_eq!(done["verdict"], "inconclusive");
    let text = compare(few.path(), "--fail-inconclusive --markdown", 3);
    assert!(
        text.contains("<summary>cullbench: inconclusive: 0 slower, 2 inc"),
        "{text}"
    );
    let same = with_change(|_| ());
    let done = compare(same.path(), "--fail-inconclusive --markdown", 0);
    assert!(
        done.contains("<summary>cullbench: no regression: 0 slower"),
        "{done}"
    );
}

#[test]
fn a_shift_of_most_structures_is_no_bare_verdict() {
    let most = with_change(|new| {
        let all = cells(new).iter_mut();
        let trees = all.filter(|cell| cell["structure"] != "linear");
        trees.for_each(|cell| scale(cell, "query_ns", 1.5));
    });
    let text = compare(most.path(), "", 0);
    assert_eq!(compare::rows(&text, "faster than the others"), 2, "{text}");
    let shift = "among the structures; query_ns as a whole changed by +";
    let counts = "which is not judged here (use compare --against): 0 slower, 0 inconclusive, \
        2 faster, 8 same of 10";
    let told = unwrapped(&text);
    assert!(
        told.contains(&format!("No regression {shift}")) && told.contains(counts),
        "{text}"
    );
    let open = "inconclusive; query_ns as a whole changed by +";
    for (options, words, code) in [
        ("", format!("no regression {shift}"), 0),
        ("--fail-inconclusive", open.to_owned(), 3),
    ] {
        let text = compare(most.path(), &format!("{options} --markdown"), code);
        let wanted = format!("<summary>cullbench: {words}");
        assert!(text.contains(&wanted) && text.contains(counts), "{text}");
    }
    // Each metric has a shift of its own.
    for metrics in ["locate_ns,query_ns", "query_ns,build_ms"] {
        let options = format!("--fail-inconclusive --metric {metrics}");
        let text = unwrapped(&compare(most.path(), &options, 3));
        assert!(text.contains("query_ns as a whole changed by +"), "{text}");
        assert_eq!(text.matches(" of NEW is ").count(), 2, "{text}");
    }
    let one = with_change(|new| scale(bvh(new), "query_ns", 0.5));
    let text = compare(one.path(), "--fail-inconclusive", 0);
    assert_eq!(compare::rows(&text, "faster"), 1, "{text}");
    assert!(text.contains("No regression: "), "{text}");
}

const RUN: &str = "run --scene uniform:n=50 --path orbit:frames=4 --structure linear,bvh \
    --processes 1 --no-bounds";

#[test]
fn a_saved_run_is_the_baseline_of_the_newest() {
    let folder = folder(&[]);
    let path = folder.path();
    all_refused(
        &folder,
        &["compare --baseline main"],
        "no baseline 'main' in results/baselines | expected one that `run --save NAME` kept",
    );
    let text = works(path, &format!("{RUN} --save main --out first"));
    let last = text.lines().last().unwrap_or_default();
    assert!(
        last.trim_start().starts_with("results/baselines/main.json"),
        "{text}"
    );
    let read = |file: &str| json(&fs::read_to_string(path.join(file)).expect(file));
    assert_eq!(
        read("results/baselines/main.json"),
        read("first/report.json")
    );
    all_refused(
        &folder,
        &["compare --baseline main"],
        "no run in results since the baseline | expected",
    );
    all_refused(
        &folder,
        &["compare --baseline main first"],
        "is the baseline 'main' itself",
    );
    works(path, RUN);
    let id = |line: &str| {
        let done = works(path, &format!("{line} --gate work --format json"));
        json(&done)["new"]["id"].as_str().expect("an id").to_owned()
    };
    // Neither an older run nor a folder that is named otherwise is the newest run.
    for name in ["20200101T000000Z-old", "reference"] {
        let other = path.join("results").join(name);
        fs::create_dir(&other).expect("writable");
        fs::copy(path.join("first/report.json"), other.join("report.json")).expect("writable");
    }
    let newest = id("compare --baseline main");
    // By its name, and not the folder of baselines.
    works(path, &format!("{RUN} --out second"));
    assert_eq!(
        id("compare --baseline main second"),
        read("second/report.json")["run"]["id"]
    );
    assert_eq!(id("compare --baseline main"), newest);
    // Whatever the folder of a newer one is named; a file is none.
    fs::write(path.join("results/9zzz"), "a file").expect("writable");
    works(path, &format!("{RUN} --out results/try-2"));
    let newer = read("results/try-2/report.json")["run"]["id"].clone();
    assert_eq!(id("compare --baseline main.json"), newer);
    // Killed before its report was written, it is the newest still.
    fs::remove_file(path.join("results/try-2/report.json")).expect("removable");
    assert_eq!(id("compare --baseline main"), newer);
    // Again: the newer one stays.
    works(path, &format!("{RUN} --save main.json --out third"));
    assert_eq!(
        read("results/baselines/main.json"),
        read("third/report.json")
    );
    for (line, wanted) in [
        (
            "compare --baseline old",
            "no baseline 'old' in results/baselines | available: main",
        ),
        (
            "compare --baseline main first second",
            "cannot be used with",
        ),
        (
            "compare --baseline main --against first",
            "cannot be used with",
        ),
        ("compare first", "NEW.json"),
        (
            "run --save a/b",
            "--save is 'a/b' | expected a name of at most 100 letters",
        ),
        ("run --save ..", "--save is '..'"),
        ("run --save ''", "--save is ''"),
        ("run --save main --shard 1/2", "cannot be used with"),
    ] {
        all_refused(&folder, &[line], wanted);
    }
    // Before anything is measured.
    fs::remove_dir_all(path.join("results")).expect("writable");
    fs::create_dir(path.join("results")).expect("writable");
    fs::write(path.join("results/baselines"), "no folder").expect("writable");
    all_refused(
        &folder,
        &["run --save main"],
        "results/baselines: not a folder | --save",
    );
}

#[test]
fn two_programs_are_compared_by_their_counters_alone() {
    let folder = folder(&[]);
    let line = "compare --scene uniform:n=50 --path orbit:frames=4 --structure linear,bvh \
        --gate work --threshold 0 --against";
    let text = works(folder.path(), &format!("{line} {}", super::PROGRAM));
    let verdict = "0 more work, 0 less work, 8 same of 8 figures of 2 cells";
    assert_eq!(last_line(&text), verdict, "{text}");
    assert!(unwrapped(&text).contains("bounds per region search, threshold 0 %"));
    assert!(!text.contains("not compared"), "{text}");
    let line = line.replace(" --structure linear,bvh", "");
    let text = works(folder.path(), &format!("{line} {}", super::PROGRAM));
    let told = unwrapped(&text);
    let note = told.split("note: not compared by default: ").nth(1);
    assert!(
        note.is_some_and(|names| names.starts_with("linear-scalar, ")),
        "{text}"
    );
}

/// The other program tells how it was built.
#[cfg(unix)]
#[test]
fn programs_that_are_built_differently_are_told() {
    use std::os::unix::fs::PermissionsExt;

    let folder = folder(&[]);
    let other = folder.path().join("other");
    let script = format!(
        "#!/bin/sh\nif [ \"$1\" = env ]; then\n  {0} \"$@\" | sed 's/\"opt_level\": \".\"/\"opt_level\": \
         \"9\"/'\nelse\n  exec {0} \"$@\"\nfi\n",
        super::PROGRAM
    );
    fs::write(&other, script).expect("written");
    fs::set_permissions(&other, fs::Permissions::from_mode(0o755)).expect("executable");
    let line = "compare --scene uniform:n=50 --path orbit:frames=4 --structure linear,bvh \
        --gate work --against ./other";
    let text = unwrapped(&works(folder.path(), line));
    assert!(
        text.contains("note: toolchain differs: opt-level '9' and '"),
        "{text}"
    );
    let all = json(&works(folder.path(), &format!("{line} --format json")));
    assert_eq!(all["settings"].as_array().map(Vec::len), Some(1), "{all}");
}

#[test]
fn two_programs_are_compared_by_their_frames() {
    let folder = folder(&[]);
    let line = format!(
        "compare --scene uniform:n=300 --path orbit:frames=3 --structure linear,wide \
         --motion drift:share=0.1,frames=3 --update refit,rebuild --threshold 90% --format json --against {}",
        super::PROGRAM
    );
    let changes = json(&works(folder.path(), &line));
    let rows = changes["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 4, "{changes}");
    for row in rows {
        assert_eq!(row["metric"], "frame_ns");
        assert_ne!(row["pairs_ln_ns"], Value::Null, "{row}");
    }
    let wanted = "--motion | cannot be used with | --cold";
    all_refused(&folder, &[format!("{line} --cold")], wanted);
}

#[test]
fn bencher_gets_every_right_cell_once() {
    let folder = with_change(|new| cells(new)[0]["status"] = json!("wrong"));
    let text = works(folder.path(), "report new.json --bencher b.json");
    assert_eq!(text, "");
    let written = fs::read_to_string(folder.path().join("b.json")).expect("written");
    let benchmarks = json(&written);
    let benchmarks = benchmarks.as_object().expect("an object");
    assert_eq!(benchmarks.len(), 9);
    let found = &benchmarks["bvh on uniform:n=300, orbit:frames=8, six-plane"];
    let measures = "latency locate-ns build-ms nodes-tested items-tested planes-tested \
        memory-bytes-per-item";
    assert_eq!(keys(found), set(measures));
    let mut report = json(&fs::read_to_string(folder.path().join("new.json")).expect("there"));
    let own = |name: &str, value: &mut Value| value["metrics"][name]["value"].clone();
    let cell = bvh(&mut report);
    assert_eq!(found["latency"]["value"], own("query_ns", cell));
    assert_eq!(
        found["planes-tested"],
        json!({ "value": own("planes_tested", cell) })
    );
    // What is no default is in the name.
    for (from, to) in [
        ("\"epsilon\":8.0", "\"epsilon\":64.0"),
        ("\"f32\"", "\"f32-relative\""),
    ] {
        let text = fs::read_to_string(folder.path().join("new.json")).expect("there");
        fs::write(folder.path().join("new.json"), text.replace(from, to)).expect("writable");
    }
    works(folder.path(), "report new.json --bencher b.json");
    let written = fs::read_to_string(folder.path().join("b.json")).expect("written");
    let name = "bvh on uniform:n=300, orbit:frames=8, six-plane, f32-relative, epsilon 64";
    assert_ne!(json(&written)[name], Value::Null, "{written}");
    let wanted = "b.json: an input or another output | --bencher";
    all_refused(&folder, &["report b.json --bencher b.json"], wanted);
}

/// Each with its options, if not with its measurement.
#[test]
fn the_commands_of_the_workflows_exist() {
    let text = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/CI.md"));
    let text = text
        .expect("docs/CI.md")
        .replace("target/release/\"$PROGRAM\" ", "cullbench ");
    let mut in_code = false;
    let lines = text.lines().filter(|line| {
        in_code ^= line.starts_with("```");
        in_code
    });
    let commands = lines.flat_map(|line| line.split("&&")).filter_map(|part| {
        let end = part.find(['>', '#', '|']).unwrap_or(part.len());
        part[..end].trim().strip_prefix("cullbench ")
    });
    let folder = folder(&[]);
    let tried = commands.map(|command| {
        let done = cullbench(folder.path(), &format!("{command} --help"));
        assert_eq!((done.code, done.err.as_str()), (Some(0), ""), "{command}");
    });
    assert_eq!(tried.count(), 13);
}
