//! `advise`: the fields of its JSON, every rule once with both sides checked,
//! statistics against plain expectations, options that turn a decision, and
//! refusals. Where the clock decides, no decision is judged.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::OnceLock;

use serde_json::Value;

use super::BOXES;
use super::advise_motion::moving;
use super::process::*;

const SMALL: &str =
    "advise --scene uniform:n=900 --path orbit:frames=6 --structure linear,wide,bvh --processes";
const RULES: &str = "needless-planes plane-masks no-index six-planes regions occlusion \
     back-faces third-dimension rebasing rebuild f64-kernel frame-correction";

/// Advice from one process, for checks of everything but times.
pub fn advice(folder: &Path, line: &str) -> Value {
    json(&works(
        folder,
        &format!("{line} --processes 1 --format json"),
    ))
}

/// The outcome of [`SMALL`], made once for all tests here.
pub fn small() -> &'static Value {
    static OUTCOME: OnceLock<Value> = OnceLock::new();
    OUTCOME.get_or_init(|| json(&works(Path::new("."), &format!("{SMALL} 4 --format json"))))
}

/// The ratio is that of the two times shown, within its interval.
fn assert_ratio(check: &Value) {
    let [kept, left_out] = ["kept", "left_out"].map(|side| number(&check[side], "ns"));
    let shown = kept / left_out;
    assert!(
        (number(check, "ratio") / shown - 1.0).abs() < 1e-9,
        "{check}"
    );
    let ends = ["lower", "upper"].map(|end| number(check, &format!("ratio_{end}")));
    assert!(
        ends[0] <= shown * (1.0 + 1e-9) && shown <= ends[1] * (1.0 + 1e-9),
        "{check}"
    );
}

/// The value of a metric of a cell.
pub fn metric(row: &Value, name: &str) -> f64 {
    number(&row["metrics"][name], "value")
}

pub fn rule<'a>(advice: &'a Value, name: &str) -> &'a Value {
    let mut rules = array(advice, "omissions").iter();
    rules.find(|o| o["rule"] == name).expect(name)
}

#[test]
fn json_has_the_documented_fields() {
    let top = "draw_ns processes twin structure test omissions motion changes";
    let times = "query_ns query_ns_lower query_ns_upper";
    let test_row = format!(
        "structure test {times} excess false_negative_ppm false_positives_per_query total_ns"
    );
    let omission = "rule left_out statistic_name statistic threshold saving decision tie reason \
         cost_ns check";
    let side = "ns excess false_positives_per_query false_negative_ppm";
    let told = include_str!("../../docs/METHODOLOGY.md");
    let documented = |fields: &str| {
        for field in set(fields) {
            assert!(told.contains(&format!("`{field}`")), "{field}");
        }
    };
    let advice = small();
    let one = |value: &Value, fields: &str| {
        assert_eq!(keys(value), set(fields));
        documented(fields);
    };
    one(advice, top);
    one(&advice["twin"], "value lower upper");
    one(&advice["structure"], "name ties rows");
    one(&advice["test"], "name ties structure rows");
    array(&advice["test"], "rows")
        .iter()
        .for_each(|row| one(row, &test_row));
    for row in array(advice, "omissions") {
        one(row, omission);
        let check = &row["check"];
        if !check.is_null() {
            one(
                check,
                "on kept left_out ratio ratio_lower ratio_upper same_answers",
            );
            ["kept", "left_out"]
                .iter()
                .for_each(|own| one(&check[own], side));
        }
    }
    let first = &array(&advice["structure"], "rows")[0];
    assert_eq!(
        (
            &first["scene"]["total_count"],
            &first["path"]["camera_count"]
        ),
        (&900.into(), &6.into())
    );
    assert!(advice["motion"].is_null());
    let moving = moving();
    one(&moving["motion"], "policy policy_ties policies ruled_out");
    for advice in [advice, moving] {
        for change in array(advice, "changes") {
            one(change, "axis here not_varied measured below above");
            for turn in ["below", "above"].map(|side| &change[side]) {
                if !turn.is_null() {
                    one(turn, "structure at lower upper");
                    let at = ["lower", "at", "upper"].map(|name| number(turn, name));
                    assert!(at.is_sorted() && at[0] > 0.0, "{turn}");
                    assert_ne!(turn["structure"], advice["structure"]["name"]);
                }
            }
        }
    }
}

