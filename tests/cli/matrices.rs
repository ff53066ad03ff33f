//! Cameras that are matrices: what a camera of the same numbers sees, under
//! every name, by every command, and what is refused.

use std::path::Path;

use cullbench::camera::{Camera, ClipSpace, Lens, look_at};
use glam::{DMat4, DVec3};
use serde_json::Value;

use super::process::*;
use super::{BOXES, EYE_LOOK};

pub const ENTRIES: &str = "m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23,m30,m31,m32,m33";

/// From (2, 3, 1) along +y with z up, 90 degrees, from 1 to 9 ahead: x to the
/// right, z upward.
const EYE: &str = "2,3,1,2,4,1,90,1,1,9";
/// Depth -1 to 1: z = (10 (y - 3) - 18)/8.
const GL: [[f64; 4]; 4] = [
    [1.0, 0.0, 0.0, -2.0],
    [0.0, 0.0, 1.0, -1.0],
    [0.0, 1.25, 0.0, -6.0],
    [0.0, 1.0, 0.0, -3.0],
];
/// Depth 0 to 1: z = 9/8 (y - 4).
const D3D: [f64; 4] = [0.0, 1.125, 0.0, -4.5];
/// Depth 1 to 0: z = (12 - y)/8.
const REVERSED: [f64; 4] = [0.0, -0.125, 0.0, 1.5];

fn row(m: [[f64; 4]; 4], by_columns: bool) -> String {
    let entry = |i: usize| {
        let (row, column) = (i / 4, i % 4);
        if by_columns {
            m[column][row]
        } else {
            m[row][column]
        }
    };
    let entries: Vec<String> = (0..16).map(|i| entry(i).to_string()).collect();
    entries.join(",")
}

fn with_depth(depth: [f64; 4]) -> [[f64; 4]; 4] {
    let [x, y, _, w] = GL;
    [x, y, depth, w]
}

fn boxes() -> String {
    let mut random = Random(3);
    let mut text = format!("{BOXES}\n");
    for _ in 0..500 {
        let low = [(); 3].map(|()| random.between(-60, 80));
        let high = low.map(|low| low + random.between(0, 9));
        let all: Vec<String> = low
            .into_iter()
            .chain(high)
            .map(|v| (v as f64 / 4.0).to_string())
            .collect();
        text += &format!("{}\n", all.join(","));
    }
    text
}

fn seen(folder: &Path, cameras: &str) -> Vec<[String; 2]> {
    let mut all = Vec::new();
    for test in ["sphere", "six-plane", "exact"] {
        let line = format!(
            "query --scene boxes.csv --cameras {cameras} --structure linear,bvh --ids --test {test}"
        );
        let rows = rows(&works(folder, &line));
        all.extend(
            rows.iter()
                .map(|row| ["structure", "visible_ids"].map(|c| row[c].clone())),
        );
    }
    all
}

#[test]
fn a_matrix_sees_what_its_camera_sees_under_every_name() {
    let eye = format!("{EYE_LOOK},fovy_deg,aspect,near,far\n{EYE}\n");
    let cases = [
        ("column-gl", row(GL, false)),
        ("column-d3d", row(with_depth(D3D), false)),
        ("column-d3d", row(with_depth(REVERSED), false)),
        ("row-gl", row(GL, true)),
        ("row-d3d", row(with_depth(D3D), true)),
        ("row-d3d", row(with_depth(REVERSED), true)),
    ];
    let folder = folder(&[
        ("boxes.csv", boxes().as_bytes()),
        ("eye.csv", eye.as_bytes()),
    ]);
    let wanted = seen(folder.path(), "eye.csv");
    assert!(
        wanted.iter().all(|row| row[1].split(' ').count() > 10),
        "{wanted:?}"
    );
    for (name, row) in &cases {
        let text = format!("time_s,{ENTRIES}\n0,{row}\n");
        std::fs::write(folder.path().join("matrix.csv"), text).expect("writable");
        let cameras = format!("matrix.csv --matrix-convention {name}");
        assert_eq!(seen(folder.path(), &cameras), wanted, "{name}");
        // By its transpose it is another camera, or none.
        let (kind, depth) = name.split_once('-').expect("two words");
        let other = if kind == "row" { "column" } else { "row" };
        let line = format!(
            "query --scene boxes.csv --cameras matrix.csv --structure linear --ids \
             --matrix-convention {other}-{depth}"
        );
        let done = cullbench(folder.path(), &line);
        assert!(
            done.code == Some(2) || !done.out.contains(&wanted[2][1]),
            "{name}: {done:?}"
        );
    }
}

