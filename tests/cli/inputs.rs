//! Inputs: the up axis of a scene, and what is said of cameras and lenses as used.

use std::path::Path;

use super::process::*;
use super::run_tables::prose;
use super::{BOXES, FULL_CAMERA};

/// Corners of random boxes, z up.
fn corners() -> Vec<[i64; 6]> {
    let mut random = Random(7);
    let corners = |_| {
        let low = [100, 60, 20].map(|most| random.between(-most, most));
        let size = [(); 3].map(|()| random.between(1, 9));
        [
            low[0],
            low[1],
            low[2],
            low[0] + size[0],
            low[1] + size[1],
            low[2] + size[2],
        ]
    };
    (0..400).map(corners).collect()
}

fn table(header: &str, rows: impl IntoIterator<Item = [i64; 6]>) -> String {
    let row = |row: [i64; 6]| row.map(|n| n.to_string()).join(",");
    let rows: Vec<String> = rows.into_iter().map(row).collect();
    format!("{header}\n{}\n", rows.join("\n"))
}

/// The same in axes of which y is up.
fn y_up([a, b, c, d, e, f]: [i64; 6]) -> [i64; 6] {
    [b, c, a, e, f, d]
}

/// The scene in both axes.
fn both_axes() -> tempfile::TempDir {
    folder(&[
        ("z.csv", table(BOXES, corners()).as_bytes()),
        (
            "y.csv",
            table(BOXES, corners().into_iter().map(y_up)).as_bytes(),
        ),
    ])
}

fn ids(folder: &Path, line: &str) -> Vec<String> {
    let out = works(
        folder,
        &format!("query {line} --structure linear,quadtree --ids"),
    );
    let ids = rows(&out).into_iter().map(|row| row["visible_ids"].clone());
    ids.collect()
}

#[test]
fn generated_paths_turn_about_the_up_axis() {
    let folder = both_axes();
    for path in [
        "orbit:frames=9,radius=0.9",
        "flythrough:frames=9",
        "spin:frames=9",
        "zoom:frames=9",
        "teleport:frames=9",
        "outside:frames=4",
        "street:frames=9",
        "flythrough:frames=9,visible=5%",
    ] {
        let [z, y, as_z] = ["z.csv", "y.csv --up y", "y.csv"]
            .map(|scene| ids(folder.path(), &format!("--scene {scene} --cameras {path}")));
        assert!(z.iter().any(|ids| ids.contains(' ')), "{path}: {z:?}");
        assert_eq!(z, y, "{path}");
        assert!(as_z != y || path.starts_with("outside"), "{path}");
    }
}

#[test]
fn recorded_cameras_see_the_same_whatever_is_up() {
    let folder = both_axes();
    // Level views with y up, from the middle.
    let cameras: Vec<String> = [(1, 0), (0, 1), (-1, 0), (3, -4)]
        .map(|(x, z)| format!("0,0,0,{x},0,{z},0,1,0,50,1.5,0.5,400"))
        .into();
    let cameras = format!("{FULL_CAMERA}\n{}\n", cameras.join("\n"));
    std::fs::write(folder.path().join("c.csv"), &cameras).expect("writable");
    let [said, unsaid] = ["--up y", "--up z"].map(|up| {
        let line = format!("query --scene y.csv --cameras c.csv --structure linear --ids {up}");
        cullbench(folder.path(), &line).out
    });
    assert_eq!(said, unsaid);
    assert!(
        rows(&said)
            .iter()
            .all(|row| row["visible_ids"].contains(' '))
    );
    // Without up the cameras get the scene's.
    let bare: Vec<String> = cameras
        .lines()
        .map(|line| {
            let fields: Vec<&str> = line.split(',').collect();
            [&fields[..6], &fields[9..]].concat().join(",")
        })
        .collect();
    std::fs::write(folder.path().join("bare.csv"), bare.join("\n")).expect("writable");
    let ids = |line: &str| ids(folder.path(), line);
    let with_up = ids("--scene y.csv --up y --cameras c.csv");
    assert_eq!(ids("--scene y.csv --up y --cameras bare.csv"), with_up);
    // Two of them look along z.
    let wrong = cullbench(folder.path(), "query --scene y.csv --cameras bare.csv");
    let wanted = "bare.csv, line 3: up is zero or parallel to the direction of view; expected columns \
                  up_x,up_y,up_z";
    assert_eq!(
        (wrong.code, wrong.err),
        (Some(2), format!("error: {wanted}\n"))
    );
}

