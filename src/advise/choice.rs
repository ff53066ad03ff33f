//! The structure and the culling test to take.
//!
//! A structure is chosen by measured cells, a test by its time and the cost of drawing its
//! false positives.

use serde::{Serialize, Serializer};
use serde_json::json;

use super::omission::{TIE, is_longer};
use super::options::{SCAN, TREE};
use super::trials::{Answered, Trials};
use crate::camera::PlaneOptions;
use crate::culling::{Arithmetic, Culling, CullingTest, TESTS};
use crate::index::BuildError;
use crate::measure::{OverProcesses, ReportCell};
use crate::statistics::{ALPHA, Estimate, Rate, flat, rate_of, ratio, shows_less_in_sum};

/// Which structure, and all that took part.
#[derive(Clone, Debug, Serialize)]
pub struct StructureChoice {
    /// The fastest that answered right; null if none did.
    pub name: Option<String>,
    /// Others that the processes do not tell from it.
    pub ties: Vec<String>,
    /// The fastest for region search.
    pub region_search: Option<String>,
    /// Others that the processes do not tell from it.
    pub region_search_ties: Vec<String>,
    /// Fastest first; what failed comes last.
    #[serde(serialize_with = "rows")]
    pub rows: Vec<ReportCell>,
    /// `true` if the one to take is a scan.
    #[serde(skip)]
    pub is_scan: bool,
}

/// Metrics of a structure in the advice.
const METRICS: &str = "query_ns speedup build_ms memory_bytes_per_item break_even_queries \
     locate_ns frame_ns update_ns worst_frame_ns";

/// Structures as measured, each with its metrics; null where one was not measured.
pub(super) fn rows<S: Serializer>(cells: &[ReportCell], out: S) -> Result<S::Ok, S::Error> {
    out.collect_seq(cells.iter().map(|cell| {
        let (name, status, reason) = (&cell.structure, cell.status.name(), &cell.reason);
        let mut row = json!({ "structure": name, "status": status, "reason": reason });
        for metric in METRICS.split_whitespace() {
            row[metric] = json!(cell.value(metric));
        }
        for metric in ["query_ns", "frame_ns"] {
            let found = cell.metrics.get(metric);
            row[format!("{metric}_lower")] = json!(found.and_then(|found| found.lower));
            row[format!("{metric}_upper")] = json!(found.and_then(|found| found.upper));
        }
        row
    }))
}

/// CPU time per frame, or per frustum query of a still scene, ns.
pub fn ns(cell: &ReportCell) -> Option<f64> {
    Some(cell.time()?.value)
}

impl StructureChoice {
    /// From what a run measures of all structures on one scene and path.
    pub(super) fn of(cells: &[ReportCell]) -> StructureChoice {
        let mut rows = cells.to_vec();
        // Wrong answers and fat bounds below: they have no rank.
        rows.sort_by(|a, b| {
            let order = a.rank.is_none().cmp(&b.rank.is_none());
            order.then(or_last(ns(a)).total_cmp(&or_last(ns(b))))
        });
        let first = |metric| fastest(cells, metric).into_iter();
        let mut first_located = first(Some("locate_ns")).map(|cell| cell.structure.clone());
        let mut first = first(None).map(|cell| cell.structure.clone());
        StructureChoice {
            is_scan: matches!(rows.first(), Some(row) if row.is_scan() && row.rank.is_some()),
            name: first.next(),
            ties: first.collect(),
            region_search: first_located.next(),
            region_search_ties: first_located.collect(),
            rows,
        }
    }

    fn fastest(&self, is_scan: bool) -> Option<&ReportCell> {
        alone(&self.rows).find(|row| row.is_scan() == is_scan)
    }

    /// Labels of the fastest tree or grid and of the fastest scan, for the rules.
    ///
    /// Without any, `wide` and `linear`.
    pub(super) fn tree_and_scan(&self) -> [String; 2] {
        [(false, TREE), (true, SCAN)].map(|(is_scan, otherwise)| {
            let own = self.fastest(is_scan);
            own.map_or(otherwise, |row| &row.structure).to_owned()
        })
    }

    /// Times of the fastest tree or grid and of the fastest scan, if both were timed.
    ///
    /// Per frame of moving items, or per query of a still scene, ns.
    pub(super) fn tree_and_scan_ns(&self) -> Option<[f64; 2]> {
        let [tree, scan] = [false, true].map(|is_scan| ns(self.fastest(is_scan)?));
        Some([tree?, scan?])
    }

