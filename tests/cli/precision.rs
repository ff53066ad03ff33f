//! `precision`: the fields of its JSON, every combination once, errors that
//! belong to the culling and not to the structure, dominance as documented,
//! the sweeps against published and plain expectations, tables that
//! fit, and refusals. No time is judged.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::OnceLock;

use serde_json::Value;

use super::process::*;

pub const SMALL: &str = "precision --scene city:n=2000 --path orbit:frames=4 --cubes 40000 \
     --structure linear,bvh --processes 4 --format json";
pub const ERRORS: [&str; 9] = [
    "visible_count",
    "undecided_count",
    "false_negative_count",
    "touch_dropped_count",
    "false_positive_count",
    "excess_by_storage_count",
    "excess_by_planes_count",
    "worst_miss",
    "worst_excess",
];

/// The outcome of [`SMALL`], made once for all tests here.
fn small() -> &'static Value {
    static OUTCOME: OnceLock<Value> = OnceLock::new();
    OUTCOME.get_or_init(|| json(&works(Path::new("."), SMALL)))
}

/// A rate's value.
fn rate(row: &Value, name: &str) -> f64 {
    number(&row[name], "value")
}

/// Key of a culling: test, arithmetic, planes, epsilon.
fn culling(point: &Value) -> String {
    let of = |name: &str| point[name].to_string();
    ["test", "arithmetic", "planes", "epsilon"]
        .map(of)
        .join(" ")
}

#[test]
fn json_has_the_documented_fields() {
    let outcome = small();
    let top = "scene path items skipped_items cameras processes rounds twin points front seed \
                sweeps warnings";
    assert_eq!(keys(outcome), set(top));
    assert_eq!(
        (&outcome["scene"], &outcome["path"]),
        (&"city:n=2000".into(), &"orbit:frames=4".into())
    );
    assert_eq!(
        (number(outcome, "items"), number(outcome, "cameras")),
        (2000.0, 4.0)
    );
    assert_eq!(number(outcome, "seed"), 1.0);
    assert!(number(outcome, "rounds") >= 3.0);
    assert_eq!(number(outcome, "processes"), 4.0);
    assert_eq!(keys(&outcome["twin"]), set("value lower upper"));
    let errors = ERRORS.join(" ");
    let point = format!(
        "structure test arithmetic planes epsilon status reason excess false_negative_ppm \
         {errors} worst_miss_px query_ns query_ns_lower query_ns_upper ns_per_item \
         memory_bytes_per_item dominated_by is_tie on_front"
    );
    let swept = format!(
        "sweep value test planes arithmetic epsilon false_negative_ppm excess {errors} refused"
    );
    let rate = "value lower upper";
    for (name, fields) in [("points", point.as_str()), ("sweeps", swept.as_str())] {
        assert!(!array(outcome, name).is_empty(), "{name}");
        for row in array(outcome, name) {
            assert_eq!(keys(row), set(fields), "{name}");
        }
    }
    for row in array(outcome, "sweeps")
        .iter()
        .filter(|row| row["sweep"] == "size")
    {
        assert_eq!(keys(&row["excess"]), set(rate));
    }
    // Every field has a line in the documentation.
    let told = include_str!("../../docs/METHODOLOGY.md");
    let fields = format!("{top} {point} {swept} {rate}");
    for field in set(&fields) {
        assert!(told.contains(&format!("`{field}`")), "{field}");
    }
}

