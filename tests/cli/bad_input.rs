//! Input that cannot be read, generated or written.
//!
//! The program ends with exit code 2 and one line that names the place, what was found and
//! what was expected, and leaves nothing on disk.

use std::fs;

use super::process::*;
use super::{BOXES, EYE_LOOK, FULL_CAMERA};

/// Every command that reads a scene.
fn commands_with_scene(scene: &str) -> [String; 10] {
    [
        format!("query --scene {scene} --cameras cameras.csv"),
        format!("locate --scene {scene} --points points.csv"),
        format!("verify --scene {scene} --path orbit:frames=2"),
        format!("scene info {scene}"),
        format!("scene generate {scene}"),
        format!("scene generate {scene} --out new.csv"),
        format!("scene generate {scene} --out kept.csv"),
        format!("scene convert {scene}"),
        format!("scene convert {scene} kept.csv"),
        format!("run --scene {scene} --path orbit:frames=4 --out new/run"),
    ]
}

/// Every command that reads cameras.
fn commands_with_cameras(cameras: &str) -> [String; 3] {
    [
        format!("query --scene scene.csv --cameras {cameras}"),
        format!("verify --scene scene.csv --path {cameras}"),
        format!("run --scene scene.csv --path {cameras} --out new/run"),
    ]
}

#[test]
fn a_scene_file_that_is_none_is_refused_by_every_command() {
    let mut random = Random(1);
    let noise: Vec<u8> = (0..5000).map(|_| random.next() as u8).collect();
    let (wad, good) = (map12(), "0,0,0,1,1,1");
    let wrong_magic = [b"XWAD", &wad[4..]].concat();
    let text = |rows: &str| format!("{BOXES}\n{good}\n{rows}\n").into_bytes();
    let cases: Vec<(&str, Option<Vec<u8>>, &str)> = vec![
        ("missing.csv", None, "missing.csv | No such file"),
        ("no/where.csv", None, "no/where.csv | No such file"),
        (
            "folder.csv",
            None,
            "folder.csv | a directory; expected a file",
        ),
        ("empty.csv", Some(vec![]), "line 1 | empty | header"),
        (
            "header.csv",
            Some(b"a,b,c\n1,2,3\n".to_vec()),
            "line 1 | no column 'min_x' | expected a header with min_x,min_y",
        ),
        (
            "text.csv",
            Some(text("1,2,3,4,five,6")),
            "text.csv, line 3 | max_y 'five' | expected",
        ),
        ("nan.csv", Some(text("1,nan,3,4,5,6")), "min_y 'nan'"),
        ("inf.csv", Some(text("1,2,3,4,5,inf")), "max_z 'inf'"),
        ("huge.csv", Some(text("0,0,0,1e999,1,1")), "max_x '1e999'"),
        (
            "beyond.csv",
            Some(text("0,0,0,1e308,1,1")),
            "line 3 | 1e308 | range of f32 | expected",
        ),
        (
            "inverted.csv",
            Some(text("0,0,5,1,1,4")),
            "line 3 | min_z 5 | max_z 4 | expected min_z <= max_z",
        ),
        (
            "few.csv",
            Some(text("0,0,0,1,1")),
            "line 3: 5 fields | expected 6",
        ),
        (
            "many.csv",
            Some(text("0,0,0,1,1,1,1")),
            "line 3: 7 fields | expected 6",
        ),
        (
            "twice.csv",
            Some(format!("{BOXES},min_x\n{good},0\n").into_bytes()),
            "line 1 | column 'min_x' twice | expected",
        ),
        (
            "long.csv",
            Some(text(&format!("{},0,0,1,1,1", "9".repeat(100_000)))),
            "line 3 | min_x '999 | expected",
        ),
        (
            "quote.csv",
            Some(text("0,0,0,\"1,1,1\n2,2,2,3,3,3")),
            "line 3 | expected",
        ),
        (
            "utf8.csv",
            Some([&text("")[..], b"\xff\xfe,0,0,1,1,1\n"].concat()),
            "line 4 | expected",
        ),
        ("noise.csv", Some(noise), "noise.csv, line | expected"),
        (
            "windows.csv",
            Some(
                b"min_x,min_y,min_z,max_x,max_y,max_z\r\n0,0,0,1,1,1\r\n\r\nx,0,0,1,1,1\r\n"
                    .to_vec(),
            ),
            "windows.csv, line 4: min_x 'x'",
        ),
        (
            "macintosh.csv",
            Some(
                text("x,0,0,1,1,1")
                    .iter()
                    .map(|b| if *b == b'\n' { b'\r' } else { *b })
                    .collect(),
            ),
            "macintosh.csv, line 3: min_x 'x'",
        ),
        (
            "cut.wad",
            Some(wad[..wad.len() / 2].to_vec()),
            "cut.wad, byte | the end of the file | expected",
        ),
        (
            "short.wad",
            Some(b"PWAD\x01".to_vec()),
            "short.wad, byte 5 | expected a 12 byte header",
        ),
        ("none.wad", Some(vec![]), "none.wad, byte 0 | IWAD or PWAD"),
        (
            "magic.wad",
            Some(wrong_magic),
            "magic.wad, byte 0: 'XWAD' | expected | IWAD or PWAD",
        ),
        (
            "other.wad#E1M1",
            None,
            "other.wad | no map 'E1M1' among MAP12",
        ),
    ];
    for (name, bytes, wanted) in cases {
        let folder = with_good_files(&[("other.wad", &wad)]);
        if let Some(bytes) = bytes {
            fs::write(folder.path().join(name), bytes).expect("writable");
        }
        all_refused(&folder, &commands_with_scene(name), wanted);
    }
}

