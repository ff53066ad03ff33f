//! `compare OLD NEW`: what it calls slower, faster, same, inconclusive, broken,
//! lost or different, its exit codes, its JSON and Markdown, and what it refuses.
//! All reports here come from one run over a tiny scene, with times of ten
//! processes that are made up; every change in them is made by hand.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use serde_json::{Value, json};
use tempfile::TempDir;

use super::process::*;

/// The run, made once: five structures on two paths.
pub fn measured() -> &'static Value {
    static REPORT: OnceLock<Value> = OnceLock::new();
    REPORT.get_or_init(|| {
        let folder = folder(&[]);
        let run = "run --scene uniform:n=300 --path orbit:frames=8 --path outside:frames=8 \
            --structure linear-scalar,linear,bvh,octree,bsp --processes 1 --out run";
        works(folder.path(), run);
        let text = fs::read_to_string(folder.path().join("run/report.json"));
        let mut report = json(&text.expect("a report"));
        for (cell, own) in cells(&mut report).iter_mut().zip(0..) {
            cell["times"]["processes"] = json!(10);
            for metric in ["query_ns", "locate_ns", "locate_batched_ns", "build_ms"] {
                let value = cell["metrics"][metric]["value"].as_f64().expect(metric);
                cell["times"]["by_process"][metric] = json!(ten(value, own));
            }
        }
        report
    })
}

/// Times of ten processes: a fifth by the machine, for all cells alike, and one
/// percent of a cell's own.
pub fn ten(value: f64, own: usize) -> Vec<f64> {
    let time = |process: usize| {
        let machine = 1.0 + 0.2 * ((process * 7 % 5) as f64 / 4.0 - 0.5);
        let noise = 1.0 + 0.01 * (((process + own) * 3 % 7) as f64 / 6.0 - 0.5);
        value * machine * noise
    };
    (0..10).map(time).collect()
}

pub fn cells(report: &mut Value) -> &mut Vec<Value> {
    report["cells"].as_array_mut().expect("an array")
}

/// The cell of the bvh on the orbit.
pub fn bvh(report: &mut Value) -> &mut Value {
    let is_it =
        |cell: &&mut Value| cell["structure"] == "bvh" && cell["path"]["name"] == "orbit:frames=8";
    cells(report).iter_mut().find(is_it).expect("a cell of bvh")
}

/// Multiplies a figure, its interval, and the times of its processes.
pub fn scale(cell: &mut Value, metric: &str, factor: f64) {
    let scaled = |value: &Value| value.as_f64().map(|value| json!(value * factor));
    for part in ["value", "lower", "upper"] {
        if let Some(value) = scaled(&cell["metrics"][metric][part]) {
            cell["metrics"][metric][part] = value;
        }
    }
    if let Some(times) = cell["times"]["by_process"][metric].as_array_mut() {
        for time in times {
            *time = scaled(time).expect("a number");
        }
    }
}

/// A folder with the run as old.json, and as new.json what became of it.
pub fn with_change(change: impl FnOnce(&mut Value)) -> TempDir {
    let mut new = measured().clone();
    change(&mut new);
    let (old, new) = (measured().to_string(), new.to_string());
    folder(&[("old.json", old.as_bytes()), ("new.json", new.as_bytes())])
}

pub const COMPARE: &str = "compare old.json new.json";

/// Runs a comparison that must end with this exit code, without a word on
/// stderr; its output.
pub fn compare(folder: &Path, options: &str, code: i32) -> String {
    let done = cullbench(folder, &format!("{COMPARE} {options}"));
    assert_eq!(
        (done.code, done.err.as_str()),
        (Some(code), ""),
        "{options}: {}",
        done.out
    );
    done.out
}

/// Counts of the last sentence: "1 slower, .. of 10 cells".
pub fn last_line(text: &str) -> String {
    let text = unwrapped(text.trim_end());
    let heads = ["egression", "was decided"].into_iter();
    let mut ends = heads.filter_map(|head| text.rsplit_once(head));
    let (_, verdict) = ends.next().unwrap_or(("", &text));
    let (_, counts) = verdict.split_once(": ").unwrap_or(("", verdict));
    counts
        .split("; worst")
        .next()
        .unwrap_or_default()
        .to_owned()
}

/// Rows of the table with this verdict.
pub fn rows(text: &str, verdict: &str) -> usize {
    let verdict = format!("  {verdict}  ");
    let rows = text.lines().map(|line| format!("{line}  "));
    rows.filter(|row| row.contains(&verdict)).count()
}

pub fn row_with<'t>(text: &'t str, part: &str) -> &'t str {
    let part = format!("  {part}");
    let row = text.lines().find(|line| line.contains(&part));
    row.unwrap_or_else(|| panic!("no row with '{part}' in:\n{text}"))
}