#[test]
fn every_combination_is_there_once_a_structure() {
    let f32s = ["sphere", "six-plane", "six-box", "exact"];
    let mut wanted = BTreeSet::new();
    for test in f32s {
        for epsilon in ["0.0", "8.0"] {
            wanted.insert(format!("\"{test}\" \"f32\" \"frame\" {epsilon}"));
            if test != "sphere" {
                wanted.insert(format!("\"{test}\" \"f32-relative\" \"frame\" {epsilon}"));
            }
        }
        if test != "sphere" {
            wanted.insert(format!("\"{test}\" \"f64\" \"frame\" 0.0"));
        }
    }
    for matrix in ["gl", "d3d", "revz"] {
        for bits in ["f32", "f64"] {
            wanted.insert(format!("\"six-plane\" \"f32\" \"gh-{matrix}-{bits}\" 0.0"));
        }
    }
    wanted.insert("\"six-plane\" \"f32\" \"frame-f32\" 0.0".to_owned());
    assert_eq!(wanted.len(), 24);
    for structure in ["linear", "bvh"] {
        let points = array(small(), "points").iter();
        let of_it = points.filter(|p| p["structure"] == structure).map(culling);
        let found: Vec<String> = of_it.collect();
        assert_eq!(found.len(), wanted.len(), "{structure}");
        assert_eq!(
            found.into_iter().collect::<BTreeSet<_>>(),
            wanted,
            "{structure}"
        );
    }
}

#[test]
fn errors_belong_to_the_culling_and_not_to_the_structure() {
    let mut errors: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for point in array(small(), "points") {
        let of_point = ERRORS.map(|name| number(point, name)).to_vec();
        let known = errors
            .entry(culling(point))
            .or_insert_with(|| of_point.clone());
        assert_eq!(*known, of_point, "{}", culling(point));
        let [
            visible,
            _,
            missed,
            dropped,
            extra,
            _,
            _,
            worst_miss,
            worst_excess,
        ] = of_point[..]
        else {
            panic!("{of_point:?}");
        };
        assert!(
            visible > 0.0 && (missed > 0.0) == (worst_miss > 0.0),
            "{point}"
        );
        assert!((extra > 0.0) == (worst_excess > 0.0), "{point}");
        assert!((rate(point, "excess") - extra / visible).abs() < 1e-12);
        assert!((rate(point, "false_negative_ppm") - missed / visible * 1e6).abs() < 1e-6);
        assert_eq!(
            missed > 0.0,
            number(point, "worst_miss_px") > 0.0,
            "{point}"
        );
        if missed == 0.0 {
            let upper = number(&point["false_negative_ppm"], "upper");
            assert!((upper - 3e6 / visible).abs() < 1e-6 * upper, "{point}");
        }
        assert_eq!(point["status"], if missed > 0.0 { "unsafe" } else { "ok" });
        if point["epsilon"] == 8.0 {
            assert_eq!((missed, dropped), (0.0, 0.0), "{point}");
        }
    }
    // Each test returns no more than the coarser ones, whatever the numbers.
    let extra = |test: &str| errors[&format!("\"{test}\" \"f32\" \"frame\" 8.0")][4];
    let by_test = ["sphere", "six-plane", "six-box", "exact"].map(extra);
    assert!(
        by_test.is_sorted_by(|a, b| a >= b) && by_test[0] > by_test[3],
        "{by_test:?}"
    );
    assert_eq!(errors["\"exact\" \"f64\" \"frame\" 0.0"][4], 0.0);
}

/// Columns of which less is better.
const DIMENSIONS: [&str; 6] = [
    "false_negative_count",
    "touch_dropped_count",
    "false_positive_count",
    "worst_miss_px",
    "memory_bytes_per_item",
    "query_ns",
];

fn values(point: &Value) -> [f64; 6] {
    DIMENSIONS.map(|name| number(point, name))
}

fn is_better(a: &[f64; 6], b: &[f64; 6]) -> bool {
    a.iter().zip(b).all(|(a, b)| a <= b) && a != b
}

