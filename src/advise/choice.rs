//! The structure and the culling test to take.
//!
//! A structure is chosen by measured cells, a test by its time and the cost of drawing its
//! false positives.

use serde::Serialize;

use super::trials::{Answered, Trials};
use crate::culling::{Culling, CullingTest, TESTS};
use crate::index::{BuildError, Execution, Kind, StructureSpec};
use crate::measure::{Group, Metric, OverProcesses, ReportCell};
use crate::statistics::{ALPHA, Estimate, Rate, flat, rate, shows_less_in_sum};
use crate::verify::ErrorCount;

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
    pub rows: Vec<StructureRow>,
    /// `true` if the one to take is a scan.
    #[serde(skip)]
    pub is_scan: bool,
    /// `true` if scans and others were timed.
    #[serde(skip)]
    pub(super) is_open: bool,
}

/// A structure as measured.
#[derive(Clone, Debug, Serialize)]
pub struct StructureRow {
    /// Label of the structure.
    pub structure: String,
    /// How building, counting and timing ended.
    pub status: &'static str,
    /// Why, where the status is not ok.
    pub reason: Option<String>,
    /// CPU time per frustum query, ns.
    #[serde(flatten, serialize_with = "flat::query_ns")]
    pub query_ns: Option<Estimate>,
    /// Time of `linear` / time of this; above 1 is faster.
    pub speedup: Option<f64>,
    /// Time of one build, ms.
    pub build_ms: Option<f64>,
    /// Memory of nodes and items / number of items.
    pub memory_bytes_per_item: Option<f64>,
    /// Queries after which the build is repaid against `linear`.
    pub break_even_queries: Option<f64>,
    /// CPU time per region search, ns.
    pub locate_ns: Option<f64>,
    #[serde(skip)]
    pub(super) is_failure: bool,
}

impl StructureRow {
    fn of(cell: &ReportCell) -> StructureRow {
        let value = |name: &str| cell.metrics.get(name).map(|m| m.value);
        StructureRow {
            structure: cell.structure.clone(),
            status: cell.status.name(),
            reason: cell.reason.clone(),
            query_ns: cell.metrics.get("query_ns").map(Metric::estimate),
            speedup: value("speedup"),
            build_ms: value("build_ms"),
            memory_bytes_per_item: value("memory_bytes_per_item"),
            break_even_queries: value("break_even_queries"),
            locate_ns: value("locate_ns"),
            is_failure: cell.status.is_failure(),
        }
    }

    /// CPU time per frustum query, ns.
    pub fn ns(&self) -> Option<f64> {
        Some(self.query_ns?.value)
    }
}

impl StructureChoice {
    /// From what a run measures of all structures on one scene and path.
    pub fn of(group: &Group) -> StructureChoice {
        let mut rows: Vec<StructureRow> = group.cells.iter().map(StructureRow::of).collect();
        rows.sort_by(|a, b| or_last(a.ns()).total_cmp(&or_last(b.ns())));
        let rank = |row: &StructureRow| {
            let mut cells = group.cells.iter();
            cells.find(|cell| cell.structure == row.structure)?.rank
        };
        let located = |row: &StructureRow| {
            let mut ranks = group.located.iter();
            Some(ranks.find(|(structure, _)| *structure == row.structure)?.1)
        };
        let mut first = first_ranked(&rows, rank, StructureRow::ns).into_iter();
        let mut first_located = first_ranked(&rows, located, |row| row.locate_ns).into_iter();
        StructureChoice {
            name: first.next(),
            ties: first.collect(),
            region_search: first_located.next(),
            region_search_ties: first_located.collect(),
            rows,
            is_scan: false,
            is_open: false,
        }
    }

    /// Notes the kinds of what was timed.
    pub(super) fn note_kinds(&mut self, structures: &[StructureSpec]) {
        let is_scan = |label: &str| {
            let spec = structures.iter().find(|spec| spec.label == label);
            spec.is_some_and(|spec| spec.info().kind == Kind::Scan)
        };
        self.is_scan = self.name.as_deref().is_some_and(is_scan);
        let timed = self.rows.iter().filter(|row| row.query_ns.is_some());
        let mut scans = timed.map(|row| is_scan(&row.structure));
        self.is_open = scans.any(|scan| scan != self.is_scan);
    }

