//! `drift`: every method at every number of steps, figures of the known size,
//! limits by formulas written here, and recommendations that follow from the
//! figures beside them. Times are looked at only as far as choices follow from
//! them. One process, and few arms: what is to be seen does not need more.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use super::process::*;

const METHODS: &str = "f32 f32-gram-schmidt f32-polar-100 f32-quaternion f32-radians f64 \
    f64-gram-schmidt f64-polar-100 f64-lecture";
const STEPPED: &str =
    "explicit-euler semi-implicit-euler rk4 implicit-euler implicit-midpoint exact-linear";
/// One process and one arm.
const SMALL: &str = "--processes 1 --seconds 1 --arm linear --rate 60 --stiffness 1e2";

fn drift(options: &str) -> Value {
    json(&works(
        Path::new("."),
        &format!("drift --format json {options}"),
    ))
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

/// The one row whose fields have these values.
fn row<'a>(report: &'a Value, table: &str, fields: &[(&str, Value)]) -> &'a Value {
    let same = |row: &&Value| fields.iter().all(|(field, value)| row[*field] == *value);
    let mut found = rows(report, table).iter().filter(same);
    let row = found.next().unwrap_or_else(|| panic!("{table} {fields:?}"));
    assert!(found.next().is_none(), "{table} {fields:?}: two rows");
    row
}

#[test]
fn every_method_is_there_at_every_number_of_steps() {
    let report = drift(&format!("--steps 20k {SMALL}"));
    assert_eq!(report["steps"], 20_000);
    let of = |table: &str, name: &str, at: &str| -> BTreeSet<(String, u64)> {
        let rows = rows(&report, table).iter();
        rows.map(|row| (text(row, name).to_owned(), number(row, at) as u64))
            .collect()
    };
    let product = |names: &str, at: &[u64]| -> BTreeSet<(String, u64)> {
        let names = names.split_whitespace();
        names
            .flat_map(|name| at.iter().map(|&at| (name.to_owned(), at)))
            .collect()
    };
    let steps = [1_000, 10_000, 20_000];
    assert_eq!(of("rotation", "method", "steps"), product(METHODS, &steps));
    assert_eq!(
        of("one_degree_turns", "method", "turns"),
        product(METHODS, &[1, 1000])
    );
    let rated = rows(&report, "rotation_methods").iter();
    assert_eq!(
        rated.map(|r| text(r, "name")).collect::<BTreeSet<_>>(),
        set(METHODS)
    );
    for rated in rows(&report, "rotation_methods") {
        assert!(number(rated, "ns_per_step") > 0.0, "{rated}");
        assert!(rated["ns_per_step_lower"].is_null(), "{rated}");
    }
    assert_eq!(
        (&report["processes"], &report["period_steps"]),
        (&1.into(), &34.into())
    );
}

