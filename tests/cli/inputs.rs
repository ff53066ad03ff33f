//! Inputs: the up axis of a scene, and what is said of cameras and lenses as used.

use std::path::Path;

use super::process::*;
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
                  up_x,up_y,up_z, or --up y where y is up";
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
    let wanted = "note: freedm-map12: z is up by its format; --up y is for boxes CSV only\n";
    assert_eq!(said.err, wanted);
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
