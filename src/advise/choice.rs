//! Choice of structure (by measured cells), of culling test and of update policy.

use serde::Serialize;

use super::case::{AdviseInput, SCAN, TREE};
use super::tasks::{CheckedAnswers, TaskList, is_longer, of_costs};
use crate::camera::PlaneOptions;
use crate::culling::{Arithmetic, Culling, CullingTest, TESTS};
use crate::index::{BuildError, UpdatePolicy};
use crate::measure::{OverProcesses, ReportCell};
use crate::statistics::{Estimate, flat, rate_of, ratio};

/// Chosen structure, and all candidates.
#[derive(Clone, Debug, Serialize)]
pub struct StructureChoice {
    /// Fastest correct structure; of ties a single-threaded scan first; null if none.
    pub name: Option<String>,
    /// Others that tie with it.
    pub ties: Vec<String>,
    /// Cells as in a report, fastest first; failures come last.
    pub rows: Vec<ReportCell>,
}

/// CPU time per frame, or per frustum query of a still scene, ns.
pub fn ns(cell: &ReportCell) -> Option<f64> {
    Some(cell.time()?.value)
}

impl StructureChoice {
    /// Chooses from the cells of a run with all structures on one scene and path.
    pub(super) fn of(cells: &[ReportCell]) -> StructureChoice {
        let mut rows = cells.to_vec();
        // Wrong answers come last: they have no rank.
        rows.sort_by(|a, b| {
            let order = a.rank.is_none().cmp(&b.rank.is_none());
            order.then(or_last(ns(a)).total_cmp(&or_last(ns(b))))
        });
        let mut first = fastest(cells);
        first.sort_by_key(|cell| (is_shared(cell), !cell.is_scan()));
        let mut first = first.into_iter().map(|cell| cell.structure.clone());
        StructureChoice {
            name: first.next(),
            ties: first.collect(),
            rows,
        }
    }

    /// Cell of the chosen structure.
    pub fn taken(&self) -> Option<&ReportCell> {
        let mut rows = self.rows.iter();
        rows.find(|row| self.name.as_ref() == Some(&row.structure))
    }

    /// Returns `true` if the chosen structure is a scan.
    pub fn is_scan(&self) -> bool {
        self.taken().is_some_and(ReportCell::scans)
    }

    /// Returns `true` if a scan ties with a chosen tree, or a tree with a chosen scan.
    pub(super) fn is_scan_or_tree(&self) -> bool {
        let ties = |row: &ReportCell| self.ties.contains(&row.structure);
        let mut tied = alone(&self.rows).filter(|row| ties(row));
        tied.any(|row| row.scans() != self.is_scan())
    }

    /// Adds ties that appear only where the contenders are timed without the others.
    pub(super) fn add_ties(&mut self, contenders: &[String], alone: &[ReportCell]) {
        let Some(taken) = &self.name else { return };
        let own = |label: &&String| *label == taken || self.ties.contains(label);
        let ties = |label: &&String| {
            let ratio = time_over(alone, taken, label);
            let ratio = ratio.filter(|ratio| ratio.ends().is_some() && !own(label));
            ratio.is_some_and(|ratio| is_longer(ratio) != Some(false))
        };
        let ties: Vec<String> = contenders.iter().filter(ties).cloned().collect();
        self.ties.extend(ties);
    }

    /// Fastest tree or grid, and fastest scan.
    pub(super) fn tree_and_scan(&self) -> [Option<&ReportCell>; 2] {
        [false, true].map(|scans| alone(&self.rows).find(|row| row.scans() == scans))
    }

    /// Labels of the two for the rules; `wide` and `linear` if missing.
    pub(super) fn tree_and_scan_labels(&self) -> [String; 2] {
        let [tree, scan] = self.tree_and_scan();
        let label = |own: Option<&ReportCell>, otherwise: &str| {
            own.map_or(otherwise, |row| &row.structure).to_owned()
        };
        [label(tree, TREE), label(scan, SCAN)]
    }