#[test]
fn rows_are_sorted_and_dominance_is_what_it_says() {
    let points = array(small(), "points");
    let timed: Vec<&Value> = points.iter().filter(|p| !p["query_ns"].is_null()).collect();
    assert_eq!(points.len(), timed.len());
    let times: Vec<f64> = timed.iter().map(|p| number(p, "query_ns")).collect();
    assert!(times.is_sorted(), "{times:?}");
    let front: Vec<u64> = array(small(), "front")
        .iter()
        .map(|i| i.as_u64().expect("an index"))
        .collect();
    let marked = (0u64..).zip(points).filter(|(_, p)| p["on_front"] == true);
    assert_eq!(front, marked.map(|(i, _)| i).collect::<Vec<_>>());
    assert!(!front.is_empty());
    for point in timed.iter().copied() {
        let [lower, time, upper] =
            ["query_ns_lower", "query_ns", "query_ns_upper"].map(|name| number(point, name));
        assert!(0.0 < lower && lower <= time && time <= upper, "{point}");
        assert!((number(point, "ns_per_item") - time / 2000.0).abs() < 1e-6 * time);
        let own = values(point);
        let by_values = timed.iter().any(|other| is_better(&values(other), &own));
        let better = point["dominated_by"].as_u64().map(|i| &points[i as usize]);
        assert_eq!(point["on_front"], better.is_none(), "{point}");
        let is_tie = by_values && better.is_none();
        assert_eq!(point["is_tie"], is_tie, "{point}");
        if let Some(better) = better {
            assert!(
                better["on_front"] == true && is_better(&values(better), &own),
                "{better} {point}"
            );
        }
        // Transitive: what is no better than something dominated is dominated.
        let is_shown = |p: &Value| !p["dominated_by"].is_null();
        let below = |other: &&&Value| is_shown(other) && is_better(&values(other), &own);
        assert!(
            timed.iter().find(below).is_none() || is_shown(point),
            "{point}"
        );
        // What takes three times as long with no fewer errors is no tie.
        let slow = |other: &&&Value| {
            is_better(&values(other), &own) && 3.0 * number(other, "query_ns") < time
        };
        assert!(
            timed.iter().find(slow).is_none() || is_shown(point),
            "{point}"
        );
    }
}

#[test]
fn where_nothing_is_visible_nothing_is_recommended() {
    let folder = tempfile::tempdir().expect("a folder");
    let written = |name: &str, text: &str| std::fs::write(folder.path().join(name), text);
    written(
        "b.csv",
        "min_x,min_y,min_z,max_x,max_y,max_z\n2,0,0,2,0,0\n",
    )
    .expect("written");
    let lens = "fovy_deg,aspect,near,far\n0,0,0,-1,0,0,60,1,.1,100\n";
    let camera = format!("eye_x,eye_y,eye_z,look_x,look_y,look_z,{lens}");
    written("c.csv", &camera).expect("written");
    let line = "precision --scene b.csv --path c.csv --cubes 0 --processes 1 --structure linear";
    let out = works(folder.path(), line);
    assert!(
        out.contains("Nothing is to be taken: no camera sees an item") && !out.contains("Fastest"),
        "{out}"
    );
}

#[test]
fn one_process_gives_the_same_errors_without_intervals_or_ties() {
    let one = json(&works(
        Path::new("."),
        &SMALL
            .replace("--cubes 40000", "--cubes 0")
            .replace("--processes 4", "--processes 1"),
    ));
    assert_eq!(number(&one, "processes"), 1.0);
    let errors = |outcome: &Value| -> BTreeMap<String, String> {
        let points = array(outcome, "points").iter();
        let of = |p: &Value| ERRORS.map(|name| p[name].to_string()).join(" ");
        points
            .map(|p| (format!("{} {}", p["structure"], culling(p)), of(p)))
            .collect()
    };
    assert_eq!(errors(small()), errors(&one));
    let points = array(&one, "points");
    for (n, point) in points.iter().enumerate() {
        assert!(point["query_ns_lower"].is_null() && point["query_ns_upper"].is_null());
        // The order of the times is the order of the points, and no tie is one in
        // time.
        let better = point["dominated_by"].as_u64();
        assert!(better.is_none_or(|better| (better as usize) < n), "{point}");
        assert_eq!(point["is_tie"], false, "{point}");
    }
    assert_eq!(points[0]["on_front"], true);
}

