//! `compare`: its JSON, reports it cannot compare, files it must not overwrite.

use std::fs;

use serde_json::json;

use super::compare::{COMPARE, bvh, cells, compare, measured, scale, with_change};
use super::process::*;

#[test]
fn json_says_the_same_with_types() {
    let folder = with_change(|new| {
        scale(bvh(new), "query_ns", 2.0);
        bvh(new)["metrics"]["planes_tested"]["value"] = json!(1e6);
        let last = cells(new).pop().expect("a cell");
        assert_eq!(last["structure"], "bsp");
    });
    let done = json(&compare(folder.path(), "--format json", 3));
    let fields = "old new verdict gate counts head notes settings advice threshold cells_in_common rows \
        work_changed only_in_old only_in_new common_shifts";
    assert_eq!(keys(&done), set(fields));
    assert_eq!(done["verdict"], "regression");
    let head = "id started_at finished_at command version commit dirty cells";
    assert_eq!(keys(&done["old"]), set(head));
    assert_eq!(
        (&done["old"]["cells"], &done["new"]["cells"]),
        (&json!(10), &json!(9))
    );
    assert_eq!(done["advice"], json!(null));
    let outcomes = "broken lost slower more_work different unmeasured failed_in_both gained \
        inconclusive faster less_work same";
    assert_eq!(keys(&done["counts"]), set(outcomes));
    assert_eq!(
        (&done["counts"]["slower"], &done["counts"]["same"]),
        (&json!(1), &json!(8))
    );
    let rows = done["rows"].as_array().expect("an array");
    assert_eq!(rows.len(), 9);
    let row = "verdict scene path cache test arithmetic planes epsilon structure metric old new \
        judgement processes old_status new_status reason";
    assert!(rows.iter().all(|one| keys(one) == set(row)));
    let worst = &rows[0];
    assert_eq!(
        (&worst["verdict"], &worst["structure"]),
        (&json!("slower"), &json!("bvh"))
    );
    let judged = &worst["judgement"];
    let figures = "change ratio lower upper resolution more_pairs pairs";
    assert_eq!(keys(judged), set(figures));
    let figure = |name: &str| judged[name].as_f64().expect(name);
    assert!((figure("ratio") - 2.0).abs() < 1e-9, "{judged}");
    assert!(figure("lower") < 2.0 && 2.0 < figure("upper"), "{judged}");
    assert_eq!(
        (&judged["pairs"], &worst["processes"]),
        (&json!(10), &json!([10, 10]))
    );
    let [old, new] = ["old", "new"].map(|side| worst[side].as_f64().expect(side));
    assert_eq!(new, 2.0 * old);
    let work = &done["work_changed"][0];
    assert_eq!(
        (&work["structure"], &work["counter"], &work["new"]),
        (&json!("bvh"), &json!("planes_tested"), &json!(1e6))
    );
    let lone = &done["only_in_old"][0];
    assert_eq!(
        (&lone["structure"], &lone["status"]),
        (&json!("bsp"), &json!("ok"))
    );
    assert_eq!(done["only_in_new"], json!([]));
    let shift = &done["common_shifts"][0];
    assert_eq!(keys(shift), set("group metric ratio lower upper cells"));
    assert_eq!(shift["cells"], json!(9));
    let same = json(&works(
        folder.path(),
        "compare old.json old.json --format json",
    ));
    assert_eq!(
        (&same["verdict"], &same["counts"]["same"]),
        (&json!("ok"), &json!(10))
    );
}

#[test]
fn what_cannot_be_compared_is_refused_in_one_line() {
    let folder = with_change(|new| cells(new).truncate(3));
    let mut other = measured().clone();
    for cell in cells(&mut other) {
        cell["scene"]["name"] = json!("another");
    }
    let mut twice = measured().clone();
    let again = cells(&mut twice)[1].clone();
    cells(&mut twice).push(again);
    let half = &measured().to_string()[..3000];
    for (file, text) in [
        ("half.json", half),
        ("other.json", &other.to_string()),
        ("twice.json", &twice.to_string()),
        ("noise.json", "\u{1}{"),
    ] {
        fs::write(folder.path().join(file), text).expect("writable");
    }
    for (file, wanted) in [
        ("missing.json", "missing.json: No such file"),
        ("half.json", "half.json | expected the report of a run"),
        ("noise.json", "noise.json | expected the report of a run"),
        (
            "twice.json",
            "twice.json, uniform:n=300: linear on orbit:frames=8 a second time; expected each cell once",
        ),
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
        (
            "--metric query_ns,frame_ns",
            "--metric frame_ns: nothing moves in NEW; expected a run with --motion",
        ),
        ("--metric update_ns", "--metric update_ns: nothing moves"),
        ("--metric ,", "unknown metric '' | known: query_ns"),
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

/// The files of a run are inputs, whichever of them is named.
#[test]
fn no_page_takes_the_place_of_an_input() {
    let folder = with_change(|_| ());
    let at = |name: &str| folder.path().join(name);
    for name in ["run", "results/baselines"] {
        fs::create_dir_all(at(name)).expect("made");
    }
    fs::copy(at("old.json"), at("run/report.json")).expect("writable");
    fs::copy(at("old.json"), at("results/baselines/main.json")).expect("writable");
    for name in ["summary.csv", "samples.csv", "stream.jsonl"] {
        fs::write(at("run").join(name), name).expect("writable");
    }
    let mut lines = vec![
        "compare --baseline main new.json --html results/baselines/main.json".to_owned(),
        "compare --baseline main run --html run/report.json".to_owned(),
        format!("compare --against {0} --html {0}", super::PROGRAM),
    ];
    for name in ["report.json", "summary.csv", "samples.csv", "stream.jsonl"] {
        lines.extend([
            format!("compare run new.json --html run/{name}"),
            format!("compare new.json run/report.json --html run/{name}"),
            format!("report run --html run/{name}"),
            format!("report run/report.json --markdown run/{name}"),
            format!("report run new.json --history run/{name}"),
        ]);
    }
    all_refused(
        &folder,
        &lines,
        "an input or another output; expected a file",
    );
    works(folder.path(), "report run --html run/report.html");
    works(folder.path(), "report run --html run/report.html");
}