#[test]
fn every_rule_is_there_once_with_both_sides_checked() {
    let omissions = array(small(), "omissions");
    let names: Vec<&str> = omissions
        .iter()
        .filter_map(|o| o["rule"].as_str())
        .collect();
    assert_eq!(names.len(), set(RULES).len());
    assert_eq!(names.iter().copied().collect::<BTreeSet<_>>(), set(RULES));
    let told = include_str!("../../docs/METHODOLOGY.md");
    for omission in omissions {
        let name = omission["rule"].as_str().expect("a name");
        assert!(told.contains(&format!("\n| {name} |")), "{name}");
        let taken = small()["structure"]["name"].as_str().expect("a name");
        let of_nodes = set("plane-masks third-dimension").contains(name);
        if set("regions rebuild").contains(name) || of_nodes && taken == "linear" {
            // Boxes in the open and at rest, or no nodes.
            assert_eq!(omission["decision"], "not_applicable", "{omission}");
            assert!(omission["cost_ns"].is_null(), "{omission}");
            continue;
        }
        let (statistic, threshold) = (number(omission, "statistic"), number(omission, "threshold"));
        let predicted = statistic <= threshold;
        let check = &omission["check"];
        assert!(check.is_object(), "{omission}");
        assert!(number(omission, "saving") < 1.0);
        assert!(
            ["leave_out", "keep"]
                .map(Value::from)
                .contains(&omission["decision"])
        );
        // Where nothing but time differs and it differs by far, the clock decides.
        if set("needless-planes plane-masks third-dimension").contains(name) {
            let (lower, upper) = (number(check, "ratio_lower"), number(check, "ratio_upper"));
            if lower > 1.2 || upper < 0.8 {
                let wanted = if lower > 1.2 { "leave_out" } else { "keep" };
                assert_eq!(omission["decision"], wanted, "{omission}");
            }
            let excess = ["kept", "left_out"].map(|side| &check[side]["excess"]);
            assert_eq!(excess[0], excess[1], "{omission}");
            assert_eq!(check["same_answers"], true, "{omission}");
        } else if set("rebasing f64-kernel").contains(name) && !predicted {
            assert_eq!(omission["decision"], "keep", "{omission}");
        }
        assert!(number(&check["kept"], "ns") > 0.0 && number(&check["left_out"], "ns") > 0.0);
        assert_ratio(check);
        if name == "frame-correction" {
            let reason = omission["reason"].as_str().expect("a reason");
            assert!(
                reason.contains("500 steps are timed; error after 6"),
                "{reason}"
            );
        }
        // What is hidden is in the frustum all the same: another truth.
        if !set("occlusion back-faces frame-correction").contains(name) {
            for side in ["kept", "left_out"] {
                let missed = number(&check[side], "false_negative_ppm");
                assert_eq!(missed, 0.0, "{omission}");
            }
        }
    }
}

#[test]
fn index_and_third_dimension_follow_the_structure_taken() {
    for (scene, structures) in [
        ("uniform:n=900", "linear,octree"),
        ("uniform:n=900", "linear,quadtree"),
        ("uniform:n=8", "linear,octree-textbook"),
    ] {
        let line = format!("advise --scene {scene} --path orbit:frames=4 --structure {structures}");
        let advice = advice(Path::new("."), &line);
        let taken = advice["structure"]["name"].as_str().expect("a structure");
        let index = &rule(&advice, "no-index")["decision"];
        let third = &rule(&advice, "third-dimension")["decision"];
        match taken {
            "linear" => assert_eq!(index, "leave_out", "{advice}"),
            "quadtree" => assert_eq!([index, third], ["keep", "leave_out"], "{advice}"),
            _ => assert_eq!([index, third], ["keep", "keep"], "{advice}"),
        }
    }
}

