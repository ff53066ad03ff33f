//! glTF as a scene: y up, with triangles and camera places.

use std::fs;
use std::path::Path;

use super::FULL_CAMERA;
use super::process::*;

fn turned() -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/gltf");
    folder.join("turned.gltf").display().to_string()
}

/// A camera of a y-up scene, or the same one where (z, x, y) are its (x, y, z).
fn camera(z_up: bool, [eye, look]: [[f64; 3]; 2]) -> String {
    let turned = [eye, look, [0.0, 1.0, 0.0]].map(|[x, y, z]| match z_up {
        true => format!("{z},{x},{y}"),
        false => format!("{x},{y},{z}"),
    });
    format!("{},50,1.5,0.1,100\n", turned.join(","))
}

#[test]
fn a_y_up_file_and_its_boxes_as_z_up_csv_are_seen_alike() {
    let folder = folder(&[]);
    let line = format!("scene convert {} --out y.csv", turned());
    assert_eq!(cullbench(folder.path(), &line).code, Some(0));
    let boxes = fs::read_to_string(folder.path().join("y.csv")).expect("boxes");
    let header = boxes.lines().next().expect("a header").to_owned();
    let mut z_up = header + "\n";
    for line in boxes.lines().skip(1) {
        let f: Vec<&str> = line.split(',').collect();
        z_up += &format!(
            "{},{},{},{},{},{},{}\n",
            f[2], f[0], f[1], f[5], f[3], f[4], f[6]
        );
    }
    fs::write(folder.path().join("z.csv"), z_up).expect("writable");
    let views = [
        [[0.0, 20.0, 0.0], [10.0, 24.0, -25.0]],
        [[12.0, 40.0, -20.0], [12.0, 20.0, -22.0]],
        [[0.0, 20.0, 0.0], [-10.0, 20.0, 30.0]],
    ];
    let mut answers = Vec::new();
    for (scene, z_up) in [(turned(), false), ("z.csv".to_owned(), true)] {
        let rows: String = views.map(|view| camera(z_up, view)).concat();
        let text = format!("{FULL_CAMERA}\n{rows}");
        fs::write(folder.path().join("c.csv"), text).expect("writable");
        let line = format!("query --scene {scene} --cameras c.csv --structure all --ids");
        let rows = rows_of(&works(folder.path(), &line));
        assert!(rows.iter().any(|row| row.1 == "0 1") && rows.iter().any(|row| row.1.is_empty()));
        answers.push(rows);
    }
    assert_eq!(answers[0], answers[1]);
}

fn rows_of(csv: &str) -> Vec<(String, String)> {
    let rows = rows(csv).into_iter();
    rows.map(|row| {
        (
            row["camera"].clone() + &row["structure"],
            row["visible_ids"].clone(),
        )
    })
    .collect()
}

#[test]
fn a_note_tells_of_skins() {
    let text = fs::read_to_string(turned()).expect("readable");
    let skinned = text.replacen("\"mesh\"", "\"skin\": 0, \"mesh\"", 1);
    let folder = folder(&[("s.gltf", skinned.as_bytes())]);
    let done = cullbench(folder.path(), "scene info s.gltf");
    let note = "note: s.gltf: 1 item with a skin, placed by its node and not by joints\n";
    assert_eq!((done.code, done.err.as_str()), (Some(0), note));
}

#[test]
fn its_triangles_and_cameras_reach_the_later_stages() {
    let folder = folder(&[]);
    let path = "--path outside:frames=4 --processes 1 --samples 48x32 --format json";
    let line = format!("funnel --scene {} {path}", turned());
    let report = json(&works(folder.path(), &line));
    for row in array(&report, "stages") {
        assert_eq!(
            row["false_negative_count"].as_f64().unwrap_or(0.0),
            0.0,
            "{row}"
        );
    }
    let of_triangles = |row: &&serde_json::Value| row["stage"] == "triangle";
    assert!(
        array(&report, "stages")
            .iter()
            .any(|row| of_triangles(&row))
    );
    works(
        folder.path(),
        &format!(
            "query --scene {} --cameras places --structure bvh",
            turned()
        ),
    );
}

#[test]
fn its_cameras_keep_their_lens_and_its_animation_is_a_path() {
    let folder = folder(&[]);
    let animated = turned().replace("turned.gltf", "animated.gltf");
    let lens = |path: &str| {
        let line = format!("scene info {animated} --path {path} --format json");
        json(&works(folder.path(), &line))["cameras"].clone()
    };
    for (path, count) in [("places", 1), ("animation:frames=5", 5)] {
        let cameras = lens(path);
        assert_eq!(cameras["camera_count"], count);
        let fovy = cameras["lens"]["fovy_deg"][0].as_f64().expect("degrees");
        assert!((fovy - 57.29578).abs() < 1e-5, "{fovy}");
        assert_eq!(cameras["lens"]["aspect"], serde_json::json!([1.5, 1.5]));
        assert_eq!(cameras["lens"]["far"], serde_json::json!([99.0, 99.0]));
    }
    let typed = lens("places:fovy=40,far=50");
    assert_eq!(typed["lens"]["fovy_deg"][0], 40.0);
    assert_eq!(typed["lens"]["far"][1], 50.0);
    let done = cullbench(folder.path(), "query --scene city:n=9 --cameras animation");
    assert_eq!(done.code, Some(2));
    assert!(
        done.err.contains("no animated camera; expected"),
        "{}",
        done.err
    );
}