/// Excess of the six-plane test, from two million cubes for each ratio.
#[test]
fn the_sweep_over_sizes_finds_the_published_excess() {
    let published = [
        (0.01, 0.058),
        (0.1, 3.8),
        (0.3, 20.0),
        (1.0, 83.0),
        (10.0, 363.0),
    ];
    let rows = array(small(), "sweeps").iter();
    let rows: Vec<&Value> = rows.filter(|row| row["sweep"] == "size").collect();
    assert_eq!(rows.len(), 6 * published.len());
    let bare = ("f32", 0.0);
    for (ratio, percent) in published {
        let of = |test: &str, (arithmetic, epsilon): (&str, f64)| -> f64 {
            let is_it = |row: &&&Value| {
                (&row["test"], &row["arithmetic"]) == (&test.into(), &arithmetic.into())
                    && (number(row, "value"), number(row, "epsilon")) == (ratio, epsilon)
            };
            let row = rows.iter().find(is_it).expect(test);
            assert!(number(row, "visible_count") > 1000.0, "{row}");
            if (arithmetic, epsilon) != bare {
                assert_eq!(row["false_negative_count"], 0, "{row}");
            }
            rate(row, "excess") * 100.0
        };
        let six = of("six-plane", bare);
        // Eight false positives at the smallest ratio: counted, not measured.
        let factor = if ratio == 0.01 { 6.0 } else { 2.0 };
        assert!(
            percent / factor < six && six < percent * factor,
            "{ratio}: {six} %"
        );
        assert_eq!(of("exact", ("f64", 0.0)), 0.0, "{ratio}");
        assert!(of("exact", ("f32", 8.0)) < 0.1, "{ratio}");
        let with_bounds = of("six-box", bare);
        assert!(of("sphere", bare) > six && six >= with_bounds, "{ratio}");
        assert!(with_bounds >= of("exact", bare), "{ratio}");
    }
}

#[test]
fn f32_matrices_lose_what_the_frame_keeps() {
    let rows = array(small(), "sweeps");
    let mut values: BTreeMap<&str, BTreeSet<u64>> = BTreeMap::new();
    for row in rows {
        let sweep = row["sweep"].as_str().expect("text");
        values
            .entry(sweep)
            .or_default()
            .insert(number(row, "value").to_bits());
    }
    let names: Vec<&str> = values.keys().copied().collect();
    assert_eq!(
        names,
        ["aspect", "far/near", "fov", "offset", "scale", "size"]
    );
    assert!(values.values().all(|values| values.len() == 5));
    let row = |sweep: &str, planes: &str, epsilon: f64, value: f64| {
        rows.iter()
            .find(|row| {
                (&row["sweep"], &row["planes"], &row["arithmetic"])
                    == (&sweep.into(), &planes.into(), &"f32".into())
                    && (number(row, "epsilon"), number(row, "value")) == (epsilon, value)
            })
            .expect(planes)
    };
    let missed = |sweep, planes, epsilon, value| {
        rate(row(sweep, planes, epsilon, value), "false_negative_ppm")
    };
    assert!(missed("offset", "gh-gl-f32", 0.0, 1e6) > 2.0 * missed("offset", "frame", 0.0, 1e6));
    assert!(missed("offset", "gh-gl-f32", 0.0, 1e6) > 100.0);
    let powers = [10, 16, 20, 24, 26].map(|power| f64::from(1u32 << power));
    assert!(missed("far/near", "gh-gl-f32", 0.0, powers[3]) > 1e4);
    let last = row("far/near", "gh-gl-f32", 0.0, powers[4]);
    assert!(
        last["refused"]
            .as_str()
            .is_some_and(|r| r.contains("not finite")),
        "{last}"
    );
    let is_default = |row: &&Value| {
        (&row["arithmetic"], &row["planes"]) == (&"f32".into(), &"frame".into())
            && row["epsilon"] == 8.0
    };
    for row in rows.iter().filter(is_default) {
        assert_eq!(
            (number(row, "false_negative_count"), &row["refused"]),
            (0.0, &Value::Null),
            "{row}"
        );
    }
}