#[test]
fn a_scene_spec_that_is_none_is_refused_by_every_command() {
    let cases: [(&str, &str); 17] = [
        ("city:n=200%", "n is '200%' | a whole number from 0"),
        (
            "unifrom",
            "unknown scene 'unifrom' | did you mean 'uniform'",
        ),
        ("helsinky", "did you mean 'helsinki'"),
        ("''", "unknown scene '' | uniform | helsinki"),
        ("city:n", "city:n | 'n' | key=value"),
        ("city:n=many", "n is 'many' | a whole number from 0"),
        ("city:n=-1", "n is '-1'"),
        ("city:n=1.5", "n is '1.5'"),
        ("city:n=1e30", "n is '1e30'"),
        ("city:n=1,n=2", "'n' is given twice; expected it once"),
        ("city:sed=3", "unknown parameter | did you mean 'seed'"),
        ("uniform:n=9,side=0", "side is '0' | a number above 0"),
        ("uniform:n=9,side=nan", "side is 'nan' | a number"),
        ("uniform:n=9,offset=1e300,size=1e300", "f32"),
        (
            "rooms:n=9,room=1e-300",
            "room is '1e-300' | above 2 and below",
        ),
        ("helsinki:n=5", "unknown parameter | 'n'"),
        ("two\nlines", "unknown scene 'two lines'"),
    ];
    let folder = with_good_files(&[]);
    for (scene, wanted) in cases {
        all_refused(&folder, &commands_with_scene(scene), wanted);
    }
}

