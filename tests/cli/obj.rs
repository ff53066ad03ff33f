//! OBJ as a scene, separators of tables, standard input, unread formats.

use std::fs;
use std::path::Path;

use super::process::*;
use super::{BOXES, EYE_LOOK, FULL_CAMERA};

/// Two quadrilaterals and a triangle, y up.
const WORLD: &str = "o near\nv 8.1 20 -31\nv 20.3 20 -27.7\nv 20 25.9 -27\nf 1 2 3\n\
                     g far\nv 5.7 21.1 -21.3\nv 18.6 21 -17.3\nv 18 27 -17\nv 6 27 -17\n\
                     f -4 -3 -2 -1\nf 4 5 6\n";
/// The boxes of its groups, z up.
const BOXES_OF_IT: &str = "-31;8.1;20;-27;20.3;25.9\n-21.3;5.7;21;-17;18.6;27\n";

fn ids(csv: &str) -> Vec<(String, String)> {
    let rows = rows(csv).into_iter();
    rows.map(|row| {
        (
            row["camera"].clone() + &row["structure"],
            row["visible_ids"].clone(),
        )
    })
    .collect()
}

/// Runs with a file as standard input.
fn fed(folder: &Path, line: &str, file: &str) -> Done {
    let output = assert_cmd::Command::from_std(command(folder, line))
        .pipe_stdin(folder.join(file))
        .expect("readable")
        .output()
        .expect("the program starts");
    Done {
        code: output.status.code(),
        out: String::from_utf8(output.stdout).expect("UTF-8"),
        err: String::from_utf8(output.stderr).expect("UTF-8"),
    }
}

#[test]
fn bad_items_of_a_mesh_are_not_left_out() {
    let folder = folder(&[("y.obj", WORLD.as_bytes())]);
    let done = cullbench(folder.path(), "scene info y.obj --skip-bad-items");
    let note = "note: y.obj: --skip-bad-items is for boxes CSV\n";
    assert_eq!((done.code, done.err.as_str()), (Some(0), note));
}

/// The file and the same world as a CSV with semicolons, from the same cameras.
#[test]
fn a_y_up_file_and_its_boxes_as_z_up_csv_are_seen_alike() {
    let folder = folder(&[("y.obj", WORLD.as_bytes())]);
    let boxes = format!("{}\n{BOXES_OF_IT}", BOXES.replace(',', ";"));
    fs::write(folder.path().join("z.csv"), boxes).expect("writable");
    let views = [
        [[0.0, 20.0, 0.0], [10.0, 24.0, -25.0]],
        [[12.0, 40.0, -20.0], [12.0, 20.0, -22.0]],
        [[0.0, 20.0, 0.0], [-10.0, 20.0, 30.0]],
    ];
    let mut answers = Vec::new();
    for (scene, turn) in [("y.obj", [0, 1, 2]), ("z.csv", [2, 0, 1])] {
        let row = |[eye, look]: [[f64; 3]; 2]| {
            let all =
                [eye, look, [0.0, 1.0, 0.0]].map(|v| turn.map(|k| v[k].to_string()).join("\t"));
            format!("{}\t50\t1.5\t0.1\t100\n", all.join("\t"))
        };
        let text = format!(
            "{}\n{}",
            FULL_CAMERA.replace(',', "\t"),
            views.map(row).concat()
        );
        fs::write(folder.path().join("c.csv"), text).expect("writable");
        let line = format!("query --scene {scene} --cameras c.csv --structure all --ids");
        let rows = ids(&works(folder.path(), &line));
        assert!(rows.iter().any(|row| row.1 == "0 1") && rows.iter().any(|row| row.1.is_empty()));
        answers.push(rows);
    }
    assert_eq!(answers[0], answers[1]);
}

