//! Reading a report: which cells were asked the same, in which order they come
//! and what counts as a tie. It owns no format and measures nothing.

use super::{Report, ReportCell};
use crate::measure::Status;

/// Structures of other crates are named so.
const PEER_PREFIX: &str = "peer-";

/// Cells of one scene, path, cache state and culling test.
pub struct Comparison<'r> {
    /// Fastest first; what failed comes last, unranked.
    pub ranked: Vec<Ranked<'r>>,
    /// Measured beside them, in the order of the table of bounds.
    pub bounds: Vec<&'r ReportCell>,
}

/// A cell with its rank; none if it may not be compared by its time.
pub struct Ranked<'r> {
    pub rank: Option<usize>,
    pub cell: &'r ReportCell,
}

/// What a comparison is found by.
type Key<'r> = (&'r str, &'r str, &'r str, &'r str);

fn key(cell: &ReportCell) -> Key<'_> {
    let path = &cell.path;
    (&cell.scene.name, &path.name, &path.cache, &cell.test)
}

/// All comparisons of a report, in the order in which they were measured.
pub fn comparisons(report: &Report) -> Vec<Comparison<'_>> {
    let mut keys: Vec<Key> = Vec::new();
    for cell in &report.cells {
        if !keys.contains(&key(cell)) {
            keys.push(key(cell));
        }
    }
    let floor = report.noise.aa_floor.unwrap_or(0.0);
    keys.into_iter()
        .map(|wanted| {
            let same = |cell: &&ReportCell| key(cell) == wanted;
            Comparison {
                ranked: ranked(report.cells.iter().filter(same).collect(), floor),
                bounds: report.bounds.iter().filter(same).collect(),
            }
        })
        .collect()
}

/// Time by which a cell is ranked.
fn time(cell: &ReportCell) -> Option<f64> {
    let time = cell.value("query_ns").filter(|ns| ns.is_finite());
    time.filter(|_| cell.status == Status::Ok)
}

/// Within the noise floor of the leader of its rank: a tie.
fn ranked(mut cells: Vec<&ReportCell>, floor: f64) -> Vec<Ranked<'_>> {
    let order = |cell: &ReportCell| time(cell).unwrap_or(f64::INFINITY);
    cells.sort_by(|a, b| order(a).total_cmp(&order(b)));
    let (mut rank, mut leader) = (0, 0.0);
    let places = cells.into_iter().zip(1..);
    places
        .map(|(cell, place)| {
            let spent = time(cell);
            if let Some(spent) = spent
                && (rank == 0 || spent > leader * (1.0 + floor))
            {
                (rank, leader) = (place, spent);
            }
            Ranked {
                rank: spent.map(|_| rank),
                cell,
            }
        })
        .collect()
}

impl<'r> Comparison<'r> {
    /// Any of its cells: scene, path and test are the same in all.
    pub fn about(&self) -> &'r ReportCell {
        self.ranked[0].cell
    }

    /// Those of the first rank: the fastest and what ties with it.
    pub fn winners(&self) -> impl Iterator<Item = &'r ReportCell> {
        let first = self.ranked.iter().filter(|r| r.rank == Some(1));
        first.map(|r| r.cell)
    }

    /// The fastest structure of another crate whose answers are right.
    pub fn fastest_peer(&self) -> Option<&'r ReportCell> {
        let sound = self.ranked.iter().filter(|r| r.rank.is_some());
        let mut cells = sound.map(|r| r.cell);
        cells.find(|cell| cell.structure.starts_with(PEER_PREFIX))
    }

    /// A metric that is the same in all cells, from the first that has it.
    pub fn of_any(&self, metric: &str) -> Option<f64> {
        self.ranked.iter().find_map(|r| r.cell.value(metric))
    }
}

/// Time of `base` / time of `cell`: how many times as fast the cell is. From
/// their ratios to linear where both have one, because those are paired.
pub fn times_as_fast(base: &ReportCell, cell: &ReportCell) -> Option<f64> {
    let quotient = |metric: &str| Some((base.value(metric)?, cell.value(metric)?));
    let paired = quotient("ratio_to_linear").map(|(base, cell)| cell / base);
    paired.or_else(|| quotient("query_ns").map(|(base, cell)| base / cell))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use serde_json::json;

    /// A cell with a time, and a ratio to a linear scan of 1000 ns.
    pub fn cell(scene: &str, items: usize, path: &str, structure: &str, ns: f64) -> ReportCell {
        let metric = |value: f64| json!({ "value": value, "unit": "" });
        let cell = json!({
            "scene": { "name": scene, "total_count": items, "region_count": 0,
                "origin": [0.0, 0.0, 0.0], "bounds_min": [0.0, 0.0, 0.0],
                "bounds_max": [1.0, 1.0, 1.0], "skipped_items": 0, "digest": "" },
            "path": { "name": path, "camera_count": 8, "cache": "warm", "planes": "frame",
                "epsilon": 8.0, "arithmetic": "f32" },
            "structure": structure, "params": {}, "test": "six-plane", "status": "ok",
            "reason": null, "error": null, "left_out": [], "samples_ref": null,
            "metrics": { "query_ns": metric(ns), "ratio_to_linear": metric(1000.0 / ns) },
        });
        serde_json::from_value(cell).unwrap()
    }

    #[test]
    fn ties_share_a_rank_and_what_failed_has_none() {
        let times = [
            ("a", 100.0),
            ("peer-x", 104.0),
            ("peer-y", 90.0),
            ("b", 111.0),
            ("c", 5.0),
        ];
        let mut cells = times.map(|(name, ns)| cell("s", 10, "p", name, ns));
        cells[4].status = Status::Wrong;
        cells[2].status = Status::Unsafe;
        let ranked = ranked(cells.iter().collect(), 0.05);
        let found: Vec<_> = ranked
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
        let comparison = Comparison {
            ranked,
            bounds: Vec::new(),
        };
        let winners: Vec<_> = comparison.winners().map(|c| c.structure.as_str()).collect();
        assert_eq!(winners, ["a", "peer-x"]);
        let peer = comparison.fastest_peer().unwrap();
        assert_eq!(peer.structure, "peer-x");
        let failed = Comparison {
            ranked: super::ranked(cells[2..3].iter().collect(), 0.05),
            bounds: Vec::new(),
        };
        assert!(failed.fastest_peer().is_none() && failed.winners().next().is_none());
        assert_eq!(
            times_as_fast(peer, &cells[0]),
            Some((1000.0 / 100.0) / (1000.0 / 104.0))
        );
    }
}
