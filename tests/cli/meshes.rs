//! Generated meshes as scenes: `funnel` uses their triangles, other commands boxes.

use std::path::Path;

use super::funnel::{picked_exactly, row, rows};
use super::process::*;

#[test]
fn the_funnel_of_a_mesh_is_judged_by_its_triangles() {
    for (scene, path) in [
        ("mesh:spheres:n=40k", "flythrough:frames=4"),
        ("mesh:forest:n=10k", "street:frames=2"),
        ("mesh:terrain:n=5k", "street:frames=1"),
        ("mesh:statue:n=5k", "orbit:frames=1"),
    ] {
        let line = format!(
            "funnel --scene {scene} --path {path} --samples 64x36 --processes 1 --format json"
        );
        let report = json(&works(Path::new("."), &line));
        for row in array(&report, "stages") {
            let what = format!("{scene} {} {}", row["stage"], row["name"]);
            if row["guarantee"] != "unproven" {
                assert_eq!(number(row, "false_negative_count"), 0.0, "{what}");
            }
        }
        let inner = &report["inner_boxes"];
        let [items, boxed] = ["item_count", "boxed_count"].map(|name| number(inner, name));
        assert_eq!(items, number(&report, "items"), "{scene}");
        // Of spheres and statues all, of a forest the trees, of ground nothing.
        match scene.split(':').nth(1) {
            Some("spheres" | "statue") => assert_eq!(boxed, items, "{scene}"),
            Some("forest") => assert!(boxed > 10.0 && boxed < items / 2.0, "{boxed} of {items}"),
            _ => assert!(boxed == 0.0 && inner["volume_share"].is_null()),
        }
        if boxed > 0.0 {
            let share = number(inner, "volume_share");
            assert!(share > 0.25 && share < 0.8, "{scene}: {share}");
        }
        assert!(number(inner, "build_ns") > 0.0);
        let none = row(&report, "triangle", "none");
        let exact = row(&report, "triangle", "per-triangle");
        assert_eq!(number(exact, "false_positive_count"), 0.0, "{scene}");
        assert_eq!(number(none, "input_count"), number(exact, "input_count"));
        picked_exactly(&report);
        match scene.split(':').nth(1) {
            // Geodesic spheres of 1,280 triangles.
            Some("spheres") => {
                let left = number(row(&report, "fragment", "none"), "input_count");
                assert_eq!(number(none, "input_count"), 1280.0 * left);
                let hidden = row(&report, "occlusion", "masked-inner");
                assert!(number(hidden, "output_count") < number(hidden, "input_count"));
            }
            // All of it is left of every view, of which the eye sees less than half.
            Some("statue") => {
                let made = 20.0 * 15.0 * 15.0;
                assert_eq!(number(none, "input_count"), made);
                let share = number(exact, "output_count") / made;
                assert!((0.1..0.5).contains(&share), "{share}");
            }
            _ => {}
        }
    }
}

/// The same boxes as a file: the same frustum, and another truth.
#[test]
fn triangles_hide_less_than_their_boxes() {
    let folder = folder(&[]);
    let scene = "mesh:spheres:n=60k";
    let done = cullbench(folder.path(), &format!("scene convert {scene} boxes.csv"));
    assert_eq!(done.code, Some(0), "{done:?}");
    let visible = [scene, "boxes.csv"].map(|scene| {
        let line = format!(
            "funnel --scene {scene} --path orbit:frames=3 --samples 96x54 --processes 1 \
             --format json"
        );
        let report = json(&works(folder.path(), &line));
        let object = rows(&report, "object").find(|row| row["structure"] == "wide");
        let object = object.expect("the structure of the chain");
        ["output_count", "truth_count"].map(|name| number(object, name))
    });
    assert_eq!(visible[0][0], visible[1][0]);
    assert!(visible[0][1] > visible[1][1], "{visible:?}");
}

#[test]
fn a_mesh_is_a_scene_of_every_command() {
    let folder = folder(&[]);
    let ask = |line: &str| json(&works(folder.path(), &format!("{line} --format json")));
    let info = ask("scene info mesh:statue:n=5k,seed=7");
    assert_eq!(
        (&info["total_count"], &info["triangle_count"]),
        (&1.into(), &4500.into())
    );
    let verify = ask("verify --scene mesh:forest:n=20k --path street:frames=4 --cases 0");
    assert_eq!(
        (&verify["ok"], &verify["mismatches"]),
        (&true.into(), &0.into())
    );
    assert!(number(&verify, "verdicts") > 1000.0);
    let table = works(
        folder.path(),
        "funnel --scene mesh:forest:n=5k --path street:frames=2 --samples 32x18 --processes 1 --all",
    );
    for word in [
        "Occluders: boxes that hide others",
        "of the volume, %",
        "found in",
        "items of ground",
    ] {
        assert!(table.replace('\n', " ").contains(word), "{word}: {table}");
    }
    let generated = cullbench(folder.path(), "scene convert mesh:forest:n=5k f.csv");
    assert_eq!(generated.code, Some(0));
    assert!(
        generated.err.contains("triangles not written"),
        "{generated:?}"
    );
    let run = "run --scene mesh:forest:n=5k,seed=2 --path street:frames=4 --structure linear,bvh \
               --processes 1 --out run";
    let done = cullbench(folder.path(), run);
    assert_eq!(done.code, Some(0), "{done:?}");
}

#[test]
fn what_a_mesh_cannot_be_is_refused_in_a_line() {
    let here = Path::new(".");
    for (line, wanted) in [
        (
            "scene info mesh:sphere",
            "unknown scene 'mesh:sphere' | did you mean 'mesh:spheres'",
        ),
        ("scene info mesh:", "unknown scene 'mesh:'"),
        ("scene info mesh:statue:n=0", "mesh:statue | n is '0'"),
        ("scene info mesh:statue:n=1G", "mesh:statue | n is '1G'"),
        ("scene info mesh:statue:relief=3", "mesh:statue | relief"),
        (
            "scene info mesh:statue:offset=1e300",
            "mesh:statue | item 0 | f32",
        ),
    ] {
        assert_refused(&cullbench(here, line), wanted, line);
    }
}