#[test]
fn every_command_that_reads_a_scene_takes_up() {
    let folder = both_axes();
    for command in [
        "run",
        "query",
        "locate",
        "verify",
        "precision",
        "advise",
        "funnel",
        "compare",
        "scene info",
        "scene generate",
        "scene convert",
        "scene draw",
    ] {
        let help = works(folder.path(), &format!("{command} --help"));
        assert!(help.contains("--up <AXIS>"), "{command}");
    }
    let wrong = cullbench(folder.path(), "scene info y.csv --up x");
    assert_eq!(wrong.code, Some(2));
    assert!(
        wrong.err.contains("'x'") && wrong.err.contains("y, z"),
        "{wrong:?}"
    );
    // What states its axes keeps them.
    let line = "query --scene freedm-map12 --cameras places:frames=2 --structure bvh --ids";
    let said = cullbench(folder.path(), &format!("{line} --up y"));
    assert_eq!((said.code, said.out), (Some(0), works(folder.path(), line)));
    let wanted = "note: freedm-map12: z is up by its format; --up y is for boxes CSV and OBJ\n";
    assert_eq!(said.err, wanted);
    // What does not may be flat along the other axis.
    let header = "min_x,min_y,min_z,max_x,max_y,max_z";
    std::fs::write(
        folder.path().join("f.csv"),
        format!("{header}\n0,0,0,9,2,9\n"),
    )
    .unwrap();
    let told = ["", " --up y", " --up z"]
        .map(|up| cullbench(folder.path(), &format!("scene info f.csv{up}")).err);
    let wanted = "note: f.csv: flat along y; --up y if that is up, --up z if not\n";
    assert_eq!(told, [wanted, "", ""]);
    // Coordinates are not turned.
    let done = cullbench(folder.path(), "scene convert y.csv --up y");
    let kept = std::fs::read_to_string(folder.path().join("y.csv")).expect("a scene");
    assert_eq!((done.code, done.out), (Some(0), kept));
    assert!(
        done.err.contains("does not state that y is up"),
        "{}",
        done.err
    );
}

const MATRIX: &str = "m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23,m30,m31,m32,m33";
/// From (2, 3, 1) along +y with z up, 90 degrees, from 1 to 9 ahead, depth -1 to 1.
const GL: &str = "1,0,0,-2,0,0,1,-1,0,1.25,0,-6,0,1,0,-3";
/// A lens without a view.
const LONE: &str = "1,0,0,0,0,1,0,0,0,0,-1.02,-2.02,0,0,-1,0";
/// The axis of x leans towards z.
const SHEARED: &str = "1,0,0.5,-2,0,0,1,-1,0,1.25,0,-6,0,1,0,-3";

