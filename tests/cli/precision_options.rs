//! `precision`: its options, tables and refusals.

use std::path::Path;

use serde_json::Value;

use super::precision::{ERRORS, SMALL};
use super::process::*;

#[test]
fn sweeps_can_be_left_out_and_points_refused() {
    let line = "precision --scene uniform:n=200 --path orbit:frames=2 --structure linear --cubes 0 \
         --processes 1";
    let lens = "--near 1e-6 --far 1000";
    let outcome = json(&works(
        Path::new("."),
        &format!("{line} {lens} --format json"),
    ));
    assert!(array(&outcome, "sweeps").is_empty());
    let points = array(&outcome, "points");
    let refused: Vec<&Value> = points.iter().filter(|p| p["status"] == "refused").collect();
    assert!(
        refused.iter().any(|p| p["planes"] == "gh-gl-f32"),
        "{refused:?}"
    );
    for point in &refused {
        assert!(
            point["planes"].as_str().expect("text").ends_with("f32"),
            "{point}"
        );
        assert!(
            point["reason"]
                .as_str()
                .is_some_and(|r| r.contains("not finite")),
            "{point}"
        );
        let others = ["excess", "false_negative_ppm", "query_ns", "dominated_by"];
        for name in others.into_iter().chain(ERRORS) {
            assert!(point[name].is_null(), "{name}: {point}");
        }
        assert_eq!(point["on_front"], false);
    }
    // What has no time comes last.
    let is_timed = |p: &Value| !p["query_ns"].is_null();
    assert!(points.iter().map(is_timed).is_sorted_by(|a, b| a >= b));
    assert!(refused.iter().all(|p| !is_timed(p)));
    assert_eq!(
        outcome["front"].as_array().map(|f| f.is_empty()),
        Some(false)
    );
    // As a table: plain text, with the reason in a line of its own.
    let table = works(Path::new("."), &format!("{line} {lens}"));
    assert!(!table.contains('\u{1b}'), "{table}");
    let told = "linear with six-plane f32 gh-gl-f32 c=0: refused: ";
    assert!(
        table.contains(told) && table.contains("Pareto front") && table.contains("Conclusions:"),
        "{table}"
    );
}

#[test]
fn tables_fit_the_terminal_and_end_with_conclusions() {
    let line = SMALL
        .replace("--format json", "")
        .replace("--processes 4", "--processes 1");
    let shown = works(Path::new("."), &line);
    for line in shown.lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
    let conclusions = shown.split("Conclusions:\n").nth(1).expect("conclusions");
    assert!(
        conclusions
            .lines()
            .filter(|line| line.starts_with("- "))
            .count()
            >= 5,
        "{shown}"
    );
    let least = conclusions
        .lines()
        .find(|line| line.contains("Least memory"));
    let least = least.expect("the least memory");
    assert!(!least.contains("c=0"), "a margin of none: {least}");
    let figure = "misses no items; others miss items";
    assert!(conclusions.contains(figure), "{conclusions}");
}

#[test]
fn mistakes_are_one_line() {
    let folder = folder(&[]);
    let line = "precision --cubes 0 --path orbit:frames=2";
    for (more, wanted) in [
        ("--scene citty:n=10", "citty | did you mean 'city'"),
        (
            "--scene city:n=10 --structure bhv",
            "bhv | did you mean 'bvh'",
        ),
        ("--scene nothing.csv", "nothing.csv"),
        ("--scene city:n=10 --fovy 0", "--fovy is '0'"),
        (
            "--scene city:n=10 --kernel avx3",
            "avx3 | did you mean 'avx2'",
        ),
        ("--scene city:n=10 --processes 0", "0 | --processes"),
    ] {
        all_refused(&folder, &[format!("{line} {more}")], wanted);
    }
}