#[test]
fn cameras_that_are_none_are_refused_with_line_and_rule() {
    let good = "0,0,0,1,0,0,0,0,1,60,1,1,9";
    let full: [(&str, &str); 15] = [
        ("0,0,zero,1,0,0,0,0,1,60,1,1,9", "eye_z 'zero'"),
        ("0,0,nan,1,0,0,0,0,1,60,1,1,9", "eye_z 'nan'"),
        ("0,0,0,inf,0,0,0,0,1,60,1,1,9", "look_x 'inf'"),
        ("0,0,0,1,0,0,0,0,1,0,1,1,9", "0 degrees | 0 < fov < 180"),
        ("0,0,0,1,0,0,0,0,1,180,1,1,9", "180 degrees | 0 < fov"),
        ("0,0,0,1,0,0,0,0,1,-60,1,1,9", "-60 degrees"),
        ("0,0,0,1,0,0,0,0,1,60,0,1,9", "aspect ratio is 0"),
        ("0,0,0,1,0,0,0,0,1,60,1,9,9", "near is 9 and far 9"),
        ("0,0,0,1,0,0,0,0,1,60,1,10,9", "expected near < far"),
        ("0,0,0,1,0,0,0,0,1,60,1,0,9", "near is 0 | near > 0"),
        ("0,0,0,1,0,0,0,0,1,60,1,1,nan", "far 'nan' | inf or nothing"),
        (
            "0,0,0,1,0,0,0,0,1,60,1,1,\"100,5\"",
            "far '100,5' | a decimal comma",
        ),
        ("0,0,0,0,0,2,0,0,1,60,1,1,9", "up | parallel"),
        ("0,0,0,0,0,0,0,0,1,60,1,1,9", "eye and look | same"),
        ("0,0,0,1,0,0,0,0,1,60,1,1", "12 fields | expected 13"),
    ];
    for (row, wanted) in full {
        let text = format!("{FULL_CAMERA}\n{good}\n{row}\n");
        let folder = with_good_files(&[("bad.csv", text.as_bytes())]);
        let wanted = format!("bad.csv, line 3: | ; expected | {wanted}");
        all_refused(&folder, &commands_with_cameras("bad.csv"), &wanted);
    }
    let wad = map12();
    let files: [(&[u8], &str); 13] = [
        (b"", "line 1 | empty file"),
        (b"\x1f\x8b\x08\0eye", "line 1 | gzip, which is not read"),
        (b"\n\n\n", "empty file"),
        (FULL_CAMERA.as_bytes(), "line 2 | no camera"),
        (b"x,y,z\n1,2,3\n", "line 1 | no column 'eye_x'"),
        (
            b"eye_x,eye_y,eye_z\n1,2,3\n",
            "line 1 | 'look_x' or 'forward_x' in 'eye_x,eye_y,eye_z' | direction",
        ),
        (
            b"eye_x,eye_y,eye_z,look_x,look_y,look_z,up_x\n0,0,0,1,0,0,0\n",
            "line 1 | no column 'up_y'",
        ),
        (
            b"eye_x,eye_y,eye_z,near,near\n",
            "line 1 | column 'near' twice",
        ),
        (
            b"eye_x,eye_y,eye_z,forward_x,forward_y,forward_z\n0,0,0,0,0,0\n",
            "line 2 | forward is zero",
        ),
        (
            b"eye_x,eye_y,eye_z,\"a\nb\",\"a\nb\"\n",
            "line 1 | column 'a b' twice",
        ),
        (
            b"eye_x,eye_y,eye_z,look_x,look_y,look_z,forward_x\n0,0,0,1,0,0,1\n",
            "line 1 | look_* and forward_* | not both",
        ),
        (b",,,\n,,,\n", "line 1 | 4 columns without a name"),
        (&wad, "line 1"),
    ];
    for (bytes, wanted) in files {
        let folder = with_good_files(&[("bad.csv", bytes)]);
        let wanted = format!("bad.csv, | ; expected | {wanted}");
        all_refused(&folder, &commands_with_cameras("bad.csv"), &wanted);
    }
    let folder = with_good_files(&[]);
    let specs: [(&str, &str); 24] = [
        (
            "orbit:visible=200%",
            "visible=200% | a share between 0 and 1",
        ),
        ("orbit:visible=-5%", "visible=-5% | a share between 0 and 1"),
        (
            "orbit:frames=200%",
            "frames is '200%' | a whole number from 1 to",
        ),
        ("orbit:far=-1", "far is -1 | expected a number above 0"),
        ("orbit:far=0", "far is 0 | expected a number above 0"),
        ("orbit:height=1e300", "height is '1e300' | below 1000000"),
        ("orbit:aspect=1e304", "the aspect ratio is 1e304 | 1e100"),
        ("orbit:far=5e-324", "far is 5e-324 | expected"),
        ("missing.csv", "missing.csv: No such file"),
        ("missing.txt", "missing.txt: No such file"),
        ("no/where", "no/where: No such file"),
        ("folder.csv", "folder.csv: Is a directory"),
        ("orbt", "unknown path 'orbt' | did you mean 'orbit'"),
        ("''", "unknown path '' | orbit"),
        (
            "orbit:frames=few",
            "frames is 'few' | a whole number from 1 to",
        ),
        ("orbit:frame=3", "did you mean 'frames'"),
        ("orbit:fovy=0", "camera 0 | 0 degrees | expected"),
        ("orbit:fovy=180", "180 degrees"),
        ("orbit:near=0", "near is 0"),
        ("orbit:near=5,far=5", "near < far"),
        ("orbit:visible=2", "visible=2 | between 0 and 1"),
        (
            "orbit:near=1e60,far=inf",
            "camera 0 | does not fit f32 | expected",
        ),
        ("places", "no camera places"),
        ("two\nlines", "unknown path 'two lines'"),
    ];
    for (path, wanted) in specs {
        all_refused(&folder, &commands_with_cameras(path), wanted);
    }
}

#[test]
fn points_that_are_none_are_refused() {
    let cases: [(&[u8], &str); 8] = [
        (b"", "line 1 | empty file"),
        (b"x,y,z\n", "line 2 | no point"),
        (b"y,z\n1,2\n", "line 1 | no column 'x' | x,y,z"),
        (b"x,y,z\n1,2,3\n1,q,3\n", "line 3 | y 'q'"),
        (b"x,y,z\n1,2,nan\n", "line 2 | z 'nan'"),
        (b"x,y,z\n1,2\n", "2 fields | 3"),
        (b"x,y,z,x\n1,2,3,4\n", "column 'x' twice"),
        (b"\x00\xff\x80,,\n\xfe", "line 1 | zero bytes | UTF-8"),
    ];
    let locate = |points| [format!("locate --scene scene.csv --points {points}")];
    for (bytes, wanted) in cases {
        let folder = with_good_files(&[("bad.csv", bytes)]);
        let wanted = format!("bad.csv, | ; expected | {wanted}");
        all_refused(&folder, &locate("bad.csv"), &wanted);
    }
    let folder = with_good_files(&[]);
    all_refused(&folder, &locate("missing.csv"), "missing.csv: No such");
    all_refused(&folder, &locate("folder.csv"), "folder.csv: Is a dir");
    // Points or boxes, one of them; boxes are read as a scene's are.
    let locate = |sought| [format!("locate --scene scene.csv {sought}")];
    all_refused(&folder, &locate(""), "--points <FILE>|--boxes <FILE>");
    let both = "--points points.csv --boxes scene.csv";
    all_refused(&folder, &locate(both), "--points | --boxes");
    let folder = with_good_files(&[("bad.csv", b"min_x,min_y\n1,2\n")]);
    all_refused(
        &folder,
        &locate("--boxes bad.csv"),
        "bad.csv, | no column 'min_z'",
    );
    let folder = with_good_files(&[("bad.csv", BOXES.as_bytes())]);
    let wanted = "bad.csv, line 2: no box; expected at least one row";
    all_refused(&folder, &locate("--boxes bad.csv"), wanted);
}

