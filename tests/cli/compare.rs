//! `compare`: what it calls slower, faster, broken, lost or different, its exit
//! codes, its JSON, and what it refuses. All reports here come from one run
//! over a tiny scene; every change in them is made by hand.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use serde_json::{Value, json};
use tempfile::TempDir;

use super::process::*;

/// The run, made once.
fn measured() -> &'static Value {
    static REPORT: OnceLock<Value> = OnceLock::new();
    REPORT.get_or_init(|| {
        let folder = folder(&[]);
        let run = "run --scene uniform:n=300 --path orbit:frames=8 --path outside:frames=8 \
            --structure linear-scalar,linear,bvh --out run";
        works(folder.path(), run);
        let text = fs::read_to_string(folder.path().join("run/report.json"));
        let mut report = json(&text.expect("a report"));
        // So small a scene is all noise; these figures are to be exact.
        report["noise"]["aa_floor"] = json!(0.02);
        report
    })
}

fn cells(report: &mut Value) -> &mut Vec<Value> {
    report["cells"].as_array_mut().expect("an array")
}

/// The cell of the bvh on the orbit.
fn bvh(report: &mut Value) -> &mut Value {
    let is_it =
        |cell: &&mut Value| cell["structure"] == "bvh" && cell["path"]["name"] == "orbit:frames=8";
    cells(report).iter_mut().find(is_it).expect("a cell of bvh")
}

/// Multiplies a figure and its interval.
fn scale(cell: &mut Value, metric: &str, factor: f64) {
    for part in ["value", "lower", "upper"] {
        if let Some(value) = cell["metrics"][metric][part].as_f64() {
            cell["metrics"][metric][part] = json!(value * factor);
        }
    }
}

/// A folder with the run as old.json, and as new.json what became of it.
fn with_change(change: impl FnOnce(&mut Value)) -> TempDir {
    let mut new = measured().clone();
    change(&mut new);
    let (old, new) = (measured().to_string(), new.to_string());
    folder(&[("old.json", old.as_bytes()), ("new.json", new.as_bytes())])
}

const COMPARE: &str = "compare old.json new.json";

/// Runs a comparison that must end with this exit code, without a word on
/// stderr; its output.
fn compare(folder: &Path, options: &str, code: i32) -> String {
    let done = cullbench(folder, &format!("{COMPARE} {options}"));
    assert_eq!(
        (done.code, done.err.as_str()),
        (Some(code), ""),
        "{options}: {}",
        done.out
    );
    done.out
}

fn last_line(text: &str) -> &str {
    text.lines().last().unwrap_or_default()
}

#[test]
fn a_report_and_itself_have_nothing_but_ties() {
    let folder = with_change(|_| ());
    let text = compare(folder.path(), "", 0);
    let verdict = "0 slower, 0 faster, 6 ties of 6 cells; worst 1.00 (";
    assert!(last_line(&text).starts_with(verdict), "{text}");
    assert!(
        text.contains("bar  query_ns: 5.00 % (the threshold)"),
        "{text}"
    );
    assert!(
        text.contains("noise floor 2.00 %") && text.contains("bounds"),
        "{text}"
    );
    // Ties are counted; --all shows them.
    assert_eq!(text.matches("│ tie").count(), 0, "{text}");
    let all = compare(folder.path(), "--all", 0);
    assert_eq!(all.matches("│ tie").count(), 6, "{all}");
    // The folder is as good as the file in it, and every metric is known.
    fs::create_dir(folder.path().join("run")).expect("writable");
    fs::copy(
        folder.path().join("old.json"),
        folder.path().join("run/report.json"),
    )
    .expect("writable");
    works(folder.path(), "compare run old.json --threshold 0");
    let metrics = "query_ns,query_ns_p95,query_ns_p99 --metric query_wall_ns,ns_per_visible \
        --metric times_read,times_memcpy,times_replay,build_ms,update_ms \
        --metric memory_bytes_per_item,locate_ns,locate_batched_ns";
    let many = compare(folder.path(), &format!("--metric {metrics}"), 0);
    assert!(last_line(&many).contains("78 figures of 6 cells"), "{many}");
    // No wide, no replay: in neither report, so counted and not shown.
    assert!(last_line(&many).contains("6 unmeasured"), "{many}");
    assert!(!many.contains("in neither report"), "{many}");
}

