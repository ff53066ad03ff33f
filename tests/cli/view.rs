//! The page of `view`: sets and counters are those of `query --ids`.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use super::page::{assert_well_formed, between};
use super::process::*;
use super::queries::number;

/// The page that a command writes as view.html.
fn page(folder: &Path, options: &str) -> String {
    works(folder, &format!("view {options} -o view.html"));
    fs::read_to_string(folder.join("view.html")).expect("a page")
}

fn data(page: &str) -> Value {
    json(
        between(
            page,
            "<script type=\"application/json\" id=\"data\">",
            "</script>",
        )[0],
    )
}

/// Packed numbers: five bits per digit, lowest first; the sixth continues.
fn unpacked(packed: &Value) -> Vec<u64> {
    const DIGITS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
    let (mut numbers, mut number, mut shift) = (Vec::new(), 0, 0);
    for digit in packed.as_str().expect("a text").chars() {
        let digit = DIGITS.find(digit).expect("a digit") as u64;
        number |= (digit & 31) << shift;
        shift += 5;
        if digit < 32 {
            numbers.push(number);
            (number, shift) = (0, 0);
        }
    }
    assert_eq!(shift, 0, "an unfinished number");
    numbers
}

fn signed(number: u64) -> i64 {
    (number >> 1) as i64 ^ -((number & 1) as i64)
}

/// Ids of the items in the order of the page.
fn ids(data: &Value) -> Vec<i64> {
    let ids = unpacked(&data["ids"]).into_iter();
    ids.map(|id| id as i64).collect()
}

/// Members of some kinds, ascending by id.
///
/// Packed runs are five times the length less 1, plus the kind.
fn members(ids: &[i64], packed: &Value, kinds: &[u64]) -> Vec<i64> {
    let (mut found, mut at) = (Vec::new(), 0);
    for run in unpacked(packed) {
        let end = at + (run / 5) as usize + 1;
        if kinds.contains(&(run % 5)) {
            found.extend(&ids[at..end]);
        }
        at = end;
    }
    assert_eq!(at, ids.len(), "kinds of other items");
    found.sort_unstable();
    found
}

fn array(value: &Value) -> &[Value] {
    value.as_array().expect("an array")
}

#[test]
fn sets_and_counters_of_every_view_are_those_of_the_query() {
    let folder = folder(&[]);
    let cases = [
        ("city:n=3000", "orbit:frames=12", "--test six-plane"),
        ("uniform:n=500", "teleport:frames=20", "--test sphere"),
        ("city:n=900", "street:frames=9,far=inf", "--samples 32x18"),
        ("freedm-map12", "places", "--test exact"),
        (
            "clustered:n=700",
            "zoom:frames=7",
            "--epsilon 0 --planes gh-gl-f32",
        ),
    ];
    let mut seen = BTreeSet::new();
    for (scene, path, options) in cases {
        let what = format!("--scene {scene} --path {path} --structure wide,bvh");
        let done = cullbench(
            folder.path(),
            &format!("view {what} {options} -o view.html"),
        );
        assert_eq!(done.code, Some(0), "{done:?}");
        let page = fs::read_to_string(folder.path().join("view.html")).expect("a page");
        let data = data(&page);
        let ids = ids(&data);
        assert!(
            ids.iter()
                .copied()
                .collect::<BTreeSet<_>>()
                .into_iter()
                .eq(0..ids.len() as i64)
        );
        let test = if options.starts_with("--samples") {
            ""
        } else {
            options
        };
        let query = cullbench(folder.path(), &format!("query {what} {test} --ids"));
        let rows = rows(&query.out);
        let frames = array(&data["frames"]);
        assert_eq!(rows.len(), 2 * frames.len(), "{scene} {path}");
        for (n, frame) in frames.iter().enumerate() {
            assert_eq!(frame["camera"], n);
            let wanted: Vec<i64> = rows[2 * n]["visible_ids"]
                .split_whitespace()
                .map(|id| id.parse().expect("an id"))
                .collect();
            assert_eq!(
                members(&ids, &frame["fates"], &[1, 2, 3]),
                wanted,
                "{scene} {path} {n}"
            );
            let fates = ["culled", "visible", "false_positive", "hidden", "lost"];
            for run in unpacked(&frame["fates"]) {
                seen.insert(fates[run as usize % 5]);
            }
            for (own, row) in array(&data["structures"]).iter().zip(&rows[2 * n..]) {
                assert_eq!(own[0], row["structure"]);
                for (k, column) in ["nodes_tested", "items_tested"].into_iter().enumerate() {
                    assert_eq!(own[1][n][k], number(row, column), "{scene} {n} {column}");
                }
            }
        }
    }
    assert_eq!(
        seen,
        set("culled false_positive hidden visible"),
        "cases of too little variety"
    );
}

