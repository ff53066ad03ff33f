//! The tables that a run ends with.

use std::collections::BTreeSet;
use std::path::Path;

use super::process::*;
use super::runs::{TINY, cells, report};

/// The lines of a table: from its header to the first empty line.
fn table_of<'t>(out: &'t str, header: &str) -> Vec<&'t str> {
    let lines = out.lines().skip_while(|line| !line.starts_with(header));
    lines
        .take_while(|line| !line.is_empty() && !line.starts_with("* "))
        .collect()
}

/// Lines of prose, joined again.
pub fn prose(out: &str) -> String {
    out.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn a_run_ends_with_its_conclusion_in_eighty_columns() {
    let folder = folder(&[]);
    let short = works(
        folder.path(),
        &format!("{TINY} --structure default,octree-textbook --processes 3"),
    );
    let all = works(folder.path(), &format!("{TINY} --resume --all-columns"));
    for out in [&all, &short] {
        let wide = out.lines().find(|line| line.chars().count() > 80);
        assert_eq!(wide, None, "{out}");
    }
    let rows = table_of(&short, "structure");
    let heads: Vec<&str> = rows[0]
        .split("  ")
        .filter(|head| !head.is_empty())
        .collect();
    let wanted = [
        "structure",
        "rank",
        "time per query",
        "vs linear",
        "build",
        "bytes/item",
    ];
    assert_eq!(heads.iter().map(|h| h.trim()).collect::<Vec<_>>(), wanted);
    assert_eq!(rows.len(), 1 + timed_names().len() + 1, "{short}");
    for column in ["/ read", "/ copy", "locate", "update of 1 %", "bound-read"] {
        assert!(all.contains(column), "no {column}: {all}");
        assert!(!short.contains(column), "{column}: {short}");
    }
    // The sentence has the ratios of the two times that the report has.
    let report = report(&folder.path().join("out/run"));
    let mut cells: Vec<(f64, &str, u64)> = cells(&report)
        .iter()
        .map(|cell| {
            let time = cell["metrics"]["query_ns"]["value"].as_f64();
            let name = cell["structure"].as_str().expect("a name");
            (
                time.expect("a time"),
                name,
                cell["rank"].as_u64().expect("a rank"),
            )
        })
        .collect();
    cells.sort_by(|a, b| (a.2, a.0).partial_cmp(&(b.2, b.0)).expect("numbers"));
    let told = prose(&short);
    let winners = cells.iter().filter(|cell| cell.2 == 1).count();
    let ratio = |cell: &(f64, &str, u64)| {
        let ratio = cell.0 / cells[0].0;
        let digits = usize::from(ratio < 100.0) + usize::from(ratio < 10.0);
        let about = if cell.1 == "linear" {
            ", a flat scan"
        } else {
            ""
        };
        format!("{ratio:.digits$} x as fast as {}{about}", cell.1)
    };
    let next = format!("{}, the next best", ratio(&cells[winners]));
    assert!(told.contains(&next), "no '{next}': {told}");
    // Noise may tie the fastest with what is slower than the next best.
    let ahead = cells[..winners].iter();
    let ahead = ahead.filter(|cell| cell.0 <= cells[winners].0).count();
    assert_eq!(told.contains("(a tie)"), ahead > 1, "{told}");
    for wanted in [
        "All structures returned the sets of the reference scan in all 16 views, of which",
        "A/A check:",
        "next cullbench advise --scene uniform:n=200 --path orbit:frames=16",
        "report out/run/report.html report.json, summary.csv, samples.csv, stream.jsonl, *.svg",
    ] {
        assert!(told.contains(wanted), "no '{wanted}': {told}");
    }
}

#[test]
fn several_paths_have_a_row_each_and_a_geometric_mean() {
    let folder = folder(&[]);
    let paths = "--path orbit:frames=8,visible=20% --path outside:frames=8";
    let line = format!("run --scene uniform:n=1000 --scene city:n=300 {paths} --processes 3");
    let out = works(folder.path(), &format!("{line} --out r"));
    let rows = table_of(&out, "scene, path");
    assert_eq!(rows.len(), 1 + 4 + 1, "{out}");
    assert!(rows[1].starts_with("uniform 1k orbit 20 %  "), "{out}");
    assert!(out.contains("further structures: --all-columns"), "{out}");
    assert!(out.lines().all(|line| line.chars().count() <= 80), "{out}");
    let all = works(
        folder.path(),
        &format!("{line} --out r --resume --all-columns"),
    );
    for name in timed_names() {
        assert!(all.contains(&name), "no {name}: {all}");
    }
    // Means of the report's own ratios, of the structure in the second column.
    let report = report(&folder.path().join("r"));
    let best = rows[0].split_whitespace().nth(3).expect("a structure");
    let of_best = cells(&report).iter().filter(|c| c["structure"] == best);
    let ratios = of_best.map(|c| c["metrics"]["speedup"]["value"].as_f64().expect("a ratio"));
    let mean = (ratios.map(f64::ln).sum::<f64>() / 4.0).exp();
    let shown = rows[5].split_whitespace().nth(5).expect("a mean");
    let shown: f64 = shown.parse().expect("a number");
    assert!((shown / mean - 1.0).abs() < 6e-3, "{shown} {mean}: {out}");
    let told = prose(&out);
    assert!(told.contains("linear in the geometric mean"), "{told}");
    assert!(told.contains(" of 4."), "{told}");
    // Without linear, the slowest structure is the base, and is named as that.
    let out = works(
        folder.path(),
        &format!("{line} --structure bvh,uniform-grid --out s"),
    );
    let told = prose(&out);
    let bases = ["bvh", "uniform-grid"].map(|base| {
        told.contains(&format!(
            "Speed-ups refer to {base}, the slowest: linear lacks times."
        )) && told.contains(&format!("geometric mean, x {base} 1.00 "))
    });
    assert!(bases.contains(&true), "{told}");
}

#[test]
fn textbook_forms_are_timed_where_they_are_named_and_by_the_suite_standard() {
    let planned = |options: &str| -> BTreeSet<String> {
        let plan = works(Path::new("."), &format!("run --plan {options}"));
        let of_line = |line: &str| json(line)["structure"].as_str().expect("a name").to_owned();
        plan.lines().map(of_line).collect()
    };
    let all: BTreeSet<String> = structure_names().into_iter().collect();
    let timed: BTreeSet<String> = timed_names().into_iter().collect();
    let name = "octree-textbook";
    assert!(!timed.contains(name) && timed.contains("uniform-grid"));
    for options in ["", "--scene uniform:n=9", "--suite growth"] {
        assert_eq!(planned(options), timed, "{options}");
    }
    for options in ["--suite standard", "--structure all"] {
        assert_eq!(planned(options), all, "{options}");
    }
    let mut moving = timed.clone();
    moving.insert("moving".to_owned());
    let drift = "--scene uniform:n=9 --path flythrough:frames=9 --motion drift";
    assert_eq!(planned(drift), moving);
    let mut named = timed;
    named.insert(name.to_owned());
    assert_eq!(planned(&format!("--structure default,{name}")), named);
}
