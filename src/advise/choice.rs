//! The structure and the culling test to take: from measured cells, and from
//! what each test costs together with what it lets through. Omissions are
//! settled elsewhere.

use serde::Serialize;

use super::case::{Case, asked};
use super::trials::{Times, Trials};
use crate::culling::{Culling, CullingTest, TESTS};
use crate::index::{BuildError, Execution, Kind, StructureSpec};
use crate::measure::{Cell, Group, Metric};

/// Which structure, and all that took part.
#[derive(Clone, Debug, Serialize)]
pub struct StructureChoice {
    /// The fastest that answered right; null if none did.
    pub name: Option<String>,
    /// Others within the noise floor of it.
    pub ties: Vec<String>,
    /// The fastest for region search.
    pub region_search: Option<String>,
    /// Others within the noise floor of it.
    pub region_search_ties: Vec<String>,
    pub noise_floor: f64,
    /// Fastest first; what failed comes last.
    pub rows: Vec<StructureRow>,
}

/// A structure as measured.
#[derive(Clone, Debug, Serialize)]
pub struct StructureRow {
    pub structure: String,
    pub status: &'static str,
    pub reason: Option<String>,
    pub query_ns: Option<f64>,
    pub query_ns_lower: Option<f64>,
    pub query_ns_upper: Option<f64>,
    /// Time of `linear` / time of this; above 1 is faster.
    pub speedup: Option<f64>,
    pub build_ms: Option<f64>,
    pub memory_bytes_per_item: Option<f64>,
    /// Queries after which the build is repaid against `linear`.
    pub break_even_queries: Option<f64>,
    pub locate_ns: Option<f64>,
    #[serde(skip)]
    pub(super) is_failure: bool,
}

impl StructureRow {
    fn of(cell: &Cell) -> StructureRow {
        let metric = |name: &str| -> Option<&Metric> { cell.metrics.get(name) };
        let value = |name: &str| metric(name).map(|m| m.value);
        StructureRow {
            structure: cell.structure.clone(),
            status: cell.verdict.status.name(),
            reason: cell.verdict.reason.clone(),
            query_ns: value("query_ns"),
            query_ns_lower: metric("query_ns").and_then(|m| m.lower),
            query_ns_upper: metric("query_ns").and_then(|m| m.upper),
            speedup: value("speedup"),
            build_ms: value("build_ms"),
            memory_bytes_per_item: value("memory_bytes_per_item"),
            break_even_queries: value("break_even_queries"),
            locate_ns: value("locate_ns"),
            is_failure: cell.verdict.status.is_failure(),
        }
    }
}

impl StructureChoice {
    pub(super) fn of(group: &Group) -> StructureChoice {
        let mut rows: Vec<StructureRow> = group.cells.iter().map(StructureRow::of).collect();
        let time = |row: &StructureRow| row.query_ns.unwrap_or(f64::INFINITY);
        rows.sort_by(|a, b| time(a).total_cmp(&time(b)));
        let twin = group.twin.as_ref().map(|twin| twin.1.value);
        let noise_floor = twin.map_or(0.0, |ratio| (ratio - 1.0).abs());
        let fastest = rows.first().filter(|row| row.query_ns.is_some());
        let most = fastest.map_or(0.0, |row| time(row) * (1.0 + noise_floor));
        let near = rows.iter().skip(1).filter(|row| time(row) <= most);
        let mut located = fastest_located(&rows, noise_floor).into_iter();
        StructureChoice {
            name: fastest.map(|row| row.structure.clone()),
            ties: near.map(|row| row.structure.clone()).collect(),
            region_search: located.next(),
            region_search_ties: located.collect(),
            noise_floor,
            rows,
        }
    }

    /// The fastest tree or grid, or `wide` if there was none: what rules are forced on.
    pub(super) fn tree(&self, structures: &[StructureSpec]) -> Result<StructureSpec, BuildError> {
        self.fastest(structures, |kind| kind != Kind::Scan, "wide")
    }

    /// The fastest scan, or `linear` if there was none.
    pub(super) fn scan(&self, structures: &[StructureSpec]) -> Result<StructureSpec, BuildError> {
        self.fastest(structures, |kind| kind == Kind::Scan, "linear")
    }

