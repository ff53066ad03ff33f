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
     cones sorting third-dimension rebasing rebuild f64-kernel frame-correction";

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
fn assert_ratio(row: &Value, [ratio, time, other]: &[&str; 3]) {
    let shown = number(row, time) / number(row, other);
    assert!((number(row, ratio) / shown - 1.0).abs() < 1e-9, "{row}");
    let ends = ["lower", "upper"].map(|end| number(row, &format!("{ratio}_{end}")));
    assert!(
        ends[0] <= shown * (1.0 + 1e-9) && shown <= ends[1] * (1.0 + 1e-9),
        "{row}"
    );
}

pub fn rule<'a>(advice: &'a Value, name: &str) -> &'a Value {
    let mut rules = array(advice, "omissions").iter();
    rules.find(|o| o["rule"] == name).expect(name)
}

#[test]
fn json_has_the_documented_fields() {
    let top = "scene path items skipped_items cameras options processes twin structure test omissions \
         warnings motion threads changes";
    let options = "draw_ns shade_ns tolerance moved queries_per_update";
    let structure = "name ties region_search region_search_ties rows";
    let times = "query_ns query_ns_lower query_ns_upper";
    let structure_row = format!(
        "structure status reason {times} speedup build_ms memory_bytes_per_item \
         break_even_queries locate_ns frame_ns frame_ns_lower frame_ns_upper update_ns worst_frame_ns"
    );
    let test = "name ties structure rows";
    let test_row =
        format!("test {times} excess false_negative_ppm false_positives_per_query total_ns");
    let omission = "rule left_out statistic_name statistic threshold left_out_if predicted saving \
         decision confirmed reason checks tie";
    let check = "on kept_ns left_out_ns ratio ratio_lower ratio_upper same_answers same_expected \
         kept_excess left_out_excess kept_false_negative_ppm left_out_false_negative_ppm";
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
    one(&advice["options"], options);
    one(&advice["twin"], "value lower upper");
    one(&advice["structure"], structure);
    one(&advice["test"], test);
    for (rows, fields) in [
        (array(&advice["structure"], "rows"), structure_row.as_str()),
        (array(&advice["test"], "rows"), test_row.as_str()),
        (array(advice, "omissions"), omission),
    ] {
        assert!(!rows.is_empty());
        rows.iter().for_each(|row| one(row, fields));
    }
    for omission in array(advice, "omissions") {
        array(omission, "checks")
            .iter()
            .for_each(|row| one(row, check));
    }
    assert_eq!(
        (number(advice, "items"), number(advice, "cameras")),
        (900.0, 6.0)
    );
    assert!(advice["motion"].is_null() && array(advice, "threads").is_empty());
    let moving = moving();
    one(
        &moving["motion"],
        "name share_moved views policy policy_ties policies ruled_out",
    );
    one(
        &array(moving, "threads")[0],
        "structure shares_views wall_ns wall_gain cpu_ratio",
    );
    for advice in [advice, moving] {
        for change in array(advice, "changes") {
            one(change, "axis here measured below above");
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
        if name == "regions" {
            // Boxes in the open: the rule has a test of its own.
            assert_eq!(omission["decision"], "not_applicable", "{omission}");
            continue;
        }
        let (statistic, threshold) = (number(omission, "statistic"), number(omission, "threshold"));
        let wanted = match omission["left_out_if"].as_str() {
            Some("at_most") => statistic <= threshold,
            Some("at_least") => statistic >= threshold,
            other => panic!("{other:?}"),
        };
        assert_eq!(omission["predicted"], wanted, "{omission}");
        // A frame is walked, and the walk outweighs the estimate.
        if name == "frame-correction" {
            let agrees = (omission["decision"] == "leave_out") == wanted;
            assert_eq!(omission["confirmed"], agrees, "{omission}");
        } else {
            assert!(!array(omission, "checks").is_empty(), "{omission}");
        }
        assert!(number(omission, "saving") < 1.0);
        assert!(
            ["leave_out", "keep"]
                .map(Value::from)
                .contains(&omission["decision"])
        );
        // Where nothing but time differs and it differs by far, the clock decides.
        let by_time = set("needless-planes plane-masks third-dimension").contains(name);
        if let Some(check) = array(omission, "checks").first().filter(|_| by_time) {
            let (lower, upper) = (number(check, "ratio_lower"), number(check, "ratio_upper"));
            if lower > 1.2 || upper < 0.8 {
                let wanted = if lower > 1.2 { "leave_out" } else { "keep" };
                assert_eq!(omission["decision"], wanted, "{omission}");
            }
        }
        for check in array(omission, "checks") {
            assert!(number(check, "kept_ns") > 0.0 && number(check, "left_out_ns") > 0.0);
            assert_ratio(check, &["ratio", "kept_ns", "left_out_ns"]);
            if check["same_expected"] == true {
                assert_eq!(check["same_answers"], true, "{omission}");
                assert_eq!(check["kept_excess"], check["left_out_excess"], "{omission}");
            }
            // What is hidden is in the frustum all the same: another truth.
            if !set("rebuild occlusion cones sorting").contains(name) {
                for side in ["kept", "left_out"] {
                    let missed = number(check, &format!("{side}_false_negative_ppm"));
                    assert_eq!(missed, 0.0, "{omission}");
                }
            }
        }
    }
    let expected = |name: &str| {
        let checks = array(rule(small(), name), "checks");
        checks.iter().all(|check| check["same_expected"] == true)
    };
    for name in "needless-planes plane-masks no-index third-dimension rebuild".split(' ') {
        assert!(expected(name), "{name}");
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
    let times: Vec<f64> = rows.iter().map(|row| number(row, "query_ns")).collect();
    assert!(times.is_sorted(), "{times:?}");
    let rows = array(&small()["test"], "rows");
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
    for name in ["ties", "region_search_ties"] {
        assert!(array(&one["structure"], name).is_empty(), "{name}");
    }
    assert!(array(&one["test"], "ties").is_empty());
    let both = |name: &str| {
        let rows = [small(), &one].map(|advice| array(advice, name));
        rows[0].iter().zip(rows[1])
    };
    let has_interval = |row: &Value, time: &str| {
        let ends = ["lower", "upper"].map(|end| row[format!("{time}_{end}")].is_number());
        assert_eq!(ends[0], ends[1]);
        ends[0]
    };
    for (many, one) in both("omissions") {
        assert_eq!(many["rule"], one["rule"]);
        for (many, one) in array(many, "checks").iter().zip(array(one, "checks")) {
            assert!(
                has_interval(many, "ratio") && !has_interval(one, "ratio"),
                "{one}"
            );
            for field in set("on same_answers same_expected kept_excess left_out_excess") {
                assert_eq!(many[field], one[field], "{field}");
            }
        }
    }
    for name in ["structure", "test"] {
        for (advice, wanted) in [(small(), true), (&one, false)] {
            let mut rows = array(&advice[name], "rows").iter();
            assert!(
                rows.all(|row| has_interval(row, "query_ns") == wanted),
                "{name}"
            );
        }
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
    assert!(number(planes, "statistic") >= 7.0 / 12.0, "{planes}");
    assert!(number(planes, "statistic") < 1.0, "{planes}");
    assert_eq!(planes["predicted"], true);
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
    assert_eq!(rule(&near, "rebasing")["decision"], "leave_out");
    let rebasing = rule(&far, "rebasing");
    assert_eq!(rebasing["decision"], "keep");
    assert!(number(rebasing, "statistic") > 1e4 * number(rule(&near, "rebasing"), "statistic"));
    let check = &array(rebasing, "checks")[0];
    assert!(
        number(check, "left_out_excess") > number(check, "kept_excess"),
        "{check}"
    );
    // Moved, the scene is as good as the near one.
    let f64s = [&near, &far].map(|advice| number(rule(advice, "f64-kernel"), "statistic"));
    assert!((f64s[0] / f64s[1]).ln().abs() < 1.0, "{f64s:?}");
    let flat = advice(
        Path::new("."),
        "advise --scene us-counties --path orbit:frames=2 --structure linear,wide",
    );
    assert_eq!(rule(&flat, "third-dimension")["predicted"], true);
    assert_eq!(number(rule(&flat, "third-dimension"), "statistic"), 0.0);
    assert_eq!(rule(small(), "third-dimension")["predicted"], false);
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
fn options_turn_the_decisions_that_are_theirs() {
    // Items as large as the view is deep, so that six planes let many through.
    let of = |more: &str| {
        let line =
            "advise --scene forest:n=400 --path orbit:frames=4 --structure linear,wide --far 200";
        advice(Path::new("."), &format!("{line} {more}"))
    };
    let dear = of("--draw-ns 1e12 --tolerance 1e-9");
    assert_eq!(rule(&dear, "six-planes")["decision"], "keep");
    assert_eq!(dear["test"]["name"], "exact");
    assert_eq!(rule(&dear, "f64-kernel")["decision"], "keep");
    assert_eq!(rule(&dear, "frame-correction")["decision"], "keep");
    let agree = |advice: &serde_json::Value| {
        let taken = advice["test"]["name"].as_str().expect("a test");
        let decision = match taken {
            "six-plane" | "sphere" => "leave_out",
            _ => "keep",
        };
        assert_eq!(rule(advice, "six-planes")["decision"], decision, "{taken}");
    };
    agree(&dear);
    let cheap = of("--draw-ns 0 --tolerance 1e-2 --moved 100% --queries-per-update 0");
    assert_eq!(number(rule(&cheap, "six-planes"), "statistic"), 0.0);
    agree(&cheap);
    assert_eq!(rule(&cheap, "f64-kernel")["decision"], "leave_out");
    assert_eq!(rule(&cheap, "frame-correction")["decision"], "leave_out");
    assert_eq!(number(rule(&cheap, "rebuild"), "statistic"), 0.0);
    let moved = rule(&cheap, "rebuild")["reason"]
        .as_str()
        .expect("a reason");
    assert!(moved.contains("400 items moved"), "{moved}");
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
    let counts = ["skipped_items", "items"].map(|name| number(&advice, name));
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
    for part in [
        "\nTake structure ",
        ", test ",
        "For region search: ",
        "\n  index  ",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    // Notes are wrapped before a column goes.
    for (title, ratio) in [("Needed ", "gain"), ("Not needed ", "cost")] {
        let head = told.lines().find(|line| line.starts_with(title));
        assert!(head.is_some_and(|line| line.ends_with(ratio)), "{told}");
    }
    // What is assumed stands in its line.
    let culling = told.lines().find(|line| line.contains("occlusion culling"));
    assert!(
        culling.is_some_and(|line| line.contains("1000 ns/item")),
        "{told}"
    );
    let all = works(Path::new("."), &format!("{line} --all-columns"));
    assert!(!all.contains('\u{1b}'), "{all}");
    assert!(all.contains("\nTake structure "), "{all}");
    // A row is a line, however wide.
    let is_cut = |line: &str| line.starts_with(['[', '/']) || line.starts_with("extras");
    assert!(!all.lines().any(is_cut), "{all}");
    for feature in ["plane masks", "index", "portals", "basis correction"] {
        assert!(all.contains(&format!("\n  {feature} ")), "{feature}: {all}");
    }
    // One vocabulary: needed or not, with and without.
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
        ("--shade-ns -1", "--shade-ns is '-1' | at least 0"),
        ("--tolerance 0", "--tolerance is '0' | above 0"),
        ("--queries-per-update inf", "--queries-per-update is 'inf'"),
        ("--moved 0", "--moved is '0' | above 0"),
        ("--moved 101%", "--moved is '101%' | at most 100%"),
        ("--moved some", "--moved is 'some'"),
        ("--processes 0", "0 | --processes"),
        ("--fovy 0", "--fovy is '0'"),
        ("--update refit", "--motion"),
    ] {
        all_refused(&folder, &[format!("{line} {more}")], wanted);
    }
    all_refused(&folder, &["advise --scene nothing.csv"], "nothing.csv");
}