/// Rounded outward to a grid, and no farther than one step of it.
#[test]
fn boxes_hold_the_items() {
    let boxes = "min_x,min_y,min_z,max_x,max_y,max_z\n-3,1e6,0,5,1000001,0\n\
        0.25,1000000.5,0,0.75,1000002,0\n100,1000003,0,100,1000003,0\n";
    let folder = folder(&[("s.csv", boxes.as_bytes())]);
    let page = page(
        folder.path(),
        "--scene s.csv --path orbit:frames=2 --structure linear",
    );
    let data = data(&page);
    let (ids, numbers) = (ids(&data), unpacked(&data["boxes"]));
    let of = |key: &str, k: usize| data[key][k].as_f64().expect("a number");
    let steps = data["steps"].as_f64().expect("a number");
    let mut corner = [0; 3];
    for (id, packed) in ids.into_iter().zip(numbers.chunks(6)) {
        let line = boxes.lines().nth(id as usize + 1).expect("a box");
        let wanted: Vec<f64> = line
            .split(',')
            .map(|x| x.parse().expect("a number"))
            .collect();
        for k in 0..3 {
            corner[k] += signed(packed[k]);
            let (step, low) = (of("extent", k) / steps, of("origin", k) + of("low", k));
            let [min, max] =
                [corner[k], corner[k] + packed[3 + k] as i64].map(|at| low + at as f64 * step);
            let slack = step + 1e-9;
            assert!(
                (wanted[k] - slack..=wanted[k] + 1e-9).contains(&min),
                "{line} {min}"
            );
            assert!(
                (wanted[3 + k] - 1e-9..=wanted[3 + k] + slack).contains(&max),
                "{line} {max}"
            );
        }
    }
}

/// Triangles of a mesh in the items' order, corners on the grid of the boxes.
#[test]
fn triangles_lie_within_the_boxes_of_their_items() {
    let folder = folder(&[]);
    for (scene, count) in [
        ("mesh:forest:n=3000", 3068),
        ("mesh:terrain:n=40000", 41472),
    ] {
        let options = format!("--scene {scene} --path orbit:frames=1 --structure linear");
        let data = data(&page(folder.path(), &options));
        assert_eq!(data["triangles"], count, "{scene}");
        let [counts, corners, steps] = [0, 1, 2].map(|part| unpacked(&data["mesh"][part]));
        assert_eq!(counts.iter().sum::<u64>(), count, "{scene}");
        assert_eq!(corners.len() as u64, 3 * count, "{scene}");
        let mut steps = steps.into_iter().map(signed);
        let (mut at, mut points) = ([0; 3], Vec::new());
        let mut corners = corners.into_iter();
        let (mut low, boxes) = ([0; 3], unpacked(&data["boxes"]));
        for (count, packed) in counts.into_iter().zip(boxes.chunks(6)) {
            let (mut min, mut max) = ([i64::MAX; 3], [i64::MIN; 3]);
            for _ in 0..3 * count {
                let back = corners.next().expect("a corner") as usize;
                if back == 0 {
                    at = at.map(|x| x + steps.next().expect("a point"));
                    points.push(at);
                }
                let point = points[points.len() - back.max(1)];
                min = [0, 1, 2].map(|k| min[k].min(point[k]));
                max = [0, 1, 2].map(|k| max[k].max(point[k]));
            }
            for k in 0..3 {
                low[k] += signed(packed[k]);
                let high = low[k] + packed[3 + k] as i64;
                assert!(
                    (0..=1).contains(&(min[k] - low[k])),
                    "{scene} {min:?} {low:?}"
                );
                assert!((0..=1).contains(&(high - max[k])), "{scene} {max:?} {high}");
            }
        }
        assert!(
            corners.next().is_none() && steps.next().is_none(),
            "{scene}"
        );
    }
    let options = "--scene mesh:spheres:n=301000 --path orbit:frames=1 --structure linear";
    let data = data(&page(folder.path(), options));
    assert!(data["triangles"] == 300_800 && data["mesh"].is_null() && data["nodes"].is_null());
}