    /// The fastest tree or grid and the fastest scan, for the rules.
    ///
    /// Without any, `wide` and `linear`.
    pub(super) fn tree_and_scan(
        &self,
        structures: &[StructureSpec],
    ) -> Result<[StructureSpec; 2], BuildError> {
        let of_row = |row: &StructureRow| structures.iter().find(|s| s.label == row.structure);
        let fastest = |is_scan: bool, otherwise| {
            let timed = self.rows.iter().filter(|row| row.query_ns.is_some());
            let mut timed = timed.filter_map(of_row);
            let found = timed.find(|s| (s.info().kind == Kind::Scan) == is_scan);
            let found = found.cloned().map(Ok);
            found.unwrap_or_else(|| named(otherwise, execution(structures)))
        };
        Ok([fastest(false, TREE)?, fastest(true, SCAN)?])
    }
}

/// The structures of the first rank, fastest first.
fn first_ranked(
    rows: &[StructureRow],
    rank: impl Fn(&StructureRow) -> Option<usize>,
    time: impl Fn(&StructureRow) -> Option<f64>,
) -> Vec<String> {
    let mut first: Vec<&StructureRow> = rows.iter().filter(|row| rank(row) == Some(1)).collect();
    first.sort_by(|a, b| or_last(time(a)).total_cmp(&or_last(time(b))));
    first.iter().map(|row| row.structure.clone()).collect()
}

/// Maps a missing time to the end of the order.
fn or_last(time: Option<f64>) -> f64 {
    time.unwrap_or(f64::INFINITY)
}

/// The structure that a plan names: one of the list, or of this crate.
pub(super) fn planned(
    structures: &[StructureSpec],
    label: &str,
) -> Result<StructureSpec, BuildError> {
    let found = structures.iter().find(|spec| spec.label == label);
    let otherwise = if label == SCAN { SCAN } else { TREE };
    let found = found.cloned().map(Ok);
    found.unwrap_or_else(|| named(otherwise, execution(structures)))
}

fn execution(structures: &[StructureSpec]) -> Execution {
    structures.first().map(|s| s.execution).unwrap_or_default()
}

/// Structures of the rules where the list has no tree, no scan.
const TREE: &str = "wide";
const SCAN: &str = "linear";

/// A structure of this crate with its default parameters.
pub(super) fn named(name: &'static str, execution: Execution) -> Result<StructureSpec, BuildError> {
    let spec = StructureSpec::parse(name).map_err(|error| BuildError::Params {
        structure: name,
        reason: error.to_string(),
    })?;
    Ok(spec.by(execution))
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
    /// The cost of drawing at each judged camera, ns.
    #[serde(skip)]
    by_camera: Vec<f64>,
}

/// Enters every culling test, except where a camera has no such view.
pub(super) fn enter_tests(trials: &mut Trials) -> Result<Vec<(CullingTest, usize)>, BuildError> {
    let mut entered = Vec::with_capacity(TESTS.len());
    for (test, ..) in TESTS {
        let culling = Culling {
            test,
            ..Culling::default()
        };
        if let Ok(views) = trials.case.views_by(&culling) {
            let index = trials.case.tree_for(test)?;
            entered.push((test, trials.index(index, views)));
        }
    }
    Ok(entered)
}

