//! `funnel` at its limits: sizes of scenes, windows, and depth complexity.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::BOXES;
use super::funnel::row;
use super::process::*;

const FORWARD: &str = "eye_x,eye_y,eye_z,forward_x,forward_y,forward_z,up_x,up_y,up_z";

/// The report of one view; `lens` names the columns behind those of the frame.
fn report(scene: &str, lens: &str, camera: &str, options: &str) -> Value {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), "scene.csv", &format!("{BOXES}\n{scene}"));
    write(
        folder.path(),
        "cameras.csv",
        &format!("{FORWARD},{lens}\n{camera}\n"),
    );
    let line = "funnel --scene scene.csv --path cameras.csv --processes 1 --format json";
    json(&works(folder.path(), &format!("{line} {options}")))
}

fn write(folder: &Path, name: &str, text: &str) {
    fs::write(folder.join(name), text).expect("written");
}

#[test]
fn triangles_are_those_of_the_boxes_in_the_file() {
    // Where the camera is, numbers of f32 are 8 apart.
    let scene = "99999950.0,0.0,0.0,100000001.0,100.0,100.0\n\
                 -100000010.0,0.0,0.0,-100000000.0,10.0,10.0\n";
    let camera = "100000004.0,-20.0,50.0,-0.2,1.0,0.0,0.0,0.0,1.0,60.0,1.5,0.1,1000.0";
    let options = "--occlusion none --region none --samples 48x32";
    let report = report(scene, "fovy_deg,aspect,near,far", camera, options);
    for name in ["per-triangle", "cone-f32-safe"] {
        let row = row(&report, "triangle", name);
        assert_eq!(number(row, "truth_count"), 4.0, "{name}");
        assert_eq!(number(row, "false_negative_count"), 0.0, "{name}");
    }
    let exact = row(&report, "triangle", "per-triangle");
    assert_eq!(number(exact, "output_count"), 4.0);
}

#[test]
fn areas_that_overflow_and_windows_too_narrow_for_f32_lose_nothing() {
    let large = "4e19,-1e19,-1e19,6e19,1e19,1e19\n8e19,1e19,1e19,1e20,3e19,3e19\n";
    let camera = "0,0,0,1,0,0,0,0,1,60,1.5,1e19,5e20";
    let far = report(large, "fovy_deg,aspect,near,far", camera, "--samples 48x32");
    for pick in array(&far, "picks") {
        assert_eq!(number(pick, "wrong_count"), 0.0, "{pick}");
    }
    assert_eq!(array(&far, "left_out").len(), 0);
    let tiny = "-8.32e-42,1.48e-41,-9.08e-42,-1.72e-42,1.82e-41,-8.4e-42\n";
    let camera = "1.64e-42,-1.08e-43,-1.23e-42,-0.376,0.882,-0.2825,0.837,0.527,0.177,3.5e-41,\
                  1.5,1e-42,1e-37";
    let narrow = report(
        tiny,
        "ortho_height,aspect,near,far",
        camera,
        "--samples 48x32",
    );
    let row = row(&narrow, "occlusion", "masked-inner");
    assert_eq!(
        (number(row, "truth_count"), number(row, "output_count")),
        (1.0, 1.0)
    );
}

/// Rays of orthographic cameras have origins of their own.
///
/// Far from zero those are rounded, behind the eye they are far from it, and triangles on edge are
/// met as the rays meet them. Quotients may overflow f32.
#[test]
fn rows_with_a_guarantee_keep_it_under_orthographic_cameras() {
    let folder = tempfile::tempdir().expect("a folder");
    let lens = format!("{FORWARD},ortho_height,near,far,aspect");
    let kept = |scene: &str, text: &str, camera: &str, samples: &str| {
        write(folder.path(), scene, text);
        write(folder.path(), "camera.csv", &format!("{lens}\n{camera}\n"));
        let line = format!("funnel --scene {scene} --path camera.csv --processes 1 --up z");
        let done = cullbench(folder.path(), &format!("{line} --samples {samples}"));
        assert_eq!(done.code, Some(0), "{scene}: {done:?}");
    };
    let far = 1e13;
    let bar = |i: usize| {
        let (y, z) = (5.0 - 10.0 * ((i as f64 + 0.5) / 180.0), i as f64 / 8.0);
        let [x, y, z] = [4.0, y, z].map(|v| far + v);
        format!("{:?},{y:?},{z:?},{x:?},{y:?},{z:?}\n", far - 4.0)
    };
    let bars: String = (0..180).map(bar).collect();
    let camera = format!(
        "{far:?},{far:?},{:?},0,0,-1,0,1,0,10,1,100,1.7777777777777777",
        far + 60.0
    );
    kept("bars.csv", &format!("{BOXES}\n{bars}"), &camera, "320x180");

    // A window so small that the outer rows of rays lie outside of it.
    let beside = "9999999999996,10000000000000.006,9999999999999,10000000000004,10000000000001.006,\
        10000000000000\n9999999999996,9999999999994,9999999999991,10000000000004,10000000000006,\
        9999999999992\n";
    let window = camera.replace(",10,1,100,", ",0.01,1,100,");
    kept(
        "window.csv",
        &format!("{BOXES}\n{beside}"),
        &window,
        "320x180",
    );

    // A direction and a bound whose quotients overflow f32.
    let row = "20,-3,-3,30,3,3\n5,-0.5,-0.5,6,0.5,0.5\n40,-2,-2,41,2,2\n";
    let camera = "0,0,0,1,1e-60,0,0,0,1,10,1,100,1.7777777777777777";
    kept("row.csv", &format!("{BOXES}\n{row}"), camera, "320x180");
    let beside = "20,1e-42,-8,30,12,8\n5,0.5,-0.5,6,1.5,0.5\n-1,-1,-9,-0.5,-0.5,9\n";
    let camera = "0,0,0,1,0,0,0,0,1,60,1,100,1.7777777777777777";
    report(
        beside,
        "fovy_deg,near,far,aspect",
        camera,
        "--samples 320x180",
    );

    let square = "v 5 7 -7\nv 15 21 -13\nv 15 21 -5\nv 5 7 1\n";
    let edge = format!("{square}o front\nf 1 2 3 4\no back\nf 4 3 2 1\n");
    let camera = "0,0,0,5,7,-3,0,0,1,6,0,1000,1.5";
    kept("edge.obj", &edge, camera, "321x181");

    let height = |x: usize| if (45..=55).contains(&x) { 10 } else { 0 };
    let mut hill = String::new();
    for (y, x) in (0..=20).flat_map(|y| (0..=20).map(move |x| (5 * y, 5 * x))) {
        hill += &format!("v {x} {y} {}\n", height(x));
    }
    hill += "o ground\n";
    for (j, i) in (0..20).flat_map(|j| (0..20).map(move |i| (j, i))) {
        let [a, b] = [21 * j + i + 1, 21 * j + i + 22];
        hill += &format!("f {a} {} {}\nf {a} {} {b}\n", a + 1, b + 1, b + 1);
    }
    hill += "o under\nv 90 45 -1\nv 90 45 0\nv 90 55 0\nv 90 55 -1\nf -4 -3 -2 -1\n";
    let camera = "1000010.0,50,-0.004,1,0,0,0,0,1,0.01,-1000000.0,-999850.0,1";
    kept("hill.obj", &hill, camera, "320x180");
}
