//! `funnel`: boxes inside meshes, questions of picking.

use std::path::Path;
use std::sync::LazyLock;

use cullbench::visibility::inscribed::BOXES;
use serde_json::Value;

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
    for question in ["first item", "nearest 8", "all within 4 pixels"] {
        let of_question = || picks.iter().filter(|row| row["question"] == question);
        assert!(of_question().count() >= 3, "{question}");
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

/// A table without pairs shows the eye's own room alone: later stages lose nothing more.
#[test]
fn the_loss_of_a_table_is_charged_to_its_stage_alone() {
    let table: &[u8] = br#"{"regions": 12, "sees": []}"#;
    let folder = folder(&[("p.json", table)]);
    let line = "funnel --scene rooms:n=400 --path walk:frames=4 --samples 64x36 --processes 1 \
                --pvs p.json --region stored-pvs --no-picks --format json";
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
    let seen = format!("{visible:.2}");
    assert!(told.contains(&format!("and {seen} are in front")), "{told}");
}
