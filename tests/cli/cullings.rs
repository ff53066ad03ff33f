//! Culling tests and arithmetics from the command line: `query`, `run` and
//! `verify` with every choice, what does not go together, and answers that are
//! wrong at camera level though all structures agree about them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use serde_json::Value;

use super::process::*;
use super::runs::{cells, report};
use super::{BOXES, FULL_CAMERA};

/// From the coarsest to the finest.
const TESTS: [&str; 4] = ["sphere", "six-plane", "six-box", "exact"];

/// A camera off zero with a right angle of view, and boxes whose corners lie
/// exactly on its four sides: what the epsilon is for.
fn with_ties() -> tempfile::TempDir {
    let mut scene = format!("{BOXES}\n");
    for i in 1..400 {
        let depth = i as f64 * 0.37;
        // To the precision of the file's numbers in f32: exact in binary.
        let depth = (depth * 64.0).floor() / 64.0;
        for (y, z) in [(depth, 0.0), (-depth, 0.0), (0.0, depth), (0.0, -depth)] {
            let [x, y, z] = [1003.0 + depth, 205.0 + y, 77.0 + z];
            let out = |v: f64, middle: f64| (v - middle).signum() * f64::from(v != middle) * 0.25;
            let (dy, dz) = (out(y, 205.0), out(z, 77.0));
            let span = |v: f64, d: f64| (v.min(v + d), v.max(v + d));
            let ((ly, hy), (lz, hz)) = (span(y, dy), span(z, dz));
            scene += &format!("{},{ly},{lz},{x},{hy},{hz}\n", x - 0.25);
        }
    }
    let cameras = format!("{FULL_CAMERA}\n1003,205,77,1004,205,77,0,0,1,90,1,0.125,1000\n");
    folder(&[("s.csv", scene.as_bytes()), ("c.csv", cameras.as_bytes())])
}

/// The rows of a query, and whether it notes that its margin is not proven.
fn queried(folder: &Path, line: &str, is_noted: bool) -> Vec<BTreeMap<String, String>> {
    let done = cullbench(folder, line);
    let note = done.err.starts_with("note: the margin is proven");
    assert_eq!((done.code, note), (Some(0), is_noted), "{line}: {done:?}");
    assert!(is_noted || done.err.is_empty(), "{line}: {done:?}");
    rows(&done.out)
}

#[test]
fn finer_tests_return_less_whatever_the_numbers() {
    let here = folder(&[]);
    let line = "query --scene uniform:n=1500,side=100,size=12 --cameras teleport:frames=5 --structure all --ids";
    let structures = structure_names().len();
    for arithmetic in ["f32", "f64", "f32-relative"] {
        let mut coarser: BTreeMap<String, BTreeSet<u32>> = BTreeMap::new();
        let mut total = Vec::new();
        for test in TESTS {
            let line = format!("{line} --test {test} --arithmetic {arithmetic}");
            if test == "sphere" && arithmetic != "f32" {
                let done = cullbench(here.path(), &line);
                assert_refused(&done, "sphere | expected --arithmetic f32", &line);
                continue;
            }
            let rows = queried(here.path(), &line, arithmetic == "f64");
            assert_eq!(rows.len(), 5 * structures);
            let mut count = 0;
            for row in rows {
                assert_eq!(row["test"], test);
                let ids = row["visible_ids"].split_whitespace();
                let ids: BTreeSet<u32> = ids.map(|id| id.parse().expect("an id")).collect();
                let key = format!("{} {}", row["camera"], row["structure"]);
                count += ids.len();
                if let Some(before) = coarser.insert(key, ids.clone()) {
                    assert!(ids.is_subset(&before), "{test} {arithmetic}");
                }
            }
            total.push(count);
        }
        assert!(
            total.first() > total.last() && total.last() > Some(&0),
            "{total:?}"
        );
    }
}

#[test]
fn choices_that_do_not_go_together_are_refused() {
    let here = with_good_files(&[]);
    let scene = "--scene scene.csv --path orbit:frames=2";
    for (choice, wanted) in [
        (
            "--arithmetic f64 --planes gh-gl-f64",
            "gh-gl-f64 | expected --planes frame",
        ),
        (
            "--arithmetic f32-relative --planes frame-f32",
            "frame-f32 | expected --planes frame",
        ),
        (
            "--arithmetic f63",
            "unknown arithmetic 'f63' | did you mean 'f64'",
        ),
        ("--epsilon -1", "--epsilon is '-1'"),
        (
            "--arithmetic f64 --epsilon 4",
            "--epsilon is 4 with --arithmetic f64 | expected 0",
        ),
        ("--planes gh-gl-f16", "gh-gl-f16 | did you mean 'gh-gl-f"),
    ] {
        let commands = ["query", "verify", "run --out r"].map(|c| format!("{c} {scene} {choice}"));
        all_refused(&here, &commands, wanted);
    }
    for (choice, wanted) in [
        (
            "--test spere",
            "unknown test 'spere' | did you mean 'sphere'",
        ),
        (
            "--test sphere --arithmetic f64",
            "expected --arithmetic f32",
        ),
    ] {
        let commands = ["query", "run --out r"].map(|c| format!("{c} {scene} {choice}"));
        all_refused(&here, &commands, wanted);
    }
    let twice = [
        format!("run --out r {scene} --test exact --test exact"),
        format!("run --out r {scene} --test sphere,exact,sphere"),
    ];
    all_refused(&here, &twice, "is named twice");
}

