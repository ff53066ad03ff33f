//! `report`: what a run found as Markdown, pictures and a page; what is no
//! report, and what a report of another program's making may hold.

use std::fs;

use serde_json::{Value, json};

use super::process::*;
use super::run_tables::prose;

/// A run over three sizes, with a fixed count and a share, small and quick.
const RUN: &str = "run --scene uniform:n=300 --scene uniform:n=900 --scene uniform:n=2700 \
    --path orbit:frames=8,visible=30 --path orbit:frames=8,visible=2% --path outside:frames=8 \
    --structure linear-scalar,linear,bvh --processes 3 --out run";

#[test]
fn a_run_is_reported_as_markdown_as_pictures_and_as_a_page() {
    let folder = folder(&[]);
    let shown = works(folder.path(), RUN);
    assert!(
        shown.contains("Crossover: uniform, warm, six-plane"),
        "{shown}"
    );
    assert!(shown.contains("Growth at a fixed number"), "{shown}");
    let text = works(folder.path(), "report run/report.json");
    // The folder is as good as the file in it.
    assert_eq!(works(folder.path(), "report run"), text);
    for wanted in [
        "# cullbench run ",
        "## uniform:n=2700",
        "### outside:frames=8, warm, six-plane",
        "| bound-read | lower bound |",
        "| bound-memcpy | lower bound |",
        "## Crossover: uniform, warm, six-plane",
        "| items \\\\ visible |",
        "| 100 % |",
        "faster than linear from",
        "## Growth at a fixed number of visible items",
        "| uniform, orbit, warm, six-plane | bvh | ",
    ] {
        assert!(text.contains(wanted), "no '{wanted}' in:\n{text}");
    }
    // A bound has its speed-up as on the screen, and no column is empty.
    let bounds = text.lines().filter(|line| line.starts_with("| bound-"));
    for bound in bounds {
        let cells: Vec<&str> = bound.split('|').map(str::trim).collect();
        let speedup = cells.get(4).and_then(|cell| cell.split(' ').next());
        let speedup = speedup.and_then(|cell| cell.replace(',', "").parse::<f64>().ok());
        assert!(speedup.is_some_and(|ratio| ratio > 0.0), "{bound}");
    }
    assert!(!text.contains("| p95 |"), "{text}");
    // The run has no other crates.
    assert!(!text.contains("vs fastest peer"));
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
    // Lines of growth, and no other file.
    assert!(page.contains("class=\"curve\"") && page.contains("geometric mean"));
    assert!(!page.contains("http"), "loads something");
}

/// One estimator: every value in its interval, every ratio the ratio of the two
/// values, and the ranks of the report in every table.
#[test]
fn values_ratios_and_ranks_are_the_same_everywhere() {
    let folder = folder(&[]);
    let run = "run --scene city:n=300 --path orbit:frames=8 --path outside:frames=8 \
        --structure linear-scalar,linear,bvh,octree,bsp,wide --processes 4 --all-columns \
        --out run";
    let screen = works(folder.path(), run);
    let markdown = works(folder.path(), "report run");
    works(folder.path(), "report run --html r.html");
    let page = fs::read_to_string(folder.path().join("r.html")).expect("a page");
    let text = fs::read_to_string(folder.path().join("run/report.json")).expect("a report");
    let report = json(&text);
    let list = |name: &str| report[name].as_array().expect("an array").clone();
    let value = |cell: &Value, metric: &str| cell["metrics"][metric]["value"].as_f64();
    let cells = list("cells");
    type Row = (u64, f64, String);
    let mut ranked: Vec<(String, Vec<Row>)> = Vec::new();
    for cell in &cells {
        let (path, name) = (cell["path"]["name"].as_str(), cell["structure"].as_str());
        let (path, name) = (
            path.expect("text").to_owned(),
            name.expect("text").to_owned(),
        );
        let mut intervals = 0;
        for (metric, found) in cell["metrics"].as_object().expect("metrics") {
            let part = |part: &str| found[part].as_f64();
            if let (Some(lower), Some(upper)) = (part("lower"), part("upper")) {
                let value = part("value").expect("a value");
                assert!(lower <= value && value <= upper, "{name} {metric}: {found}");
                intervals += 1;
            }
        }
        assert!(intervals >= 5, "{name}: {intervals}");
        let of = |list: &[Value], structure: &str| {
            let same = |c: &&Value| c["path"]["name"] == *path && c["structure"] == structure;
            value(list.iter().find(same).expect(structure), "query_ns").expect("a time")
        };
        let ns = of(&cells, &name);
        for (metric, ratio) in [
            ("speedup", of(&cells, "linear") / ns),
            ("times_read", ns / of(&list("bounds"), "bound-read")),
            ("times_memcpy", ns / of(&list("bounds"), "bound-memcpy")),
        ] {
            let shown = value(cell, metric).expect(metric);
            assert!(
                (shown / ratio - 1.0).abs() < 1e-9,
                "{name} {metric}: {shown} {ratio}"
            );
        }
        let rank = cell["rank"].as_u64().expect("a rank");
        match ranked.iter_mut().find(|found| found.0 == path) {
            Some(found) => found.1.push((rank, ns, name)),
            None => ranked.push((path, vec![(rank, ns, name)])),
        }
    }
    let mut wanted: Vec<(u64, String)> = Vec::new();
    for (_, rows) in &mut ranked {
        // A slower one with more noise can rank before a faster one, but not before the fastest.
        let fastest = rows.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        assert_eq!(fastest.map(|row| row.0), Some(1), "{rows:?}");
        rows.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        wanted.extend(rows.iter().map(|row| (row.0, row.2.clone())));
    }
    let parsed = |rank: &str, name: &str| Some((rank.parse().ok()?, name.to_owned()));
    let mut is_ranked = false;
    let of_screen = screen.lines().filter_map(|line| {
        let is_head = line.starts_with("structure ");
        is_ranked = !line.is_empty() && (is_ranked || is_head && line.contains("time per query"));
        let mut words = line.split_whitespace().filter(|_| is_ranked);
        let name = words.next()?;
        parsed(words.next()?, name)
    });
    let of_markdown = markdown.lines().filter_map(|line| {
        let mut cells = line.strip_prefix("| ")?.split(" | ");
        let name = cells.next()?;
        parsed(cells.next()?, name)
    });
    let of_page = page.lines().filter_map(|line| {
        let (name, row) = line
            .strip_prefix("<tr data-s=\"")?
            .split_once("</th><td class=\"n\">")?;
        let (_, name) = name.split_once("<th scope=\"row\">")?;
        parsed(row.split_once("</td>")?.0, name)
    });
    let told: [(&str, Vec<(u64, String)>); 3] = [
        ("screen", of_screen.collect()),
        ("Markdown", of_markdown.collect()),
        ("page", of_page.collect()),
    ];
    for (place, told) in told {
        // What follows are the tables of crossovers.
        assert!(told.len() >= wanted.len(), "{place}: {told:?}");
        assert_eq!(told[..wanted.len()], wanted[..], "{place}");
    }
    for text in [&screen, &markdown, &page] {
        assert!(text.contains("4 processes, "), "{text}");
        assert!(
            prose(text).contains(" of them against the oracle"),
            "{text}"
        );
    }
}