    /// Labels of the chosen structure and of those that may replace it elsewhere.
    ///
    /// These are the fastest tree and scan; with a motion the three fastest too.
    pub(super) fn contenders(&self, moves: bool) -> Vec<String> {
        let (most, of_kind) = (if moves { 3 } else { 1 }, self.tree_and_scan());
        let own = alone(&self.rows).enumerate();
        let own = own.filter(|(n, row)| *n < most || of_kind.contains(&Some(row)));
        let mut own: Vec<String> = own.map(|(_, row)| row.structure.clone()).collect();
        own.sort_by_key(|label| Some(label) != self.name.as_ref());
        own
    }
}

/// Ranked rows on one thread.
fn alone(rows: &[ReportCell]) -> impl Iterator<Item = &ReportCell> {
    (rows.iter()).filter(|row| row.rank.is_some() && !is_shared(row))
}

fn is_shared(row: &ReportCell) -> bool {
    row.params["threads"].as_u64() > Some(1)
}

/// Time of a structure / time of another one, by the metric that ranks them.
pub(super) fn over(own: &ReportCell, other: &ReportCell) -> Option<Estimate> {
    let [own, other] = [own, other].map(|cell| cell.ln_ns(cell.ranked_by()));
    ratio(&other, &own, &other)
}

/// [`over`], by the labels of the two cells.
pub(super) fn time_over(cells: &[ReportCell], own: &str, other: &str) -> Option<Estimate> {
    let cell = |label| cells.iter().find(|cell| cell.structure == label);
    over(cell(own)?, cell(other)?)
}

/// Fastest structure and those that tie with it.
pub(super) fn fastest(cells: &[ReportCell]) -> Vec<&ReportCell> {
    // Wrong answers have no rank.
    let sound = |cell: &&ReportCell| cell.rank.is_some() && ns(cell).is_some();
    let mut sound: Vec<&ReportCell> = cells.iter().filter(sound).collect();
    sound.sort_by(|a, b| or_last(ns(a)).total_cmp(&or_last(ns(b))));
    let Some(&first) = sound.first() else {
        return sound;
    };
    let is_longer = |cell: &ReportCell| is_longer(over(cell, first)?);
    sound.retain(|cell| cell.structure == first.structure || is_longer(cell) != Some(true));
    sound
}

/// Maps a missing time to the end of the order.
fn or_last(time: Option<f64>) -> f64 {
    time.unwrap_or(f64::INFINITY)
}

/// Chosen culling test, and all candidates, on the fastest tree.
#[derive(Clone, Debug, Serialize)]
pub struct TestChoice {
    /// Simplest of the tests that tie with the least total; null if none is left.
    pub name: Option<&'static str>,
    /// Others that tie with the least total.
    pub ties: Vec<&'static str>,
    /// Structure that the tests were measured with.
    pub structure: String,
    /// All measured culling tests.
    pub rows: Vec<TestRow>,
}

/// Measurements of a culling test.
#[derive(Clone, Debug, Serialize)]
pub struct TestRow {
    /// Name of the test.
    pub test: &'static str,
    /// CPU time per frustum query, ns.
    #[serde(flatten, serialize_with = "flat::query_ns")]
    pub query_ns: Option<Estimate>,
    /// False positives / visible items, by camera with a truth.
    pub excess: Option<Estimate>,
    /// False negatives per million visible items.
    pub false_negative_ppm: Option<Estimate>,
    /// Mean over the cameras with a truth.
    pub false_positives_per_query: Option<f64>,
    /// Time of a query plus the cost of drawing its false positives.
    pub total_ns: Option<f64>,
    /// Index of its task.
    #[serde(skip)]
    task: usize,
}