#[test]
fn tests_and_structures_have_their_rows() {
    let structure = &small()["structure"];
    let rows = array(structure, "rows");
    let names: BTreeSet<&str> = rows
        .iter()
        .filter_map(|r| r["structure"].as_str())
        .collect();
    assert_eq!(names, set("linear wide bvh"));
    assert_eq!(structure["name"], rows[0]["structure"]);
    let times: Vec<f64> = rows.iter().map(|row| metric(row, "query_ns")).collect();
    assert!(times.is_sorted(), "{times:?}");
    // A scan that is taken has four rows, and the tree four more.
    let rows = &array(&small()["test"], "rows")[..4];
    assert!(
        rows.iter()
            .all(|row| row["structure"] == rows[0]["structure"])
    );
    let names: Vec<&str> = rows.iter().filter_map(|r| r["test"].as_str()).collect();
    assert_eq!(names, ["sphere", "six-plane", "six-box", "exact"]);
    let excess: Vec<f64> = rows
        .iter()
        .map(|row| number(&row["excess"], "value"))
        .collect();
    assert!(
        excess.is_sorted_by(|a, b| a >= b) && excess[3] == 0.0,
        "{excess:?}"
    );
    for row in rows {
        assert_eq!(number(&row["false_negative_ppm"], "value"), 0.0);
        let drawn = number(row, "false_positives_per_query") * 1000.0;
        let total = number(row, "query_ns") + drawn;
        assert!((number(row, "total_ns") - total).abs() < 1e-6 * total);
    }
}

#[test]
fn one_process_gives_the_same_answers_without_intervals_or_ties() {
    let one = json(&works(Path::new("."), &format!("{SMALL} 1 --format json")));
    let processes = [small(), &one].map(|advice| number(advice, "processes"));
    assert_eq!(processes, [4.0, 1.0]);
    assert!(array(&one["structure"], "ties").is_empty());
    assert!(array(&one["test"], "ties").is_empty());
    let rows = [small(), &one].map(|advice| array(advice, "omissions"));
    let has_interval = |row: &Value, time: &str| {
        let ends = ["lower", "upper"].map(|end| row[format!("{time}_{end}")].is_number());
        assert_eq!(ends[0], ends[1]);
        ends[0]
    };
    for (many, one) in rows[0].iter().zip(rows[1]) {
        assert_eq!(many["rule"], one["rule"]);
        let (many, one) = (&many["check"], &one["check"]);
        if many.is_object() && one.is_object() {
            assert!(
                has_interval(many, "ratio") && !has_interval(one, "ratio"),
                "{one}"
            );
            assert_eq!(many["same_answers"], one["same_answers"]);
            for side in ["kept", "left_out"] {
                assert_eq!(many[side]["excess"], one[side]["excess"], "{side}");
            }
        }
    }
    for (advice, wanted) in [(small(), true), (&one, false)] {
        let mut rows = array(&advice["test"], "rows").iter();
        assert!(rows.all(|row| has_interval(row, "query_ns") == wanted));
        let mut cells = array(&advice["structure"], "rows").iter();
        assert!(cells.all(|cell| cell["metrics"]["query_ns"]["lower"].is_number() == wanted));
    }
}

#[test]
fn planes_that_hold_the_scene_are_counted() {
    // From far away and looking on, the scene is inside of near, far and the sides.
    let cameras = "eye_x,eye_y,eye_z,look_x,look_y,look_z,near,far\n\
         -90,0,0,0,0,0,1,500\n-90,0,0,-200,0,0,1,500\n";
    let scene = format!("{BOXES}\n-1,-1,-1,1,1,1\n3,3,3,4,4,4\n");
    let folder = folder(&[("s.csv", scene.as_bytes()), ("c.csv", cameras.as_bytes())]);
    let advice = advice(folder.path(), "advise --scene s.csv --path c.csv");
    let planes = rule(&advice, "needless-planes");
    // All six of the first camera; of the second, which looks away, only the
    // far plane and the sides that open towards the scene as well.
    let reason = planes["reason"].as_str().expect("a reason");
    assert!(reason.contains("of 12 planes"), "{reason}");
    assert!(number(planes, "statistic") <= 5.0 / 12.0, "{planes}");
    assert!(number(planes, "statistic") > 0.0, "{planes}");
}