#[test]
fn a_run_without_times_has_no_chart_and_says_so() {
    let folder = folder(&[("none.csv", b"min_x,min_y,min_z,max_x,max_y,max_z\n")]);
    let run = "run --scene none.csv --path orbit:frames=8 --structure linear,bvh --out run";
    works(folder.path(), run);
    let done = cullbench(folder.path(), "report run --svg charts");
    assert_eq!((done.code, done.out.as_str()), (Some(0), ""));
    assert_eq!(done.err.lines().count(), 1, "{}", done.err);
    assert!(
        done.err.starts_with("note: no chart in charts;"),
        "{}",
        done.err
    );
    assert!(!folder.path().join("charts").exists());
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
        set(cell, "speedup", ratio);
        cell["rank"] = json!(match structure.as_str() {
            "linear-scalar" => 3,
            "bvh" if ratio > 1.0 => 1,
            "bvh" => 2,
            _ if items > 900.0 => 2,
            _ => 1,
        });
        set(cell, "query_ns", items / ratio);
        if structure == "linear-scalar" {
            cell["structure"] = json!("peer-<b>|x");
            (cell["kind"], cell["origin"]) = (json!("tree"), json!({ "crate": "b" }));
        }
    }
    fs::write(&path, report.to_string()).expect("writable");
    let text = works(folder.path(), "report run --html r.html");
    assert_eq!(text, "");
    let text = works(folder.path(), "report run");
    // linear takes `items` ns and is 20 times as fast as the peer.
    assert!(text.contains("vs fastest peer"), "{text}");
    assert!(text.contains("peer-\\<b>\\|x"), "{text}");
    assert!(text.contains("| linear | 1 | 300 ns |"), "{text}");
    assert!(text.contains("| 2,700 | bvh: 10.0 (at 1.11 %) |"), "{text}");
    // Faster from 900 on: not known where only one size has that share.
    assert!(text.contains("| bvh |  | \\~ 900 |"), "{text}");
    let page = fs::read_to_string(folder.path().join("r.html")).expect("a page");
    assert!(page.contains("peer-&lt;b&gt;|x") && !page.contains("peer-<b>"));
}