    fn fastest(
        &self,
        structures: &[StructureSpec],
        is_one: impl Fn(Kind) -> bool,
        otherwise: &'static str,
    ) -> Result<StructureSpec, BuildError> {
        let of_row = |row: &StructureRow| structures.iter().find(|s| s.label == row.structure);
        let timed = self.rows.iter().filter(|row| row.query_ns.is_some());
        let found = timed.filter_map(of_row).find(|s| is_one(s.info().kind));
        let execution = structures.first().map(|spec| spec.execution);
        let default = || named(otherwise, execution.unwrap_or_default());
        found.cloned().map_or_else(default, Ok)
    }
}

/// The fastest for region search and what ties with it, fastest first.
fn fastest_located(rows: &[StructureRow], floor: f64) -> Vec<String> {
    let timed = rows.iter().filter_map(|row| Some((row.locate_ns?, row)));
    let mut timed: Vec<(f64, &StructureRow)> = timed.collect();
    timed.sort_by(|a, b| a.0.total_cmp(&b.0));
    let most = timed.first().map_or(0.0, |least| least.0 * (1.0 + floor));
    let near = timed.iter().take_while(|(ns, _)| *ns <= most);
    near.map(|(_, row)| row.structure.clone()).collect()
}

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
    /// The one with the least total, or the simplest of those that come within
    /// the noise of it; null if nothing could be judged.
    pub name: Option<&'static str>,
    /// Others within the noise.
    pub ties: Vec<&'static str>,
    pub structure: String,
    pub rows: Vec<TestRow>,
}

#[derive(Clone, Debug, Serialize)]
pub struct TestRow {
    pub test: &'static str,
    pub query_ns: Option<f64>,
    pub query_ns_lower: Option<f64>,
    pub query_ns_upper: Option<f64>,
    /// False positives / visible items.
    pub excess: Option<f64>,
    pub false_negative_ppm: Option<f64>,
    /// Mean of the judged cameras.
    pub false_positives_per_query: Option<f64>,
    /// A query and the drawing of what it lets through though it cannot be
    /// seen.
    pub total_ns: Option<f64>,
}

/// A test with its place in the trials.
pub(super) struct EnteredTest {
    test: CullingTest,
    place: usize,
}

/// Enters every culling test. A camera that has no such view leaves its test
/// out.
pub(super) fn enter_tests<'c>(
    case: &'c Case<'c>,
    trials: &mut Trials<'c>,
) -> Result<Vec<EnteredTest>, BuildError> {
    let mut entered = Vec::with_capacity(TESTS.len());
    for (test, ..) in TESTS {
        let culling = Culling {
            test,
            ..Culling::default()
        };
        if let Ok(views) = case.views(&culling) {
            let place = trials.add(asked(case.tree_for(test)?, views), true);
            entered.push(EnteredTest { test, place });
        }
    }
    Ok(entered)
}

impl TestChoice {
    pub(super) fn of(case: &Case, tests: &[EnteredTest], times: &Times, floor: f64) -> TestChoice {
        let rows: Vec<TestRow> = tests
            .iter()
            .map(|entered| {
                let query = times.query(entered.place);
                let errors = times.errors(entered.place);
                let judged = times.judged as f64;
                let extra = errors.map(|e| e.false_positives as f64 / judged);
                let extra = extra.filter(|extra| extra.is_finite());
                let drawn = extra.map(|extra| extra * case.options.draw_ns);
                TestRow {
                    test: entered.test.name(),
                    query_ns: query.map(|q| q.value),
                    query_ns_lower: query.map(|q| q.lower),
                    query_ns_upper: query.map(|q| q.upper),
                    excess: errors.and_then(|e| e.excess()),
                    false_negative_ppm: errors.and_then(|e| e.false_negative_ppm()),
                    false_positives_per_query: extra,
                    total_ns: query.zip(drawn).map(|(query, drawn)| query.value + drawn),
                }
            })
            .collect();
        let near = near_the_least(&rows, floor);
        TestChoice {
            name: near.first().copied(),
            ties: near.iter().skip(1).copied().collect(),
            structure: case.spec.label.clone(),
            rows,
        }
    }
}

