//! `scene convert`: the same answers from the file as from what it was made of,
//! the same bytes the second time, and outputs it does not know.

use std::fs;
use std::path::Path;

use super::BOXES;
use super::process::*;

/// Converts and lets nothing but notes be said; the bytes of the file.
fn convert(folder: &Path, line: &str, file: &str) -> (String, String) {
    let done = cullbench(folder, &format!("scene convert {line}"));
    assert_eq!(
        (done.code, done.out.as_str()),
        (Some(0), ""),
        "{line}: {done:?}"
    );
    let text = fs::read_to_string(folder.join(file)).expect("written");
    (text, done.err)
}

/// Counts of visible items and sums of their ids, as returned by `query`.
fn seen(folder: &Path, scene: &str) -> Vec<[String; 3]> {
    let line = format!("query --scene {scene} --cameras cameras.csv --structure linear,bvh");
    let rows = rows(&works(folder, &line));
    let columns = ["total_count", "visible_count", "visible_id_sum"];
    rows.iter()
        .map(|row| columns.map(|c| row[c].clone()))
        .collect()
}

#[test]
fn a_converted_scene_gives_the_same_answers_and_the_same_bytes_again() {
    let far = "kind,min_x,min_y,min_z,max_x,max_y,max_z,note\n\
         hut,500000.1,6700000.7,-0.3,500012.4,6700009.9,8.25,\"a, b\"\n\
         ,500100.01,6700200.02,0,500100.01,6700300.3,0.1,\n\
         tower,499990.5,6699999.125,1e-7,500000.5,6700009.3,90.75,\"x\ny\"\n";
    let cameras = "eye_x,eye_y,eye_z,look_x,look_y,look_z,near,far\n\
        499900,6699900,50,500050,6700150,5,1,5000\n\
        500,500,500,0,0,0,1,5000\n\
        1000,-4000,200,1000,-3000,0,1,9000\n\
        24.94,60.17,400,300,300,0,1,9000\n\
        -98,20,30,-98,40,0,0.1,300\n";
    let map = map12();
    let folder = folder(&[
        ("far.csv", far.as_bytes()),
        ("cameras.csv", cameras.as_bytes()),
        ("map.wad", &map),
    ]);
    let sources = "far.csv map.wad map.wad#MAP12 helsinki us-counties rooms:n=300 \
        uniform:n=300,offset=1e6 city:n=300,seed=9";
    let mut counts = Vec::new();
    for source in sources.split_whitespace() {
        let (once, told) = convert(folder.path(), &format!("{source} --out one.csv"), "one.csv");
        assert!(told.contains("one.csv: "), "{told}");
        let is_plain = !source.contains("wad") && !source.contains("rooms");
        assert_eq!(told.starts_with("note: "), !is_plain, "{source}: {told}");
        let (twice, _) = convert(folder.path(), "one.csv two.csv", "two.csv");
        assert!(once == twice, "{source}");
        let from_source = seen(folder.path(), source);
        assert_eq!(from_source, seen(folder.path(), "one.csv"), "{source}");
        counts.extend(from_source.into_iter().map(|row| row[1].clone()));
        // To a terminal, and from `generate`: the same.
        let printed = cullbench(folder.path(), &format!("scene convert {source}"));
        assert_eq!((printed.code, printed.out), (Some(0), once));
    }
    assert!(counts.iter().any(|count| count != "0"), "nothing is seen");
    let (text, _) = convert(folder.path(), "far.csv one.csv", "one.csv");
    assert!(text.starts_with(&format!("{BOXES},kind,note\n")), "{text}");
    assert_eq!(text.matches("hut,\"a, b\"\n").count(), 1, "{text}");
    assert!(text.ends_with(",tower,\"x\ny\"\n"), "{text}");
}

/// Output of `query`, `locate` and `verify` for `boxes.csv` in a folder.
fn told(folder: &Path) -> [String; 3] {
    let query = "query --scene boxes.csv --cameras cameras.csv --structure linear,bvh --ids";
    let locate = "locate --scene boxes.csv --points points.csv --structure linear,bvh";
    let verify = "verify --scene boxes.csv --path cameras.csv --structure bvh --cases 0";
    let mut verified = json(&works(folder, &format!("{verify} --format json")));
    verified["seconds"] = 0.into();
    [
        works(folder, query),
        works(folder, locate),
        verified.to_string(),
    ]
}

