//! `drift`: every method at every number of steps, figures of the known size,
//! limits by formulas written here, and recommendations that follow from the
//! figures beside them. Times are looked at only as far as choices follow from
//! them. One process, and few arms: what is to be seen does not need more.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use super::process::*;

const METHODS: &str = "f32 f32-gram-schmidt f32-polar-100 f32-quaternion f32-radians f32-degrees \
    f32-degrees-wrapped f64 f64-gram-schmidt f64-polar-100 f64-quaternion f64-radians \
    f64-degrees-wrapped f64-lecture";
const CARRIERS: &str = "f32-carried f32-carried-radius f64-carried f64-carried-radius f64-angle";
const STEPPED: &str = "explicit-euler semi-implicit-euler verlet rk4 implicit-euler \
    implicit-midpoint tr-bdf2 exact-held exact-linear";
const TOLD_MORE: &str = "rk4-midpoints exact-midpoints";
const OWN_STEPS: &str = "bogacki-shampine dormand-prince";
const ARMS: &str = "linear collision quaternion";
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
    assert_eq!(of("orbit", "method", "steps"), product(CARRIERS, &steps));
    for (table, names) in [("rotation_methods", METHODS), ("orbit_methods", CARRIERS)] {
        let rated = rows(&report, table).iter();
        assert_eq!(
            rated.map(|r| text(r, "name")).collect::<BTreeSet<_>>(),
            set(names)
        );
        for rated in rows(&report, table) {
            assert!(number(rated, "ns_per_step") > 0.0, "{rated}");
            assert!(rated["ns_per_step_lower"].is_null(), "{rated}");
        }
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
fn arms_are_stepped_by_every_method_in_both_precisions() {
    let all: BTreeSet<&str> = [STEPPED, TOLD_MORE, OWN_STEPS]
        .into_iter()
        .flat_map(set)
        .collect();
    for name in set(ARMS) {
        let few = "--steps 1 --processes 1 --seconds 1 --stiffness 1e2 --rate 60";
        let report = drift(&format!("{few} --arm {name}"));
        let arm = &report["arm"];
        let of_setting = |row: &&Value| row["arm"] == name;
        for (frames, arithmetic) in [
            ("steady", "f32"),
            ("steady", "f64"),
            ("jittered", "f32"),
            ("jittered", "f64"),
        ] {
            let own = rows(arm, "points").iter().filter(of_setting);
            let own = own.filter(|p| p["frame_times"] == frames && p["arithmetic"] == arithmetic);
            let methods: BTreeSet<&str> = own.clone().map(|p| text(p, "method")).collect();
            assert_eq!(methods, all, "{name} {frames} {arithmetic}");
            for point in own {
                let omega_h = number(point, "omega_h");
                assert!((omega_h * 6.0 - 1.0).abs() < 1e-12, "{point}");
                let timed = frames == "jittered" && !point["position_error"].is_null();
                assert_eq!(
                    point["us_per_second"].as_f64().is_some_and(|us| us > 0.0),
                    timed
                );
                let more = set(TOLD_MORE).contains(text(point, "method"));
                assert_eq!(point["information"] == "midpoints", more);
                assert_eq!(
                    point["substeps"].is_null(),
                    set(OWN_STEPS).contains(text(point, "method"))
                );
            }
        }
        assert_eq!(rows(arm, "choices").iter().filter(of_setting).count(), 1);
        assert_eq!(
            rows(arm, "information").iter().filter(of_setting).count(),
            4
        );
        assert_eq!(rows(arm, "methods").len(), all.len());
    }
}

#[test]
fn explicit_steps_blow_up_beyond_the_limits_of_the_formulas() {
    let report =
        drift("--steps 1000 --processes 1 --seconds 2 --arm linear --rate 60 --stiffness 1e4,1e5");
    let arm = &report["arm"];
    let explicit = |z: f64| {
        2.0 * if z <= 1.0 {
            z
        } else {
            z - (z * z - 1.0).sqrt()
        }
    };
    let semi_implicit = |z: f64| 2.0 * ((1.0 + z * z).sqrt() - z);
    for row in rows(arm, "stability") {
        let zeta = number(row, "damping_ratio");
        let wanted = match text(row, "method") {
            "explicit-euler" => Some(explicit(zeta)),
            "semi-implicit-euler" => Some(semi_implicit(zeta)),
            "verlet" => Some(2.0),
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
    assert_eq!(rows(arm, "stability").len(), 9 * 4);
    let steady = rows(arm, "points").iter().filter(|p| {
        p["frame_times"] == "steady" && p["arm"] == "linear" && !p["substeps"].is_null()
    });
    for point in steady {
        let step = number(point, "omega_h") / number(point, "substeps");
        let limit = match text(point, "method").trim_end_matches("-midpoints") {
            "explicit-euler" | "verlet" => 2.0,
            "semi-implicit-euler" => semi_implicit(1.0),
            "rk4" => 2.785,
            _ => f64::INFINITY,
        };
        assert_eq!(point["position_error"].is_null(), step > limit, "{point}");
    }
}

#[test]
fn errors_of_arms_have_the_known_size_and_order() {
    let report =
        drift("--steps 1000 --processes 1 --seconds 2 --arm linear --rate 60 --stiffness 1e2,1e6");
    let soft = |method: &str, steps: u32| {
        let all = rows(&report["arm"], "points").iter();
        all.filter(|p| p["stiffness"] == 1e2 && p["arm"] == "linear" && p["method"] == method)
            .find(|p| {
                p["substeps"] == steps && p["frame_times"] == "steady" && p["arithmetic"] == "f64"
            })
            .expect(method)
    };
    // 1e-2 of a second is a sixth of 1/omega: by the leading term of each method.
    for (method, order) in [
        ("explicit-euler", 1.0),
        ("verlet", 2.0),
        ("rk4", 4.0),
        ("tr-bdf2", 2.0),
    ] {
        let found = number(soft(method, 4), "observed_order");
        assert!((found - order).abs() < 0.3, "{method}: {found}");
    }
    // The line between two targets is off by at most h^2/8, and the arm lags behind it.
    let told = number(soft("exact-linear", 1), "position_error");
    assert!(
        (0.3..1.1).contains(&(told / (1.0 / 60.0f64.powi(2) / 8.0))),
        "{told:e}"
    );
    assert!(number(soft("exact-linear", 1), "own_error") < 1e-14);
    assert!(number(soft("exact-midpoints", 1), "position_error") < told / 100.0);
    for row in rows(&report["arm"], "information") {
        assert!(number(row, "reference_error") <= 1e-11, "{row}");
    }
    let stiff = rows(&report["arm"], "points").iter();
    let mut stiff = stiff.filter(|p| p["stiffness"] == 1e6 && p["method"] == "implicit-midpoint");
    assert!(stiff.any(|p| p["order_reduced"] == true));
}

/// That the front and who dominates whom follow from the figures: of one process the
/// order of the times.
fn check_front(rated: &[&Value], name: impl Fn(&Value) -> String, error: &str, time: &str) {
    let point = |row: &Value| (row[error].as_f64(), number(row, time));
    let beats = |a: &Value, b: &Value| match (point(a), point(b)) {
        ((Some(e), t), (Some(f), u)) => e <= f && t <= u && (e, t) != (f, u),
        _ => false,
    };
    for row in rated {
        let beaten = rated.iter().any(|rival| beats(rival, row));
        assert_eq!(row["on_front"], !beaten && !row[error].is_null(), "{row}");
        assert_eq!(!row["dominated_by"].is_null(), beaten, "{row}");
        if beaten {
            let by = rated.iter().find(|r| row["dominated_by"] == name(r));
            let by = by.expect("one of the rows");
            assert!(beats(by, row) && by["on_front"] == true, "{row}");
        }
    }
}

/// As the program names a point.
fn label(point: &Value) -> String {
    let effort = match (point["substeps"].as_u64(), point["step_tolerance"].as_f64()) {
        (Some(1), _) => String::new(),
        (Some(steps), _) => format!(" x{steps}"),
        (None, tolerance) => format!(" at {:e}", tolerance.expect("an effort")),
    };
    format!(
        "{}{effort} {}",
        text(point, "method"),
        text(point, "arithmetic")
    )
}

#[test]
fn the_arm_to_take_follows_from_its_front() {
    for (tolerance, nothing) in [("1e-3", false), ("1e-15", true)] {
        let report = drift(&format!(
            "--steps 1000 {SMALL},1e4 --arm-tolerance {tolerance}"
        ));
        let arm = &report["arm"];
        for choice in rows(arm, "choices") {
            let own = rows(arm, "points").iter().filter(|p| {
                ["arm", "stiffness", "rate_hz"]
                    .iter()
                    .all(|key| p[*key] == choice[*key])
                    && !p["us_per_second"].is_null()
                    && p["information"] == "frame-ends"
            });
            let own: Vec<&Value> = own.collect();
            check_front(&own, label, "position_error", "us_per_second");
            let good = own
                .iter()
                .filter(|p| number(p, "position_error") <= tolerance.parse().unwrap());
            let cheapest = good
                .min_by(|a, b| number(a, "us_per_second").total_cmp(&number(b, "us_per_second")));
            assert_eq!(
                choice["name"].as_str().map(str::to_owned),
                cheapest.map(|p| label(p))
            );
            assert_eq!(choice["name"].is_null(), nothing, "{choice}");
        }
        let conclusion = text(arm, "conclusion");
        assert!(conclusion.contains("for the linear arm "), "{conclusion}");
        assert_eq!(conclusion.contains("nothing"), nothing, "{conclusion}");
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
        let report = drift(&format!("--steps 1e4 {SMALL} --tolerance {tolerance}"));
        let methods = rows(&report, "rotation_methods");
        let name = |row: &Value| text(row, "name").to_owned();
        for table in ["rotation_methods", "orbit_methods"] {
            let rated: Vec<&Value> = rows(&report, table).iter().collect();
            check_front(&rated, name, "error", "ns_per_step");
        }
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
    let folder = tempfile::tempdir().expect("a folder");
    let table = works(
        folder.path(),
        &format!("drift --steps 1000 {SMALL},1e6 --svg arms.svg"),
    );
    let names = [METHODS, STEPPED, TOLD_MORE, OWN_STEPS]
        .map(set)
        .into_iter()
        .flatten();
    for name in names.chain([
        "f64-polar-100 (default)",
        "unstable",
        "rings",
        "0.8284",
        "8.147e-4",
        "Cheapest within 1e-3 on jittered frames: for the linear arm ",
    ]) {
        assert!(table.contains(name), "{name}");
    }
    assert!(!table.contains('\x1b'), "{table}");
    for line in table.lines() {
        assert!(line.chars().count() <= 100, "{line}");
    }
    assert_eq!(table.matches("Recommended for ").count(), 2);
    let svg = std::fs::read_to_string(folder.path().join("arms.svg")).expect("a picture");
    for name in [
        "<svg",
        "linear arm, k = 1e6/s2, 60 Hz",
        "tr-bdf2",
        "position error",
    ] {
        assert!(svg.contains(name), "{name}");
    }
    let none = works(
        Path::new("."),
        &format!("drift --steps 1000 {SMALL} --tolerance 1e-30 --arm-tolerance 1e-15"),
    );
    assert!(none.contains("Recommended for a frame: nothing; no method has"));
    assert!(none.contains("none is within 1e-15"), "{none}");
}

#[test]
fn how_much_there_is_to_do_is_said_before_it_is_done() {
    let here = Path::new(".");
    let drift = cullbench(here, &format!("drift --steps 1000 {SMALL}"));
    let studies = METHODS.split(' ').chain(CARRIERS.split(' '));
    let studies = studies.filter(|name| !name.is_empty()).count() + 1;
    assert_eq!(
        drift.err,
        format!(
            "at work: {studies} studies, up to 1e3 steps or 1 s each, timed in 1 process; the \
             defaults take minutes\n"
        )
    );
    let options = "--processes 2 --frames 3 --samples 20x10 --path orbit:frames=5";
    let funnel = cullbench(here, &format!("funnel --scene city:n=50 {options}"));
    assert_eq!(
        funnel.err,
        "at work: city:n=50, orbit:frames=5: 50 items, 3 views of 20x10 samples, timed in 2 \
         processes; the defaults take minutes\n"
    );
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
    for tolerance in ["0", "-1e-6", "nan", "inf"] {
        let wanted = "--tolerance is ' | expected a number above 0";
        all_refused(&folder, &[format!("drift --tolerance={tolerance}")], wanted);
    }
    for (option, wanted) in [
        ("--stiffness", "a number from 0.01 to 1e8"),
        ("--rate", "a number from 1 to 1e3"),
        ("--seconds", "a number from 1 to 1e3"),
    ] {
        for typed in ["0", "-1", "nan", "1e9"] {
            let wanted = format!("{option} is '{typed}' | expected {wanted}");
            all_refused(&folder, &[format!("drift {option}={typed}")], &wanted);
        }
    }
    let wanted = "unknown arm 'chain' | linear, collision, quaternion";
    all_refused(&folder, &["drift --arm chain".to_owned()], wanted);
    let wanted = "nowhere: expected an existing folder for --svg";
    all_refused(&folder, &["drift --svg nowhere/a.svg".to_owned()], wanted);
}
