//! Ranks as reports have them, on handmade cells.

use super::*;
use crate::index::Origin;
use serde_json::json;

/// A cell of our own tree with a time, and a ratio to a scan of 1000 ns.
pub fn cell(scene: &str, items: usize, path: &str, structure: &str, ns: f64) -> ReportCell {
    let metric = |value: f64| json!({ "value": value, "unit": "" });
    let cell = json!({
        "scene": { "name": scene, "total_count": items, "region_count": 0,
            "origin": [0.0, 0.0, 0.0], "bounds_min": [0.0, 0.0, 0.0],
            "bounds_max": [1.0, 1.0, 1.0], "skipped_items": 0, "digest": "d" },
        "path": { "name": path, "camera_count": 8, "cache": "warm", "planes": "frame",
            "epsilon": 8.0, "arithmetic": "f32" },
        "structure": structure, "kind": "tree", "origin": "ours", "params": {}, "test": "six-plane", "status": "ok",
        "reason": null, "error": null, "left_out": [], "samples_ref": null,
        "metrics": { "query_ns": metric(ns), "speedup": metric(1000.0 / ns) },
    });
    serde_json::from_value(cell).unwrap()
}

#[test]
fn ranks_are_the_runs_own_and_what_failed_has_none() {
    // "a" and "peer-x" share a rank, whatever their times.
    let rows = [
        ("peer-x", 104.0, Some(1)),
        ("a", 100.0, Some(1)),
        ("peer-y", 90.0, Some(1)),
        ("b", 101.0, Some(3)),
        ("c", 5.0, None),
    ];
    let mut cells = rows.map(|(name, ns, rank)| {
        let mut cell = cell("s", 10, "p", name, ns);
        cell.rank = rank;
        cell
    });
    for peer in [0, 2] {
        cells[peer].origin = Some(Origin::Crate("theirs".to_owned()));
    }
    cells[4].status = Status::Wrong;
    cells[2].status = Status::Unsafe;
    without_false_ranks(&mut cells);
    let of = |cells: &'static [ReportCell]| Comparison {
        cells: ranked(cells.iter().collect()),
        bounds: Vec::new(),
    };
    let cells: &'static [ReportCell] = Box::leak(Box::new(cells));
    let comparison = of(cells);
    let found: Vec<_> = comparison
        .cells
        .iter()
        .map(|cell| (cell.structure.as_str(), cell.rank))
        .collect();
    // The two that failed are in the order of their input.
    let wanted = [
        ("a", Some(1)),
        ("peer-x", Some(1)),
        ("b", Some(3)),
        ("peer-y", None),
        ("c", None),
    ];
    assert_eq!(found, wanted);
    let winners: Vec<_> = comparison.winners().map(|c| c.structure.as_str()).collect();
    assert_eq!(winners, ["a", "peer-x"]);
    let peer = comparison.fastest_peer().unwrap();
    assert_eq!(peer.structure, "peer-x");
    let failed = of(&cells[2..3]);
    assert!(failed.fastest_peer().is_none() && failed.winners().next().is_none());
    assert_eq!(times_as_fast(peer, &cells[1]), Some(104.0 / 100.0));
}

#[test]
fn cells_are_matched_by_their_whole_name_each_once() {
    let one = cell("s", 10, "p", "a", 1.0);
    let changed = |change: fn(&mut ReportCell)| {
        let mut other = one.clone();
        change(&mut other);
        let (pairs, alone) = matched(std::slice::from_ref(&one), std::slice::from_ref(&other));
        (pairs.len(), alone.map(|cells| cells.len()))
    };
    for change in [
        (|c| c.scene.name.push('x')) as fn(&mut ReportCell),
        |c| c.path.name.push('x'),
        |c| c.path.cache.push('x'),
        |c| c.path.arithmetic.push('x'),
        |c| c.path.planes.push('x'),
        |c| c.path.epsilon = 0.0,
        |c| c.test.push('x'),
        |c| c.structure.push('x'),
    ] {
        assert_eq!(changed(change), (0, [1, 1]));
    }
    // Measured values are not part of the name.
    assert_eq!(changed(|c| c.scene.digest.push('x')), (1, [0, 0]));
}

#[test]
fn no_time_of_zero_or_below_has_a_rank() {
    for (ns, wanted) in [(7.0, Some(1)), (0.0, None), (-5.0, None), (f64::NAN, None)] {
        let mut cells = [cell("s", 10, "p", "a", 1.0)];
        cells[0].rank = Some(1);
        cells[0].metrics.get_mut("query_ns").unwrap().value = ns;
        without_false_ranks(&mut cells);
        assert_eq!(cells[0].rank, wanted, "{ns}");
    }
}

