//! Ranks as a report has them, on cells made by hand.

use super::*;
use crate::index::Origin;
use serde_json::json;

/// A cell of our own tree with a time, and a ratio to a scan of 1000 ns.
pub fn cell(scene: &str, items: usize, path: &str, structure: &str, ns: f64) -> ReportCell {
    let metric = |value: f64| json!({ "value": value, "unit": "" });
    let cell = json!({
        "scene": { "name": scene, "total_count": items, "region_count": 0,
            "origin": [0.0, 0.0, 0.0], "bounds_min": [0.0, 0.0, 0.0],
            "bounds_max": [1.0, 1.0, 1.0], "skipped_items": 0, "digest": "" },
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
    // "a" and "peer-x" share a rank, whatever their times say.
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
    let of = |cells: &'static [ReportCell]| Comparison {
        ranked: ranked(cells.iter().collect()),
        bounds: Vec::new(),
    };
    let cells: &'static [ReportCell] = Box::leak(Box::new(cells));
    let comparison = of(cells);
    let found: Vec<_> = comparison
        .ranked
        .iter()
        .map(|r| (r.cell.structure.as_str(), r.rank))
        .collect();
    // In the order they came in, the two that failed.
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
