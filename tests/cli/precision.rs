//! `precision`: the fields of its JSON, every combination once, errors that
//! belong to the culling and not to the structure, dominance as documented,
//! the sweeps against published and plain expectations, and refusals. No time
//! is judged.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::OnceLock;

use serde_json::Value;

use super::process::*;

const SMALL: &str = "precision --scene city:n=2000 --path orbit:frames=4 --cubes 40000 \
     --structure linear,bvh --processes 4 --format json";
const ERRORS: [&str; 9] = [
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

/// What makes a culling: test, arithmetic, planes, epsilon.
fn culling(point: &Value) -> String {
    let of = |name: &str| point[name].to_string();
    ["test", "arithmetic", "planes", "epsilon"]
        .map(of)
        .join(" ")
}

#[test]
fn json_has_the_documented_fields() {
    let outcome = small();
    let top = "scene path items cameras processes rounds twin points front stability seed size_sweep offset_sweep";
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
        "structure test arithmetic planes epsilon status reason excess false_negative_ppm {errors} \
         query_ns query_ns_lower query_ns_upper ns_per_item memory_bytes_per_item dominated_by \
         on_front"
    );
    let size = "size_over_depth cubes visible tests";
    let size_error = "test excess false_negative_count ns_per_box";
    let offset =
        format!("offset planes arithmetic epsilon false_negative_ppm excess {errors} refused");
    for (name, fields) in [
        ("points", point.as_str()),
        ("stability", "cameras pairs_in_order seconds"),
        ("size_sweep", size),
        ("offset_sweep", offset.as_str()),
    ] {
        assert!(!array(outcome, name).is_empty(), "{name}");
        for row in array(outcome, name) {
            assert_eq!(keys(row), set(fields), "{name}");
        }
    }
    for row in array(outcome, "size_sweep") {
        assert_eq!(array(row, "tests").len(), 7);
        for test in array(row, "tests") {
            assert_eq!(keys(test), set(size_error));
        }
    }
    // Every field has a line in the documentation.
    let told = include_str!("../../docs/METHODOLOGY.md");
    let fields = format!("{top} {point} {size} {size_error} {offset} pairs_in_order seconds");
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
    // Quantised items are other items.
    let own = |p: &&Value| {
        !p["structure"]
            .as_str()
            .is_some_and(|s| s.starts_with("quantised"))
    };
    for point in array(small(), "points").iter().filter(own) {
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
        assert!((number(point, "excess") - extra / visible).abs() < 1e-12);
        assert!((number(point, "false_negative_ppm") - missed / visible * 1e6).abs() < 1e-6);
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

#[test]
fn rows_are_sorted_and_dominance_is_what_it_says() {
    let points = array(small(), "points");
    let times: Vec<f64> = points.iter().map(|p| number(p, "query_ns")).collect();
    assert!(times.is_sorted(), "{times:?}");
    let front: Vec<u64> = array(small(), "front")
        .iter()
        .map(|i| i.as_u64().expect("an index"))
        .collect();
    let marked = (0u64..).zip(points).filter(|(_, p)| p["on_front"] == true);
    assert_eq!(front, marked.map(|(i, _)| i).collect::<Vec<_>>());
    assert!(!front.is_empty());
    for point in points {
        let [lower, time, upper] =
            ["query_ns_lower", "query_ns", "query_ns_upper"].map(|name| number(point, name));
        assert!(0.0 < lower && lower <= time && time <= upper, "{point}");
        assert!((number(point, "ns_per_item") - time / 2000.0).abs() < 1e-6 * time);
        let Some(better) = point["dominated_by"].as_u64() else {
            assert_eq!(point["on_front"], true, "{point}");
            continue;
        };
        assert_eq!(point["on_front"], false, "{point}");
        let better = &points[better as usize];
        let errors = [
            "false_negative_count",
            "touch_dropped_count",
            "false_positive_count",
        ];
        let pairs = errors.map(|name| (number(better, name), number(point, name)));
        assert!(pairs.iter().all(|(a, b)| a <= b), "{better} {point}");
        // What only time decides is faster; what a test over the processes finds
        // slower by far dominates nothing.
        let faster = number(better, "query_ns") < time;
        assert!(
            faster || pairs.iter().any(|(a, b)| a < b),
            "{better} {point}"
        );
        assert!(number(better, "query_ns") < 3.0 * time, "{better} {point}");
    }
    let cameras = array(small(), "stability")
        .iter()
        .map(|row| number(row, "cameras"));
    assert_eq!(cameras.collect::<Vec<_>>(), [1.0, 2.0, 4.0]);
    assert_eq!(array(small(), "stability")[2]["pairs_in_order"], 1.0);
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
        // No ties: the order of the times is the order of the points.
        let better = point["dominated_by"].as_u64();
        assert!(better.is_none_or(|better| (better as usize) < n), "{point}");
    }
    assert_eq!(points[0]["on_front"], true);
}

#[test]
fn items_in_few_bits_miss_nothing_and_return_more_the_fewer_the_bits() {
    let points = array(small(), "points").iter();
    let of = |bits: &str, grid: &str, name: &str| -> f64 {
        let label = format!("quantised:bits={bits},grid={grid}");
        let mut found = points.clone().filter(|p| p["structure"] == label.as_str());
        let point = found.find(|p| p["test"] == "six-plane").expect("a point");
        assert_eq!(
            (number(point, "false_negative_count"), &point["status"]),
            (0.0, &"ok".into())
        );
        number(point, name)
    };
    let excess = |bits, grid| of(bits, grid, "false_positive_count");
    assert!(excess("8", "world") > excess("16", "world"));
    assert!(excess("8", "world") > excess("8", "block"));
    let memory = |bits, grid| of(bits, grid, "memory_bytes_per_item");
    assert!(memory("8", "world") < memory("8", "block"));
    assert!(memory("8", "block") < memory("16", "world"));
}

/// Excess of the six-plane test, from two million cubes for each ratio.
#[test]
fn the_size_sweep_finds_the_published_excess() {
    let published = [
        (0.01, 0.058),
        (0.1, 3.8),
        (0.3, 20.0),
        (1.0, 83.0),
        (10.0, 363.0),
    ];
    let rows = array(small(), "size_sweep");
    assert_eq!(rows.len(), published.len());
    for (row, (ratio, percent)) in rows.iter().zip(published) {
        assert_eq!(number(row, "size_over_depth"), ratio);
        assert!(
            number(row, "cubes") >= 40_000.0 && number(row, "visible") > 1000.0,
            "{row}"
        );
        let tests = array(row, "tests");
        let of = |name: &str| -> f64 {
            let test = tests.iter().find(|t| t["test"] == name).expect(name);
            if name == "exact + epsilon" || name == "exact f64" {
                assert_eq!(test["false_negative_count"], 0, "{row}");
            }
            number(test, "excess") * 100.0
        };
        let six = of("six-plane");
        // Eight false positives at the smallest ratio: counted, not measured.
        let factor = if ratio == 0.01 { 6.0 } else { 2.0 };
        assert!(
            percent / factor < six && six < percent * factor,
            "{ratio}: {six} %"
        );
        assert_eq!(of("exact f64"), 0.0, "{row}");
        assert!(of("exact + epsilon") < 0.1, "{row}");
        assert!(
            of("sphere") > six && six >= of("six-box") && of("six-box") >= of("exact"),
            "{row}"
        );
    }
}

#[test]
fn far_from_zero_f32_matrices_lose_what_the_frame_keeps() {
    let rows = array(small(), "offset_sweep");
    let offsets: BTreeSet<u64> = rows
        .iter()
        .map(|row| number(row, "offset") as u64)
        .collect();
    assert_eq!(
        offsets,
        BTreeSet::from([0, 10_000, 100_000, 1_000_000, 10_000_000])
    );
    let missed = |planes: &str, epsilon: f64, offset: f64| -> f64 {
        let row = rows.iter().find(|row| {
            (&row["planes"], &row["arithmetic"]) == (&planes.into(), &"f32".into())
                && (number(row, "epsilon"), number(row, "offset")) == (epsilon, offset)
        });
        number(row.expect(planes), "false_negative_ppm")
    };
    assert!(missed("gh-gl-f32", 0.0, 1e6) > 2.0 * missed("frame", 0.0, 1e6));
    assert!(missed("gh-gl-f32", 0.0, 1e6) > 100.0);
    for offset in [0.0, 1e4, 1e5, 1e6, 1e7] {
        assert_eq!(missed("frame", 8.0, offset), 0.0, "{offset}");
    }
    assert!(rows.iter().all(|row| row["refused"].is_null()));
}

#[test]
fn sweeps_can_be_left_out_and_points_refused() {
    let line = "precision --scene uniform:n=200 --path orbit:frames=2 --structure linear --cubes 0 \
         --processes 1";
    let lens = "--near 1e-6 --far 1000";
    let outcome = json(&works(
        Path::new("."),
        &format!("{line} {lens} --format json"),
    ));
    for sweep in ["size_sweep", "offset_sweep"] {
        assert!(array(&outcome, sweep).is_empty());
    }
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
        for name in ["excess", "false_negative_ppm", "query_ns", "dominated_by"] {
            assert!(point[name].is_null(), "{name}: {point}");
        }
        assert_eq!(point["on_front"], false);
    }
    // They come last.
    let measured = points.len() - refused.len();
    assert!(points[measured..].iter().all(|p| p["status"] == "refused"));
    assert_eq!(
        outcome["front"].as_array().map(|f| f.is_empty()),
        Some(false)
    );
    // As a table: plain text, with the reason in a line of its own.
    let table = works(Path::new("."), &format!("{line} {lens}"));
    assert!(!table.contains('\u{1b}'), "{table}");
    let told = "linear six-plane f32 gh-gl-f32 eps 0: refused: ";
    assert!(
        table.contains(told) && table.contains("Pareto front"),
        "{table}"
    );
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
        ("--scene city:n=10 --fovy 0", "field of view is 0"),
        (
            "--scene city:n=10 --kernel avx3",
            "avx3 | did you mean 'avx2'",
        ),
        ("--scene city:n=10 --processes 0", "0 | --processes"),
    ] {
        all_refused(&folder, &[format!("{line} {more}")], wanted);
    }
}
