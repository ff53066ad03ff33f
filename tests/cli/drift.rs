//! `drift`: every method, figures of the known size, limits by formulas, advice.
//!
//! Recommendations follow from the figures beside them; times are looked at only as far as
//! choices follow from them.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::OnceLock;

use serde_json::Value;

use super::process::*;

const METHODS: &str = "f32 f32-gram-schmidt f32-polar-100 f32-quaternion f32-radians f64 \
    f64-gram-schmidt f64-polar-100 f64-lecture";
const STEPPED: &str =
    "explicit-euler semi-implicit-euler rk4 implicit-euler implicit-midpoint exact-linear";

/// A hundred thousand steps, timed in one process; made once for all tests here.
fn report() -> &'static Value {
    static REPORT: OnceLock<Value> = OnceLock::new();
    let line = "drift --format json --steps 1e5 --processes 1";
    REPORT.get_or_init(|| json(&works(Path::new("."), line)))
}

fn rows<'a>(report: &'a Value, table: &str) -> &'a [Value] {
    report[table].as_array().expect(table)
}

fn text<'a>(row: &'a Value, field: &str) -> &'a str {
    row[field].as_str().expect(field)
}

fn number(row: &Value, field: &str) -> f64 {
    row[field].as_f64().expect(field)
}

/// The cheapest of some rows.
fn cheapest<'a>(rows: impl Iterator<Item = &'a Value>, time: &str) -> &'a Value {
    let cheapest = rows.min_by(|a, b| number(a, time).total_cmp(&number(b, time)));
    cheapest.expect("a row")
}

#[test]
fn every_method_is_there_with_a_time() {
    let report = report();
    assert_eq!(
        (&report["steps"], &report["processes"]),
        (&100_000.into(), &1.into())
    );
    for (table, methods) in [("rotation", METHODS), ("arm_methods", STEPPED)] {
        let names = rows(report, table).iter().map(|row| text(row, "name"));
        assert_eq!(names.collect::<BTreeSet<_>>(), set(methods));
    }
    for row in rows(report, "rotation") {
        assert!(number(row, "ns_per_step") > 0.0, "{row}");
        assert!(row["ns_per_step_lower"].is_null(), "{row}");
    }
    // Two arms, three stiffnesses, six methods, five numbers of steps.
    let points = rows(report, "arm_points");
    assert_eq!(points.len(), 2 * 3 * 6 * 5);
    for point in points {
        let is_timed = point["us_per_second"].as_f64().is_some_and(|us| us > 0.0);
        assert_eq!(is_timed, !point["position_error"].is_null(), "{point}");
    }
}

#[test]
fn drift_has_the_known_size() {
    let figure = |method: &str, field: &str| {
        let mut rows = rows(report(), "rotation").iter();
        number(rows.find(|row| row["name"] == method).expect(method), field)
    };
    // After a hundredth of the reference's ten million steps: what grows with
    // every step is a hundredth, what is corrected is the same.
    for (method, orthogonality, angle) in [
        ("f32", 0.18e-2, 2e-5),
        ("f32-gram-schmidt", 1e-7, 1e-4),
        ("f32-polar-100", 1.5e-6, 9e-5),
        ("f32-quaternion", 6e-8, 1e-4),
        ("f64", 3e-12, 3e-14),
        ("f64-gram-schmidt", 6e-16, 3e-13),
    ] {
        let (off, turned) = (
            figure(method, "orthogonality_error"),
            figure(method, "angle_error_rad"),
        );
        assert!(
            (0.03..30.0).contains(&(off / orthogonality)),
            "{method}: {off:e}"
        );
        assert!(
            (0.1..10.0).contains(&(turned / angle)),
            "{method}: {turned:e}"
        );
    }
    // The most of a period, not what is left the moment after a correction.
    let corrected = figure("f64-polar-100", "orthogonality_error");
    assert!((3e-15..8e-15).contains(&corrected), "{corrected:e}");
    // Radians in f32 are the worst there is.
    let angle = |method: &&str| figure(method, "angle_error_rad");
    let worst = set(METHODS)
        .into_iter()
        .max_by(|a, b| angle(a).total_cmp(&angle(b)));
    assert_eq!(worst, Some("f32-radians"));
}

#[test]
fn limits_of_stability_are_those_of_the_formulas() {
    for row in rows(report(), "arm_methods") {
        let wanted = match text(row, "name") {
            "explicit-euler" => Some(2.0),
            "semi-implicit-euler" => Some(2.0 * (2f64.sqrt() - 1.0)),
            "rk4" => Some(2.785),
            _ => None,
        };
        let found = row["limit_omega_h"].as_f64();
        assert_eq!(found.is_some(), wanted.is_some(), "{row}");
        let ratio = found
            .zip(wanted)
            .map_or(1.0, |(found, wanted)| found / wanted);
        assert!((ratio - 1.0).abs() < 1e-3, "{row}: {wanted:?}");
    }
}