/// A structure of docs/PEERS.md is no misspelt one.
#[cfg(not(feature = "peers"))]
#[test]
fn structures_of_another_build_are_refused_with_the_feature_they_need() {
    let folder = with_good_files(&[]);
    for name in ["peer-rstar", "peer-obvhs", "peer-bevy-style"] {
        let commands = [
            format!("query --scene scene.csv --cameras cameras.csv --structure {name}"),
            format!("run --scene scene.csv --structure linear,{name} --out new/run"),
            format!("verify --cases 1 --structure {name}"),
        ];
        let wanted = format!("'{name}' | not in this build | expected | --features peers");
        all_refused(&folder, &commands, &wanted);
    }
}

/// A row may be a camera whose planes do not fit f32.
#[test]
fn a_camera_too_far_away_is_named_by_its_line() {
    let far = format!("{EYE_LOOK}\n\n0,0,0,1,0,0\n1e300,0,0,0,1,0\n");
    let folder = with_good_files(&[("far.csv", far.as_bytes())]);
    let lines = [
        "query --scene scene.csv --cameras far.csv",
        "run --scene scene.csv --path far.csv --out new",
        "funnel --scene scene.csv --path far.csv",
    ];
    all_refused(
        &folder,
        &lines,
        "far.csv, line 4: | does not fit f32 | expected",
    );
}

#[test]
fn several_bad_rows_are_counted_and_skipped_on_request() {
    let text = format!(
        "{BOXES},kind\n0,0,0,1,1,1,a\n0,0,0,-1,1,1,b\n0,0,0,nan,1,1,c\n2,2,2,3,3,3,d\n1,2,3\n"
    );
    let folder = with_good_files(&[("bad.csv", text.as_bytes())]);
    all_refused(
        &folder,
        &commands_with_scene("bad.csv"),
        "bad.csv, line 3: | max_x -1 | 3 bad items | --skip-bad-items",
    );
    for line in commands_with_scene("bad.csv") {
        let done = cullbench(folder.path(), &format!("{line} --skip-bad-items"));
        assert_eq!(done.code, Some(0), "{line}: {done:?}");
        let told = (done.err)
            .contains("3 bad items left out of bad.csv; ids are rows of that file")
            || done.out.contains("3 bad items left out");
        assert!(told, "{line}: {done:?}");
    }
    let info = "scene info bad.csv --skip-bad-items --format json";
    let info = json(&cullbench(folder.path(), info).out);
    assert_eq!(
        (&info["total_count"], &info["skipped_items"]),
        (&2.into(), &3.into())
    );
    let report = fs::read_to_string(folder.path().join("new/run/report.json"));
    let report = json(&report.expect("a report"));
    assert_eq!(report["cells"][0]["scene"]["skipped_items"], 3);
    let summary = fs::read_to_string(folder.path().join("new/run/summary.csv"));
    assert_eq!(rows(&summary.expect("a table"))[0]["skipped_items"], "3");
    let verify = "verify --scene bad.csv --path orbit:frames=2 --skip-bad-items --format json";
    let verified = json(&cullbench(folder.path(), verify).out);
    assert_eq!(verified["skipped_items"], 3);
    let written = fs::read_to_string(folder.path().join("kept.csv")).expect("written");
    assert_eq!(written.lines().count(), 3);
}

/// 300,001 columns: comparing each with all others would take minutes.
#[test]
fn a_column_twice_is_found_among_very_many() {
    use std::fmt::Write;
    let mut header = BOXES.to_owned();
    for column in 0..60_000 {
        write!(header, ",column_{column}").expect("a string");
    }
    let text = format!("{header},column_59999\n");
    let folder = with_good_files(&[("wide.csv", text.as_bytes())]);
    let wanted = "wide.csv, line 1 | column 'column_59999' twice | expected each column once";
    all_refused(&folder, &["scene info wide.csv"], wanted);
}