/// Adds tasks for all culling tests, except if a camera has no such view.
pub(super) fn add_tests(tasks: &mut TaskList) -> Result<Vec<(CullingTest, usize)>, BuildError> {
    let mut entered = Vec::with_capacity(TESTS.len());
    for (test, ..) in TESTS {
        let culling = Culling::new(test, Arithmetic::F32, PlaneOptions::default());
        if let Ok(views) = tasks.case.views_by(&culling) {
            let index = tasks.case.tree_for(test)?;
            entered.push((test, tasks.add_queries(index, views)));
        }
    }
    Ok(entered)
}

impl TestChoice {
    pub(super) fn of(
        structure: String,
        draw_ns: f64,
        tests: &[(CullingTest, usize)],
        answered: &CheckedAnswers,
        times: &OverProcesses,
    ) -> TestChoice {
        let rows = tests.iter().map(|&(test, task)| {
            let query = times.ns(task);
            let by_camera = answered.by_camera(task).unwrap_or_default();
            let missed = rate_of(by_camera, |e| [e.false_negatives, e.visible]);
            let extra = answered.false_positives_per_query(task);
            let both = query.zip(extra);
            TestRow {
                test: test.name(),
                query_ns: query,
                excess: rate_of(by_camera, |e| [e.false_positives, e.visible]),
                false_negative_ppm: missed.map(|share| share.of_share().times(1e6)),
                false_positives_per_query: extra,
                total_ns: both.map(|(query, extra)| query.value + extra * draw_ns),
                task,
            }
        });
        let rows: Vec<TestRow> = rows.collect();
        let near = near_the_least(&rows, times);
        TestChoice {
            name: near.first().copied(),
            ties: near.iter().skip(1).copied().collect(),
            structure,
            rows,
        }
    }
}

/// Tests whose total ties with the least one, simplest first.
///
/// Tests with false negatives are excluded.
fn near_the_least(rows: &[TestRow], times: &OverProcesses) -> Vec<&'static str> {
    let sound = rows.iter().filter(|row| {
        let misses = row.false_negative_ppm.is_some_and(|ppm| ppm.value != 0.0);
        row.total_ns.is_some() && !misses
    });
    let total = |row: &TestRow| or_last(row.total_ns);
    let Some(least) = sound.clone().min_by(|a, b| total(a).total_cmp(&total(b))) else {
        return Vec::new();
    };
    let sides = |row: &TestRow| [row.query_ns.map_or(f64::NAN, |ns| ns.value), total(row)];
    let is_longer = |row: &TestRow| {
        let times = times.ratio(row.task, least.task)?;
        is_longer(of_costs(times, sides(row), sides(least)))
    };
    let near = sound.filter(|row| row.test == least.test || is_longer(row) != Some(true));
    let mut near: Vec<&'static str> = near.map(|row| row.test).collect();
    // Rows are by number of planes; the sphere test needs an index of its own, so it comes last.
    near.sort_by_key(|name| *name == CullingTest::Sphere.name());
    near
}

/// Rebuilding is ruled out if the builds alone take this many times a frame.
const RULED_OUT: f64 = 1.5;

/// Chosen update policy of the structure.
#[derive(Clone, Default, Debug, Serialize)]
pub struct MotionChoice {
    /// Fastest policy of the chosen structure; null without a structure.
    pub policy: Option<String>,
    /// Others that tie with it.
    pub policy_ties: Vec<String>,
    /// Measured policies of the structure, fastest first.
    pub policies: Vec<ReportCell>,
    /// Unmeasured policies, each with its builds / a frame with refits, same processes.
    pub ruled_out: Vec<(String, f64)>,
    /// `false` if the structure is rebuilt in every frame.
    #[serde(skip)]
    refits: bool,
}