    /// Returns true if the processes do not tell these two times apart.
    pub(super) fn tree_and_scan_tie(&self) -> Option<bool> {
        let [tree, scan] = [false, true].map(|is_scan| self.fastest(is_scan));
        over(tree?, scan?, None).map(|ratio| is_longer(ratio).is_none())
    }

    /// Labels of the structure that is taken and of those that may replace it.
    ///
    /// In another workload: the fastest tree and scan, of a motion the three fastest too.
    pub(super) fn contenders(&self, moves: bool) -> Vec<String> {
        let first = alone(&self.rows).take(if moves { 3 } else { 1 });
        let of_kind = [false, true].map(|is_scan| self.fastest(is_scan));
        let mut labels: Vec<String> = Vec::new();
        for row in first.chain(of_kind.into_iter().flatten()) {
            if !labels.contains(&row.structure) {
                labels.push(row.structure.clone());
            }
        }
        labels
    }
}

/// Rows with a rank on one thread.
fn alone(rows: &[ReportCell]) -> impl Iterator<Item = &ReportCell> {
    let is_shared = |row: &ReportCell| row.params["threads"].as_u64() > Some(1);
    (rows.iter()).filter(move |row| row.rank.is_some() && !is_shared(row))
}

/// Time of a structure / time of another one.
///
/// The times are those of a given metric, or of the one that ranks.
fn over(own: &ReportCell, other: &ReportCell, metric: Option<&str>) -> Option<Estimate> {
    let [own, other] = [own, other].map(|cell| cell.ln_ns(metric.unwrap_or(cell.ranked_by())));
    ratio(&other, &own, &other)
}

/// [`over`] of the labels of two cells.
pub(super) fn time_over(cells: &[ReportCell], own: &str, other: &str) -> Option<Estimate> {
    let cell = |label| cells.iter().find(|cell| cell.structure == label);
    over(cell(own)?, cell(other)?, None)
}

/// The fastest structure and those that tie with it.
///
/// The times are those of a given metric, or of the one that ranks.
pub(super) fn fastest<'c>(cells: &'c [ReportCell], metric: Option<&str>) -> Vec<&'c ReportCell> {
    let ns = |cell: &ReportCell| cell.value(metric.unwrap_or(cell.ranked_by()));
    // Wrong answers, and sets of fat bounds, have no rank.
    let sound = |cell: &&ReportCell| cell.rank.is_some() && ns(cell).is_some();
    let mut sound: Vec<&ReportCell> = cells.iter().filter(sound).collect();
    sound.sort_by(|a, b| or_last(ns(a)).total_cmp(&or_last(ns(b))));
    let Some(&first) = sound.first() else {
        return sound;
    };
    let is_longer = |cell: &ReportCell| is_longer(over(cell, first, metric)?);
    sound.retain(|cell| cell.structure == first.structure || is_longer(cell) != Some(true));
    sound
}

/// Maps a missing time to the end of the order.
fn or_last(time: Option<f64>) -> f64 {
    time.unwrap_or(f64::INFINITY)
}

/// Which culling test, and all that took part, on the fastest tree.
#[derive(Clone, Debug, Serialize)]
pub struct TestChoice {
    /// The one with the least total, or the simplest of those that the processes
    /// do not tell from it; null if nothing could be judged.
    pub name: Option<&'static str>,
    /// The others of those.
    pub ties: Vec<&'static str>,
    /// The structure that the tests were measured with.
    pub structure: String,
    /// Every culling test that took part.
    pub rows: Vec<TestRow>,
}

/// A culling test as measured.
#[derive(Clone, Debug, Serialize)]
pub struct TestRow {
    /// Name of the test.
    pub test: &'static str,
    /// CPU time per frustum query, ns.
    #[serde(flatten, serialize_with = "flat::query_ns")]
    pub query_ns: Option<Estimate>,
    /// False positives / visible items, by judged camera.
    pub excess: Option<Rate>,
    /// Visible items that were not returned, in millionths.
    pub false_negative_ppm: Option<Rate>,
    /// Mean of the judged cameras.
    pub false_positives_per_query: Option<f64>,
    /// A query and the drawing of what it lets through though it cannot be
    /// seen.
    pub total_ns: Option<f64>,
    /// The query's time in each process, ns.
    #[serde(skip)]
    by_process: Vec<f64>,
    /// The cost of drawing at each judged camera, ns; their mean where all are judged.
    #[serde(skip)]
    by_camera: Vec<f64>,
}