/// The same structures take other times by them.
#[test]
fn the_head_of_a_run_names_its_arithmetic_and_planes() {
    let here = folder(&[]);
    let run = "run --path orbit:frames=2 --structure linear --processes 1 --no-bounds";
    let one = format!("{run} --scene city:n=50 --planes gh-gl-f32 --epsilon 0 --out r");
    let told = works(here.path(), &one);
    assert!(
        told.contains("2 views, six-plane, gh-gl-f32, epsilon 0\n"),
        "{told}"
    );
    let told = works(here.path(), "report r --markdown r.md");
    let markdown = fs::read_to_string(here.path().join("r.md")).expect(&told);
    assert!(
        markdown.contains("warm, six-plane, gh-gl-f32, epsilon 0\n"),
        "{markdown}"
    );
    let two = format!("{run} --scene city:n=50 --scene city:n=60 --arithmetic f64 --out s");
    let told = works(here.path(), &two);
    assert!(told.contains("six-plane, f64; z up; "), "{told}");
}

#[test]
fn a_run_has_a_cell_with_its_errors_for_every_test() {
    let here = folder(&[]);
    let line = "run --scene city:n=400 --path orbit:frames=8 --structure linear,bvh --out r";
    let all_tests = format!("{line} --test sphere,exact --test six-plane");
    works(here.path(), &all_tests);
    let run = here.path().join("r");
    let all = report(&run);
    assert_eq!(cells(&all).len(), 6);
    let mut errors: BTreeMap<&str, Vec<&Value>> = BTreeMap::new();
    for cell in cells(&all) {
        assert_eq!(cell["status"], "ok", "{cell}");
        let test = cell["test"].as_str().expect("a test");
        errors.entry(test).or_default().push(&cell["error"]);
    }
    assert_eq!(
        errors.keys().copied().collect::<Vec<_>>(),
        ["exact", "six-plane", "sphere"]
    );
    let mut extra = Vec::new();
    for (test, errors) in errors {
        // One for each structure, the same in both.
        assert!(
            errors.len() == 2 && errors[0] == errors[1],
            "{test}: {errors:?}"
        );
        let number = |name: &str| errors[0][name].as_u64().expect(name);
        assert!(number("visible_count") > 0 && number("judged_queries") == 8);
        assert_eq!(
            number("false_negative_count") + number("touch_dropped_count"),
            0
        );
        extra.push(number("false_positive_count"));
    }
    assert!(extra.is_sorted() && extra[0] < extra[2], "{extra:?}");
    // Nothing is left to do.
    let before = contents(&run);
    works(here.path(), &format!("{all_tests} --resume"));
    assert!(contents(&run) == before);
}

/// A point that six planes without a margin return, and another culling misses.
#[test]
fn verify_judges_every_test_and_arithmetic_against_the_cameras() {
    let point = "10000020.978243487,10000046.952126395,9999991.555016268";
    let boxes = format!("min_x,min_y,min_z,max_x,max_y,max_z\n{point},{point}\n");
    let camera = "eye_x,eye_y,eye_z,forward_x,forward_y,forward_z,up_x,up_y,up_z,fovy_deg,aspect,\
                  near,far\n10000016.271550953,10000016.646299759,10000017.740588337,\
                  -0.313282631480201,-0.2225254482401904,-1.486615913654193,-1.4807502450553403,\
                  1.2954806965326675,-0.5096205434010808,81.59953724585176,1.7875602052130715,1,20\n";
    let here = folder(&[("p.csv", boxes.as_bytes()), ("c.csv", camera.as_bytes())]);
    let what = "verify --scene p.csv --path c.csv --structure linear";
    assert_eq!(cullbench(here.path(), what).code, Some(0));
    let bare = cullbench(here.path(), &format!("{what} --epsilon 0"));
    assert_eq!(bare.code, Some(1), "{}", bare.out);
    let is_other = bare
        .out
        .contains(" volume, camera level: missed 1 visible item");
    assert!(
        is_other && !bare.out.contains("six-plane f32 volume"),
        "{}",
        bare.out
    );
}