impl MotionChoice {
    /// Choice before its measurement, and the label of the rebuilds to measure.
    ///
    /// No label if policies of `--update` are rows of the run.
    pub(super) fn start(
        input: &AdviseInput,
        structure: &StructureChoice,
    ) -> (MotionChoice, Option<String>) {
        let mut all = input.setting.structures.iter();
        let are_rows = all.clone().any(|s| s.policy != UpdatePolicy::Refit);
        let spec = all.find(|s| structure.name.as_ref() == Some(&s.label));
        let mut choice = MotionChoice {
            refits: spec.is_none_or(|spec| spec.info().refits),
            ..MotionChoice::default()
        };
        let spec = spec.filter(|_| choice.refits && !are_rows);
        let rebuilt = spec.zip(structure.rows.first()).and_then(|(spec, row)| {
            let builds = row.value("build_ms").unwrap_or(0.0) * 1e6;
            if builds > RULED_OUT * ns(row).unwrap_or(f64::INFINITY) {
                let frames = builds / ns(row).unwrap_or(f64::INFINITY);
                choice.ruled_out.push(("rebuild".to_owned(), frames));
                return None;
            }
            Some(format!("{}@rebuild", spec.label))
        });
        (choice, rebuilt)
    }

    /// Chooses among the cells of the chosen structure under several policies.
    pub(super) fn choose(self, structure: &StructureChoice, cells: &[ReportCell]) -> MotionChoice {
        let alone = |label: &str| label.split('@').next().map(str::to_owned);
        let taken = structure.name.as_deref().and_then(alone);
        let own = cells.iter().filter(|cell| alone(&cell.structure) == taken);
        let own = StructureChoice::of(&own.cloned().collect::<Vec<_>>());
        let policy = |label: &String| match policy_of(label) {
            "refit" if !self.refits => "rebuild".to_owned(),
            policy => policy.to_owned(),
        };
        MotionChoice {
            policy: own.name.as_ref().map(policy),
            policy_ties: own.ties.iter().map(policy).collect(),
            policies: own.rows,
            ..self
        }
    }
}

