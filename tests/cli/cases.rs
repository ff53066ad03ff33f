//! Small inputs that are easily answered wrongly.
//!
//! Maps with lumps or linedefs out of order, numbers at the limits of f32, CSV whose quotes
//! are not closed.

use std::path::PathBuf;

use serde_json::Value;

use super::funnel::{row, rows};
use super::process::*;
use super::{BOXES, FULL_CAMERA};

fn cases() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/cases"))
}

/// Runs `funnel`; returns the report and the sum of visible items over all views.
///
/// Panics if a back end with a guarantee loses an item.
fn funnel(scene: &str, path: &str, options: &str) -> (Value, f64) {
    let line = format!(
        "funnel --scene {scene} --path {path} --samples 48x32 --processes 1 --format json {options}"
    );
    let report = json(&works(&cases(), &line));
    for row in array(&report, "stages") {
        let kept = number(row, "false_negative_count") == 0.0 || row["guarantee"] == "unproven";
        assert!(kept, "{line}: {row}");
    }
    for pick in array(&report, "picks") {
        assert_eq!(number(pick, "wrong_count"), 0.0, "{line}: {pick}");
    }
    let visible = number(row(&report, "region", "none"), "truth_count");
    let seen = (visible * number(&report, "views")).round();
    (report, seen)
}

#[test]
fn maps_that_cannot_be_read_are_refused_by_name() {
    let refused = [
        ("next_maps_sidedefs.wad#MAP01", "MAP01 without SIDEDEFS"),
        ("nonodes.wad", "MAP01 whose nodes are not built"),
        ("freedm12_zX.wad", "MAP12 with extended nodes"),
        ("freedm12_zz.wad", "MAP12 with compressed extended nodes"),
        ("freedm12_zgX.wad", "MAP12 with extended GL nodes"),
        ("freedm12_zx.wad", "MAP12 with GL nodes alone"),
        ("two_rooms_foreign_after_MAP01.wad#MAP01", "no map 'MAP01'"),
        (
            "unclosed_quote.csv",
            "line 2 | a quote that is never closed",
        ),
    ];
    let commands = [
        "scene info",
        "query --cameras two_cam.csv --scene",
        "locate --points two_cam.csv --scene",
        "verify --path two_cam.csv --scene",
        "run --path two_cam.csv --scene",
        "advise --path two_cam.csv --scene",
        "precision --path two_cam.csv --scene",
        "funnel --path two_cam.csv --scene",
    ];
    for (scene, wanted) in refused {
        for command in commands {
            let line = format!("{command} {scene}");
            assert_refused(&cullbench(&cases(), &line), wanted, &line);
        }
    }
}

#[test]
fn a_foreign_lump_among_a_maps_own_changes_nothing() {
    let asked = |scene: &str| {
        let (_, seen) = funnel(scene, "two_cam.csv", "");
        let query = format!("query --scene {scene} --cameras two_cam.csv --ids");
        (seen, works(&cases(), &query))
    };
    let own = asked("two_rooms.wad");
    assert_eq!(own.0, 8.0);
    for lump in
        "MAP01 THINGS LINEDEFS SIDEDEFS VERTEXES SEGS SSECTORS NODES SECTORS REJECT BLOCKMAP"
            .split(' ')
    {
        let scene = format!("two_rooms_foreign_after_{lump}.wad");
        assert!(asked(&scene) == own, "{lump}");
    }
}

/// Maps whose lines do not close their sectors have no regions and lose no item.
#[test]
fn sectors_that_their_lines_do_not_close_lose_nothing() {
    let maps = [
        ("sr_proper.wad", "src.csv", 10.0, true),
        (
            "../../cli/maps/self_referencing.wad",
            "src.csv",
            10.0,
            false,
        ),
        ("sr_c3.wad", "src.csv", 10.0, false),
        ("sr_proper_pit.wad", "pit.csv", 11.0, true),
        ("../../cli/maps/deep_water.wad", "pit.csv", 3.0, false),
        ("sr_d.wad", "sd.csv", 10.0, false),
        ("sr_f.wad", "sd.csv", 10.0, false),
        ("se_2.wad", "sd.csv", 6.0, false),
    ];
    for (map, path, visible, has_regions) in maps {
        let (report, seen) = funnel(map, path, "");
        assert_eq!(seen, visible, "{map}");
        let left_out = array(&report, "left_out");
        assert_eq!(rows(&report, "region").count() > 1, has_regions, "{map}");
        assert_eq!(left_out.is_empty(), has_regions, "{map}: {left_out:?}");
    }
}

/// The items that every structure finds; `None` if the question is refused.
fn found(name: &str, options: &str) -> Option<String> {
    let line = format!("query --scene {name}_b.csv --cameras {name}_c.csv --ids {options}");
    let done = cullbench(&cases(), &line);
    if done.code == Some(2) {
        assert_refused(&done, "expected", &line);
        return None;
    }
    assert_eq!(done.code, Some(0), "{line}: {done:?}");
    let answers = super::process::rows(&done.out);
    let ids = &answers[0]["visible_ids"];
    for answer in &answers {
        assert_eq!(&answer["visible_ids"], ids, "{line}");
    }
    Some(ids.clone())
}