/// Every structure agrees, and all of them miss what the camera sees.
#[test]
fn answers_that_are_wrong_at_camera_level_are_unsafe() {
    let here = folder(&[]);
    let what = "--scene uniform:n=3000 --path orbit:frames=8 --structure linear,bvh \
                --near 1e-3 --far 900";
    let line = &format!("run {what}");
    let planes = "--planes gh-gl-f32 --epsilon 0";
    let verified = cullbench(here.path(), &format!("verify {what} {planes}"));
    assert_eq!(verified.code, Some(1), "{}", verified.out);
    assert!(verified.out.contains("camera level: "), "{}", verified.out);
    let mut all = Vec::new();
    for motion in ["", " --motion drift:share=0.1,frames=8"] {
        let out = format!("bad{}", all.len());
        let done = cullbench(here.path(), &format!("{line} --out {out} {planes}{motion}"));
        assert_eq!(
            (done.code, done.err.as_str()),
            (Some(1), ""),
            "{}",
            done.out
        );
        all.extend(cells(&report(&here.path().join(out))).clone());
    }
    assert!(all.iter().any(|cell| cell["path"]["motion"] != ""));
    for cell in &all {
        assert_eq!(cell["status"], "unsafe", "{cell}");
        let missed = cell["error"]["false_negative_count"].as_u64();
        assert!(missed > Some(0), "{cell}");
        let reason = cell["reason"].as_str().unwrap_or_default();
        assert!(reason.contains("missed at camera level"), "{cell}");
        assert!(
            reason.starts_with(&missed.unwrap_or(0).to_string()),
            "{cell}"
        );
        // Three digits, no 16.
        let deepest = reason.rsplit(' ').next().unwrap_or_default();
        assert!(deepest.len() < 7 && !deepest.contains('e'), "{reason}");
        // What is unsafe is not ranked.
        assert!(cell["metrics"]["query_ns"].is_null(), "{cell}");
    }
    works(here.path(), &format!("{line} --out good"));
}

#[test]
fn verify_asks_every_kind_of_volume_test_and_arithmetic() {
    let here = folder(&[]);
    let scene = "--scene rooms:n=300 --path flythrough:frames=4";
    let told = works(here.path(), &format!("verify {scene} --format json"));
    let told = json(&told);
    let checks = told["checks"].as_array().expect("an array");
    assert_eq!(checks.len(), structure_names().len());
    for check in checks {
        // Nine kinds of volume; four tests in f32, three in each of the others,
        // one of which is the first kind again.
        assert_eq!(check["volumes"], 4 * (9 + 10 - 1), "{check}");
        assert_eq!(check["status"], "ok", "{check}");
    }
}

/// Spheres reach farther than boxes: only their sums overflow f32 here.
#[test]
fn a_test_that_f32_does_not_hold_leaves_the_others() {
    let scene =
        format!("{BOXES}\n-3e37,-3e37,-3e37,-2e37,-2e37,-2e37\n2e37,2e37,2e37,3e37,3e37,3e37\n");
    let cameras = format!("{FULL_CAMERA}\n0,0,0,1,2,0.3,0,0,1,60,1.5,1e34,1e38\n");
    let here = folder(&[("s.csv", scene.as_bytes()), ("c.csv", cameras.as_bytes())]);
    let what = "--scene s.csv --path c.csv --structure linear,wide";
    let verify = format!("verify {what} --format json");
    let told = json(&works(here.path(), &verify));
    assert_eq!(told["ok"], true, "{told}");
    let left_out = told["left_out"].as_array().expect("a list");
    let [line] = &left_out[..] else {
        panic!("{told}");
    };
    let wanted = "s.csv: sphere f32 left out: c.csv, line 2: sums of the plane test reach";
    assert!(
        line.as_str().is_some_and(|line| line.starts_with(wanted)),
        "{line}"
    );
    let run = format!("run {what} --processes 2");
    works(
        here.path(),
        &format!("{run} --test sphere,six-plane --out run"),
    );
    let report = report(&here.path().join("run"));
    for cell in cells(&report) {
        let is_refused = cell["test"] == "sphere";
        assert_eq!(
            cell["status"],
            ["ok", "refused"][usize::from(is_refused)],
            "{cell}"
        );
        let reason = cell["reason"].as_str().unwrap_or_default();
        assert_eq!(
            reason.starts_with("c.csv, line 2: sums"),
            is_refused,
            "{cell}"
        );
        // Other cameras are another question, of refused cells too.
        let digest = &cell["path"]["digest"];
        assert!(
            digest.is_string() && *digest == cells(&report)[0]["path"]["digest"],
            "{cell}"
        );
    }
    // Where nothing is left.
    let alone = cullbench(here.path(), &format!("{run} --test sphere --out alone"));
    assert_refused(
        &alone,
        "c.csv, line 2: sums of the plane test | expected",
        "alone",
    );
}