#[test]
fn its_triangles_reach_the_later_stages_whole_or_one_by_one() {
    let folder = folder(&[("y.obj", WORLD.as_bytes())]);
    let path = "--path outside:frames=4 --processes 1 --samples 48x32 --format json";
    for (items, count) in [("objects", 2), ("triangles", 4)] {
        let line = format!("funnel --scene y.obj --items {items} {path}");
        let report = json(&works(folder.path(), &line));
        let stages = array(&report, "stages");
        assert!(stages.iter().any(|row| row["stage"] == "triangle"));
        for row in stages {
            assert_eq!(
                row["false_negative_count"].as_f64().unwrap_or(0.0),
                0.0,
                "{row}"
            );
        }
        let line = format!("scene info y.obj --items {items} --format json");
        let info = json(&works(folder.path(), &line));
        assert_eq!(
            (&info["total_count"], &info["up"]),
            (&count.into(), &"y".into())
        );
        assert_eq!(info["triangle_count"], 4);
    }
    let with_lines = format!("mtllib no.mtl\n{WORLD}l 4 5\n");
    fs::write(folder.path().join("l.obj"), with_lines).expect("writable");
    let done = cullbench(folder.path(), "scene info l.obj --up z --format json");
    assert_eq!(json(&done.out)["up"], "z");
    assert_eq!(
        done.err,
        "note: l.obj: lines that are not read: 'l', 'mtllib'; all surfaces are opaque\n"
    );
    let done = cullbench(folder.path(), "scene info city:n=9 --items triangles");
    assert_eq!(done.code, Some(2));
    assert!(
        done.err.contains("city:n=9: no triangles; expected"),
        "{}",
        done.err
    );
}

#[test]
fn standard_input_is_one_of_scene_cameras_and_points() {
    let camera = format!("{EYE_LOOK}\n0,20,0,10,24,-25\n");
    let folder = folder(&[
        ("y.obj", WORLD.as_bytes()),
        ("c.csv", camera.as_bytes()),
        ("p.csv", b"x,y,z\n9,21,-29\n"),
    ]);
    let line = |scene: &str, cameras: &str| {
        format!("query --scene {scene} --cameras {cameras} --structure linear,bvh --ids")
    };
    let wanted = ids(&works(folder.path(), &line("y.obj", "c.csv")));
    for (line, file) in [(line("-", "c.csv"), "y.obj"), (line("y.obj", "-"), "c.csv")] {
        let done = fed(folder.path(), &line, file);
        assert_eq!(
            (done.code, ids(&done.out)),
            (Some(0), wanted.clone()),
            "{line}: {}",
            done.err
        );
    }
    let locate = "locate --scene y.obj --structure linear --points ";
    let found = fed(folder.path(), &format!("{locate}-"), "p.csv");
    assert_eq!(found.out, works(folder.path(), &format!("{locate}p.csv")));
    let run = "run --scene - --path c.csv --structure linear,bvh --processes 2 --out run";
    let done = fed(folder.path(), run, "y.obj");
    assert_eq!(done.code, Some(0), "{}", done.err);
    // Outputs are no inputs: convert's is standard output, a picture's is refused by name.
    let done = fed(folder.path(), "scene convert - - --up y", "y.obj");
    let named = cullbench(folder.path(), "scene convert y.obj --up y");
    assert_eq!(done.out, named.out);
    for out in ["-o -", "--out=-"] {
        let done = fed(folder.path(), &format!("scene draw - {out}"), "y.obj");
        assert_refused(&done, "--out is '-'; expected a file", out);
    }
    // Both programs of a comparison would have to read it.
    for inputs in [
        "--scene -",
        "--scene=- --path c.csv",
        "--scene y.obj --path -",
    ] {
        let line = format!("compare --against {} --gate work {inputs}", super::PROGRAM);
        let file = if inputs.ends_with('-') && inputs.contains("y.obj") {
            "c.csv"
        } else {
            "y.obj"
        };
        let done = fed(folder.path(), &line, file);
        assert_refused(&done, "'-' can be read only once; expected a file", inputs);
    }
    let done = fed(folder.path(), &line("-", "-"), "y.obj");
    assert_eq!(done.code, Some(2));
    assert_eq!(
        done.err,
        "error: '-' 2 times; expected standard input once\n"
    );
}

#[test]
fn formats_that_are_not_read_are_named_with_advice() {
    let folder = folder(&[
        ("a.stl", b"solid a\n"),
        ("tiles.json", b"{\"geometricError\": 1}"),
    ]);
    for (file, wanted) in [
        (
            "a.stl",
            "error: a.stl, byte 0: STL, which is not read; expected glTF or OBJ exported",
        ),
        (
            "tiles.json",
            "error: tiles.json, byte 0: 3D Tiles, which is not read; expected its tiles",
        ),
    ] {
        let done = cullbench(folder.path(), &format!("scene info {file}"));
        assert_eq!(done.code, Some(2));
        assert!(
            done.err.starts_with(wanted) && done.err.lines().count() == 1,
            "{}",
            done.err
        );
    }
}