#[test]
fn a_report_and_itself_are_the_same() {
    let folder = with_change(|_| ());
    let text = compare(folder.path(), "", 0);
    let verdict = "0 slower, 0 inconclusive, 0 faster, 10 same of 10 cells";
    assert_eq!(last_line(&text), verdict, "{text}");
    for wanted in [
        "10 processes vs 10 processes, threshold 5.00 %; finds changes from about",
        "as a whole query_ns of NEW is 100.0 % [",
        "of OLD (10 cells)",
    ] {
        assert!(
            unwrapped(&text).contains(wanted),
            "no '{wanted}' in:\n{text}"
        );
    }
    // What stayed the same is counted; --all shows it.
    assert_eq!(rows(&text, "same"), 0, "{text}");
    let all = compare(folder.path(), "--all", 0);
    assert_eq!(rows(&all, "same"), 10, "{all}");
    assert_eq!(all.matches("10 vs 10").count(), 10, "{all}");
    // The folder is as good as the file in it, and every metric is known.
    fs::create_dir(folder.path().join("run")).expect("writable");
    fs::copy(
        folder.path().join("old.json"),
        folder.path().join("run/report.json"),
    )
    .expect("writable");
    works(folder.path(), "compare run old.json --threshold 0");
    let metrics = "query_ns,locate_ns --metric locate_batched_ns,build_ms";
    let many = compare(folder.path(), &format!("--metric {metrics}"), 0);
    let verdict = "40 same of 40 figures of 10 cells";
    assert!(last_line(&many).ends_with(verdict), "{many}");
}

#[test]
fn twice_the_time_is_slower_and_half_of_it_faster() {
    let slower = with_change(|new| scale(bvh(new), "query_ns", 2.0));
    let text = compare(slower.path(), "", 3);
    let row = row_with(&text, "slower");
    for part in ["uniform 300 orbit", "bvh", "+100.0 % [+"] {
        assert!(row.contains(part), "no '{part}' in: {row}");
    }
    let verdict = "1 slower, 0 inconclusive, 0 faster, 9 same of 10 cells";
    assert_eq!(last_line(&text), verdict, "{text}");
    // By another metric nothing has happened.
    compare(slower.path(), "--metric build_ms", 0);
    compare(slower.path(), "--metric build_ms,query_ns", 3);
    // The threshold says how finely "same" is shown; a proven loss stays one.
    compare(slower.path(), "--threshold 150%", 3);
    let faster = with_change(|new| scale(bvh(new), "query_ns", 0.5));
    let text = compare(faster.path(), "", 0);
    let verdict = "0 slower, 0 inconclusive, 1 faster, 9 same of 10 cells";
    assert_eq!(last_line(&text), verdict, "{text}");
    assert!(row_with(&text, "faster").contains(" -50.0 % [-"), "{text}");
    let finer = compare(faster.path(), "--threshold 0.0001%", 0);
    assert!(finer.contains(", threshold 0.000100 %"), "{finer}");
    assert!(last_line(&finer).contains(" 9 inconclusive"), "{finer}");
}

#[test]
fn what_moves_everything_is_one_line_and_no_verdict() {
    let folder = with_change(|new| {
        let all = cells(new).iter_mut();
        all.for_each(|cell| scale(cell, "query_ns", 1.5));
        scale(bvh(new), "query_ns", 1.2);
    });
    let text = compare(folder.path(), "", 3);
    assert!(
        unwrapped(&text).contains("query_ns of NEW is 150."),
        "{text}"
    );
    assert!(
        last_line(&text).starts_with("1 slower, 0 inconclusive"),
        "{text}"
    );
    assert!(row_with(&text, "slower").contains(" +20."), "{text}");
}

#[test]
fn one_process_and_few_structures_are_inconclusive() {
    let one = with_change(|new| {
        scale(bvh(new), "query_ns", 3.0);
        for cell in cells(new) {
            let first = cell["times"]["by_process"]["query_ns"][0].clone();
            cell["times"]["by_process"]["query_ns"] = json!([first]);
            cell["times"]["processes"] = json!(1);
        }
    });
    let text = compare(one.path(), "", 0);
    for wanted in [
        "0 slower, 10 inconclusive",
        "10 processes vs 1 process,",
        "Nothing was decided",
        "10 inconclusive: ",
        "finer runs, perhaps with --processes 20,",
        "compare --against BINARY",
        "under three processes on a side",
    ] {
        assert!(
            unwrapped(&text).contains(wanted),
            "no '{wanted}' in:\n{text}"
        );
    }
    let found = works(one.path(), "compare old.json new.json --format json");
    assert_eq!(json(&found)["verdict"], "nothing_was_decided");
    let few = with_change(|new| {
        scale(bvh(new), "query_ns", 3.0);
        cells(new).retain(|cell| cell["structure"] == "bvh" || cell["structure"] == "linear");
    });
    let text = compare(few.path(), "", 0);
    assert!(
        last_line(&text).starts_with("0 slower, 4 inconclusive"),
        "{text}"
    );
    assert!(!text.contains("+200.0 %"), "relative to nothing: {text}");
    let why = unwrapped(&text);
    assert!(why.contains("under three other structures"), "{text}");
    assert!(
        why.contains("the same four structures or more would decide"),
        "{text}"
    );
}