#[test]
fn options_of_other_cameras_are_told_once() {
    let eye = format!("{EYE_LOOK},fovy_deg,aspect,near,far\n{EYE}\n");
    let matrix = format!("{ENTRIES}\n{}\n", row(GL, false));
    let folder = folder(&[
        ("boxes.csv", boxes().as_bytes()),
        ("eye.csv", eye.as_bytes()),
        ("m.csv", matrix.as_bytes()),
    ]);
    let convention = "--matrix-convention column-gl";
    let lens = |cameras: &str, name: &str| {
        format!("note: {cameras}: not used, its cameras have their own: {name}\n")
    };
    let of = |cameras: &str| {
        format!("note: {cameras}: --matrix-convention is for cameras that are matrices\n")
    };
    for (cameras, note) in [
        (format!("m.csv {convention}"), String::new()),
        (
            format!("m.csv {convention} --near 3"),
            lens("m.csv", "--near"),
        ),
        (
            format!("m.csv {convention} --fovy 30"),
            lens("m.csv", "--fovy"),
        ),
        ("eye.csv --near 3".to_owned(), lens("eye.csv", "--near")),
        // The default, where it is typed.
        ("eye.csv --fovy 60".to_owned(), lens("eye.csv", "--fovy")),
        (format!("eye.csv {convention}"), of("eye.csv")),
        (format!("orbit:frames=2 {convention}"), of("orbit:frames=2")),
    ] {
        let line = format!("query --scene boxes.csv --structure linear --cameras {cameras}");
        let done = cullbench(folder.path(), &line);
        assert_eq!((done.code, done.err), (Some(0), note), "{line}");
    }
}

#[test]
fn every_command_takes_matrices() {
    // Without an end, and one more.
    let endless = row(with_depth([0.0, 0.0, 0.0, 1.0]), false);
    let matrices = format!("{ENTRIES}\n{}\n{endless}\n", row(with_depth(D3D), false));
    let folder = folder(&[
        ("boxes.csv", boxes().as_bytes()),
        ("m.csv", matrices.as_bytes()),
    ]);
    let on = "--scene boxes.csv --path m.csv --matrix-convention column-d3d";
    let run = works(
        folder.path(),
        &format!("run {on} --up=z --structure linear,bvh --processes 2 --out run"),
    );
    assert!(run.contains("0 wrong"), "{run}");
    let next = "advise --scene boxes.csv --path m.csv --up=z --matrix-convention=column-d3d";
    let joined = run.replace(" \\\n       ", "");
    assert!(joined.contains(next), "{run}");
    let verified = works(
        folder.path(),
        &format!("verify {on} --cases 0 --structure bvh"),
    );
    assert!(
        verified.contains("no mismatches") || verified.contains("0 mismatches"),
        "{verified}"
    );
    let precision = json(&works(
        folder.path(),
        &format!("precision {on} --structure linear --cubes 0 --format json"),
    ));
    for point in array(&precision, "points") {
        let by_frame = point["planes"] == "frame";
        assert_eq!(point["status"] == "refused", !by_frame, "{point}");
        let is_safe = by_frame && number(point, "epsilon") > 0.0;
        assert!(!is_safe || point["false_negative_count"] == 0, "{point}");
    }
}

