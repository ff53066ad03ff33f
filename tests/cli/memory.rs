//! Failed allocations are one line and exit code 2, or a row that is left out.
//!
//! No command aborts because of one.

use std::path::Path;
use std::process::Command;

use super::PROGRAM;
use super::process::*;

/// Runs a command with an address space of `kibibytes` KiB.
fn limited(folder: &Path, kibibytes: u32, line: &str) -> Done {
    let mut command = Command::new("sh");
    let script = format!("ulimit -v {kibibytes}; exec {PROGRAM} {line}");
    let output = command.args(["-c", &script]).current_dir(folder).output();
    let output = output.expect("the program starts");
    Done {
        code: output.status.code(),
        out: String::from_utf8(output.stdout).expect("UTF-8 on stdout"),
        err: String::from_utf8(output.stderr).expect("UTF-8 on stderr"),
    }
}

#[test]
fn a_scene_beyond_the_limits_of_the_process_is_one_line() {
    let folder = folder(&[("points.csv", b"x,y,z\n0,0,0\n")]);
    let commands = [
        "scene info SCENE",
        "scene generate SCENE --out out.csv",
        "query --scene SCENE --cameras spin:frames=1",
        "locate --scene SCENE --points points.csv",
        "verify --scene SCENE --path spin:frames=1",
        "funnel --scene SCENE --path spin:frames=1",
        "advise --scene SCENE --path spin:frames=1",
        "precision --scene SCENE --path spin:frames=1",
    ];
    for scene in ["city:n=50000000", "mesh:statue:n=50000000"] {
        for line in commands {
            let line = line.replace("SCENE", scene);
            let done = limited(folder.path(), 500_000, &line);
            let wanted = format!("{scene}: needs about |  MB are free; expected a smaller input");
            assert_refused(&done, &wanted, &line);
        }
    }
    assert!(!folder.path().join("out.csv").exists());
    let line = "query --scene uniform:n=5 --cameras orbit:frames=1000000";
    let wanted =
        "path 'orbit:frames=1000000', 1000000 cameras: needs about 3.0 GB, | expected a smaller";
    assert_refused(&limited(folder.path(), 500_000, line), wanted, line);
    let line = "verify --scene uniform:n=5 --path orbit:frames=25000 --structure linear";
    let wanted =
        "volumes of the cameras of 'orbit:frames=25000': needs about 650 MB, | expected fewer";
    assert_refused(&limited(folder.path(), 600_000, line), wanted, line);
}

#[test]
fn a_structure_beyond_the_limits_leaves_the_others() {
    let line = "query --scene uniform:n=1500000 --cameras spin:frames=1 --structure";
    let here = Path::new(".");
    let done = limited(here, 470_000, &format!("{line} linear,bvh"));
    assert_eq!(done.code, Some(0), "{done:?}");
    let told = "left out: 'bvh' needs about 384 MB for 1500000 items, more than";
    assert!(done.err.starts_with(told), "{}", done.err);
    assert_eq!(rows(&done.out).len(), 1, "{}", done.out);
    let done = limited(here, 470_000, &format!("{line} bvh"));
    assert_refused(&done, "structure 'bvh': | needs about 384 MB", "bvh alone");
}

#[test]
fn points_beyond_the_limits_are_one_line_and_fewer_are_answered_within_them() {
    let points = |count: usize| format!("x,y,z\n{}", "1,2,3\n".repeat(count));
    let [many, some] = [1_500_000, 150_000].map(points);
    let files = [("many.csv", many.as_bytes()), ("some.csv", some.as_bytes())];
    let folder = folder(&files);
    let line = "locate --scene city:n=100 --structure bvh --points";
    let done = limited(folder.path(), 180_000, &format!("{line} many.csv"));
    assert_refused(&done, "many.csv: needs about | MB are free; expected", line);
    let done = limited(folder.path(), 250_000, &format!("{line} some.csv"));
    assert_eq!(done.code, Some(0), "{}", done.err);
    assert_eq!(rows(&done.out).len(), 150_000);
}