impl TestChoice {
    /// Before any test is timed.
    pub(super) fn untimed(structure: &str) -> TestChoice {
        TestChoice {
            name: None,
            ties: Vec::new(),
            structure: structure.to_owned(),
            rows: Vec::new(),
        }
    }

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
            let rate_of = |count: fn(&ErrorCount) -> u64| {
                let clusters = by_camera.iter();
                let clusters = clusters.map(|e| [count(e) as f64, e.visible as f64]);
                rate(&clusters.collect::<Vec<_>>())
            };
            let extra = errors.map(|e| e.false_positives as f64 / judged);
            let extra = extra.filter(|extra| extra.is_finite());
            let drawn = extra.map(|extra| extra * draw_ns);
            TestRow {
                test: test.name(),
                query_ns: query,
                excess: rate_of(|e| e.false_positives),
                false_negative_ppm: rate_of(|e| e.false_negatives).map(|share| share.per(1e6)),
                false_positives_per_query: extra,
                total_ns: query.zip(drawn).map(|(query, drawn)| query.value + drawn),
                by_process: times.ln_ns(task).iter().map(|ln_ns| ln_ns.exp()).collect(),
                by_camera: by_camera
                    .iter()
                    .map(|e| e.false_positives as f64 * draw_ns)
                    .collect(),
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
        let times = [&a.by_process[..], &b.by_process[..]];
        shows_less_in_sum(times, [&a.by_camera, &b.by_camera], ALPHA)
    };
    let sound = rows
        .iter()
        .filter(is_sound)
        .filter(|row| row.total_ns.is_some());
    let least = sound
        .clone()
        .min_by(|a, b| or_last(a.total_ns).total_cmp(&or_last(b.total_ns)));
    let Some(least) = least else {
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
    use super::*;
    use crate::index::Registry;

    /// A query of about 100 ns in ten processes, each a little off.
    fn row(test: &'static str, query: f64, drawn: f64) -> TestRow {
        let off = |n: usize| 1.0 + 0.01 * ((n * test.len()) % 7) as f64 - 0.03;
        TestRow {
            test,
            query_ns: Some(Estimate::within(query, [f64::NAN; 2])),
            excess: None,
            false_negative_ppm: rate(&[[0.0, 1e6]]),
            false_positives_per_query: Some(drawn),
            total_ns: Some(query + drawn),
            by_process: (0..10).map(|n| query * off(n)).collect(),
            by_camera: vec![drawn; 4],
        }
    }

    fn structure(structure: &str, query_ns: Option<f64>, locate_ns: Option<f64>) -> StructureRow {
        StructureRow {
            structure: structure.to_owned(),
            status: "ok",
            reason: None,
            query_ns: query_ns.map(|ns| Estimate::within(ns, [f64::NAN; 2])),
            speedup: None,
            build_ms: None,
            memory_bytes_per_item: None,
            break_even_queries: None,
            locate_ns,
            is_failure: false,
        }
    }

    #[test]
    fn all_of_the_first_rank_tie_with_the_fastest() {
        let rows = [
            structure("bvh", Some(1.0), Some(104.0)),
            structure("octree", Some(2.0), None),
            structure("wide", Some(3.0), Some(100.0)),
            structure("linear", Some(4.0), Some(111.0)),
        ];
        let rank = |row: &StructureRow| Some(if row.locate_ns? < 110.0 { 1 } else { 3 });
        assert_eq!(
            first_ranked(&rows, rank, |row| row.locate_ns),
            ["wide", "bvh"]
        );
        assert!(first_ranked(&rows[1..2], rank, |row| row.locate_ns).is_empty());
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
        assert_eq!(
            near_the_least(&[rare, row("exact", 100.0, 0.0)]),
            ["six-plane", "exact"]
        );
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
        let mut choice = StructureChoice {
            name: None,
            ties: Vec::new(),
            region_search_ties: Vec::new(),
            region_search: None,
            rows: Vec::new(),
            is_scan: false,
            is_open: false,
        };
        let structures = Registry::builtin()
            .structures("octree,linear-scalar")
            .unwrap();
        let labels = |choice: &StructureChoice| {
            choice
                .tree_and_scan(&structures)
                .unwrap()
                .map(|spec| spec.label)
        };
        assert_eq!(labels(&choice), ["wide", "linear"]);
        let row = |name: &str| structure(name, Some(1.0), None);
        choice.rows = vec![row("linear-scalar"), row("octree")];
        assert_eq!(labels(&choice), ["octree", "linear-scalar"]);
        // A plan names what was found, also what the list does not hold.
        for name in ["octree", "linear-scalar", "wide", "linear"] {
            assert_eq!(planned(&structures, name).unwrap().label, name);
        }
    }
}