/// Tenths near zero, and astronomical distances where f32 has steps of 8 and
/// f64 of 1.5e-8.
#[test]
fn boxes_that_f32_cannot_hold_are_written_as_they_were() {
    let boxes = format!(
        "{BOXES},kind\n\
         0.1,0.2,0.3,0.7,0.8,0.9,tenths\n\
         149597870.7,0.1,-0.3,149597871.1,0.30000000000000004,0.3,far\n\
         149597871.1,0.1,-0.3,149597871.10000002,0.7,0.3,next\n\
         -149597870.7,-1e-300,-0.3,149597870.7,5e-324,0.3,wide\n"
    );
    let cameras = "eye_x,eye_y,eye_z,forward_x,forward_y,forward_z,near,far\n\
        149597860.7,0.1,0,1,0,0,0.1,100\n\
        -5,0.5,0.5,1,0,0,0.1,100\n";
    // Within what f32 makes of a box, on its face, within it.
    let points = "x,y,z\n149597870.6,0.2,0\n149597871.1,0.2,0\n149597870.9,0.2,0\n\
        0.09999999999999999,0.5,0.5\n0.1,0.5,0.5\n";
    let asked = [
        ("cameras.csv", cameras.as_bytes()),
        ("points.csv", points.as_bytes()),
        ("boxes.csv", boxes.as_bytes()),
    ];
    let folder = folder(&asked);
    let before = told(folder.path());
    assert!(before[1].contains("\n1,bvh,2,3,1 2,"), "{}", before[1]);
    let info = "scene info boxes.csv";
    let info_before = works(folder.path(), info);
    let (once, _) = convert(folder.path(), "boxes.csv once.csv", "once.csv");
    let decimals = "149597870.7,0.1,-0.3,149597871.1,0.30000000000000004,0.3,far\n";
    assert!(once.contains(decimals), "{once}");
    let (twice, _) = convert(folder.path(), "once.csv boxes.csv", "boxes.csv");
    assert_eq!(once, twice);
    assert_ne!(twice, boxes, "not converted");
    assert_eq!(told(folder.path()), before);
    assert_eq!(works(folder.path(), info), info_before);
}

#[test]
fn outputs_have_any_name_but_that_of_the_input() {
    // Blanks and marks of labels stay, so that none become equal.
    let text = format!(
        "{BOXES},kind\n0.5,1,2,3,4,5, a\n7,7,7,8,8,8.25,a\n7,7,7,8,8,9,'=1\n7,7,7,8,8,9,''=1\n"
    );
    let map = map12();
    let folder = folder(&[("s.csv", text.as_bytes()), ("map.wad", &map)]);
    let (other, _) = convert(folder.path(), "s.csv -o S.CSV", "S.CSV");
    assert_eq!(other, text);
    for out in ["-", "--out -", "-o -"] {
        let done = cullbench(folder.path(), &format!("scene convert s.csv {out}"));
        assert_eq!(
            (done.code, done.out, done.err),
            (Some(0), text.clone(), String::new())
        );
    }
    let onto_input = [
        "convert s.csv s.csv",
        "convert s.csv -o ./s.csv",
        "generate s.csv -o s.csv",
    ];
    let lines = onto_input.map(|line| format!("scene {line}"));
    all_refused(
        &folder,
        &lines,
        "s.csv: an input or another output; expected a file of its own",
    );
    let part = "scene convert map.wad#MAP12 map.wad --to csv";
    all_refused(&folder, &[part], "map.wad: an input or another output");
    let drawn = "scene draw s.csv --out -";
    all_refused(
        &folder,
        &[drawn],
        "--out is '-'; expected a file, such as './-'",
    );
    // No extension, and one that the format is named for.
    convert(folder.path(), "s.csv boxes", "boxes");
    convert(folder.path(), "s.csv boxes.txt --to csv", "boxes.txt");
}

#[test]
fn what_cannot_be_converted_leaves_no_trace() {
    let folder = with_good_files(&[("bad.csv", b"a,b\n1,2\n"), ("half.wad", b"PWAD\x01")]);
    let into_wad = "map.wad: a scene cannot be written as '.wad' | expected .csv";
    let beyond = "item 0 | beyond | 3.4 | expected";
    for (line, wanted) in [
        ("scene.csv map.wad", into_wad),
        ("scene.csv --out map.wad", into_wad),
        (
            "missing.csv new.json",
            "new.json: a scene cannot be written as '.json'",
        ),
        ("missing.csv new.csv", "missing.csv: No such file"),
        ("bad.csv kept.csv", "bad.csv, line 1 | no column 'min_x'"),
        ("half.wad kept.csv", "half.wad"),
        ("unifrom kept.csv", "did you mean 'uniform'"),
        ("scene.csv no/where.csv", "no: expected an existing folder"),
        ("scene.csv folder.csv", "folder.csv: a folder"),
        ("uniform:n=2,offset=1e39 new.csv", beyond),
    ] {
        all_refused(&folder, &[format!("scene convert {line}")], wanted);
    }
    let generate = "scene generate uniform:n=2,offset=1e39";
    all_refused(&folder, &[generate], beyond);
    // clap's own: one place to write to.
    let both = cullbench(folder.path(), "scene convert scene.csv a.csv --out b.csv");
    assert_eq!((both.code, both.out.as_str()), (Some(2), ""));
    assert!(both.err.contains("cannot be used with"), "{}", both.err);
}

#[test]
fn a_note_tells_that_rows_are_counted_anew_without_bad_items() {
    let text = format!("{BOXES}\n0,0,0,1,1,1\n0,0,0,-1,1,1\n2,2,2,3,3,3\n");
    let folder = folder(&[("bad.csv", text.as_bytes())]);
    let (_, told) = convert(
        folder.path(),
        "bad.csv good.csv --skip-bad-items",
        "good.csv",
    );
    let note = "note: ids of the new file are its own rows, without the bad items\n";
    assert!(told.contains(note), "{told}");
    let (_, told) = convert(
        folder.path(),
        "good.csv again.csv --skip-bad-items",
        "again.csv",
    );
    assert!(!told.contains("note"), "{told}");
}
