//! `drift`: every method at every number of steps, figures of the known size,
//! limits by formulas written here, and recommendations that follow from the
//! figures beside them. Times are looked at only as far as choices follow from
//! them.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use super::process::*;

const METHODS: &str = "f32 f32-gram-schmidt f32-polar-100 f32-quaternion f32-radians f32-degrees \
    f32-degrees-wrapped f64 f64-gram-schmidt f64-polar-100 f64-quaternion f64-radians \
    f64-degrees-wrapped f64-lecture";
const CARRIERS: &str = "f32-carried f32-carried-radius f64-carried f64-carried-radius f64-angle";
const INTEGRATORS: &str = "explicit-euler semi-implicit-euler rk4 implicit-euler \
    implicit-midpoint exact-held exact-linear";

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
    let report = drift("--steps 20k");
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
    assert_eq!(of("orbit", "method", "steps"), product(CARRIERS, &steps));
    let stiffnesses = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000];
    assert_eq!(
        of("spring", "integrator", "stiffness"),
        product(INTEGRATORS, &stiffnesses)
    );
    for (table, names) in [
        ("rotation_methods", METHODS),
        ("orbit_methods", CARRIERS),
        ("integrators", INTEGRATORS),
    ] {
        let rated = rows(&report, table).iter();
        assert_eq!(
            rated.map(|r| text(r, "name")).collect::<BTreeSet<_>>(),
            set(names)
        );
        for rated in rows(&report, table) {
            assert!(number(rated, "ns_per_step") > 0.0, "{rated}");
        }
    }
}