#[test]
fn twice_the_time_is_slower_and_half_of_it_faster() {
    let slower = with_change(|new| scale(bvh(new), "query_ns", 2.0));
    let text = compare(slower.path(), "", 3);
    let row = text
        .lines()
        .find(|line| line.contains("slower"))
        .expect("a row");
    for part in [
        "uniform:n=300",
        "orbit:frames=8, six-plane",
        "bvh",
        "query_ns",
        " 2.00 ",
    ] {
        assert!(row.contains(part), "no '{part}' in: {row}");
    }
    let verdict = "1 slower, 0 faster, 5 ties of 6 cells; worst 2.00 (bvh on uniform:n=300, orbit";
    assert!(last_line(&text).starts_with(verdict), "{text}");
    // Over both of its cells: the square root of two.
    let mean = text
        .lines()
        .find(|line| line.contains("1.41"))
        .expect("a mean");
    assert!(mean.contains("bvh"), "{mean}");
    // By another metric nothing has happened.
    compare(slower.path(), "--metric build_ms,memory_bytes_per_item", 0);
    compare(slower.path(), "--metric build_ms,query_ns", 3);
    // The bar is the user's.
    compare(slower.path(), "--threshold 150%", 0);
    compare(slower.path(), "--threshold 99%", 3);
    let faster = with_change(|new| scale(bvh(new), "query_ns", 0.5));
    let text = compare(faster.path(), "", 0);
    assert!(
        last_line(&text).starts_with("0 slower, 1 faster, 5 ties"),
        "{text}"
    );
    assert!(
        text.contains("│ faster") && text.contains(" 0.500 "),
        "{text}"
    );
}

#[test]
fn the_larger_of_threshold_and_noise_floors_is_the_bar() {
    let slower_by = |factor: f64, old: Value, new: Value| {
        let folder = with_change(|report| {
            scale(bvh(report), "query_ns", factor);
            scale(bvh(report), "memory_bytes_per_item", factor);
            report["noise"]["aa_floor"] = new;
        });
        let mut report = measured().clone();
        report["noise"]["aa_floor"] = old;
        fs::write(folder.path().join("old.json"), report.to_string()).expect("writable");
        folder
    };
    let floor_of_new = slower_by(1.15, json!(0.02), json!(0.2));
    let text = compare(floor_of_new.path(), "", 0);
    assert!(
        text.contains("20.00 % (noise floor of NEW; threshold 5.00 %)"),
        "{text}"
    );
    let floor_of_old = slower_by(1.15, json!(0.2), json!(0.1));
    let text = compare(floor_of_old.path(), "", 0);
    assert!(
        text.contains("20.00 % (noise floor of OLD; threshold 5.00 %)"),
        "{text}"
    );
    // Noise has no part in bytes, and none of the smaller floor counts.
    compare(floor_of_old.path(), "--metric memory_bytes_per_item", 3);
    let small_floors = slower_by(1.15, json!(0.02), json!(0.14));
    compare(small_floors.path(), "", 3);
    let unknown = slower_by(1.04, json!(null), json!(null));
    let text = compare(unknown.path(), "", 0);
    assert!(text.contains("note: OLD knows no noise floor"), "{text}");
    compare(unknown.path(), "--threshold 3%", 3);
}

#[test]
fn statuses_go_before_times() {
    let status = |cell: &mut Value, status: &str| {
        cell["status"] = json!(status);
        cell["reason"] = json!("for \x1b[31ma reason");
    };
    for name in ["wrong", "unsafe", "panicked"] {
        // A wrong answer wins over a regression, and over another scene.
        let broken = with_change(|new| {
            scale(&mut cells(new)[0], "query_ns", 9.0);
            status(bvh(new), name);
            bvh(new)["scene"]["digest"] = json!("0");
        });
        let text = compare(broken.path(), "", 1);
        assert!(
            text.contains("│ broken") && text.contains("a reason"),
            "{text}"
        );
        assert!(
            text.contains(&format!("ok to {name}")) && !text.contains('\x1b'),
            "{text}"
        );
        // It was wrong already, or nobody has asked it before.
        let twice = with_change(|new| status(bvh(new), name));
        fs::copy(twice.path().join("new.json"), twice.path().join("old.json")).expect("writable");
        assert!(compare(twice.path(), "", 1).contains("│ failed in both"));
        let alone = with_change(|new| {
            status(bvh(new), name);
            bvh(new)["structure"] = json!("newest");
        });
        let text = compare(alone.path(), "", 1);
        assert!(
            text.contains(&format!(
                "only in NEW: newest on uniform:n=300, orbit:frames=8, six-plane: {name}: for"
            )),
            "{text}"
        );
    }
    for name in ["refused", "left_out", "timed_out", "out_of_memory"] {
        let lost = with_change(|new| status(bvh(new), name));
        assert!(compare(lost.path(), "", 3).contains(&format!("ok to {name}")));
        // The other way round it is no loss.
        let [old, new] = ["old.json", "new.json"].map(|file| lost.path().join(file));
        fs::rename(&old, lost.path().join("kept")).expect("writable");
        fs::rename(&new, &old).expect("writable");
        fs::rename(lost.path().join("kept"), &new).expect("writable");
        assert!(compare(lost.path(), "", 0).contains("│ gained"));
        fs::copy(&old, &new).expect("writable");
        assert!(last_line(&compare(lost.path(), "", 0)).contains("1 failed in both"));
    }
}