/// Two paths with times of each structure, ranked by these.
fn cells(rows: &[(&str, [f64; 2])]) -> Vec<ReportCell> {
    let of_path = |path: usize| {
        let of_row = move |row: &(&str, [f64; 2])| {
            let mut cell = cell("s", 10, ["p", "q"][path], row.0, row.1[path]);
            let faster = rows.iter().filter(|other| other.1[path] < row.1[path]);
            cell.rank = Some(1 + faster.count());
            cell
        };
        rows.iter().map(of_row).collect::<Vec<_>>()
    };
    [of_path(0), of_path(1)].concat()
}

fn overall(cells: &[ReportCell], look: impl Fn(&Overall)) {
    let paths = cells.chunks(cells.len() / 2).map(|cells| Comparison {
        cells: cells.iter().collect(),
        bounds: Vec::new(),
    });
    let paths: Vec<Comparison> = paths.collect();
    look(&Overall::of(&paths.iter().collect::<Vec<_>>()));
}

#[test]
fn means_are_geometric_and_refer_to_linear_or_else_to_the_slowest() {
    let rows = [
        ("linear", [800.0, 200.0]),
        ("slow", [1600.0, 1600.0]),
        ("bvh", [100.0, 100.0]),
    ];
    let told = |overall: &Overall| {
        let standings = overall.standings.iter();
        let told = standings.map(|s| (s.structure.to_owned(), s.speedup, s.first_in));
        told.collect::<Vec<_>>()
    };
    let near = |found: Option<f64>, wanted: f64| (found.unwrap() / wanted - 1.0).abs() < 1e-12;
    overall(&cells(&rows), |overall| {
        assert_eq!(overall.base, Some("linear"));
        let [bvh, linear, slow] = &told(overall)[..] else {
            panic!("three structures");
        };
        assert_eq!((bvh.0.as_str(), bvh.2), ("bvh", 2));
        assert!(near(bvh.1, 4.0) && near(linear.1, 1.0) && near(slow.1, 0.25));
    });
    // A wrong answer of linear: it counts nowhere, and is still listed.
    let mut failed = cells(&rows);
    failed[0].rank = None;
    overall(&failed, |overall| {
        assert_eq!(overall.base, Some("slow"));
        let told = told(overall);
        assert!(near(told[0].1, 16.0));
        assert_eq!((told[2].0.as_str(), told[2].1), ("linear", None));
    });
}

#[test]
fn means_tie_unless_the_processes_tell_them_apart() {
    let mut cells = cells(&[("linear", [400.0; 2]), ("a", [100.0; 2]), ("b", [103.0; 2])]);
    let ties = |cells: &[ReportCell], wanted: [bool; 2]| {
        overall(cells, |overall| {
            let [a, b, linear] = &overall.standings[..] else {
                panic!("three structures");
            };
            assert_eq!([a.ties_with(b), a.ties_with(linear)], wanted);
        });
    };
    ties(&cells, [false, false]);
    // Processes differ tenfold, the two structures within them by 3 % or more.
    for (swing, wanted) in [(0.0, [false, false]), (0.2, [true, false])] {
        for cell in &mut cells {
            let ns = cell.value("query_ns").unwrap();
            let own = if cell.structure == "b" { swing } else { 0.0 };
            let of_process = |p: i32| ns * 1.3f64.powi(p) * (own * f64::from(p % 2 * 2 - 1)).exp();
            let times = (0..10).map(of_process).collect();
            cell.times.by_process.insert("query_ns".to_owned(), times);
        }
        ties(&cells, wanted);
    }
}

#[test]
fn a_speedup_without_linear_has_the_interval_of_its_own_ratio() {
    // Alternately half and twice as fast as before, always with a ratio of two.
    let times = |factor: f64| -> Vec<f64> {
        let speeds = [1.0, 2.0, 1.0, 2.0, 1.01, 2.01];
        speeds.iter().map(|speed| speed * factor).collect()
    };
    let cells = [("bvh", 100.0), ("octree", 200.0)].map(|(name, ns)| {
        let mut cell = cell("s", 10, "p", name, ns);
        cell.rank = Some(1);
        let metric = cell.metrics.get_mut("query_ns").unwrap();
        (metric.lower, metric.upper) = (Some(ns / 2.0), Some(ns * 2.0));
        cell.times
            .by_process
            .insert("query_ns".to_owned(), times(ns));
        cell
    });
    let comparison = Comparison {
        cells: cells.iter().collect(),
        bounds: Vec::new(),
    };
    let found = comparison.speedup("octree", &cells[0]).unwrap();
    let [lower, upper] = found.ends().expect("an interval");
    assert!(
        found.value == 2.0 && 1.999 < lower && upper < 2.001,
        "{found:?}"
    );
    let itself = Some(Estimate::exact(1.0));
    assert_eq!(comparison.speedup("octree", &cells[1]), itself);
}