#[test]
fn drift_has_the_known_size() {
    let report = drift(&format!("--steps 1e5 {SMALL}"));
    let figure = |method: &str, field: &str| {
        let fields = [("method", method.into()), ("steps", 100_000.into())];
        number(row(&report, "rotation", &fields), field)
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
    // Radians in f32 are the worst there is, and the radius of an f32 orbit is
    // off by about 0.09 of 10 after a million steps.
    let angle = |method: &&str| figure(method, "angle_error_rad");
    let worst = set(METHODS)
        .into_iter()
        .max_by(|a, b| angle(a).total_cmp(&angle(b)));
    assert_eq!(worst, Some("f32-radians"));
    let radius = figure("f32", "orbit_radius_error");
    assert!((0.004..0.02).contains(&radius), "{radius}");
    assert!(figure("f64-polar-100", "orbit_position_error") < 1e-11);
    let angle = |method: &str, turns: u64| {
        let fields = [("method", method.into()), ("turns", turns.into())];
        number(row(&report, "one_degree_turns", &fields), "angle_error_rad")
    };
    assert!((angle("f64-lecture", 1) - 8.147e-4).abs() < 1e-6);
    assert!((angle("f32-radians", 1000) - 1.76).abs() < 0.02);
    assert!(angle("f64-polar-100", 1) < 1e-13);
}

#[test]
fn arms_are_stepped_by_every_method_and_the_cheapest_is_taken() {
    for (tolerance, nothing) in [("1e-3", false), ("1e-15", true)] {
        let few = "--steps 1 --processes 1 --seconds 1 --stiffness 1e2,1e6 --rate 60";
        let report = drift(&format!("{few} --arm-tolerance {tolerance}"));
        let arm = &report["arm"];
        let choices = rows(arm, "choices");
        assert_eq!((choices.len(), rows(arm, "methods").len()), (4, 6));
        for choice in choices {
            let is_own = |p: &&Value| {
                ["arm", "stiffness"]
                    .iter()
                    .all(|key| p[*key] == choice[*key])
            };
            let own: Vec<&Value> = rows(arm, "points").iter().filter(is_own).collect();
            let methods: BTreeSet<&str> = own.iter().map(|p| text(p, "method")).collect();
            assert_eq!(methods, set(STEPPED), "{choice}");
            for point in &own {
                let omega_h = number(point, "stiffness").sqrt() / 60.0;
                assert!(
                    (number(point, "omega_h") / omega_h - 1.0).abs() < 1e-12,
                    "{point}"
                );
                let is_timed = point["us_per_second"].as_f64().is_some_and(|us| us > 0.0);
                assert_eq!(is_timed, !point["position_error"].is_null(), "{point}");
            }
            let good = own.iter().filter(|p| {
                let error = p["position_error"].as_f64();
                error.is_some_and(|error| error <= tolerance.parse().expect("a number"))
            });
            let time = |p: &Value| number(p, "us_per_second");
            let cheapest = good.min_by(|a, b| time(a).total_cmp(&time(b)));
            let method = cheapest.map_or(Value::Null, |p| p["method"].clone());
            assert_eq!(choice["method"], method, "{choice}");
            assert_eq!(choice["name"].is_null(), nothing, "{choice}");
        }
    }
}

#[test]
fn limits_of_stability_are_those_of_the_formulas() {
    let report = drift(&format!("--steps 1 {SMALL}"));
    let stability = rows(&report["arm"], "stability");
    assert_eq!(stability.len(), 6 * 4);
    for row in stability {
        let z = number(row, "damping_ratio");
        let wanted = match text(row, "method") {
            "explicit-euler" if z <= 1.0 => Some(2.0 * z),
            "explicit-euler" => Some(2.0 * (z - (z * z - 1.0).sqrt())),
            "semi-implicit-euler" => Some(2.0 * ((1.0 + z * z).sqrt() - z)),
            "rk4" => [(0.1, 2.95), (0.5, 2.62), (1.0, 2.785), (2.0, 0.746)]
                .into_iter()
                .find(|known| known.0 == z)
                .map(|known| known.1),
            _ => None,
        };
        let found = row["limit_omega_h"].as_f64();
        assert_eq!(found.is_some(), wanted.is_some(), "{row}");
        let ratio = found
            .zip(wanted)
            .map_or(1.0, |(found, wanted)| found / wanted);
        assert!((ratio - 1.0).abs() < 0.01, "{row}: {wanted:?}");
    }
}

#[test]
fn recommendations_follow_from_the_figures_and_the_tolerance() {
    for (tolerance, wanted) in [
        ("1e-20", ""),
        ("1e-6", "f64 f64-gram-schmidt f64-polar-100"),
        ("1e1", METHODS),
    ] {
        let report = drift(&format!("--steps 1e4 {SMALL} --tolerance {tolerance}"));
        let methods = rows(&report, "rotation_methods");
        let good: Vec<&Value> = methods.iter().filter(|m| m["qualifies"] == true).collect();
        let names: BTreeSet<&str> = good.iter().map(|m| text(m, "name")).collect();
        assert_eq!(names, set(wanted), "{tolerance}");
        for method in methods {
            let fields = [("method", method["name"].clone()), ("steps", 10_000.into())];
            let last = row(&report, "rotation", &fields);
            let error = number(last, "angle_error_rad").max(number(last, "orthogonality_error"));
            assert_eq!(number(method, "error"), error);
            assert_eq!(method["is_default"], method["name"] == "f64-polar-100");
        }
        let time = |m: &&Value| number(m, "ns_per_step");
        let cheapest = good.iter().min_by(|a, b| time(a).total_cmp(&time(b)));
        let chosen = &report["recommended_rotation"];
        let wanted = cheapest.map_or(Value::Null, |m| m["name"].clone());
        assert_eq!(chosen["name"], wanted);
        assert_eq!(chosen["name"].is_null(), tolerance == "1e-20");
        assert!(text(chosen, "reason").contains(tolerance), "{chosen}");
    }
}

#[test]
fn the_table_says_the_same_for_people() {
    let folder = tempfile::tempdir().expect("a folder");
    let table = works(
        folder.path(),
        &format!("drift --steps 1000 {SMALL},1e6 --all --svg arms.svg"),
    );
    let names = [METHODS, STEPPED].map(set).into_iter().flatten();
    for name in names.chain([
        "f64-polar-100 (default)",
        "0.8284",
        "8.147e-4",
        "linear k=1e6, 60 Hz",
    ]) {
        assert!(table.contains(name), "{name}");
    }
    assert!(!table.contains('\x1b'), "{table}");
    for line in table.lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
    assert_eq!(table.matches("Recommended for ").count(), 2);
    let svg = std::fs::read_to_string(folder.path().join("arms.svg")).expect("a picture");
    for name in [
        "<svg",
        "linear arm, k = 1e6/s2, 60 Hz",
        "implicit-midpoint",
        "position error",
    ] {
        assert!(svg.contains(name), "{name}");
    }
    let none = works(
        Path::new("."),
        &format!("drift --steps 1000 {SMALL} --tolerance 1e-30 --arm-tolerance 1e-15"),
    );
    assert!(none.contains("Recommended for a camera base: nothing, no method has"));
    assert!(
        none.contains("Recommended for a linear arm: nothing at k=1e2"),
        "{none}"
    );
}

#[test]
fn a_pipe_gets_no_lines_about_the_work() {
    let here = Path::new(".");
    let drift = cullbench(here, &format!("drift --steps 1000 {SMALL}"));
    assert_eq!(drift.err, "");
    let options = "--processes 2 --frames 3 --samples 20x10 --path orbit:frames=5";
    let funnel = cullbench(here, &format!("funnel --scene city:n=50 {options}"));
    assert_eq!(funnel.err, "");
}

/// Three processes give intervals, and a choice that names what is as fast.
#[test]
fn times_have_intervals_over_processes() {
    let report =
        drift("--steps 1000 --processes 3 --seconds 1 --arm linear --rate 60 --stiffness 1e2");
    assert_eq!(report["processes"], 3);
    let rated = rows(&report, "rotation_methods").iter();
    let points = rows(&report["arm"], "points").iter();
    let timed = points.filter(|p| !p["us_per_second"].is_null());
    for (row, field) in rated
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
    let wanted = "--stiffness 1e8 over --seconds 1000 | 1e10 steps | expected at most 1e9";
    let line = "drift --stiffness 1e2,1e8 --seconds 1000";
    all_refused(&folder, &[line], wanted);
    for tolerance in ["0", "-1e-6", "nan", "inf"] {
        let wanted = "--tolerance is ' | expected a number above 0";
        all_refused(&folder, &[format!("drift --tolerance={tolerance}")], wanted);
    }
    for (option, wanted) in [
        ("--stiffness", "a number from 0.01 to 1e8"),
        ("--seconds", "a number from 1 to 1e3"),
    ] {
        for typed in ["0", "-1", "nan", "1e9"] {
            let wanted = format!("{option} is '{typed}' | expected {wanted}");
            all_refused(&folder, &[format!("drift {option}={typed}")], &wanted);
        }
    }
    for typed in ["0", "59.94", "2000"] {
        let wanted = format!("--rate is '{typed}' | expected a whole number from 1 to 1000");
        all_refused(&folder, &[format!("drift --rate={typed}")], &wanted);
    }
    let wanted = "unknown arm 'chain' | linear, collision";
    all_refused(&folder, &["drift --arm chain".to_owned()], wanted);
    let wanted = "nowhere: expected an existing folder for --svg";
    all_refused(&folder, &["drift --svg nowhere/a.svg".to_owned()], wanted);
}