/// Enters every culling test, except where a camera has no such view.
pub(super) fn enter_tests(trials: &mut Trials) -> Result<Vec<(CullingTest, usize)>, BuildError> {
    let mut entered = Vec::with_capacity(TESTS.len());
    for (test, ..) in TESTS {
        let culling = Culling::new(test, Arithmetic::F32, PlaneOptions::default());
        if let Ok(views) = trials.case.views_by(&culling) {
            let index = trials.case.tree_for(test)?;
            entered.push((test, trials.index(index, views)));
        }
    }
    Ok(entered)
}

impl TestChoice {
    pub(super) fn of(
        structure: String,
        draw_ns: f64,
        tests: &[(CullingTest, usize)],
        answered: &Answered,
        times: &OverProcesses,
    ) -> TestChoice {
        let judged = answered.judged as f64;
        let rows = tests.iter().map(|&(test, task)| {
            let query = times.ns(task);
            let errors = answered.errors(task);
            let by_camera = answered.by_camera(task).unwrap_or_default();
            let missed = rate_of(by_camera, |e| [e.false_negatives, e.visible]);
            let extra = errors.map(|e| e.false_positives as f64 / judged);
            let extra = extra.filter(|extra| extra.is_finite());
            let drawn = extra.map(|extra| extra * draw_ns);
            // Of the whole path nothing is left to chance.
            let of_cameras = by_camera.iter().map(|e| e.false_positives as f64 * draw_ns);
            let of_cameras = match answered.judged < answered.counts[task].len() {
                true => of_cameras.collect(),
                false => drawn.into_iter().collect(),
            };
            TestRow {
                test: test.name(),
                query_ns: query,
                excess: rate_of(by_camera, |e| [e.false_positives, e.visible]),
                false_negative_ppm: missed.map(|share| share.of_share().per(1e6)),
                false_positives_per_query: extra,
                total_ns: query.zip(drawn).map(|(query, drawn)| query.value + drawn),
                by_process: times.ln_ns(task).iter().map(|ln_ns| ln_ns.exp()).collect(),
                by_camera: of_cameras,
            }
        });
        let rows: Vec<TestRow> = rows.collect();
        let near = near_the_least(&rows);
        TestChoice {
            name: near.first().copied(),
            ties: near.iter().skip(1).copied().collect(),
            structure,
            rows,
        }
    }
}

/// The tests whose total neither the processes nor the cameras tell from the least,
/// simplest first. One that misses anything is none of them.
fn near_the_least(rows: &[TestRow]) -> Vec<&'static str> {
    let is_sound = |row: &&TestRow| row.false_negative_ppm.is_none_or(|ppm| ppm.value == 0.0);
    let is_less = |a: &TestRow, b: &TestRow| {
        // Several processes have ties.
        let margin = if a.by_process.len() < 3 { 1.0 } else { TIE };
        let [time, drawn] = [&a.by_process, &a.by_camera]
            .map(|own| own.iter().map(|ns| ns * margin).collect::<Vec<f64>>());
        let times = [&time[..], &b.by_process];
        shows_less_in_sum(times, [&drawn, &b.by_camera], ALPHA)
    };
    let timed = rows.iter().filter(|row| row.total_ns.is_some());
    let sound = timed.filter(is_sound);
    let total = |row: &TestRow| or_last(row.total_ns);
    let Some(least) = sound.clone().min_by(|a, b| total(a).total_cmp(&total(b))) else {
        return Vec::new();
    };
    let is_near = |row: &&TestRow| row.test == least.test || !is_less(least, row);
    let mut near: Vec<&'static str> = sound.filter(is_near).map(|row| row.test).collect();
    near.sort_by_key(|name| SIMPLEST_FIRST.iter().position(|test| test.name() == *name));
    near
}

/// Tests by their number of planes; the sphere test needs an index of its own.
const SIMPLEST_FIRST: [CullingTest; 4] = [
    CullingTest::SixPlane,
    CullingTest::SixBox,
    CullingTest::Exact,
    CullingTest::Sphere,
];

#[cfg(test)]
mod tests {
    use super::super::options::planned;
    use super::*;
    use crate::index::{Registry, UpdatePolicy};
    use crate::statistics::rate;

    /// A query of about 100 ns in ten processes, each a little off.
    fn row(test: &'static str, query: f64, drawn: f64) -> TestRow {
        let off = |n: usize| 1.0 + 0.01 * ((n * test.len()) % 7) as f64 - 0.03;
        TestRow {
            test,
            query_ns: Some(Estimate::exact(query)),
            excess: None,
            false_negative_ppm: rate(&[[0.0, 1e6]]),
            false_positives_per_query: Some(drawn),
            total_ns: Some(query + drawn),
            by_process: (0..10).map(|n| query * off(n)).collect(),
            by_camera: vec![drawn; 4],
        }
    }