#[test]
fn a_run_says_axes_and_lens_as_used() {
    let folder = both_axes();
    let cameras = format!(
        "{FULL_CAMERA}\n0,-90,0,0,0,0,0,0,1,50,1.5,0.5,\n0,-90,0,0,0,0,0,0,1,60,1.5,0.5,400\n"
    );
    std::fs::write(folder.path().join("c.csv"), cameras).expect("writable");
    let run = "run --scene z.csv --path c.csv --structure linear,bvh --processes 2 --out run";
    let out = works(folder.path(), run);
    for wanted in [
        "z up, no unit stated",
        "50 to 60 degrees, aspect 1.5, near 0.5, far 400 to infinite",
    ] {
        assert!(out.contains(wanted), "{wanted}: {out}");
    }
    let file = |name: &str| {
        let file = folder.path().join("run").join(name);
        std::fs::read_to_string(file).expect("a file of the run")
    };
    let report = json(&file("report.json"));
    let [scene, path] = ["scene", "path"].map(|of| &array(&report, "cells")[0][of]);
    assert_eq!((&scene["up"], scene["unit"].is_null()), (&"z".into(), true));
    let lens = &path["lens"];
    assert_eq!(lens["fovy_deg"], serde_json::json!([50.0, 60.0]));
    assert_eq!(lens["far"], serde_json::json!([400.0, null]));
    assert!(array(path, "warnings").is_empty() && lens["matrix"].is_null());
    let summary = file("summary.csv");
    let row = &rows(&summary)[0];
    for (column, wanted) in [
        ("up", "z"),
        ("unit", ""),
        ("fovy_deg_min", "50"),
        ("fovy_deg_max", "60"),
        ("aspect_min", "1.5"),
        ("near_max", "0.5"),
        ("far_min", "400"),
        ("far_max", "inf"),
        ("matrix_convention", ""),
    ] {
        assert_eq!(row[column], wanted, "{column}");
    }
    let header = summary.lines().next().expect("a header");
    assert!(header.contains("far_max,matrix_convention"), "{header}");
    // Several scenes share a line.
    let many = "run --scene freedm-map12 --scene city:n=300 --path spin:frames=4 --structure \
                linear,bvh --processes 2 --no-bounds --out many";
    let out = works(folder.path(), many);
    assert!(
        out.contains("z up; 60 degrees, aspect 1.778, near "),
        "{out}"
    );
}

#[test]
fn matrices_are_said_taken_apart() {
    let folder = both_axes();
    std::fs::write(folder.path().join("m.csv"), format!("{MATRIX}\n{GL}\n")).expect("writable");
    let taken = "column-gl; the first: depth -1 to 1, eye (2, 3, 1), right (1, 0, 0), up (0, 0, \
                 1), forward (0, 1, 0)";
    let cameras = "--path m.csv --matrix-convention column-gl";
    let run = format!("run --scene z.csv {cameras} --structure linear,bvh --processes 2 --out run");
    for line in [run.as_str(), &format!("scene info z.csv {cameras}")] {
        let out = works(folder.path(), line);
        let words: Vec<&str> = out.split_whitespace().collect();
        let words = words.join(" ");
        for wanted in [
            taken,
            "90 degrees, aspect 1, near 1, far 9",
            "z up, no unit stated",
        ] {
            assert!(words.contains(wanted), "{wanted}: {words}");
        }
    }
    let summary = std::fs::read_to_string(folder.path().join("run/summary.csv")).expect("a table");
    let row = &rows(&summary)[0];
    for (column, wanted) in [
        ("matrix_convention", "column-gl"),
        ("matrix_depth_near", "-1"),
        ("matrix_depth_far", "1"),
        ("matrix_eye_x", "2"),
        ("matrix_eye_y", "3"),
        ("matrix_eye_z", "1"),
        ("matrix_is_mirrored", "false"),
    ] {
        assert_eq!(row[column], wanted, "{column}");
    }
    let info = json(&works(
        folder.path(),
        &format!("scene info z.csv {cameras} --format json"),
    ));
    assert_eq!((&info["up"], info["unit"].is_null()), (&"z".into(), true));
    let matrix = &info["cameras"]["lens"]["matrix"];
    assert_eq!(matrix["forward"], serde_json::json!([0.0, 1.0, 0.0]));
    assert_eq!(matrix["depth"], serde_json::json!([-1.0, 1.0]));
    // Without cameras: those that state no lens.
    let info = works(folder.path(), "scene info helsinki --fovy 40 --near 2");
    let words: Vec<&str> = info.split_whitespace().collect();
    let words = words.join(" ");
    assert!(words.contains("axes z up, in m"), "{words}");
    let lens = "recorded ones without a lens: 40 degrees, aspect 1.778, near 2, far 3879";
    assert!(words.contains(lens), "{words}");
}