/// The tests whose total is within the noise of the least, simplest first. One
/// that misses anything is none of them.
fn near_the_least(rows: &[TestRow], floor: f64) -> Vec<&'static str> {
    let sound = |row: &&TestRow| row.false_negative_ppm.is_none_or(|ppm| ppm == 0.0);
    // The total at an end of the query's interval.
    let at = |row: &TestRow, end: Option<f64>| Some(row.total_ns? - row.query_ns? + end?);
    let sound: Vec<&TestRow> = rows.iter().filter(sound).collect();
    let most = sound
        .iter()
        .filter_map(|row| at(row, row.query_ns_upper))
        .fold(f64::INFINITY, f64::min);
    let mut near: Vec<&'static str> = sound
        .iter()
        .filter(|row| at(row, row.query_ns_lower).is_some_and(|low| low <= most * (1.0 + floor)))
        .map(|row| row.test)
        .collect();
    near.sort_by_key(|name| SIMPLEST_FIRST.iter().position(|test| test.name() == *name));
    near
}

/// By the planes of a view; the sphere test needs an index of its own.
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

    fn row(test: &'static str, query: f64, drawn: f64) -> TestRow {
        TestRow {
            test,
            query_ns: Some(query),
            query_ns_lower: Some(query * 0.9),
            query_ns_upper: Some(query * 1.1),
            excess: None,
            false_negative_ppm: Some(0.0),
            false_positives_per_query: Some(drawn),
            total_ns: Some(query + drawn),
        }
    }

    #[test]
    fn region_search_within_the_noise_is_a_tie() {
        let located = |structure: &str, locate_ns| StructureRow {
            structure: structure.to_owned(),
            status: "ok",
            reason: None,
            query_ns: None,
            query_ns_lower: None,
            query_ns_upper: None,
            speedup: None,
            build_ms: None,
            memory_bytes_per_item: None,
            break_even_queries: None,
            locate_ns,
            is_failure: false,
        };
        let rows = [
            located("bvh", Some(104.0)),
            located("octree", None),
            located("wide", Some(100.0)),
            located("linear", Some(111.0)),
        ];
        assert_eq!(fastest_located(&rows, 0.05), ["wide", "bvh"]);
        assert_eq!(fastest_located(&rows, 0.01), ["wide"]);
        assert!(fastest_located(&rows[1..2], 0.05).is_empty());
    }

    #[test]
    fn the_simplest_test_within_the_noise_is_taken() {
        let of = |rows: &[TestRow]| near_the_least(rows, 0.05);
        let dear = row("sphere", 900.0, 5000.0);
        // A tie, and the simplest is not the least.
        let tie = [
            dear.clone(),
            row("exact", 100.0, 0.0),
            row("six-plane", 105.0, 5.0),
        ];
        assert_eq!(of(&tie), ["six-plane", "exact"]);
        // What is drawn counts.
        let clear = [
            dear.clone(),
            row("six-plane", 90.0, 500.0),
            row("six-box", 100.0, 2.0),
        ];
        assert_eq!(of(&clear), ["six-box"]);
        // What misses something is out of the question.
        let mut blind = row("six-plane", 1.0, 0.0);
        blind.false_negative_ppm = Some(0.1);
        assert_eq!(of(&[dear, blind]), ["sphere"]);
        assert!(of(&[]).is_empty());
    }

    #[test]
    fn scans_are_told_from_trees() {
        let mut choice = StructureChoice {
            name: None,
            ties: Vec::new(),
            region_search_ties: Vec::new(),
            region_search: None,
            noise_floor: 0.0,
            rows: Vec::new(),
        };
        let structures = Registry::builtin()
            .structures("octree,linear-scalar")
            .unwrap();
        let label = |found: Result<StructureSpec, BuildError>| found.unwrap().label;
        assert_eq!(label(choice.tree(&structures)), "wide");
        assert_eq!(label(choice.scan(&structures)), "linear");
        let row = |name: &str| StructureRow {
            structure: name.to_owned(),
            status: "ok",
            reason: None,
            query_ns: Some(1.0),
            query_ns_lower: None,
            query_ns_upper: None,
            speedup: None,
            build_ms: None,
            memory_bytes_per_item: None,
            break_even_queries: None,
            locate_ns: None,
            is_failure: false,
        };
        choice.rows = vec![row("linear-scalar"), row("octree")];
        assert_eq!(label(choice.tree(&structures)), "octree");
        assert_eq!(label(choice.scan(&structures)), "linear-scalar");
    }
}