#[test]
fn far_scenes_are_moved_and_flat_ones_known() {
    let near = format!("{BOXES}\n0,0,0,1,1,1\n5,0,0,6,1,1\n");
    let far = near
        .replace("\n0,", "\n1000000,")
        .replace("\n5,0,0,6", "\n1000005,0,0,1000006");
    let far = far.replace("0,0,1,1,1", "0,0,1000001,1,1");
    let folder = folder(&[("near.csv", near.as_bytes()), ("far.csv", far.as_bytes())]);
    let of = |scene: &str| {
        let line = format!("advise --scene {scene} --path orbit:frames=3 --structure linear,wide");
        advice(folder.path(), &line)
    };
    let (near, far) = (of("near.csv"), of("far.csv"));
    // The clock may speak for it all the same.
    let tolerated = rule(&near, "rebasing");
    assert!(number(tolerated, "statistic") <= number(tolerated, "threshold"));
    let rebasing = rule(&far, "rebasing");
    assert_eq!(rebasing["decision"], "keep");
    assert!(number(rebasing, "statistic") > 1e4 * number(rule(&near, "rebasing"), "statistic"));
    let check = &rebasing["check"];
    assert!(
        number(&check["left_out"], "excess") > number(&check["kept"], "excess"),
        "{check}"
    );
    // Moved, the scene is as good as the near one.
    let f64s = [&near, &far].map(|advice| number(rule(advice, "f64-kernel"), "statistic"));
    assert!((f64s[0] / f64s[1]).ln().abs() < 1.0, "{f64s:?}");
    let flat = advice(
        Path::new("."),
        "advise --scene us-counties --path orbit:frames=2 --structure linear,wide",
    );
    let third = rule(&flat, "third-dimension");
    if third["decision"] != "not_applicable" {
        assert_eq!(number(third, "statistic"), 0.0);
    }
}

#[test]
fn scenes_of_any_extent_have_a_depth() {
    let head = "min_x,min_y,min_z,max_x,max_y,max_z\n";
    let point = format!("{head}3,4,5,3,4,5\n");
    let huge =
        format!("{head}-2e37,-2e37,-2e37,-1e37,-1e37,-1e37\n1e37,1e37,1e37,2e37,2e37,3e37\n");
    let cameras = "eye_x,eye_y,eye_z,look_x,look_y,look_z,near,far\n0,0,0,3,4,5,0.1,inf\n";
    let files = [
        ("point.csv", &point[..]),
        ("huge.csv", &huge),
        ("cameras.csv", cameras),
    ];
    let folder = folder(&files.map(|(name, text)| (name, text.as_bytes())));
    for scene in ["point.csv", "huge.csv"] {
        let line = format!("advise --scene {scene} --path cameras.csv --structure linear,bvh");
        let advice = advice(folder.path(), &line);
        let reason = |name: &str| {
            rule(&advice, name)["reason"]
                .as_str()
                .expect("a reason")
                .to_owned()
        };
        for name in ["rebasing", "f64-kernel", "six-planes", "third-dimension"] {
            let reason = reason(name);
            let is_number = |word: &str| !["inf", "NaN"].contains(&word) && word.len() < 24;
            assert!(
                reason.split([' ', '(', ')']).all(is_number),
                "{scene}: {reason}"
            );
        }
    }
}