#[test]
fn doubtful_cameras_are_one_warning_each_and_recorded() {
    let folder = both_axes();
    let camera = |eye: &str, up: &str| format!("{FULL_CAMERA}\n{eye},{up},50,1.5,0.5,4000\n");
    let from = "0,-90,0,0,0,0";
    let files = [
        ("y_up.csv", camera("90,0,0,0,0,0", "0,1,0")),
        (
            // The second looks along z, about which nothing is rolled.
            "two.csv",
            camera("90,0,0,0,0,0", "0,1,0") + "0,0,90,0,0,0,0,1,0,50,1.5,0.5,4000\n",
        ),
        ("rolled.csv", camera(from, "1,0,0.2")),
        ("down.csv", camera(from, "0,0,-1")),
        ("far.csv", camera("0,-3000,0,0,0,0", "0,0,1")),
        ("away.csv", camera("0,-90,0,0,-91,0", "0,0,1")),
        ("sheared.csv", format!("{MATRIX}\n{GL}\n{SHEARED}\n")),
        ("gl.csv", format!("{MATRIX}\n{GL}\n")),
        ("lone.csv", format!("{MATRIX}\n{LONE}\n{LONE}\n")),
    ];
    for (name, text) in &files {
        std::fs::write(folder.path().join(name), text).expect("writable");
    }
    for (cameras, wanted) in [
        (
            "y_up.csv",
            "y_up.csv: y is up in 1 of 1 camera, z in z.csv; --up y if it is the scene's",
        ),
        ("two.csv", "two.csv: y is up in 2 of 2 cameras, z in z.csv"),
        ("y_up.csv --up y", ""),
        (
            "rolled.csv",
            "rolled.csv: 1 of 1 camera rolled by more than 45 degrees",
        ),
        (
            "down.csv",
            "down.csv: 1 of 1 camera rolled by more than 45 degrees",
        ),
        (
            "far.csv",
            "far.csv: 1 of 1 camera more than 3 scene diagonals outside of z.csv as loaded, up to",
        ),
        (
            "away.csv",
            "away.csv: nothing of z.csv as loaded is visible in its view",
        ),
        (
            "sheared.csv --matrix-convention column-gl",
            "sheared.csv: 1 of 2 cameras sheared",
        ),
        (
            "gl.csv --matrix-convention row-gl",
            "gl.csv: 1 of 1 camera read as row-gl sheared, their transposes are not; \
             --matrix-convention column-gl",
        ),
        ("gl.csv --matrix-convention column-gl", ""),
        (
            "lone.csv --matrix-convention column-gl",
            "lone.csv: all matrices with the eye at 0 and the axes of the world, as without a view; \
             expected projection x view",
        ),
        ("outside:frames=4", ""),
    ] {
        let line = format!("query --scene z.csv --structure linear --cameras {cameras}");
        let done = cullbench(folder.path(), &line);
        assert_eq!(done.code, Some(0), "{line}: {}", done.err);
        let lines: Vec<&str> = done.err.lines().collect();
        let starts = format!("warning: {wanted}");
        let is_said = |line: &&&str| line.starts_with(&starts);
        let (found, all) = (lines.iter().filter(is_said).count(), lines.len());
        assert_eq!(
            found,
            usize::from(!wanted.is_empty()),
            "{line}: {}",
            done.err
        );
        assert_eq!(all, found, "{line}: {}", done.err);
    }
    // Told once by the run, and recorded in its report and page.
    let run = "run --scene z.csv --path y_up.csv --structure linear,bvh --processes 2 --out run";
    let done = cullbench(folder.path(), run);
    let told = "warning: y_up.csv: y is up in 1 of 1 camera";
    assert_eq!(
        (done.code, done.err.matches(told).count()),
        (Some(0), 1),
        "{done:?}"
    );
    let file = |name: &str| {
        let file = folder.path().join("run").join(name);
        std::fs::read_to_string(file).expect("a file of the run")
    };
    let report = json(&file("report.json"));
    let warnings = array(&array(&report, "cells")[0]["path"], "warnings");
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(
        warnings[0]
            .as_str()
            .is_some_and(|text| told.contains(&text[..20]))
    );
    let page = file("report.html");
    let warned = page.find("Warning: y_up.csv: y is up in 1 of 1 camera");
    assert!(warned.is_some() && warned < page.find("Machine and command"));
    // The fastest of empty answers is no advice.
    let run = "run --scene z.csv --path away.csv --structure linear,bvh --processes 2 --out away";
    let done = cullbench(folder.path(), run);
    let is_advised = done.out.contains("Take ") || done.out.contains("repaid after ");
    assert!(
        done.out
            .contains("Nothing is to be taken: no camera sees an item")
            && !is_advised,
        "{done:?}"
    );
    for study in ["advise", "funnel --samples 32x18"] {
        let line = format!("{study} --scene z.csv --path away.csv --structure bvh --processes 1");
        let told = prose(&cullbench(folder.path(), &line).out);
        let is_advised = ["Take ", "Use ", " is not needed"]
            .iter()
            .any(|s| told.contains(s));
        assert!(
            told.contains("Nothing is to be taken: no ") && !is_advised,
            "{told}"
        );
        let of_gains = |line: &str| array(&json(&works(folder.path(), line)), "gains").to_vec();
        if study != "advise" {
            let mut gains = of_gains(&(line + " --format json")).into_iter();
            assert!(gains.all(|gain| gain["break_even_ns"].is_null()));
        }
    }
    let line = "advise --scene z.csv --path away.csv --structure bvh --processes 1 --format json";
    let advice = json(&cullbench(folder.path(), line).out);
    assert!(advice["structure"]["name"].is_null() && advice["test"]["name"].is_null());
    assert!(array(&advice, "changes").is_empty());
    for rule in array(&advice, "omissions") {
        assert_eq!(rule["decision"], "not_applicable", "{rule}");
    }
    // The warnings about cameras are on the pages too.
    for line in [
        "funnel --scene z.csv --path away.csv --samples 32x18 --processes 1 --html page.html",
        "precision --scene z.csv --path away.csv --cubes 0 --processes 1 --html page.html",
        "view --scene z.csv --path away.csv --out page.html",
    ] {
        let done = cullbench(folder.path(), line);
        let page = std::fs::read_to_string(folder.path().join("page.html")).expect("a page");
        let told = "arning: away.csv: nothing of z.csv as loaded is visible in its view";
        assert!(done.err.contains(told) && page.contains(told), "{done:?}");
    }
    // Nor does it count beside others.
    let both = "run --scene z.csv --path away.csv --path orbit:frames=4 --processes 3 --out both \
        --structure linear,bvh";
    let told = prose(&cullbench(folder.path(), both).out);
    let counts = [
        "; first or tied in 1",
        " of 1. 1 row left out: no camera sees an item.",
    ];
    assert!(counts.iter().all(|wanted| told.contains(wanted)), "{told}");
}

#[test]
fn drawings_look_along_the_up_axis() {
    let folder = both_axes();
    for what in ["", "--structure quadtree --depth 3"] {
        let [z, y] = ["z.csv", "y.csv --up y"].map(|scene| {
            let camera = "--camera flythrough:frames=4 --frame 1";
            let line = format!("scene draw {scene} {what} {camera} --out out.svg");
            let done = cullbench(folder.path(), &line);
            assert_eq!(done.code, Some(0), "{line}: {}", done.err);
            let svg = std::fs::read_to_string(folder.path().join("out.svg")).expect("a picture");
            // Trees over other axes have their nodes in another order.
            let mut parts: Vec<String> = svg
                .replace("y.csv", "z.csv")
                .replace(">z, in units", ">x, in units")
                .replace("middle\">x</text>", "middle\">y</text>")
                .split_inclusive(['M', '"'])
                .map(|part| part.trim_end_matches('M').to_owned())
                .collect();
            parts.sort();
            parts
        });
        assert!(z.len() > 400 && z == y, "{what}");
    }
}
