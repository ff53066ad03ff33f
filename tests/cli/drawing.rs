//! `scene draw`: its legend has the counts of `query`; pictures are whole.

use std::fs;
use std::path::Path;

use super::process::*;

/// The counts of the legend behind some words: "33" of "visible: 33 of 2,000".
fn counted(svg: &str, words: &str) -> u64 {
    let found = svg.split_once(&format!(">{words}: "));
    let digits = found.map_or("0", |(_, rest)| rest.split(['<', ' ']).next().unwrap_or(""));
    digits.replace(',', "").parse().expect("a number")
}

const REJECTED: &str = "outside, rejected with their cell";
const OUTSIDE: &str = "outside, tested one by one";
const VISIBLE: &str = "visible, tested one by one";
const ACCEPTED: &str = "visible, accepted with their cell";

#[test]
fn a_drawing_counts_what_a_query_counts() {
    let folder = folder(&[]);
    let scene = "city:n=1500";
    let path = "flythrough:frames=3";
    for structure in ["quadtree-textbook", "bsp-textbook", "octree", "wide"] {
        let query = format!("query --scene {scene} --cameras {path} --structure {structure}");
        let row = rows(&works(folder.path(), &query)).swap_remove(2);
        let line = format!(
            "scene draw {scene} --camera {path} --frame 2 --structure {structure} -o x.svg"
        );
        let done = cullbench(folder.path(), &line);
        assert_eq!((done.code, done.out.as_str()), (Some(0), ""), "{done:?}");
        let tested = format!("of which the query tests {}", row["nodes_tested"]);
        assert!(done.err.contains(&tested), "{structure}: {}", done.err);
        let svg = fs::read_to_string(folder.path().join("x.svg")).expect("a picture");
        let not_drawn = done
            .err
            .split_once("; not drawn: ")
            .map_or("", |said| said.1);
        assert_eq!(
            svg.contains("not drawn: "),
            !not_drawn.is_empty(),
            "{structure}"
        );
        assert!(
            svg.contains(not_drawn.trim_end()),
            "{structure}: {not_drawn}"
        );
        let of = |words: &[&str]| {
            words
                .iter()
                .map(|w| counted(&svg, w))
                .sum::<u64>()
                .to_string()
        };
        assert_eq!(
            of(&[VISIBLE, ACCEPTED]),
            row["visible_count"],
            "{structure}"
        );
        assert_eq!(of(&[OUTSIDE, VISIBLE]), row["items_tested"], "{structure}");
        assert_eq!(of(&[REJECTED, OUTSIDE, VISIBLE, ACCEPTED]), "1500");
        let cells = [
            "cells rejected, outside",
            "cells accepted, inside",
            "cells opened, across a plane",
        ];
        assert_eq!(of(&cells), row["nodes_tested"], "{structure}");
    }
}

#[test]
fn pictures_are_whole_for_any_scene_and_camera() {
    let cameras = "eye_x,eye_y,eye_z,look_x,look_y,look_z,near,far\n\
        0,0,1e30,0,0,0,1,inf\n1e20,0,0,0,0,0,1,9\n";
    let huge = "min_x,min_y,min_z,max_x,max_y,max_z\n-3e37,0,0,3e37,1,1\n0,0,0,0,0,0\n";
    let far = "min_x,min_y,min_z,max_x,max_y,max_z\n1e37,1e37,0,1e37,1e37,0\n";
    let none = "min_x,min_y,min_z,max_x,max_y,max_z\n";
    let files = [
        ("cameras.csv", cameras),
        ("huge.csv", huge),
        ("far.csv", far),
        ("none.csv", none),
    ];
    let folder = folder(&files.map(|(name, text)| (name, text.as_bytes())));
    for scene in [
        "huge.csv",
        "far.csv",
        "none.csv",
        "freedm-map12",
        "rooms:n=300",
    ] {
        for more in ["", "--structure bsp-textbook", "--structure wide --depth 0"] {
            for camera in ["", "--camera cameras.csv", "--camera cameras.csv --frame 1"] {
                let line = format!("scene draw {scene} {more} {camera} -o x.svg");
                let done = cullbench(folder.path(), &line);
                if done.code == Some(2) {
                    // Planes about some of these eyes do not fit f32.
                    assert!(
                        !camera.is_empty() && done.err.lines().count() == 1,
                        "{done:?}"
                    );
                    continue;
                }
                assert_eq!(done.code, Some(0), "{line}: {done:?}");
                let svg = fs::read_to_string(folder.path().join("x.svg")).expect("a picture");
                assert!(svg.ends_with("</svg>\n"), "{line}");
                assert!(
                    !svg.contains("NaN") && !svg.contains("inf\""),
                    "{line}: {svg}"
                );
            }
        }
    }
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let folder = folder(&[]);
    for (line, wanted) in [
        (
            "--structure linear -o x.svg",
            "'linear' has no cells | expected one of bsp, octree",
        ),
        ("--structure quadtre -o x.svg", "did you mean 'quadtree'"),
        (
            "--camera spin:frames=4 --frame 4 -o x.svg",
            "--frame is 4; expected 0 to 3",
        ),
        ("--frame 1 -o x.svg", "--camera"),
        ("--near 5 -o x.svg", "--camera"),
        ("--matrix-convention row-gl -o x.svg", "--camera"),
        ("--depth 7 -o x.svg", "--structure"),
        ("-o no/such/x.svg", "expected an existing folder for --out"),
        ("-o .", "a folder; expected a file"),
    ] {
        let done = cullbench(folder.path(), &format!("scene draw city:n=50 {line}"));
        assert_refused(&done, wanted, line);
    }
    assert!(contents(folder.path()).is_empty());
}

#[test]
fn pictures_of_the_lectures_are_what_their_commands_draw() {
    let docs = datasets().with_file_name("docs");
    let text = fs::read_to_string(docs.join("LECTURES.md")).expect("part of the repository");
    let folder = folder(&[]);
    let mut drawn = 0;
    for line in text.lines().filter(|line| line.contains(" -o lecture-")) {
        let (_, arguments) = line.split_once("cullbench ").expect("a command");
        assert_eq!(cullbench(folder.path(), arguments).code, Some(0), "{line}");
        let name = line.rsplit(' ').next().expect("a file");
        let read = |from: &Path| fs::read_to_string(from.join(name)).expect("a picture");
        let picture = read(folder.path());
        assert!(
            picture == read(&docs),
            "docs/{name} is not what `{line}` draws"
        );
        assert!(picture.len() < 60_000, "{name}");
        drawn += 1;
    }
    assert_eq!(drawn, 2);
}
