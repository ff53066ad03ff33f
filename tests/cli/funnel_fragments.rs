//! The fragment stage of `funnel`: items with holes, stencils of portals.

use std::path::Path;

use serde_json::Value;

use super::funnel::{LINE, counted, folder, plain_report, row, rows};
use super::process::*;

#[test]
fn through_the_holes_of_a_wall_is_seen_what_is_behind_it() {
    let folder = folder();
    let line = format!("{LINE} --cut-out foliage:share=1,tile=0.5");
    let report = json(&works(folder.path(), &line));
    let cut_outs = &report["cut_outs"];
    assert_eq!(cut_outs["mask"], "foliage");
    assert_eq!(number(cut_outs, "item_count"), 5.0);
    for row in rows(&report, "occlusion") {
        // Nothing hides, so nothing but what is behind the camera is removed.
        assert_eq!(number(row, "output_count"), 4.0, "{row}");
        assert_eq!(number(row, "truth_count"), 3.0, "{row}");
        assert_eq!(number(row, "false_negative_count"), 0.0, "{row}");
    }
    let [z, alpha] = ["z-test", "alpha-test"].map(|name| row(&report, "fragment", name));
    assert_eq!(
        (&z["guarantee"], &z["is_chosen"]),
        (&"unproven".into(), &false.into())
    );
    assert_eq!(number(z, "false_negative_count"), 1.0);
    assert_eq!(alpha["is_chosen"], true);
    for count in ["false_negative_count", "false_positive_count"] {
        assert_eq!(number(alpha, count), 0.0, "{count}");
    }
    let clear = ["z-test", "alpha-test"].map(|test| counted(&report, test, "clear_count"));
    assert!(clear[0] == 0.0 && clear[1] > 100.0, "{clear:?}");
    let covered = ["z-test", "alpha-test"].map(|test| counted(&report, test, "covered_count"));
    assert!(
        covered[1] < covered[0] && covered[1] > 0.5 * covered[0],
        "{covered:?}"
    );
    let table = works(folder.path(), &line.replace("--format json", "--all"));
    for words in [
        "5 of the items are cut out by a mask (foliage",
        "Samples and fragments",
        "z-test?",
    ] {
        assert!(table.contains(words), "{words}: {table}");
    }
    // Without holes there is no such test.
    let solid = plain_report();
    assert!(rows(solid, "fragment").all(|row| row["name"] != "alpha-test"));
    assert!(solid["cut_outs"].is_null());
}

#[test]
fn what_promises_to_lose_nothing_sees_through_holes() {
    for (scene, mask) in [
        ("city:n=1500", "fence:share=0.3,tile=2"),
        ("rooms:n=1500", "foliage:share=1,tile=0.25"),
    ] {
        let line = format!(
            "funnel --scene {scene} --cut-out {mask} --path street:frames=4 --samples 96x54 \
             --processes 1 --format json"
        );
        let report = json(&works(Path::new("."), &line));
        // Walls of rooms are left whole.
        let share = number(&report["cut_outs"], "item_count") / number(&report, "items");
        assert!((0.1..0.8).contains(&share), "{scene}: {share}");
        for row in array(&report, "stages") {
            let what = format!("{scene} {} {}", row["stage"], row["name"]);
            if row["guarantee"] != "unproven" {
                assert_eq!(number(row, "false_negative_count"), 0.0, "{what}");
            }
        }
        let z = row(&report, "fragment", "z-test");
        assert!(number(z, "false_negative_count") > 0.0, "{scene}: {z}");
        let alpha = row(&report, "fragment", "alpha-test");
        assert_eq!(number(alpha, "false_positive_count"), 0.0, "{scene}");
    }
}

#[test]
fn a_stencil_of_portals_saves_samples_and_shows_the_same() {
    let line = "funnel --scene rooms:n=1000 --path street:frames=4 --samples 64x36 --processes 1 \
                --region none --occlusion none --format json";
    for more in ["", " --cut-out fence:share=0.5,tile=0.5"] {
        let report = json(&works(Path::new("."), &format!("{line}{more}")));
        let stencil = row(&report, "fragment", "stencil-test");
        for count in ["false_negative_count", "false_positive_count"] {
            assert_eq!(number(stencil, count), 0.0, "{count}");
        }
        let asked = ["z-test", "stencil-test"].map(|test| counted(&report, test, "asked_count"));
        assert!(asked[1] < 0.6 * asked[0], "{asked:?}");
        // Fragments that were not kept out were tested, as were the samples of the portals.
        let kept_out = counted(&report, "stencil-test", "kept_out_count");
        assert!(asked[1] + kept_out > asked[0], "{asked:?} {kept_out}");
        let said = array(&report, "conclusions").iter();
        let said = said.filter_map(Value::as_str);
        assert_eq!(
            said.filter(|told| told.contains("stencil-test tests"))
                .count(),
            1
        );
    }
    let open = json(&works(Path::new("."), &line.replace("rooms", "city")));
    assert!(rows(&open, "fragment").all(|row| row["name"] != "stencil-test"));
}