#[test]
fn matrices_that_are_no_cameras_are_refused_in_one_line() {
    let good = row(GL, false);
    let cases: [(String, &str, &str); 8] = [
        (
            format!("{ENTRIES}\n{good}\n"),
            "",
            "line 1 | not how to read them | --matrix-convention with one of column-gl, column-d3d, row-gl, row-d3d",
        ),
        (
            format!("{}\n{good}\n", ENTRIES.replace("m21", "m44")),
            "row-gl",
            "line 1 | no column 'm21'",
        ),
        (
            format!("{ENTRIES},near\n{good},1\n"),
            "row-gl",
            "line 1 | columns of a matrix and 'near' | expected",
        ),
        (
            format!("{ENTRIES},eye_x,eye_y,eye_z\n{good},1,1,1\n"),
            "row-gl",
            "line 1 | columns of a matrix and 'eye_x' | expected",
        ),
        (
            format!("{ENTRIES}\n{good}\n{}\n", good.replacen("1,0", "inf,0", 1)),
            "column-gl",
            "line 3 | m00 'inf' | a finite number",
        ),
        (
            format!("{ENTRIES}\n{}1\n", "1,".repeat(15)),
            "column-gl",
            "line 2 | the matrix is singular | expected",
        ),
        (
            format!("{ENTRIES}\n{}\n", good.replacen('1', "1e70", 1)),
            "column-gl",
            "line 2 | m00 = 1e70 | 1e-60",
        ),
        (format!("{ENTRIES}\n"), "column-gl", "no camera"),
    ];
    let folder = with_good_files(&[]);
    for (text, name, wanted) in &cases {
        std::fs::write(folder.path().join("m.csv"), text).expect("writable");
        let option = if name.is_empty() {
            String::new()
        } else {
            format!("--matrix-convention {name}")
        };
        let line = format!("query --scene scene.csv --cameras m.csv --structure linear {option}");
        all_refused(&folder, &[line], &format!("m.csv | {wanted}"));
    }
    std::fs::write(folder.path().join("m.csv"), &cases[0].0).expect("writable");
    let query = "query --scene scene.csv --cameras m.csv --structure linear --matrix-convention";
    all_refused(
        &folder,
        &[format!("{query} column")],
        "unknown matrix convention 'column' | column-gl",
    );
    let planes = format!("{query} column-gl --planes gh-gl-f32");
    all_refused(
        &folder,
        &[planes],
        "m.csv, line 2: | own rows are its planes | expected --planes frame, which takes these, or",
    );
}

/// Every count of a report of `funnel`, with its place in the document.
pub fn counts(
    folder: &Path,
    scene: &str,
    cameras: &str,
    convention: &str,
) -> Vec<(String, String)> {
    fn collect(at: &str, value: &Value, all: &mut Vec<(String, String)>) {
        let parts: Vec<(String, &Value)> = match value {
            Value::Object(map) => map.iter().map(|(k, v)| (k.clone(), v)).collect(),
            Value::Array(list) => list
                .iter()
                .enumerate()
                .map(|(i, v)| (i.to_string(), v))
                .collect(),
            value if at.ends_with("_count") => return all.push((at.to_owned(), value.to_string())),
            _ => return,
        };
        for (key, part) in parts {
            collect(&format!("{at}/{key}"), part, all);
        }
    }
    let convention = match cameras {
        "eye.csv" => String::new(),
        _ => format!("--matrix-convention {convention}"),
    };
    let line = format!(
        "funnel --scene {scene} --path {cameras} {convention} \
         --structure linear,bvh --samples 48x32 --processes 1 --format json"
    );
    let mut all = Vec::new();
    collect("", &json(&works(folder, &line)), &mut all);
    all
}

pub fn camera(eye: [f64; 3], look: [f64; 3], lens: Lens) -> Camera {
    let frame = look_at(DVec3::from(eye), DVec3::from(look), DVec3::Z).expect("a frame");
    Camera { frame, lens }
}

pub fn matrix(camera: &Camera, clip: ClipSpace) -> DMat4 {
    camera.lens.projection(clip) * camera.frame.world_to_eye()
}

pub fn csv(matrices: impl Iterator<Item = DMat4>) -> String {
    let rows = matrices.map(|m| row(m.transpose().to_cols_array_2d(), false) + "\n");
    format!("{ENTRIES}\n{}", rows.collect::<String>())
}