#[test]
fn counters_are_compared_exactly() {
    let folder = with_change(|new| {
        let metrics = &mut bvh(new)["metrics"];
        metrics["planes_tested"]["value"] = json!(1e6);
        let bytes = metrics["memory_bytes_per_item"]["value"].as_f64();
        metrics["memory_bytes_per_item"]["value"] = json!(2.0 * bytes.expect("bytes"));
    });
    let text = compare(folder.path(), "", 0);
    let name = "work changed: bvh on uniform:n=300, orbit:frames=8, six-plane: ";
    let told = unwrapped(&text);
    let lines: Vec<&str> = told.split(name).skip(1).collect();
    assert_eq!(lines.len(), 2, "{text}");
    assert!(lines[0].starts_with("planes_tested ") && lines[0].contains(" to 1000000 (+"));
    assert!(lines[1].starts_with("memory_bytes_per_item ") && lines[1].contains(" (+100.0 %) "));
    assert!(last_line(&text).ends_with("10 same of 10 cells"), "{text}");
}

#[test]
fn markdown_holds_the_table() {
    let folder = with_change(|new| scale(bvh(new), "query_ns", 2.0));
    let text = compare(folder.path(), "--markdown", 3);
    let row = text
        .lines()
        .find(|line| line.starts_with("| uniform:n=300 |"));
    let row = row.expect("a row");
    assert!(
        row.contains("| bvh | query\\_ns |") && row.contains("| slower |"),
        "{row}"
    );
    // One line with the verdict, the rest folded.
    let summary = "<details>\n<summary>cullbench: regression: 1 slower, 0 inconclusive, 0 faster, \
        9 same of 10 cells; worst: bvh on uniform:n=300, orbit:frames=8, six-plane: query_ns \
        +100.0 %</summary>\n\n";
    assert!(text.starts_with(summary), "{text}");
    assert!(text.ends_with("\n\n</details>\n"), "{text}");
    all_refused(
        &folder,
        &[format!("{COMPARE} --markdown --format json")],
        "--markdown | --format",
    );
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
            rows(&text, "broken") == 1 && text.contains("a reason"),
            "{text}"
        );
        assert!(
            text.contains(&format!("ok to {name}")) && !text.contains('\x1b'),
            "{text}"
        );
        // Wrong in OLD already, or absent from OLD.
        let twice = with_change(|new| status(bvh(new), name));
        fs::copy(twice.path().join("new.json"), twice.path().join("old.json")).expect("writable");
        assert_eq!(rows(&compare(twice.path(), "", 1), "failed in both"), 1);
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
        assert!(
            unwrapped(&text).contains("of 9 cells; 1 wrong answer only in NEW"),
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
        assert_eq!(rows(&compare(lost.path(), "", 0), "gained"), 1);
        fs::copy(&old, &new).expect("writable");
        // A cell that neither run measured has not failed.
        let both = match name {
            "left_out" => "1 unmeasured",
            _ => "1 failed in both",
        };
        assert!(
            last_line(&compare(lost.path(), "", 0)).contains(both),
            "{name}"
        );
    }
}