#[test]
fn drift_has_the_known_size() {
    let report = drift("--steps 1e5");
    let figure = |method: &str, field: &str| {
        let fields = [("method", method.into()), ("steps", 100_000.into())];
        number(row(&report, "rotation", &fields), field)
    };
    // After a hundredth of the reference's ten million steps: what grows with
    // every step is a hundredth, what is corrected is the same.
    for (method, orthogonality, angle) in [
        ("f32", 0.18e-2, 2e-5),
        ("f32-gram-schmidt", 1e-7, 1e-4),
        ("f32-polar-100", 4e-8, 2e-5),
        ("f32-quaternion", 6e-8, 1e-4),
        ("f64", 3e-12, 3e-14),
        ("f64-gram-schmidt", 3e-16, 3e-13),
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
fn springs_blow_up_beyond_the_limits_of_the_formulas() {
    let report = drift("--steps 1000");
    let explicit = |z: f64| {
        2.0 * if z <= 1.0 {
            z
        } else {
            z - (z * z - 1.0).sqrt()
        }
    };
    let semi_implicit = |z: f64| 2.0 * ((1.0 + z * z).sqrt() - z);
    for row in rows(&report, "stability") {
        let zeta = number(row, "damping_ratio");
        let wanted = match text(row, "integrator") {
            "explicit-euler" => Some(explicit(zeta)),
            "semi-implicit-euler" => Some(semi_implicit(zeta)),
            "rk4" => [(0.1, 2.95), (0.5, 2.62), (1.0, 2.785), (2.0, 0.746)]
                .into_iter()
                .find(|known| known.0 == zeta)
                .map(|known| known.1),
            _ => None,
        };
        for field in ["limit_omega_h", "formula_omega_h"] {
            let found = row[field].as_f64();
            assert_eq!(found.is_some(), wanted.is_some(), "{row}");
            if let (Some(found), Some(wanted)) = (found, wanted) {
                assert!((found / wanted - 1.0).abs() < 0.01, "{row}: {wanted}");
            }
        }
    }
    assert_eq!(rows(&report, "stability").len(), 7 * 4);
    for row in rows(&report, "spring") {
        let omega_h = number(row, "stiffness").sqrt() / 60.0;
        assert!((number(row, "omega_h") / omega_h - 1.0).abs() < 1e-12);
        let limit = match text(row, "integrator") {
            "explicit-euler" => 2.0,
            "semi-implicit-euler" => semi_implicit(1.0),
            "rk4" => 2.785,
            _ => f64::INFINITY,
        };
        assert_eq!(row["rms_error"].is_null(), omega_h > limit, "{row}");
    }
    let error = |integrator: &str, stiffness: f64| {
        let fields = [
            ("integrator", integrator.into()),
            ("stiffness", stiffness.into()),
        ];
        number(row(&report, "spring", &fields), "rms_error")
    };
    for (found, wanted) in [
        (error("rk4", 1e2), 7.8e-7),
        (error("explicit-euler", 1e4), 0.12),
        (error("implicit-midpoint", 1e6), 2.3e-2),
        (error("exact-held", 1e6), 1.4e-3),
        (error("exact-linear", 1e6), 9.6e-6),
    ] {
        assert!(
            (found / wanted - 1.0).abs() < 0.05,
            "{found:e}, not {wanted:e}"
        );
    }
}

/// That the front and who dominates whom follow from the figures.
fn check_front(rated: &[Value]) {
    let point = |row: &Value| (row["error"].as_f64(), number(row, "ns_per_step"));
    let beats = |a: &Value, b: &Value| match (point(a), point(b)) {
        ((Some(e), t), (Some(f), u)) => e <= f && t <= u && (e, t) != (f, u),
        _ => false,
    };
    for row in rated {
        let beaten = rated.iter().any(|rival| beats(rival, row));
        assert_eq!(row["on_front"], !beaten && !row["error"].is_null(), "{row}");
        assert_eq!(!row["dominated_by"].is_null(), beaten, "{row}");
        if beaten {
            let by = rated.iter().find(|r| r["name"] == row["dominated_by"]);
            let by = by.expect("one of the rows");
            assert!(beats(by, row) && by["on_front"] == true, "{row}");
        }
    }
}

#[test]
fn recommendations_follow_from_the_figures_and_the_tolerance() {
    let mut choices = Vec::new();
    for (tolerance, wanted) in [
        ("1e-20", ""),
        (
            "1e-6",
            "f64 f64-gram-schmidt f64-polar-100 f64-quaternion f64-radians f64-degrees-wrapped",
        ),
        ("1e1", METHODS),
    ] {
        let report = drift(&format!("--steps 1e4 --tolerance {tolerance}"));
        let methods = rows(&report, "rotation_methods");
        check_front(methods);
        check_front(rows(&report, "orbit_methods"));
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
        let wanted: BTreeSet<&str> = match tolerance {
            "1e-20" => BTreeSet::new(),
            "1e-6" => set("f64-carried f64-carried-radius f64-angle"),
            _ => set(CARRIERS),
        };
        let orbits = rows(&report, "orbit_methods").iter();
        let good_orbits: Vec<&Value> = orbits.filter(|m| m["qualifies"] == true).collect();
        let names: BTreeSet<&str> = good_orbits.iter().map(|m| text(m, "name")).collect();
        assert_eq!(names, wanted, "{tolerance}");
        for (what, good) in [
            ("recommended_rotation", good),
            ("recommended_orbit", good_orbits),
        ] {
            let time = |m: &&Value| number(m, "ns_per_step");
            let cheapest = good.iter().min_by(|a, b| time(a).total_cmp(&time(b)));
            let chosen = &report[what];
            let wanted = cheapest.map_or(Value::Null, |m| m["name"].clone());
            assert_eq!(chosen["name"], wanted, "{what}");
            assert!(text(chosen, "reason").contains(tolerance), "{chosen}");
            choices.push(chosen["name"].clone());
        }

        let integrators = rows(&report, "integrators");
        check_front(integrators);
        let stable = integrators.iter().filter(|i| i["qualifies"] == true);
        let names: BTreeSet<&str> = stable.clone().map(|i| text(i, "name")).collect();
        assert_eq!(
            names,
            set("implicit-euler implicit-midpoint exact-held exact-linear")
        );
        let product = |i: &Value| number(i, "error") * number(i, "ns_per_step");
        let best = stable.min_by(|a, b| product(a).total_cmp(&product(b)));
        let best = best.map(|i| text(i, "name"));
        assert_eq!(report["recommended_integrator"]["name"].as_str(), best);
        // By a factor of hundreds in error, whatever the machine.
        assert_eq!(best, Some("exact-linear"));
    }
    let nothing: Vec<bool> = choices.iter().map(Value::is_null).collect();
    assert_eq!(
        nothing,
        [true, true, false, false, false, false],
        "{choices:?}"
    );
}

#[test]
fn the_table_says_the_same_for_people() {
    let table = works(Path::new("."), "drift --steps 1000");
    let names = [METHODS, INTEGRATORS].map(set).into_iter().flatten();
    for name in names.chain([
        "f64-polar-100 (default)",
        "unstable",
        "rings",
        "0.8284 (0.8284)",
    ]) {
        assert!(table.contains(name), "{name}");
    }
    assert!(
        table.contains("8.147e-4") && !table.contains('\x1b'),
        "{table}"
    );
    assert_eq!(table.matches("Recommended for ").count(), 3);
    let none = works(Path::new("."), "drift --steps 1000 --tolerance 1e-30");
    assert!(none.contains("Recommended for a frame: nothing; no method has"));
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
    for tolerance in ["0", "-1e-6", "nan", "inf"] {
        let wanted = "--tolerance is ' | expected a number above 0";
        all_refused(&folder, &[format!("drift --tolerance={tolerance}")], wanted);
    }
}