#[test]
fn numbers_at_the_ends_of_f32_are_decided_or_refused() {
    let planes =
        "frame frame-f32 gh-gl-f32 gh-gl-f64 gh-d3d-f32 gh-d3d-f64 gh-revz-f32 gh-revz-f64";
    let linear = "--structure linear,bvh,wide";
    for test in ["sphere", "six-plane", "six-box", "exact"] {
        for (name, ids) in [("gh_exact_min", "0"), ("ortho_tiny_min", "0")] {
            for planes in planes.split(' ') {
                let options = format!("{linear} --test {test} --planes {planes}");
                let found = found(name, &options);
                let is_refused = found.is_none() && planes != "frame";
                assert!(
                    is_refused || found.as_deref() == Some(ids),
                    "{name} {options}"
                );
            }
        }
        for read in ["column-gl", "column-d3d"] {
            let options = format!("--test {test} --matrix-convention {read}");
            assert_eq!(found("near_ortho", &options).as_deref(), Some("1"));
        }
    }
    let files = "--scene near_ortho_b.csv --path near_ortho_c.csv --matrix-convention column-gl";
    works(&cases(), &format!("verify {files}"));
    let files = "near_ortho_c.csv --matrix-convention column-gl";
    assert_eq!(funnel("near_ortho_b.csv", files, "").1, 1.0);
}

#[test]
fn large_and_tiny_boxes_are_seen_by_every_stage() {
    for scene in ["two_boxes_overflow.csv", "two_boxes_2e19.csv"] {
        for path in ["street:frames=2", "orbit:frames=2"] {
            assert_eq!(funnel(scene, path, "").1, 2.0, "{scene} {path}");
        }
    }
    for (name, visible) in [("obvhs_panic", 2.0), ("ortho_tiny_min", 1.0)] {
        let [boxes, cameras] = ["b", "c"].map(|end| format!("{name}_{end}.csv"));
        assert_eq!(funnel(&boxes, &cameras, "").1, visible, "{name}");
    }
    let options = "--occlusion none --region none";
    let (report, _) = funnel("tri_storage_b.csv", "tri_storage_c.csv", options);
    let faces = row(&report, "triangle", "per-triangle");
    let counts = ["truth_count", "output_count"].map(|count| number(faces, count));
    assert_eq!(counts, [4.0, 4.0]);
}

#[test]
fn what_planes_return_too_much_is_counted_exactly() {
    for (scene, wanted) in [("planes_count_b.csv", 1), ("planes_count_many_b.csv", 2)] {
        let line = format!(
            "precision --scene {scene} --path planes_count_c.csv --matrix-convention row-d3d \
             --cubes 0 --processes 1 --format json"
        );
        let report = json(&works(&cases(), &line));
        let points = array(&report, "points").iter();
        let of_planes =
            points.filter(|point| point["planes"] == "frame" && point["test"] != "sphere");
        let counts: Vec<_> = of_planes.map(|p| &p["excess_by_planes_count"]).collect();
        assert!(
            counts.len() > 10 && counts.iter().all(|&count| *count == wanted),
            "{counts:?}"
        );
    }
}

/// Boxes of which one kind defeats halving, another stacks everything on one place.
#[test]
fn a_hundred_thousand_boxes_in_any_arrangement_are_answered_alike() {
    type Bounds = fn(f64) -> [f64; 6];
    let arrangements: [(&str, Bounds); 6] = [
        ("nested", |i| {
            [-1.0 - i, -1.0 - i, -1.0 - i, 1.0 + i, 1.0 + i, 1.0 + i]
        }),
        ("posts", |i| [2.0 * i, 0.0, 0.0, 2.0 * i + 1.0, 1.0, 1.0]),
        ("collinear", |i| [i, 0.0, 0.0, i, 0.0, 0.0]),
        ("stairs", |i| [0.0, 0.0, 0.0, 1.0 + i, 1.0 + i, 1.0 + i]),
        ("coincident", |_| [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]),
        ("overlapping", |i| {
            [i * 1e-3, 0.0, 0.0, 100.0 + i * 1e-3, 100.0, 100.0]
        }),
    ];
    let camera = format!("{FULL_CAMERA}\n-5,-30,4,20,10,0,0,0,1,60,1.5,0.1,inf\n");
    for (name, bounds) in arrangements {
        let mut boxes = format!("{BOXES}\n");
        for i in 0..100_000 {
            let row = bounds(f64::from(i)).map(|bound| bound.to_string());
            boxes += &(row.join(",") + "\n");
        }
        let folder = folder(&[("b.csv", boxes.as_bytes()), ("c.csv", camera.as_bytes())]);
        let line = "query --scene b.csv --cameras c.csv --structure all";
        let rows = super::process::rows(&works(folder.path(), line));
        assert!(rows.len() > 8, "{name}");
        for row in &rows {
            for column in ["visible_count", "visible_id_sum"] {
                assert_eq!(row[column], rows[0][column], "{name}: {row:?}");
            }
        }
    }
}
