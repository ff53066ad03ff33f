//! `report`: what a run found as Markdown, pictures and a page; what is no
//! report, and what a report of another program's making may hold.

use std::fs;

use serde_json::{Value, json};

use super::process::*;

/// A run over three sizes, with a fixed count and a share, small and quick.
const RUN: &str = "run --scene uniform:n=300 --scene uniform:n=900 --scene uniform:n=2700 \
    --path orbit:frames=8,visible=30 --path orbit:frames=8,visible=2% --path outside:frames=8 \
    --structure linear-scalar,linear,bvh --out run";

#[test]
fn a_run_is_reported_as_markdown_as_pictures_and_as_a_page() {
    let folder = folder(&[]);
    let shown = works(folder.path(), RUN);
    assert!(
        shown.contains("crossover surface: uniform, warm, six-plane"),
        "{shown}"
    );
    assert!(shown.contains("growth at a fixed number"), "{shown}");
    let text = works(folder.path(), "report run/report.json");
    // The folder is as good as the file in it.
    assert_eq!(works(folder.path(), "report run"), text);
    for wanted in [
        "# cullbench run ",
        "## uniform:n=2700",
        "### outside:frames=8, warm, six-plane",
        "| bound-read | bound |",
        "| bound-memcpy | bound |",
        "## Crossover: uniform, warm, six-plane",
        "| items \\\\ visible |",
        "| 100 % |",
        "faster than linear from",
        "## Growth at a fixed number of visible items",
        "| uniform, orbit, warm, six-plane | bvh | ",
    ] {
        assert!(text.contains(wanted), "no '{wanted}' in:\n{text}");
    }
    // Nobody asked other crates.
    assert!(!text.contains("times fastest peer"));
    let rows = text.lines().filter(|line| line.starts_with('|'));
    for (before, row) in text.lines().zip(text.lines().skip(1)) {
        let count = |line: &str| line.replace("\\|", "").matches('|').count();
        if before.starts_with('|') && row.starts_with('|') {
            assert_eq!(count(before), count(row), "{row}");
        }
    }
    assert!(rows.count() > 50);

    works(
        folder.path(),
        "report run --markdown r.md --svg charts --html r.html",
    );
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect(name);
    assert_eq!(read("r.md"), text);
    let charts = contents(&folder.path().join("charts"));
    assert!(charts.len() >= 2, "{:?}", charts.keys());
    for (name, bytes) in charts {
        let svg = String::from_utf8(bytes.expect("a file")).expect("UTF-8");
        assert!(
            name.ends_with(" visible.svg") || name.ends_with(".svg"),
            "{name}"
        );
        assert!(svg.starts_with("<svg") && svg.contains("bvh"), "{name}");
    }
    let page = read("r.html");
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("<svg"));
    assert!(
        !page.contains("http://") || page.contains("www.w3.org"),
        "loads something"
    );
}

#[test]
fn a_run_of_one_size_has_no_chart_and_says_so() {
    let folder = folder(&[]);
    let run = "run --scene uniform:n=300 --path orbit:frames=8 --structure linear,bvh --out run";
    works(folder.path(), run);
    let done = cullbench(folder.path(), "report run --svg charts");
    assert_eq!((done.code, done.out.as_str()), (Some(0), ""));
    assert_eq!(done.err.lines().count(), 1, "{}", done.err);
    assert!(
        done.err.starts_with("note: no chart in charts;"),
        "{}",
        done.err
    );
    assert!(contents(&folder.path().join("charts")).is_empty());
}

/// The crossover of a report whose figures are known.
#[test]
fn figures_are_read_off_not_measured() {
    let folder = folder(&[]);
    works(folder.path(), RUN);
    let path = folder.path().join("run/report.json");
    let mut report = json(&fs::read_to_string(&path).expect("a report"));
    // A structure of another crate, and a field of a later version.
    report["later"] = json!({ "x": [1] });
    report["noise"]["aa_floor"] = json!(0.01);
    for cell in report["cells"].as_array_mut().expect("an array") {
        cell["later"] = json!(1);
        let structure = cell["structure"].as_str().expect("text").to_owned();
        let items = cell["scene"]["total_count"].as_f64().expect("a number");
        // bvh: 0.1, 1 and 10 times as fast as linear at 300, 900 and 2700.
        let ratio = match structure.as_str() {
            "bvh" => (items / 900.0).powf(10f64.ln() / 3f64.ln()),
            "linear-scalar" => 0.05,
            _ => 1.0,
        };
        let set = |cell: &mut Value, name: &str, value: f64| {
            cell["metrics"][name] = json!({ "value": value, "unit": "1" });
        };
        set(cell, "ratio_to_linear", ratio);
        set(cell, "query_ns", items / ratio);
        if structure == "linear-scalar" {
            cell["structure"] = json!("peer-<b>|x");
        }
    }
    fs::write(&path, report.to_string()).expect("writable");
    let text = works(folder.path(), "report run --html r.html");
    assert_eq!(text, "");
    let text = works(folder.path(), "report run");
    // linear takes `items` ns and is 20 times as fast as the peer.
    assert!(text.contains("times fastest peer"), "{text}");
    assert!(text.contains("peer-\\<b>\\|x"), "{text}");
    assert!(text.contains("| linear | 1 | 300 ns |"), "{text}");
    assert!(text.contains("| 2,700 | bvh 10.0x |"), "{text}");
    // Faster from 900 on: not known where only one size has that share.
    assert!(text.contains("| bvh |  | ~ 900 |"), "{text}");
    let page = fs::read_to_string(folder.path().join("r.html")).expect("a page");
    assert!(page.contains("peer-&lt;b&gt;|x") && !page.contains("peer-<b>"));
}

#[test]
fn what_is_no_report_is_refused() {
    let folder = folder(&[
        ("empty.json", b""),
        ("other.json", b"{\"a\": 1}"),
        ("later.json", b"{\"schema_version\": 7}"),
        ("half.json", b"{\"schema_version\": 1, \"run\": {"),
        ("noise.json", &[0xFF; 64]),
    ]);
    fs::create_dir(folder.path().join("nothing")).expect("writable");
    for (file, wanted) in [
        ("missing.json", "missing.json | No such file"),
        ("nothing", "report.json | No such file"),
        ("empty.json", "empty.json | expected the report of a run"),
        (
            "other.json",
            "schema_version | expected the report of a run",
        ),
        ("later.json", "schema version 7 | expected 1"),
        ("half.json", "half.json | expected the report of a run"),
        ("noise.json", "noise.json | UTF-8"),
    ] {
        let lines = [
            format!("report {file}"),
            format!("report {file} --markdown new.md --svg new --html new.html"),
        ];
        all_refused(&folder, &lines, wanted);
    }
}