/// Eyes inside and far outside, near planes at either end of depth, no far plane.
#[test]
fn a_matrix_has_the_funnel_of_its_camera() {
    let folder = folder(&[]);
    let write = |name: &str, text: String| {
        std::fs::write(folder.path().join(name), text).expect("writable");
    };
    let perspective = |fovy, near, far| Lens::perspective(fovy, 1.5, near, far).expect("a lens");
    let near_ortho = perspective(0.1, 2000.0, Some(4000.0));
    // Its eye lies on the near plane, as that of an orthographic matrix does: masked
    // buffers compare depths whose rounding depends on the eye.
    let parallel = Lens::orthographic(9.0, 1.5, 0.0, 200.0).expect("a lens");
    for (scene, eye, look, away) in [
        (
            "rooms:n=150",
            [3.5, 3.0, 1.5],
            [9.0, 8.0, 2.0],
            [-2900.0, 150.0, 200.0],
        ),
        (
            "city:n=150",
            [-40.0, 3.0, 20.0],
            [0.0, 0.0, 5.0],
            [-2900.0, 150.0, 200.0],
        ),
    ] {
        let cameras = [
            camera(eye, look, perspective(70.0, 0.05, Some(300.0))),
            camera(eye, look, perspective(70.0, 0.05, None)),
            camera(away, look, near_ortho),
            camera(away.map(|x| x * 0.01), look, parallel),
        ];
        let of = |eye: [f64; 3]| eye.map(|x| x.to_string()).join(",");
        let written = [
            (eye, "70,", "0.05,300"),
            (eye, "70,", "0.05,inf"),
            (away, "0.1,", "2000,4000"),
            (away.map(|x| x * 0.01), ",9", "0,200"),
        ];
        let rows = written
            .map(|(eye, lens, depths)| format!("{},{},{lens},1.5,{depths}\n", of(eye), of(look)));
        let header = format!("{EYE_LOOK},fovy_deg,ortho_height,aspect,near,far\n");
        write("eye.csv", header + &rows.concat());
        let wanted = counts(folder.path(), scene, "eye.csv", "column-gl");
        let seen = wanted
            .iter()
            .filter(|(at, count)| at.ends_with("/truth_count") && count != "0.0");
        assert!(
            wanted.len() > 80 && seen.count() > 10,
            "{scene}: {wanted:?}"
        );
        for (clip, convention) in [
            (ClipSpace::OpenGl, "column-gl"),
            (ClipSpace::D3d, "column-d3d"),
            (ClipSpace::ReversedZ, "column-d3d"),
        ] {
            // Of an orthographic matrix the near end has the smaller depth.
            let own = |camera: &Camera| match (clip, camera.lens.is_orthographic()) {
                (ClipSpace::ReversedZ, true) => ClipSpace::D3d,
                _ => clip,
            };
            write("m.csv", csv(cameras.iter().map(|c| matrix(c, own(c)))));
            let found = counts(folder.path(), scene, "m.csv", convention);
            assert_eq!(found, wanted, "{scene} {clip:?}");
        }
        // Off-centre, against itself upside down.
        let lens = Lens::off_axis([-0.02, 0.07, -0.01, 0.04], 0.05, Some(300.0)).expect("a lens");
        let off_centre = matrix(&camera(eye, look, lens), ClipSpace::OpenGl);
        let rolled = DMat4::from_scale(DVec3::new(-1.0, -1.0, 1.0)) * off_centre;
        let [found, wanted] = [off_centre, rolled].map(|matrix| {
            write("m.csv", csv([matrix].into_iter()));
            counts(folder.path(), scene, "m.csv", "column-gl")
        });
        assert_eq!(found, wanted, "{scene}, off-centre");
    }
}

/// Another study of the same stages.
#[test]
fn advise_takes_matrices() {
    let lens = Lens::perspective(70.0, 1.5, 0.05, Some(300.0)).expect("a lens");
    let camera = camera([3.5, 3.0, 1.5], [9.0, 8.0, 2.0], lens);
    let text = csv([matrix(&camera, ClipSpace::D3d)].into_iter());
    let folder = folder(&[("m.csv", text.as_bytes())]);
    let on = "--scene rooms:n=150 --path m.csv --matrix-convention column-d3d --processes 1";
    let report = works(folder.path(), &format!("advise {on} --format json"));
    assert!(!report.contains("the camera is a matrix"), "{report}");
}

#[test]
fn matrices_without_rays_are_refused_where_rays_are_needed() {
    let lens = Lens::perspective(70.0, 1.5, 0.05, Some(300.0)).expect("a lens");
    let camera = camera([3.5, 3.0, 1.5], [9.0, 8.0, 2.0], lens);
    let view = camera.frame.world_to_eye();
    let mut sheared = camera.lens.projection(ClipSpace::D3d);
    sheared.y_axis.x = 0.1;
    let mut oblique = camera.lens.projection(ClipSpace::D3d);
    oblique.x_axis.z = 0.2;
    let folder = folder(&[]);
    for (projection, wanted) in [
        (sheared, "line 2: the image of the matrix is sheared by"),
        (
            oblique,
            "line 2: the near plane of the matrix is oblique by",
        ),
    ] {
        let text = csv([projection * view].into_iter());
        std::fs::write(folder.path().join("m.csv"), text).expect("writable");
        let on = "--scene rooms:n=150 --path m.csv --matrix-convention column-d3d";
        let funnel = format!("funnel {on}");
        assert_refused(&cullbench(folder.path(), &funnel), wanted, &funnel);
        works(
            folder.path(),
            &format!("verify {on} --cases 0 --structure bvh"),
        );
    }
}