/// The upper levels of many nodes.
#[test]
fn nodes_are_those_that_the_first_structure_with_nodes_tests() {
    let folder = folder(&[]);
    let options =
        "--scene city:n=9000 --path teleport:frames=12 --structure linear,bvh:leaf=2,wide";
    let data = data(&page(folder.path(), options));
    let (name, nodes) = (&data["nodes"][0], &data["nodes"][1]);
    assert_eq!(*name, data["structures"][1][0]);
    let boxes = unpacked(&nodes["boxes"]).len() / 6;
    let runs = unpacked(&nodes["kinds"][0]);
    let cells: u64 = runs.iter().map(|run| run / 5 + 1).sum();
    let all: Vec<i64> = (0..cells as i64).collect();
    let (mut union, mut is_cut) = (BTreeSet::new(), [false; 2]);
    for (n, kinds) in array(&nodes["kinds"]).iter().enumerate() {
        let found = members(&all, kinds, &[1, 2, 3]);
        let tested = data["structures"][1][1][n][0].as_u64().expect("a number");
        assert_eq!(found.len() as u64, tested.min(256), "{n}");
        is_cut[usize::from(tested > 256)] = true;
        union.extend(found);
    }
    assert_eq!((union.len(), is_cut), (boxes, [true; 2]));
}

#[test]
fn a_page_is_whole_and_small_and_loads_nothing() {
    let nasty = "a<script><b>.csv";
    let folder = folder(&[]);
    let made = cullbench(
        folder.path(),
        &format!("scene generate city:n=100000 --out {nasty}"),
    );
    assert_eq!(made.code, Some(0), "{made:?}");
    let options = format!("--scene {nasty} --path teleport:frames=500 --frames 5 --structure wide");
    let page = page(folder.path(), &options);
    let data = data(&page);
    assert_eq!(data["scene"], nasty);
    let frames = array(&data["frames"]);
    let cameras: Vec<&Value> = frames.iter().map(|frame| &frame["camera"]).collect();
    assert_eq!(cameras, [0, 100, 200, 300, 400]);
    // With 120 views no more than 3 MB.
    let views: usize = frames.iter().map(|frame| frame.to_string().len()).sum();
    assert!(
        page.len() + views / 5 * 115 < 3_000_000,
        "{} {views}",
        page.len()
    );

    let script = between(&page, "<script>", "</script>")[0].to_owned();
    let (_, visible) = page.split_once("<body>").expect("a body");
    assert_well_formed(&page);
    for outside in ["http", "@import", "url(", " src="] {
        let found = page
            .replace("http://www.w3.org/2000/svg", "")
            .contains(outside);
        assert!(!found, "loads something: {outside}");
    }
    assert!(visible.contains("no visible item lost") && visible.contains("a&lt;script&gt;"));
    let script_file = folder.path().join("view.js");
    fs::write(&script_file, script).expect("writable");
    // Where there is a node.
    if let Ok(done) = Command::new("node")
        .arg("--check")
        .arg(&script_file)
        .output()
    {
        assert!(
            done.status.success(),
            "{}",
            String::from_utf8_lossy(&done.stderr)
        );
    }
}

#[test]
fn what_cannot_be_viewed_is_one_line() {
    let folder = folder(&[]);
    for (options, wanted) in [
        (
            "--scene city:n=9 -o no/view.html",
            "no | existing folder for --out",
        ),
        (
            "--scene city:n=9 -o view.html --samples 0x9",
            "columns x rows",
        ),
        (
            "--scene city:n=2000001 -o view.html",
            "2,000,001 items | at most 2,000,000",
        ),
        ("--scene city:n=9 -o view.html --structure none", "none"),
        (
            "--scene city:n=9 --path street:frames=x -o view.html",
            "frames",
        ),
        (
            "--scene stack:n=9000,piles=1 --path orbit:frames=1 --samples 320x180 -o view.html",
            "camera 0 | surfaces to test | around the eye",
        ),
    ] {
        let done = cullbench(folder.path(), &format!("view {options}"));
        assert_refused(&done, wanted, options);
    }
    assert!(!folder.path().join("view.html").exists());
}