#[test]
fn the_cost_of_drawing_decides_about_the_axes() {
    // Items as large as the view is deep, so that six planes let many through.
    let of = |more: &str| {
        let line =
            "advise --scene forest:n=400 --path orbit:frames=4 --structure linear,wide --far 200";
        advice(Path::new("."), &format!("{line} {more}"))
    };
    let dear = of("--draw-ns 1e12");
    assert_eq!(rule(&dear, "six-planes")["decision"], "keep");
    assert_eq!(dear["test"]["name"], "exact");
    let agree = |advice: &serde_json::Value| {
        let taken = advice["test"]["name"].as_str().expect("a test");
        let decision = match taken {
            "six-plane" | "sphere" => "leave_out",
            _ => "keep",
        };
        assert_eq!(rule(advice, "six-planes")["decision"], decision, "{taken}");
    };
    agree(&dear);
    let cheap = of("--draw-ns 0");
    assert_eq!(number(rule(&cheap, "six-planes"), "statistic"), 0.0);
    agree(&cheap);
}

#[test]
fn bad_items_that_are_left_out_are_in_the_result() {
    let scene = format!("{BOXES}\n0,0,0,1,1,1\n9,0,0,1,1,1\n5,0,0,6,1,1\n");
    let folder = folder(&[("s.csv", scene.as_bytes())]);
    let line = "advise --scene s.csv --path orbit:frames=2 --structure linear,wide";
    all_refused(&folder, &[line], "s.csv");
    let done = cullbench(
        folder.path(),
        &format!("{line} --skip-bad-items --processes 1 --format json"),
    );
    assert_eq!(done.code, Some(0), "{done:?}");
    let advice = json(&done.out);
    let scene = &array(&advice["structure"], "rows")[0]["scene"];
    let counts = ["skipped_items", "total_count"].map(|name| number(scene, name));
    assert_eq!(counts, [1.0, 2.0]);
}

#[test]
fn the_advice_fits_eighty_columns_and_the_evidence_is_asked_for() {
    let line = format!("{SMALL} 1");
    let told = works(Path::new("."), &line);
    assert!(
        told.contains("1 process: times without intervals"),
        "{told}"
    );
    assert!(
        told.lines().all(|line| line.chars().count() <= 80),
        "{told}"
    );
    for part in ["\nTake structure ", ", test ", "\nindex  "] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let head = told.lines().find(|line| line.starts_with("feature "));
    assert!(head.is_some_and(|line| line.ends_with("ratio")), "{told}");
    // What is assumed stands in its line.
    let culling = told.lines().find(|line| line.contains("occlusion culling"));
    assert!(
        culling.is_some_and(|line| line.contains("1,000 ns/item")),
        "{told}"
    );
    let all = works(Path::new("."), &format!("{line} --all-columns"));
    assert!(!all.contains('\u{1b}'), "{all}");
    assert!(all.contains("\nTake structure "), "{all}");
    // A row is a line, however wide.
    let is_cut = |line: &str| line.starts_with(['[', '/']) || line.starts_with("extras");
    assert!(!all.lines().any(is_cut), "{all}");
    for feature in ["plane masks", "index", "portals", "orthonormalization"] {
        assert!(all.contains(&format!("\n{feature} ")), "{feature}: {all}");
    }
    // The help explains every name and every answer.
    let help = works(Path::new("."), "advise --help");
    for omission in array(small(), "omissions") {
        let name = omission["left_out"].as_str().expect("a name");
        assert!(help.contains(&format!("\n  {name} ")), "{name}: {help}");
    }
    assert!(help.contains("either where the costs"), "{help}");
    // One vocabulary: use or not, with and without.
    for word in ["leave out", "left out", "keep", "kept"] {
        for told in [&told, &all] {
            assert!(!told.contains(word), "{word}: {told}");
        }
    }
}

#[test]
fn mistakes_are_one_line() {
    let folder = with_good_files(&[]);
    let line = "advise --scene scene.csv --path cameras.csv";
    for (more, wanted) in [
        ("--structure bhv", "bhv | did you mean 'bvh'"),
        ("--draw-ns -1", "--draw-ns is '-1' | at least 0"),
        ("--draw-ns nan", "--draw-ns is 'nan'"),
        ("--processes 0", "0 | --processes"),
        ("--fovy 0", "--fovy is '0'"),
        ("--update refit", "--motion"),
    ] {
        all_refused(&folder, &[format!("{line} {more}")], wanted);
    }
    all_refused(&folder, &["advise --scene nothing.csv"], "nothing.csv");
}