    fn structure(structure: &str, kind: &str, threads: u64) -> ReportCell {
        let cell = json!({
            "scene": { "name": "s", "total_count": 1, "region_count": 0,
                "origin": [0.0, 0.0, 0.0], "bounds_min": [0.0, 0.0, 0.0],
                "bounds_max": [1.0, 1.0, 1.0], "skipped_items": 0, "digest": "d" },
            "path": { "name": "p", "camera_count": 8, "cache": "warm", "planes": "frame",
                "epsilon": 8.0, "arithmetic": "f32" },
            "structure": structure, "kind": kind, "params": { "threads": threads }, "rank": 1,
            "test": "six-plane", "status": "ok", "reason": null, "error": null,
            "left_out": [], "samples_ref": null,
            "metrics": { "query_ns": { "value": 1.0, "unit": "ns" } },
        });
        serde_json::from_value(cell).unwrap()
    }

    #[test]
    fn a_tie_is_a_ratio_whose_interval_holds_a_difference_of_five_percent() {
        let of = |value: f64, ends| is_longer(Estimate::within(value, ends));
        assert_eq!(of(1.2, [1.06, 1.3]), Some(true));
        assert_eq!(of(0.8, [0.7, 0.94]), Some(false));
        assert_eq!(of(1.2, [1.04, 1.3]), None);
        assert_eq!(of(1.0, [0.9, 1.1]), None);
        // Told apart, and by less than another layout of memory makes.
        assert_eq!(of(1.03, [1.02, 1.04]), None);
        assert_eq!(of(1.01, [f64::NAN; 2]), Some(true));
    }

    #[test]
    fn the_simplest_test_of_those_not_told_apart_is_taken() {
        let dear = row("sphere", 900.0, 5000.0);
        // A tie, and the simplest is not the least.
        let tie = [
            dear.clone(),
            row("exact", 100.0, 0.0),
            row("six-plane", 99.9, 0.5),
        ];
        assert_eq!(near_the_least(&tie), ["six-plane", "exact"]);
        // One process tells nothing apart: the least is taken.
        let alone = tie.clone().map(|mut row| {
            row.by_process.truncate(1);
            row
        });
        assert_eq!(near_the_least(&alone), ["exact"]);
        // What is drawn at one camera of four may be chance.
        let mut rare = row("six-plane", 90.0, 50.0);
        rare.by_camera = vec![200.0, 0.0, 0.0, 0.0];
        let exact = row("exact", 100.0, 0.0);
        assert_eq!(
            near_the_least(&[rare.clone(), exact.clone()]),
            ["six-plane", "exact"]
        );
        // Of a path that was judged whole it is not.
        rare.by_camera = vec![50.0];
        assert_eq!(near_the_least(&[rare, exact]), ["exact"]);
        // What is drawn counts.
        let clear = [
            dear.clone(),
            row("six-plane", 90.0, 500.0),
            row("six-box", 100.0, 2.0),
        ];
        assert_eq!(near_the_least(&clear), ["six-box"]);
        // What misses something is excluded.
        let mut blind = row("six-plane", 1.0, 0.0);
        blind.false_negative_ppm = rate(&[[1.0, 1e7]]);
        assert_eq!(near_the_least(&[dear, blind]), ["sphere"]);
        assert!(near_the_least(&[]).is_empty());
    }

    #[test]
    fn scans_are_told_from_trees() {
        let mut choice = StructureChoice::of(&[]);
        assert_eq!(choice.tree_and_scan(), ["wide", "linear"]);
        choice.rows = vec![
            structure("linear:threads=2", "scan", 2),
            structure("linear-scalar", "scan", 1),
            structure("octree", "tree", 1),
        ];
        let rows = serde_json::to_value(&choice).unwrap()["rows"].clone();
        assert_eq!(
            (&rows[1]["query_ns"], &rows[1]["build_ms"]),
            (&json!(1.0), &json!(null))
        );
        assert_eq!(choice.tree_and_scan(), ["octree", "linear-scalar"]);
        assert_eq!(choice.contenders(false), ["linear-scalar", "octree"]);
        // A plan names what was found, also what the list does not hold.
        let structures = Registry::builtin()
            .structures("octree,linear-scalar")
            .unwrap();
        for name in [
            "octree",
            "linear-scalar",
            "wide",
            "linear",
            "octree@every=10",
        ] {
            assert_eq!(planned(&structures, name).label, name);
        }
        let every = planned(&structures, "octree@every=10").policy;
        assert_eq!(every, UpdatePolicy::Every(10));
    }
}
