//! `funnel` of Doom maps: regions, faces of walls, floors and ceilings.

use std::path::Path;

use super::funnel::{counted, picked_exactly, row, rows};
use super::process::*;

/// The depth test removes items behind walls, floors and ceilings.
#[test]
fn a_map_is_drawn_with_its_floors_and_ceilings() {
    let line = "funnel --scene freedm-map20 --path street:frames=8 --frames 1 --samples 64x36 \
                --region none --occlusion none --processes 1 --format json";
    let report = json(&works(Path::new("."), line));
    let [nothing, drawn] = ["none", "z-test"].map(|name| row(&report, "fragment", name));
    assert!(number(nothing, "false_positive_count") > 100.0, "{nothing}");
    for wrong in ["false_positive_count", "false_negative_count"] {
        assert_eq!(number(drawn, wrong), 0.0, "{drawn}");
    }
    assert!(counted(&report, "z-test", "covered_count") > 0.99 * 64.0 * 36.0);
}

#[test]
fn a_map_has_regions_and_the_faces_of_its_walls() {
    let line = "funnel --scene freedm-map12 --path street:frames=4 --samples 96x54 --processes 1 \
                --format json";
    let report = json(&works(Path::new("."), line));
    for name in ["portal-rect", "reject"] {
        let row = row(&report, "region", name);
        assert_eq!(number(row, "false_negative_count"), 0.0, "{name}");
        assert!(
            number(row, "output_count") < number(row, "input_count"),
            "{name}"
        );
    }
    // Of a wall one side is seen, so about half of them face away.
    let faces = row(&report, "triangle", "per-triangle");
    let [given, left] = ["input_count", "output_count"].map(|count| number(faces, count));
    assert!(left > 0.1 * given && left < 0.9 * given, "{faces}");
    // Walls are two or four triangles, and no boxes of twelve.
    let items = number(row(&report, "occlusion", "none"), "output_count");
    assert!(given > items && given < 8.0 * items, "{given} of {items}");
    for row in rows(&report, "triangle") {
        let lost = number(row, "false_negative_count");
        assert!(lost == 0.0 || row["guarantee"] == "unproven", "{row}");
    }
    let gains = array(&report, "gains");
    assert!(gains.iter().any(|gain| gain["unit"] == "triangles"));
    // Boxes in its solid hide, and nothing that is visible.
    let blocks = &report["solid_blocks"];
    assert!(number(blocks, "box_count") > 30.0 && number(blocks, "build_ns") > 0.0);
    assert_eq!(number(blocks, "unclosed_sector_count"), 0.0);
    let hidden = row(&report, "occlusion", "masked-inner");
    assert_eq!(number(hidden, "false_negative_count"), 0.0);
    let [given, left] = ["input_count", "output_count"].map(|count| number(hidden, count));
    assert!(left < 0.8 * given, "{left} of {given}");
    // From outside the map nothing of it hides.
    let outside = "funnel --scene freedm-map12 --path orbit:frames=1 --samples 48x27 \
                   --processes 1 --format json";
    let outside = json(&works(Path::new("."), outside));
    for name in ["masked-inner", "masked"] {
        let row = row(&outside, "occlusion", name);
        assert_eq!(number(row, "output_count"), number(row, "input_count"));
    }
    picked_exactly(&report);
}

/// Linedefs that have the same sector, a pool, on both sides.
///
/// The pool lies where the BSP of the map has it, and no floor of the room around it
/// hides the items in it.
#[test]
fn a_map_whose_linedefs_disagree_has_no_regions_and_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let maps = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/maps");
    let from = "eye_x,eye_y,eye_z,look_x,look_y,look_z,fovy_deg,aspect,near,far\n";
    let cases = [
        (
            "self_referencing",
            "64,256,41,512,256,41,60,1.5,1,2000",
            5.0,
        ),
        ("deep_water", "150,256,90,256,256,-60,60,1.5,1,2000", 1.0),
    ];
    for (map, camera, visible) in cases {
        std::fs::write(folder.path().join("eye.csv"), format!("{from}{camera}\n")).unwrap();
        let map = maps.join(format!("{map}.wad"));
        let line = "--path eye.csv --samples 48x32 --processes 1 --format json";
        let line = format!("funnel --scene {} {line}", map.display());
        let report = json(&works(folder.path(), &line));
        let regions: Vec<_> = rows(&report, "region").collect();
        assert_eq!(regions.len(), 1, "{regions:?}");
        assert_eq!(number(regions[0], "truth_count"), visible);
        for row in array(&report, "stages") {
            assert_eq!(number(row, "false_negative_count"), 0.0, "{row}");
        }
        let [left_out] = &array(&report, "left_out")[..] else {
            panic!("{report}");
        };
        assert_eq!(left_out["name"], "region");
        let reason = "linedefs disagree about the sector at (96, 256), 0 or 1";
        assert_eq!(left_out["reason"], reason);
    }
}