#[test]
fn another_question_is_not_judged_by_its_time() {
    type Row = (fn(&mut Value), &'static str);
    let changes: [Row; 4] = [
        (|cell| cell["scene"]["digest"] = json!("0"), "other items"),
        (|cell| cell["path"]["digest"] = json!("0"), "other cameras"),
        (
            |cell| cell["path"]["camera_count"] = json!(9),
            "8 cameras and 9",
        ),
        (
            |cell| cell["metrics"]["visible_count"]["value"] = json!(1e6),
            "visible_count",
        ),
    ];
    for (change, reason) in changes {
        let folder = with_change(|new| {
            scale(bvh(new), "query_ns", 9.0);
            change(bvh(new));
        });
        let text = compare(folder.path(), "", 0);
        assert!(
            text.contains("│ different") && text.contains(reason),
            "{text}"
        );
        assert!(last_line(&text).contains("5 ties of 6 cells"), "{text}");
        // All of them: nothing is left that could say "no regression".
        let all = with_change(|new| cells(new).iter_mut().for_each(change));
        let wanted = format!("nothing can be judged | 6 were not asked the same | {reason}");
        all_refused(&all, &[COMPARE], &wanted);
    }
    // An older report does not know its cameras.
    let older = with_change(|new| bvh(new)["path"]["digest"] = json!(null));
    assert!(last_line(&compare(older.path(), "", 0)).contains("6 ties"));
}

#[test]
fn figures_that_no_ratio_can_be_taken_of_are_counted() {
    let with_value =
        |value: f64| with_change(|new| bvh(new)["metrics"]["query_ns"]["value"] = json!(value));
    for value in [0.0, -5.0, 1e-323] {
        let text = compare(with_value(value).path(), "", 0);
        let verdict = "0 slower, 1 unmeasured, 0 faster, 5 ties of 6 cells";
        assert!(last_line(&text).starts_with(verdict), "{text}");
        let row = text.lines().find(|line| line.contains("│ unmeasured"));
        let row = row.expect("a row");
        assert!(
            row.contains("bvh") && row.contains("have no ratio"),
            "{row}"
        );
    }
    // A time, however long.
    compare(with_value(1e308).path(), "", 3);
    let null = with_change(|new| bvh(new)["metrics"]["query_ns"]["value"] = json!(null));
    all_refused(&null, &[COMPARE], "new.json | null | expected");
    let gone = with_change(|new| {
        let metrics = bvh(new)["metrics"].as_object_mut().expect("an object");
        metrics.remove("query_ns");
    });
    let text = compare(gone.path(), "", 0);
    assert!(
        text.contains("only in OLD") && text.contains("unmeasured"),
        "{text}"
    );
    all_refused(
        &gone,
        &[format!("{COMPARE} --metric times_replay")],
        "nothing can be judged | 6 lack a figure | in neither report",
    );
}

#[test]
fn cells_of_one_side_and_other_settings_are_said() {
    let folder = with_change(|new| {
        bvh(new)["structure"] = json!("bvh:leaf=2");
        new["machine"]["cpu"] = json!("Another");
        new["toolchain"]["flags"] = json!("-C target-cpu=native");
        new["run"]["finished_at"] = json!(null);
        for bound in new["bounds"].as_array_mut().expect("an array") {
            scale(bound, "query_ns", 1.5);
        }
    });
    let text = compare(folder.path(), "", 0);
    for wanted in [
        "only in OLD: 1 cells (bvh on uniform:n=300, orbit:frames=8, six-plane)",
        "only in NEW: 1 cells (bvh:leaf=2 on",
        "note: cpu differs:",
        "note: different machines:",
        "--metric times_read",
        "note: flags differs: '' and '-C target-cpu=native'",
        "4 bounds (reading, copying) take 1.50 times as long in NEW",
        "note: NEW is a run that was not finished",
    ] {
        assert!(text.contains(wanted), "no '{wanted}' in:\n{text}");
    }
    assert!(last_line(&text).contains("5 ties of 5 cells"), "{text}");
    // A cell that a report holds twice is two cells.
    let twice = with_change(|new| {
        let copy = bvh(new).clone();
        cells(new).push(copy);
    });
    assert!(compare(twice.path(), "", 0).contains("only in NEW: 1 cells (bvh on"));
}

#[test]
fn json_says_the_same_with_types() {
    let folder = with_change(|new| {
        scale(bvh(new), "query_ns", 2.0);
        let gone = cells(new).remove(0);
        assert_eq!(gone["structure"], "linear-scalar");
    });
    let done = json(&compare(folder.path(), "--format json", 3));
    let fields = "old new verdict counts notes settings threshold bars cells_in_common changes \
        only_in_old only_in_new structures machine_drift";
    assert_eq!(keys(&done), set(fields));
    assert_eq!(done["verdict"], "regression");
    let head = "id started_at command version commit dirty noise_floor cells";
    assert_eq!(keys(&done["old"]), set(head));
    assert_eq!(
        (&done["old"]["cells"], &done["new"]["cells"]),
        (&json!(6), &json!(5))
    );
    let bar = json!({ "metric": "query_ns", "bar": 0.05, "decided_by": "threshold" });
    assert_eq!(done["bars"], json!([bar]));
    let outcomes = "broken lost slower different unmeasured failed_in_both gained faster tie";
    assert_eq!(keys(&done["counts"]), set(outcomes));
    assert_eq!(
        (&done["counts"]["slower"], &done["counts"]["tie"]),
        (&json!(1), &json!(4))
    );
    let changes = done["changes"].as_array().expect("an array");
    assert_eq!(changes.len(), 5);
    let row = "status scene path cache test arithmetic planes epsilon structure metric ratio old \
        new bar old_status new_status reason";
    assert!(changes.iter().all(|change| keys(change) == set(row)));
    let worst = &changes[0];
    assert_eq!(
        (&worst["status"], &worst["structure"]),
        (&json!("slower"), &json!("bvh"))
    );
    assert_eq!(
        (&worst["ratio"], &worst["bar"]),
        (&json!(2.0), &json!(0.05))
    );
    let (old, new) = (&worst["old"], &worst["new"]);
    assert_eq!(keys(old), set("value lower upper"));
    for part in ["value", "lower", "upper"] {
        let [old, new] = [old, new].map(|side| side[part].as_f64().expect(part));
        assert_eq!(new, 2.0 * old, "{part}");
    }
    let lone = &done["only_in_old"][0];
    assert_eq!(
        (&lone["structure"], &lone["status"]),
        (&json!("linear-scalar"), &json!("ok"))
    );
    assert_eq!(done["only_in_new"], json!([]));
    let mean = &done["structures"][0];
    assert_eq!(
        (&mean["structure"], &mean["cells"]),
        (&json!("bvh"), &json!(2))
    );
    let drift = json!({ "ratio": 1.0, "bounds": 4 });
    assert_eq!(done["machine_drift"], drift);
    let same = json(&works(
        folder.path(),
        "compare old.json old.json --format json",
    ));
    assert_eq!(
        (&same["verdict"], &same["counts"]["tie"]),
        (&json!("ok"), &json!(6))
    );
}

#[test]
fn what_cannot_be_compared_is_refused_in_one_line() {
    let folder = with_change(|new| cells(new).truncate(3));
    let mut other = measured().clone();
    for cell in cells(&mut other) {
        cell["scene"]["name"] = json!("another");
    }
    let half = &measured().to_string()[..3000];
    for (file, text) in [
        ("half.json", half),
        ("other.json", &other.to_string()),
        ("noise.json", "\u{1}{"),
    ] {
        fs::write(folder.path().join(file), text).expect("writable");
    }
    for (file, wanted) in [
        ("missing.json", "missing.json: No such file"),
        ("half.json", "half.json | expected the report of a run"),
        ("noise.json", "noise.json | expected the report of a run"),
        (
            "other.json",
            "no cell in common | OLD has | NEW has | another | expected runs of the same scenes",
        ),
    ] {
        let lines = [
            format!("compare {file} new.json"),
            format!("compare new.json {file}"),
            format!("compare new.json {file} --format json"),
        ];
        all_refused(&folder, &lines, wanted);
    }
    let empty = with_change(|new| cells(new).clear());
    all_refused(&empty, &[COMPARE], "no cell in common | NEW has no cells");
    for (options, wanted) in [
        (
            "--metric qery_ns",
            "unknown metric 'qery_ns' | did you mean 'query_ns'? | build_ms",
        ),
        (
            "--metric query_ns,visible_count",
            "unknown metric 'visible_count' | known: query_ns",
        ),
        (
            "--metric build_ms --metric build_ms",
            "'build_ms' is named twice",
        ),
        ("--metric ,", "no metric to compare by | expected"),
        ("--threshold nan", "--threshold is 'nan' | expected | 5%"),
        ("--threshold -5%", "--threshold is '-5%'"),
        ("--threshold -0.05", "--threshold is '-0.05'"),
        ("--threshold inf", "--threshold is 'inf'"),
        ("--threshold 1e999%", "--threshold is '1e999%'"),
        ("--threshold 5", "--threshold is '5' | 5% | 0.05"),
        ("--threshold ''", "--threshold is ''"),
        ("--threshold %", "--threshold is '%'"),
    ] {
        all_refused(&folder, &[format!("{COMPARE} {options}")], wanted);
    }
}
