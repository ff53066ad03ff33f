//! The fragment stage of `funnel`: mirrors, items with holes, stencils of portals.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::BOXES;
use super::funnel::{LINE, counted, folder, plain_report, row, rows};
use super::process::*;

/// The wall as a mirror shows items behind the camera, but none behind the wall.
#[test]
fn a_mirror_shows_what_is_before_it_on_its_own_samples() {
    let folder = folder();
    // A wall, a box behind it, one before it whose image is beside it, one behind the camera.
    let scene = "10,-5,-1,11,5,10\n20,-1,0,21,1,2\n5,12,0,6,13,2\n-9,-1,0,-8,1,2\n";
    fs::write(folder.path().join("scene.csv"), format!("{BOXES}\n{scene}")).expect("written");
    let report = json(&works(folder.path(), &format!("{LINE} --mirror 0")));
    let mirror = &report["mirror"];
    assert_eq!(
        (&mirror["axis"], &mirror["view_count"]),
        (&"x".into(), &1.into())
    );
    assert_eq!(number(mirror, "shown_count"), 1.0, "{mirror}");
    assert_eq!(number(mirror, "wrong_sample_count"), 0.0);
    let [with, without] = ["with_stencil", "without_stencil"].map(|name| &mirror[name]);
    let marked = number(mirror, "marked_count");
    assert!(marked > 1000.0 && marked < 320.0 * 180.0, "{mirror}");
    // Two high and wide at a distance of 10 + 18, where a pixel is 0.18: the centres of 12
    // columns and of 11 rows.
    for count in ["fragment_count", "covered_count"] {
        assert_eq!(number(with, count), 132.0, "{mirror}");
        assert!(number(with, count) <= number(without, count), "{mirror}");
    }
    // On the whole image the box before the plane is drawn too, beside the wall.
    assert!(number(with, "kept_out_count") > 0.0, "{mirror}");
    assert_eq!(number(without, "kept_out_count"), 0.0);
    // Ids are the rows of the file, whatever is left out of it.
    fs::write(
        folder.path().join("scene.csv"),
        format!("{BOXES}\n1,nan,1,2,2,2\n{scene}"),
    )
    .expect("written");
    let line = format!("{LINE} --skip-bad-items --mirror");
    let other = json(&cullbench(folder.path(), &format!("{line} 1")).out);
    assert_eq!(number(&other["mirror"], "item"), 1.0);
    assert_eq!(other["mirror"]["with_stencil"], mirror["with_stencil"]);
    let refused = cullbench(folder.path(), &format!("{line} 0"));
    let wanted = "expected one from 0 to 4 without the rows left out";
    assert!(
        refused.code == Some(2) && refused.err.contains(wanted),
        "{refused:?}"
    );
    fs::write(folder.path().join("scene.csv"), format!("{BOXES}\n{scene}")).expect("written");
    // From behind the wall nothing of what is before it: the camera is at the other side.
    let behind = json(&works(folder.path(), &format!("{LINE} --mirror 3")));
    assert_eq!(number(&behind["mirror"], "view_count"), 0.0);
    assert!(plain_report()["mirror"].is_null());
    let table = works(folder.path(), &LINE.replace("--format json", "--mirror 0"));
    assert!(table.contains("Items seen in the mirror"), "{table}");
    assert!(
        unwrapped(&table).contains("and no samples differ"),
        "{table}"
    );
    for (line, wanted) in [
        (
            format!("{LINE} --mirror 5"),
            "--mirror 5 | 4 items | from 0 to 3",
        ),
        (format!("{LINE} --mirror wall"), "--mirror | wall"),
        (
            format!("{LINE} --mirror 0 --cut-out fence"),
            "--mirror | --cut-out",
        ),
        (
            "funnel --scene freedm-map12 --mirror 0".to_owned(),
            "freedm-map12 | walls | --mirror",
        ),
    ] {
        assert_refused(&cullbench(folder.path(), &line), wanted, &line);
    }
}

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
