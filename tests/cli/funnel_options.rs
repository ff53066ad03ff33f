//! `funnel`: boxes inside meshes, questions of picking.

use std::path::Path;
use std::sync::LazyLock;

use cullbench::visibility::inner_boxes::BOXES;
use serde_json::Value;

use super::FULL_CAMERA;
use super::funnel::row;
use super::process::*;

const CITY: &str = "funnel --scene city:n=800 --path street:frames=3 --samples 96x54 --processes 1 \
                    --format json";

fn report(line: &str) -> Value {
    json(&works(Path::new("."), line))
}

/// The report of [`CITY`], from one run for all tests.
fn city_report() -> &'static Value {
    static REPORT: LazyLock<Value> = LazyLock::new(|| report(CITY));
    &REPORT
}

#[test]
fn every_question_of_picking_is_answered_exactly() {
    let picks = array(city_report(), "picks");
    for question in ["first item", "all within 4 pixels"] {
        let of_question = || picks.iter().filter(|row| row["question"] == question);
        assert!(of_question().count() >= 2, "{question}");
        for row in of_question().filter(|row| row["guarantee"] != "unproven") {
            assert_eq!(number(row, "wrong_count"), 0.0, "{row}");
            assert_eq!(number(row, "ray_count"), 3.0 * 144.0, "{row}");
            assert!(number(row, "ns_per_ray") > 0.0, "{row}");
        }
    }
}

#[test]
fn more_boxes_inside_meshes_hide_more_and_lose_nothing() {
    let wood = "funnel --scene mesh:forest:n=20k --frames 6 --samples 64x36 --processes 1";
    let removed = |limit: u32| {
        let report = report(&format!("{wood} --format json --inner-boxes {limit}"));
        let inner = &report["inner_boxes"];
        assert_eq!(number(inner, "box_limit"), f64::from(limit));
        let boxed = number(inner, "boxed_count");
        let boxes = number(inner, "box_count");
        assert!(boxes >= boxed && boxes <= boxed * f64::from(limit));
        let hidden = row(&report, "occlusion", "masked-inner");
        assert_eq!(number(hidden, "false_negative_count"), 0.0);
        number(hidden, "input_count") - number(hidden, "output_count")
    };
    let [one, eight] = [1, 8].map(removed);
    assert!(one > 0.0 && eight > 1.5 * one, "{one} {eight}");
    for wrong in ["0", "17", "-1", "many"] {
        let line = format!("{wood} --inner-boxes {wrong}");
        let done = cullbench(Path::new("."), &line);
        assert_refused(&done, "from 1 to 16", wrong);
    }
    // Not where there is nothing to look for them in.
    for (scene, items) in [("city:n=50", "solid boxes"), ("freedm-map12", "walls")] {
        let done = cullbench(
            Path::new("."),
            &format!("funnel --scene {scene} --inner-boxes 8"),
        );
        let told = "expected a scene of triangles for --inner-boxes";
        assert_refused(&done, &format!("are {items}; {told}"), scene);
    }
    let help = works(Path::new("."), "funnel --help");
    assert!(help.contains(&format!("[default: {BOXES}]")), "{help}");
}