/// With the epsilon nothing is lost that touches the view; without it much of
/// this scene is, so that planes that lack it would not pass for safe.
#[test]
fn verify_holds_the_default_planes_to_the_camera() {
    let here = with_ties();
    let scene = "--scene s.csv --path c.csv";
    let told = works(here.path(), &format!("verify {scene}"));
    assert!(told.contains(", no mismatches"), "{told}");
    let count = |choice: &str| -> usize {
        let line = format!("query {scene} --structure linear {choice}");
        queried(here.path(), &line, !choice.is_empty())[0]["visible_count"]
            .parse()
            .expect("a number")
    };
    // Without a margin there is nothing to hold to it, and that is said.
    let unheld = works(here.path(), &format!("verify {scene} --arithmetic f64"));
    for (told, says) in [(&told, false), (&unheld, true)] {
        assert_eq!(told.contains("faces were not"), says, "{told}");
    }
    assert_eq!(count(""), 4 * 399, "every box touches the view or is in it");
    assert!(count("--epsilon 0") < 4 * 399, "{}", count("--epsilon 0"));
}

/// Contacts are counted beside what is missed, though not promised.
#[test]
fn verify_counts_the_contacts_that_planes_without_a_margin_drop() {
    let scene = format!("{BOXES}\n2,4,3,3,6,3.5\n30,2,3,30.5,3,4\n");
    let camera = format!("{FULL_CAMERA}\n1,2,3,2,2,3,0,0,1,90,1,3.1e-6,30\n");
    let here = folder(&[("s.csv", scene.as_bytes()), ("c.csv", camera.as_bytes())]);
    let line = "verify --scene s.csv --path c.csv --planes gh-gl-f32 --epsilon 0";
    let told = cullbench(here.path(), line);
    let wanted = "missed 1 visible item and 1 boundary contact, the deepest by 1.00\n";
    assert!(
        told.code == Some(1) && told.out.contains(wanted),
        "{told:?}"
    );
}

/// Orthographic and perspective cameras in one file, read by every command.
#[test]
fn orthographic_cameras_are_typed() {
    let cameras = "eye_x,eye_y,eye_z,look_x,look_y,look_z,up_x,up_y,up_z,ortho_height,fovy_deg,near,far\n\
                   0,0,300,1,1,0,0,1,0,60,,-10,500\n\
                   100,50,40,0,0,0,0,0,1,40,,1,900\n\
                   100,50,40,0,0,0,0,0,1,,60,1,900\n";
    let both = cameras.replace("60,,-10", "60,90,-10");
    let here = folder(&[("c.csv", cameras.as_bytes()), ("both.csv", both.as_bytes())]);
    let line = "query --scene city:n=2000 --cameras both.csv";
    let wanted = "both.csv, line 2: fovy_deg and ortho_height | not both";
    assert_refused(&cullbench(here.path(), line), wanted, line);
    let scene = "--scene city:n=2000 --path c.csv";
    let told = works(here.path(), &format!("query {scene} --structure all"));
    let counts = rows(&told);
    let by_linear = |camera: &str| {
        let mut rows = counts.iter();
        let found = rows.find(|row| row["structure"] == "linear" && row["camera"] == camera);
        found.expect("a row")["visible_count"].clone()
    };
    // As high as 60 units from far above: a part, and the same by every structure.
    for row in &counts {
        assert_eq!(row["visible_count"], by_linear(&row["camera"]), "{row:?}");
    }
    assert!(by_linear("0") != by_linear("1") && by_linear("1") != by_linear("2"));
    let seen: usize = by_linear("0").parse().expect("a number");
    assert!((1..1000).contains(&seen), "{seen}");
    let told = works(
        here.path(),
        &format!("verify {scene} --structure linear,bvh,wide"),
    );
    assert!(told.contains(", no mismatches"), "{told}");
    let line = "--structure linear,wide --processes 1 --out timed";
    works(here.path(), &format!("run {scene} {line}"));
    assert!(!cells(&report(&here.path().join("timed"))).is_empty());
    let told = works(
        here.path(),
        &format!("funnel {scene} --processes 1 --samples 64x36"),
    );
    assert!(told.contains("z-test"), "{told}");
    let endless = cameras.replace("900", "inf");
    std::fs::write(here.path().join("endless.csv"), endless).expect("a file");
    let done = cullbench(here.path(), "query --scene city:n=20 --path endless.csv");
    let wanted = "error: endless.csv, line 3: far is inf; expected a finite number\n";
    assert_eq!((done.code, done.err.as_str()), (Some(2), wanted));
}
