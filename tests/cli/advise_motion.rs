//! `advise` on moving items, and where its advice changes.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::OnceLock;

use serde_json::Value;

use super::advise::{advice, metric, rule, small};
use super::process::*;

/// Options of frames of moving items, and of two threads.
const MOVING: &str = "--scene city:n=400 --path orbit:frames=4 --structure linear,wide,octree-textbook \
     --motion drift:share=10%,frames=12 --views 2 --update refit,every=5 --threads 1,2";

/// Advice about moving items that cost nothing to draw.
///
/// So no test replaces the scan by a tree.
pub fn moving() -> &'static Value {
    static OUTCOME: OnceLock<Value> = OnceLock::new();
    OUTCOME.get_or_init(|| advice(Path::new("."), &format!("advise {MOVING} --draw-ns 0")))
}

#[test]
fn advice_on_moving_items_has_the_rows_of_a_run() {
    let planned = works(Path::new("."), &format!("run --plan {MOVING}"));
    let planned: BTreeSet<String> = planned
        .lines()
        .map(|line| {
            json(line)["structure"]
                .as_str()
                .expect("a label")
                .to_owned()
        })
        .collect();
    let rows = array(&moving()["structure"], "rows");
    let label = |row: &Value| row["structure"].as_str().expect("a label").to_owned();
    assert_eq!(rows.iter().map(label).collect::<BTreeSet<_>>(), planned);
    assert!(planned.contains("wide@every=5") && planned.contains("linear:threads=2"));
    let times: Vec<f64> = rows.iter().map(|row| metric(row, "frame_ns")).collect();
    assert!(times.is_sorted(), "{times:?}");
    assert_eq!(moving()["structure"]["name"], rows[0]["structure"]);
    for row in rows {
        let parts = metric(row, "update_ns") + metric(row, "query_ns");
        assert!(parts <= metric(row, "frame_ns") * 1.001, "{row}");
    }
    // The index saves what a frame by the best tree takes less than one by the best scan.
    let alone = rows.iter().filter(|row| !label(row).contains("threads="));
    let best = |is_scan| {
        let mut own = (alone.clone()).filter(|row| label(row).starts_with("linear") == is_scan);
        metric(own.next().expect("a row"), "frame_ns")
    };
    let saving = number(rule(moving(), "no-index"), "saving");
    let wanted = 1.0 - best(true) / best(false);
    // Where another test is cheaper than six planes, its query stands in a frame for theirs.
    assert!((saving - wanted).abs() < 0.2, "{saving} {wanted}");
    // Rebuilds in every frame were not asked for.
    assert_eq!(rule(moving(), "rebuild")["decision"], "not_applicable");
}

#[test]
fn other_numbers_of_items_and_shares_are_measured() {
    let of = |advice: &Value| -> Vec<(String, Vec<f64>)> {
        let own = array(advice, "changes").iter().map(|change| {
            let measured = array(change, "measured")
                .iter()
                .map(|x| x.as_f64().expect("a number"));
            let here = [number(change, "here")];
            (
                change["axis"].as_str().expect("an axis").to_owned(),
                measured.chain(here).collect(),
            )
        });
        own.collect()
    };
    let (still, moving) = (of(small()), of(moving()));
    let axes = |of: &[(String, Vec<f64>)]| {
        of.iter()
            .map(|row| row.0.clone())
            .collect::<Vec<_>>()
            .join(" ")
    };
    assert_eq!(axes(&still), "items share_in_view");
    assert_eq!(axes(&moving), "items share_in_view share_moved");
    assert_eq!(still[0].1, [90.0, 900.0, 900.0]);
    assert_eq!(moving[0].1, [40.0, 400.0, 400.0]);
    // Of 400 items none moves at 0.01 %, one at 0.1 %.
    assert_eq!(moving[2].1, [0.0025, 1.0, 0.1]);
    for (axis, [low, high, here]) in still
        .iter()
        .chain(&moving)
        .map(|(a, v)| (a, [v[0], v[1], v[2]]))
    {
        assert!(
            low < high && low <= here && here <= high,
            "{axis}: {low} {high} {here}"
        );
    }
}

#[test]
fn policies_are_weighed_without_being_named() {
    let line = "advise --scene uniform:n=300 --path orbit:frames=4 --structure wide --motion swarm:frames=20";
    let told = works(
        Path::new("."),
        &format!("{line} --processes 1 --all-columns"),
    );
    for part in [
        "Update policies, side by side:",
        "feature             use",
        "In motion: ",
        "A frame takes ",
        "rebuild ",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    assert!(!told.contains("Another structure"), "{told}");
}

#[test]
fn what_is_recorded_is_not_varied_and_that_is_told() {
    let motion =
        b"time_s,id,min_x,min_y,min_z,max_x,max_y,max_z\n0,0,0,0,0,1,1,1\n1,0,1,0,0,2,1,1\n";
    let folder = folder(&[("m.csv", motion)]);
    let line = "advise --scene uniform:n=200 --path orbit:frames=2 --structure linear,wide --motion m.csv \
         --draw-ns 0";
    let told = works(folder.path(), &format!("{line} --processes 1"));
    for axis in ["number of items", "share moved"] {
        let wanted = format!("\n  {axis}: not varied: the motion is recorded\n");
        assert!(told.contains(&wanted), "{axis}: {told}");
    }
    let advice = advice(folder.path(), line);
    let moved = &array(&advice, "changes")[2];
    assert_eq!(moved["not_varied"], "the motion is recorded");
    assert_eq!(
        moved["measured"],
        json(&format!("[{0},{0}]", moved["here"]))
    );
}

#[test]
fn mistakes_about_motion_are_one_line() {
    let folder = with_good_files(&[]);
    let line = "advise --scene scene.csv --path cameras.csv";
    for (more, wanted) in [
        ("--motion drfit", "drfit | did you mean 'drift'"),
        (
            "--motion drift --motion doors",
            "--motion 'doors' | one motion",
        ),
        ("--motion drift --update often", "--update 'often'"),
    ] {
        all_refused(&folder, &[format!("{line} {more}")], wanted);
    }
}