/// A map whose REJECT table rejects all pairs: an eye sees its own sector only,
/// and later stages lose no more.
#[test]
fn the_loss_of_a_table_is_charged_to_its_stage_alone() {
    let mut map = map12();
    // REJECT, by the directory of the file.
    map[22_594..22_895].fill(0xff);
    let folder = folder(&[("all_rejected.wad", &map[..])]);
    let line = "funnel --scene all_rejected.wad --path street:frames=4 --samples 64x36 \
                --processes 1 --region reject --no-picks --format json";
    let report = json(&works(folder.path(), line));
    let rows = array(&report, "stages").iter();
    let chosen: Vec<_> = rows.filter(|row| row["is_chosen"] == true).collect();
    let of = |row: &Value, name| number(row, &format!("{name}_count"));
    let lost = of(chosen[0], "false_negative");
    assert!(lost > 0.0, "the premise: {lost}");
    let visible = of(chosen[0], "truth");
    for row in &chosen[1..] {
        assert_eq!(of(row, "false_negative"), 0.0, "{row}");
        if row["unit"] == "items" {
            assert_eq!(of(row, "truth"), visible - lost, "{row}");
        }
    }
    let told = report["conclusions"].to_string();
    assert!(
        told.contains("of them visible") && !told.contains("Use region"),
        "{told}"
    );
    let (before, _) = told.split_once(" are in front").expect("their number");
    let seen: f64 = before
        .rsplit(' ')
        .next()
        .unwrap()
        .parse()
        .expect("a number");
    assert!((seen / visible - 1.0).abs() < 0.005, "{visible}: {told}");
}

/// Small things at both ends of a large scene, and the same without the far end.
#[test]
fn items_that_f32_moves_by_much_of_their_size_are_warned_of() {
    let thing = |x: f64, from: usize| {
        let corners =
            [[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3]].map(|[y, z]| format!("v {x} {y} {z}\n"));
        let [a, b, c] = [from, from + 1, from + 2];
        format!(
            "o thing{from}\n{}f {a} {b} {c}\nf {a} {c} {b}\n",
            corners.concat()
        )
    };
    let flat = |x: f64, from| thing(x, from).replace(" -0.3 0.3", " -0.2 0.3");
    let near = flat(1e6, 1) + &thing(1e6 + 0.03, 4);
    let far = near.clone() + &thing(-1e6, 7);
    let (x, line) = (
        1e6 - 3.0,
        "funnel --scene S --path c.csv --samples 48x32 --processes 1 \
                                 --no-picks --format json",
    );
    let camera = format!("{FULL_CAMERA}\n{x},0,0,1e6,0,0,0,0,1,60,1.5,0.1,100\n");
    let files = [("near.obj", &near), ("far.obj", &far), ("c.csv", &camera)];
    let folder = folder(&files.map(|(name, text)| (name, text.as_bytes())));
    for (scene, is_warned) in [("near.obj", false), ("far.obj", true)] {
        let done = cullbench(folder.path(), &line.replace('S', scene));
        let told = json(&done.out)["warnings"].to_string();
        let words = "f32 moves corners of";
        assert_eq!(told.contains(words), is_warned, "{scene}: {told}");
        assert_eq!(done.err.contains(words), is_warned, "{scene}: {}", done.err);
    }
}

/// Notes of options without effect, and the reason of a missing loop.
#[test]
fn unused_options_and_large_loops_are_named() {
    let line = "funnel --scene rooms:n=400 --path walk:frames=1 --samples 16x9 --processes 1 \
                --no-picks";
    let told = cullbench(Path::new("."), line).err;
    assert!(told.contains("note: --no-picks has no effect"), "{told}");
    for (structures, scan) in [
        ("", "linear"),
        ("--structure linear-scalar,bvh", "linear-scalar"),
    ] {
        let line = format!(
            "funnel --scene city:n=20001 --path street:frames=1 --samples 16x9 --processes 1 \
             --format json {structures}"
        );
        let report = json(&works(Path::new("."), &line));
        let rows = array(&report, "left_out").iter();
        let rows = rows.filter(|row| row["section"] == "picks");
        let loops: Vec<_> = rows.map(|row| (&row["name"], &row["reason"])).collect();
        let told = |when| format!("20,001 items to test {when}; expected at most 20,000");
        let [of_ray, of_cursor] = ["for each ray", "for each cursor's frustum"].map(told);
        let (of_ray, of_cursor) = (of_ray.into(), of_cursor.into());
        let wanted = [(&"linear".into(), &of_ray), (&scan.into(), &of_cursor)];
        assert_eq!(loops, wanted);
    }
}