#[test]
fn recommendations_follow_from_the_figures() {
    let report = report();
    let error = |row: &&Value| {
        let errors = ["angle_error_rad", "orthogonality_error"].map(|name| row[name].as_f64());
        errors
            .into_iter()
            .all(|error| error.is_some_and(|error| error <= 1e-6))
    };
    let good = rows(report, "rotation").iter().filter(error);
    let names: BTreeSet<&str> = good.clone().map(|row| text(row, "name")).collect();
    assert_eq!(names, set("f64 f64-gram-schmidt f64-polar-100"));
    let chosen = &report["recommended_rotation"];
    assert_eq!(chosen["name"], cheapest(good, "ns_per_step")["name"]);
    assert!(text(chosen, "reason").contains("within 1e-6 after 1e5 steps"));
    let choices = rows(report, "arm_choices");
    assert_eq!(choices.len(), 6);
    for choice in choices {
        let is_own = |p: &&Value| {
            let keys = ["arm", "stiffness"];
            keys.iter().all(|key| p[*key] == choice[*key])
                && p["position_error"]
                    .as_f64()
                    .is_some_and(|error| error <= 1e-3)
        };
        let good = rows(report, "arm_points").iter().filter(is_own);
        let cheapest = cheapest(good, "us_per_second");
        let label = match number(cheapest, "substeps") {
            1.0 => text(cheapest, "method").to_owned(),
            steps => format!("{} x{steps}", text(cheapest, "method")),
        };
        assert_eq!(choice["name"], label.as_str(), "{choice}");
    }
}

#[test]
fn the_table_says_the_same_for_people() {
    let folder = tempfile::tempdir().expect("a folder");
    let line = "drift --steps 1000 --processes 1 --all --svg arms.svg";
    let done = cullbench(folder.path(), line);
    // A pipe gets no lines about the work.
    assert_eq!((done.code, done.err.as_str()), (Some(0), ""));
    let table = done.out;
    let told = table.replace('\n', " ");
    assert!(
        told.contains("(1, 2, 4, 16, 64 are tried)")
            && told.contains("started 0.8, 1, 1.2 from zero")
    );
    let names = [METHODS, STEPPED].map(set).into_iter().flatten();
    for name in names.chain(["0.8284", "linear, k=1e6", "collision, k=1e4"]) {
        assert!(table.contains(name), "{name}");
    }
    assert!(!table.contains('\x1b'), "{table}");
    for line in table.lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
    assert_eq!(table.matches("Recommended for a ").count(), 7);
    let svg = std::fs::read_to_string(folder.path().join("arms.svg")).expect("a picture");
    for name in [
        "<svg",
        "linear arm, k = 1e6/s2, 60 Hz",
        "implicit-midpoint",
        "position error",
    ] {
        assert!(svg.contains(name), "{name}");
    }
}

/// Three processes give intervals, and a choice that names what is as fast.
#[test]
fn times_have_intervals_over_processes() {
    let report = json(&works(
        Path::new("."),
        "drift --format json --steps 1000 --processes 3",
    ));
    assert_eq!(report["processes"], 3);
    let bases = rows(&report, "rotation").iter();
    let points = rows(&report, "arm_points").iter();
    let timed = points.filter(|p| !p["us_per_second"].is_null());
    for (row, field) in bases
        .map(|r| (r, "ns_per_step"))
        .chain(timed.map(|p| (p, "us_per_second")))
    {
        let of = |end: &str| number(row, &format!("{field}{end}"));
        assert!(of("_lower") <= of("") && of("") <= of("_upper"), "{row}");
    }
    assert!(report["recommended_rotation"]["as_fast"].is_array());
}

#[test]
fn what_cannot_be_drifted_is_refused() {
    let folder = with_good_files(&[]);
    for steps in ["0", "-5", "1.5", "many", "nan", "inf", "2e9", "''"] {
        let typed = if steps == "''" { "" } else { steps };
        let wanted = format!("--steps is '{typed}' | expected a whole number from 1 to 1e9");
        all_refused(&folder, &[format!("drift --steps={steps}")], &wanted);
        if !typed.is_empty() {
            all_refused(&folder, &[format!("drift --steps {steps}")], &wanted);
        }
    }
    let wanted = "nowhere: expected an existing folder for --svg";
    all_refused(&folder, &["drift --svg nowhere/a.svg".to_owned()], wanted);
}

#[test]
fn a_pipe_gets_no_lines_about_the_work_of_a_funnel() {
    let options = "--processes 2 --frames 3 --samples 20x10 --path orbit:frames=5";
    let funnel = cullbench(
        Path::new("."),
        &format!("funnel --scene city:n=50 {options}"),
    );
    assert_eq!(funnel.err, "");
}