/// A third of the items is not half of them.
#[test]
fn shares_stand_where_they_belong() {
    let folder = folder(&[]);
    works(folder.path(), RUN);
    let path = folder.path().join("run/report.json");
    let mut report = json(&fs::read_to_string(&path).expect("a report"));
    for cell in report["cells"].as_array_mut().expect("an array") {
        cell["metrics"]["cull_rate"]["value"] = json!(1.0 - 0.347);
    }
    fs::write(&path, report.to_string()).expect("writable");
    let text = works(folder.path(), "report run");
    let (_, table) = text.split_once("| items \\\\ visible |").expect("a table");
    let (head, rows) = table.split_once('\n').expect("rows");
    assert_eq!(head, " 30 % |", "{text}");
    let rows: Vec<&str> = rows.lines().skip(1).take(3).collect();
    assert!(
        rows.iter().all(|row| row.contains("(at 34.7 %)")),
        "{rows:?}"
    );
    works(folder.path(), "report run --svg charts");
    for (name, svg) in contents(&folder.path().join("charts")) {
        let svg = String::from_utf8(svg.expect("a file")).expect("UTF-8");
        let is_of_share = !name.contains("frames");
        let has_share = svg.contains("(measured: 34.70 % to 34.70 %)");
        assert_eq!(has_share, is_of_share, "{name}");
    }
}

/// Every figure of a report that JSON can hold, on a logarithmic axis as well.
#[test]
fn figures_beyond_any_axis_end_and_are_left_out() {
    let folder = folder(&[]);
    works(folder.path(), RUN);
    let path = folder.path().join("run/report.json");
    let report = json(&fs::read_to_string(&path).expect("a report"));
    for extreme in [1e308, f64::MAX, 5e-324, 1e-310, 0.0, -1.0] {
        let mut report = report.clone();
        for cell in report["cells"].as_array_mut().expect("an array") {
            if cell["scene"]["total_count"] == 2700 {
                for metric in cell["metrics"]
                    .as_object_mut()
                    .expect("metrics")
                    .values_mut()
                {
                    metric["value"] = json!(extreme);
                }
                let nearly_all = json!({ "value": 0.5, "unit": "1" });
                cell["metrics"]["cull_rate"] = nearly_all;
            }
            if cell["structure"] == "bvh" {
                cell["metrics"]["query_ns"]["value"] = json!(extreme);
            }
        }
        fs::write(&path, report.to_string()).expect("writable");
        let done = cullbench(folder.path(), "report run --svg charts --html page.html");
        // No time is zero: where its structure is the fastest, nothing is compared.
        let note = "note: no chart in charts; a chart needs a structure with times\n";
        let err = besides_work(&done.err);
        assert!(
            err.is_empty() || extreme <= 0.0 && err == note,
            "{extreme}: {err}"
        );
        assert_eq!((done.code, &*done.out), (Some(0), ""), "{extreme}");
        works(folder.path(), "report run");
        works(folder.path(), "compare run run --all");
        let page = fs::read_to_string(folder.path().join("page.html")).expect("a page");
        assert!(page.len() < 1_000_000, "{extreme}: {} bytes", page.len());
        if extreme > 0.0 {
            assert!(page.contains("beyond the axis left out"), "{extreme}");
        }
    }
    // No number of JSON: refused with its place.
    for (number, wanted) in [
        ("1e999", "out of range"),
        ("NaN", "expected"),
        ("null", "null"),
    ] {
        let text = report.to_string();
        let at = text.find("\"value\":").expect("a value") + 8;
        let end = at + text[at..].find([',', '}']).expect("its end");
        let bad = format!("{}{number}{}", &text[..at], &text[end..]);
        fs::write(folder.path().join("bad.json"), bad).expect("writable");
        let wanted = format!("bad.json, line 1, column | bounds | {wanted}");
        all_refused(&folder, &["report bad.json --svg new"], &wanted);
    }
}

#[test]
fn what_is_no_report_is_refused() {
    let folder = folder(&[
        ("empty.json", b""),
        ("other.json", b"{\"a\": 1}"),
        ("later.json", b"{\"schema_version\": 7}"),
        ("half.json", b"{\"schema_version\": 2, \"run\": {"),
        ("noise.json", &[0xFF; 64]),
        (
            "latin.json",
            b"{\n  \"schema_version\": 2, \"x\": \"\xe4\"}",
        ),
        ("more.json", b"{\"schema_version\": 2} {}"),
        ("text.json", b"{\n\"schema_version\": \"one\"}"),
        (
            "deep.json",
            b"{\"schema_version\": 2,\n\"run\": {\"id\": \"a\", \"started_at\": 7}}",
        ),
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
        ("later.json", "schema version 7 | expected 2"),
        ("half.json", "half.json | expected the report of a run"),
        (
            "noise.json",
            "noise.json, line 1, column 1: byte 0xff | UTF-8 | expected",
        ),
        (
            "latin.json",
            "line 2, column 30: byte 0xe4 | UTF-8 | expected",
        ),
        (
            "more.json",
            "more.json, line 1, column 23: no JSON (trailing characters)",
        ),
        (
            "text.json",
            "line 2, column 23, schema_version: the text 'one'; expected the report of a run, here \
             a whole number from 0 to 4294967295",
        ),
        (
            "deep.json",
            "deep.json, line 2, column 34, run.started_at: '7'; expected the report of a run, \
             here a text",
        ),
    ] {
        let lines = [
            format!("report {file}"),
            format!("report {file} --markdown new.md --svg new --html new.html"),
        ];
        all_refused(&folder, &lines, wanted);
    }
}