#[test]
fn another_question_is_not_judged_by_its_time() {
    type Row = (fn(&mut Value), &'static str);
    let changes: [Row; 6] = [
        (|cell| cell["scene"]["digest"] = json!("0"), "other items"),
        (|cell| cell["path"]["digest"] = json!("0"), "other cameras"),
        (
            |cell| cell["path"]["camera_count"] = json!(9),
            "8 cameras and 9",
        ),
        (
            |cell| cell["metrics"]["visible_count"]["value"] = json!(1e300),
            " and 1e300",
        ),
        (
            |cell| cell["times"]["cameras_timed"] = json!(9),
            "8 cameras timed and 9",
        ),
        (
            |cell| cell["times"]["batch"] = json!(1 << 20),
            "and 1048576 queries",
        ),
    ];
    for (change, reason) in changes {
        let folder = with_change(|new| {
            scale(bvh(new), "query_ns", 9.0);
            change(bvh(new));
        });
        let text = compare(folder.path(), "", 0);
        assert!(
            rows(&text, "different") == 1 && text.contains(reason),
            "{text}"
        );
        assert!(last_line(&text).contains("9 same of 10 cells"), "{text}");
        // All of them: nothing is left that could say "no regression".
        let all = with_change(|new| cells(new).iter_mut().for_each(change));
        let wanted =
            format!("nothing can be judged | 10 with another question or answer | {reason}");
        all_refused(&all, &[COMPARE], &wanted);
    }
    // An older report does not know its cameras.
    let older = with_change(|new| bvh(new)["path"]["digest"] = json!(null));
    assert!(last_line(&compare(older.path(), "", 0)).contains("10 same"));
}

#[test]
fn figures_that_no_ratio_can_be_taken_of_are_counted() {
    let with_value =
        |value: f64| with_change(|new| bvh(new)["metrics"]["query_ns"]["value"] = json!(value));
    for value in [0.0, -5.0] {
        let text = compare(with_value(value).path(), "", 0);
        let verdict = "0 slower, 1 unmeasured, 0 inconclusive, 0 faster, 9 same of 10 cells";
        assert!(last_line(&text).starts_with(verdict), "{text}");
        assert!(row_with(&text, "unmeasured").starts_with("bvh"), "{text}");
        let why = unwrapped(&text);
        assert!(why.contains("have no ratio (bvh on"), "{text}");
    }
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
    // In neither report: counted, not shown, and no success alone.
    let mut neither = measured().clone();
    for cell in cells(&mut neither) {
        let metrics = cell["metrics"].as_object_mut().expect("an object");
        metrics.remove("locate_ns");
    }
    for file in ["old.json", "new.json"] {
        fs::write(gone.path().join(file), neither.to_string()).expect("writable");
    }
    let text = compare(gone.path(), "--metric query_ns,locate_ns", 0);
    assert!(last_line(&text).contains("10 unmeasured"), "{text}");
    assert!(!text.contains("on neither side"), "{text}");
    all_refused(
        &gone,
        &[format!("{COMPARE} --metric locate_ns")],
        "nothing can be judged | 10 without a figure | on neither side",
    );
}

#[test]
fn cells_of_one_side_and_other_settings_are_said() {
    let folder = with_change(|new| {
        bvh(new)["structure"] = json!("bvh:leaf=2");
        new["machine"]["cpu"] = json!("Another");
        new["toolchain"]["flags"] = json!("-C target-cpu=native");
        new["run"]["finished_at"] = json!(null);
        new["source"]["dirty"] = json!(true);
    });
    let text = compare(folder.path(), "", 0);
    for wanted in [
        "only in OLD: 1 cell (bvh on uniform:n=300, orbit:frames=8, six-plane)",
        "only in NEW: 1 cell (bvh:leaf=2 on",
        "beside other structures, those in both may take other times",
        "note: machine differs: cpu '",
        "note: different machines:",
        "note: toolchain differs: flags '' and '-C target-cpu=native'",
        "note: NEW was built from a dirty working tree",
        "note: NEW is a run that was not finished",
    ] {
        assert!(
            unwrapped(&text).contains(wanted),
            "no '{wanted}' in:\n{text}"
        );
    }
    assert!(last_line(&text).contains("9 same of 9 cells"), "{text}");
}

#[test]
fn cells_of_the_same_short_name_are_told_apart() {
    let folder = with_change(|new| scale(bvh(new), "query_ns", 2.0));
    for file in ["old.json", "new.json"] {
        let path = folder.path().join(file);
        let text = fs::read_to_string(&path).expect("a report");
        // Two paths whose short names are the same.
        fs::write(&path, text.replace("outside:frames=8", "orbit:frames=9")).expect("writable");
    }
    let text = compare(folder.path(), "", 3);
    let row = row_with(&text, "slower");
    assert!(row.contains(" uniform:n=300 orbit:frames=8 "), "{text}");
    let text = compare(folder.path(), "--all", 3);
    for frames in [8, 9] {
        let name = format!("  uniform:n=300 orbit:frames={frames}  ");
        assert!(text.matches(&name).count() >= 5, "{text}");
    }
}

#[test]
fn a_run_that_was_stopped_is_to_be_finished() {
    let folder = with_change(|new| {
        new["run"]["finished_at"] = Value::Null;
        cells(new).retain(|cell| cell["structure"] == "bvh");
    });
    let text = unwrapped(&compare(folder.path(), "", 0));
    assert!(
        text.contains("2 inconclusive: finish the run that was stopped"),
        "{text}"
    );
}