/// Policy in a label, as in `wide@every=10`.
pub fn policy_of(label: &str) -> &str {
    label.split_once('@').map_or("refit", |(_, policy)| policy)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::case::spec_of;
    use super::*;
    use crate::index::{Registry, UpdatePolicy};
    use crate::measure::{Metric, ProcessTimes};
    use crate::statistics::{Estimate, rate_of};

    /// Tests near the least total, over slightly different processes.
    ///
    /// A test is its query time and its drawing, in ns, and its misses.
    fn near(tests: &[(&'static str, f64, f64, f64)], processes: usize) -> Vec<&'static str> {
        let off = |n: usize, test: &str| 0.97 + 0.01 * ((n * test.len()) % 7) as f64;
        let process = |n| ProcessTimes {
            ln_ns: tests
                .iter()
                .map(|row| Ok(Some((row.1 * off(n, row.0)).ln())))
                .collect(),
            ..ProcessTimes::default()
        };
        let times: Vec<ProcessTimes> = (0..processes).map(process).collect();
        let row = |(task, &(test, query, drawn, missed))| TestRow {
            test,
            query_ns: Some(Estimate::exact(query)),
            excess: None,
            false_negative_ppm: rate_of(&[missed], |&missed| [missed as u64, 1_000_000]),
            false_positives_per_query: Some(drawn),
            total_ns: Some(query + drawn),
            task,
        };
        let rows: Vec<TestRow> = tests.iter().enumerate().map(row).collect();
        near_the_least(&rows, &OverProcesses::of(&times))
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
        // Significant, but by less than another memory layout makes.
        assert_eq!(of(1.03, [1.02, 1.04]), None);
        assert_eq!(of(1.01, [f64::NAN; 2]), Some(true));
    }

    #[test]
    fn the_simplest_test_of_those_not_told_apart_is_taken() {
        let dear = ("sphere", 900.0, 5000.0, 0.0);
        // A tie, in which the simplest does not have the least total.
        let tie = [
            dear,
            ("six-plane", 99.9, 0.5, 0.0),
            ("exact", 100.0, 0.0, 0.0),
        ];
        assert_eq!(near(&tie, 10), ["six-plane", "exact"]);
        // With one process nothing is significant: the least is chosen.
        assert_eq!(near(&tie, 1), ["exact"]);
        // The cost of drawing counts.
        let clear = [
            dear,
            ("six-plane", 90.0, 500.0, 0.0),
            ("six-box", 100.0, 2.0, 0.0),
        ];
        assert_eq!(near(&clear, 10), ["six-box"]);
        // A test that misses something is excluded.
        assert_eq!(near(&[dear, ("six-plane", 1.0, 0.0, 1.0)], 10), ["sphere"]);
        assert!(near(&[], 10).is_empty());
    }

    #[test]
    fn a_scan_that_ties_with_the_fastest_is_taken() {
        let cell = |name: &str, kind, threads, ns: f64| {
            let mut cell = structure(name, kind, threads);
            let own = (0..10).map(|n| ns * (1.0 + 0.004 * ((n * name.len()) % 7) as f64));
            cell.times
                .by_process
                .insert("query_ns".to_owned(), own.collect());
            cell.metrics.get_mut("query_ns").unwrap().value = ns;
            cell
        };
        let of = |scan: f64| {
            let rows = [("wide", "tree", 1, 100.0), ("linear", "scan", 1, scan)];
            let shared = [
                ("linear:threads=2", "scan", 2, 100.0),
                ("bsp", "tree", 1, 150.0),
            ];
            rows.into_iter()
                .chain(shared)
                .map(|row| cell(row.0, row.1, row.2, row.3))
                .collect::<Vec<_>>()
        };
        let tie = StructureChoice::of(&of(101.0));
        assert_eq!(tie.name.as_deref(), Some("linear"));
        assert_eq!(tie.ties, ["wide", "linear:threads=2"]);
        assert!(tie.is_scan() && tie.is_scan_or_tree());
        assert_eq!(tie.contenders(false), ["linear", "wide"]);
        // A tie without the other structures counts too; a significant answer stays.
        let mut ahead = StructureChoice::of(&of(80.0));
        assert_eq!(
            (ahead.name.as_deref(), ahead.ties.len()),
            (Some("linear"), 0)
        );
        let contenders = ahead.contenders(false);
        ahead.add_ties(&contenders, &of(80.0));
        assert!(ahead.ties.is_empty() && !ahead.is_scan_or_tree());
        ahead.add_ties(&contenders, &of(100.0));
        assert!(ahead.ties == ["wide"] && ahead.is_scan_or_tree());
    }

    #[test]
    fn scans_are_told_from_trees() {
        let mut choice = StructureChoice::of(&[]);
        assert_eq!(choice.tree_and_scan_labels(), ["wide", "linear"]);
        choice.rows = vec![
            structure("linear:threads=2", "scan", 2),
            structure("linear-scalar", "scan", 1),
            structure("octree", "tree", 1),
        ];
        assert_eq!(choice.tree_and_scan_labels(), ["octree", "linear-scalar"]);
        assert_eq!(choice.contenders(false), ["linear-scalar", "octree"]);
        // A structure that selects its method is a scan where it tested most items.
        choice.rows.insert(0, structure("auto", "tree", 1));
        choice.rows[0].scene.total_count = 100;
        for (chose, tested, tree) in [
            (Some("tree"), 20.0, "auto"),
            (Some("scan of all items"), 100.0, "octree"),
            (
                Some("built as tree; scan of overwritten boxes"),
                95.0,
                "octree",
            ),
            (None, 95.0, "auto"),
        ] {
            let row = &mut choice.rows[0];
            row.chose = chose.map(str::to_owned);
            let tested = Metric::of(Estimate::exact(tested), "1");
            row.metrics.insert("items_tested".to_owned(), tested);
            assert_eq!(choice.tree_and_scan_labels()[0], tree, "{chose:?}");
        }
        // A plan names what was chosen, even if the list does not contain it.
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
            assert_eq!(spec_of(&structures, name).label, name);
        }
        let every = spec_of(&structures, "octree@every=10").policy;
        assert_eq!(every, UpdatePolicy::Every(10));
    }
}
