//! Choice of a culling test, and between a scan and a tree with their tests.

use anyhow::Result;
use serde::Serialize;

use super::choice::{StructureChoice, ns, or_last};
use super::tasks::{CheckedAnswers, PairResult, TaskList, TaskPair, is_longer, of_costs};
use crate::camera::PlaneOptions;
use crate::culling::{Arithmetic, Culling, CullingTest, TESTS};
use crate::measure::OverProcesses;
use crate::statistics::{Estimate, flat, rate_of};

/// Chosen culling test, and all candidates.
#[derive(Clone, Debug, Serialize)]
pub struct TestChoice {
    /// Simplest of the tests that tie with the least total; null if none is left.
    pub name: Option<&'static str>,
    /// Others that tie with the least total.
    ///
    /// A test on the other structure has its name too, as in `exact on wide`.
    pub ties: Vec<String>,
    /// Structure that the test is chosen for; null if none is taken.
    pub structure: Option<String>,
    /// All measured culling tests.
    pub rows: Vec<TestRow>,
    /// Costs of tree and scan, each with its test.
    ///
    /// `None` if six planes decide between them.
    #[serde(skip)]
    pub(super) costs: Option<[f64; 2]>,
    /// Exact test against six planes, with the structure.
    #[serde(skip)]
    pub(super) axes: Option<PairResult>,
}

/// Measurements of a culling test.
#[derive(Clone, Debug, Serialize)]
pub struct TestRow {
    /// Structure that was queried.
    pub structure: String,
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

/// A structure, a culling test and the index of their task.
pub(super) type Tested = (String, CullingTest, usize);

/// Adds tasks for all culling tests, except if a camera has no such view.
pub(super) fn add_tests(tasks: &mut TaskList) -> Result<Vec<Tested>> {
    let case = tasks.case;
    // The tree beside a scan.
    let specs = [&case.taken, &case.spec];
    let specs = &specs[..1 + usize::from(case.taken.label != case.spec.label)];
    let mut entered = Vec::new();
    for (spec, (test, ..)) in specs.iter().flat_map(|spec| TESTS.map(|test| (spec, test))) {
        let culling = Culling::new(test, Arithmetic::F32, PlaneOptions::default());
        if let Ok(views) = case.views_by(&culling) {
            let index = case.built(spec, test)?;
            entered.push((spec.label.clone(), test, tasks.index(index, views)));
        }
    }
    Ok(entered)
}

const SIX: &str = CullingTest::SixPlane.name();

impl TestChoice {
    /// Chooses a test for the structure taken.
    ///
    /// Takes the tree instead of a scan that with its test costs more.
    pub(super) fn of(
        [draw_ns, views]: [f64; 2],
        taken: &mut StructureChoice,
        tests: Vec<Tested>,
        answered: &CheckedAnswers,
        times: &OverProcesses,
    ) -> TestChoice {
        let rows = tests.into_iter().map(|(structure, test, task)| {
            let query = times.ns(task);
            let by_camera = answered.by_camera(task).unwrap_or_default();
            let missed = rate_of(by_camera, |e| [e.false_negatives, e.visible]);
            let extra = answered.false_positives_per_query(task);
            let both = query.zip(extra);
            TestRow {
                structure,
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
        let row = |of: &str, test: CullingTest| {
            let mut own = rows.iter().filter(|row| row.structure == of);
            own.find(|row| row.test == test.name())
        };
        // Time of a query and cost with it, in motion with the rest of a frame.
        let sides = |own: &TestRow| {
            let mut moving = taken.rows.iter().filter(|c| !c.path.motion.is_empty());
            let frame = moving.find(|cell| cell.structure == own.structure);
            let frame = frame.and_then(ns);
            let six = row(&own.structure, CullingTest::SixPlane);
            let beyond = frame.zip(six).map(|(frame, six)| frame / views - six.ns());
            [own.ns(), own.cost() + beyond.unwrap_or_default()]
        };
        let pairs = rows.chunk_by(|a, b| a.structure == b.structure);
        let pairs = pairs.filter(|_| taken.name.is_some());
        let near: Vec<_> = pairs.map(|own| near_the_least(own, times)).collect();
        let first = |n: usize| near.get(n)?.first().copied();
        // Cells decide between scan and tree with six planes.
        let both = first(0)
            .zip(first(1))
            .filter(|(own, tree)| taken.may_be_a_tree() && [own.test, tree.test] != [SIX; 2]);
        let costs = both.map(|(own, tree)| [tree, own].map(|row| sides(row)[1]));
        let is_dearer = both.map_or(Some(false), |(own, tree)| {
            let times = times.ratio(own.task, tree.task)?;
            is_longer(of_costs(times, sides(own), sides(tree)))
        });
        if is_dearer == Some(true) {
            taken.take_tree();
        }
        let own = near.into_iter().nth(usize::from(is_dearer == Some(true)));
        let own = own.unwrap_or_default();
        let mut ties: Vec<String> = own.iter().skip(1).map(|row| row.test.to_owned()).collect();
        if own.first().is_some_and(|own| own.test != SIX) {
            taken.keep_ties_of_kind();
        }
        if let (None, Some((_, tree))) = (is_dearer, both) {
            taken.ties.retain(|label| *label != tree.structure);
            taken.ties.push(tree.structure.clone());
            ties.push(format!("{} on {}", tree.test, tree.structure));
        }
        let structure = taken.name.clone();
        let of_taken = |test| row(structure.as_ref()?, test);
        let axes = of_taken(CullingTest::Exact).zip(of_taken(CullingTest::SixPlane));
        let axes = axes.map(|(exact, six)| TaskPair::new(&exact.structure, exact.task, six.task));
        let axes = axes.map(|sides| sides.check(answered, times));
        TestChoice {
            name: own.first().map(|row| row.test),
            ties,
            structure,
            costs,
            axes,
            rows,
        }
    }
}

impl TestRow {
    /// Time of a query, NaN without one.
    fn ns(&self) -> f64 {
        self.query_ns.map_or(f64::NAN, |ns| ns.value)
    }

    fn cost(&self) -> f64 {
        or_last(self.total_ns)
    }
}

/// Measurements of tests whose total ties with the least one, simplest first.
///
/// Tests with false negatives are excluded.
fn near_the_least<'r>(rows: &'r [TestRow], times: &OverProcesses) -> Vec<&'r TestRow> {
    let sound = rows.iter().filter(|row| {
        let misses = row.false_negative_ppm.is_some_and(|ppm| ppm.value != 0.0);
        row.total_ns.is_some() && !misses
    });
    let Some(least) = sound.clone().min_by(|a, b| a.cost().total_cmp(&b.cost())) else {
        return Vec::new();
    };
    let is_longer = |row: &TestRow| {
        let times = times.ratio(row.task, least.task)?;
        let [own, other] = [row, least].map(|row| [row.ns(), row.cost()]);
        is_longer(of_costs(times, own, other))
    };
    let near = sound.filter(|row| row.test == least.test || is_longer(row) != Some(true));
    let mut near: Vec<&TestRow> = near.collect();
    // Rows are by number of planes; the sphere test needs an index of its own, so it comes last.
    near.sort_by_key(|row| row.test == CullingTest::Sphere.name());
    near
}

#[cfg(test)]
mod tests {
    use super::super::choice::structure;
    use super::*;
    use crate::measure::ProcessTimes;
    use crate::verify::ErrorCount;

    /// Processes that differ slightly.
    fn over(times: &[f64], processes: usize) -> OverProcesses {
        let process = |n: usize| ProcessTimes {
            ln_ns: (times.iter().zip(1..))
                .map(|(ns, task)| Ok(Some((ns * (0.97 + 0.01 * ((n * task) % 7) as f64)).ln())))
                .collect(),
            ..ProcessTimes::default()
        };
        OverProcesses::of(&(0..processes).map(process).collect::<Vec<_>>())
    }

    /// Rows of a structure.
    ///
    /// A test is its query time and its drawing, in ns, and its misses.
    fn rows(structure: &str, tests: &[(&'static str, f64, f64, f64)]) -> Vec<TestRow> {
        let row = |(task, &(test, query, drawn, missed))| TestRow {
            structure: structure.to_owned(),
            test,
            query_ns: Some(Estimate::exact(query)),
            excess: None,
            false_negative_ppm: rate_of(&[missed], |&missed| [missed as u64, 1_000_000]),
            false_positives_per_query: Some(drawn),
            total_ns: Some(query + drawn),
            task,
        };
        tests.iter().enumerate().map(row).collect()
    }

    /// Tests near the least total.
    fn near(tests: &[(&'static str, f64, f64, f64)], processes: usize) -> Vec<&'static str> {
        let times: Vec<f64> = tests.iter().map(|row| row.1).collect();
        let rows = rows("wide", tests);
        let near = near_the_least(&rows, &over(&times, processes));
        near.into_iter().map(|row| row.test).collect()
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
    fn structure_and_test_are_taken_as_a_pair() {
        // Times of six planes and of the exact test with the scan, then with the tree.
        let of = |times: [f64; 4], drawn: f64, frame: Option<[f64; 2]>| {
            let exact = CullingTest::Exact;
            let task = |(task, structure): (usize, &str)| {
                let test = [CullingTest::SixPlane, exact][task % 2];
                (structure.to_owned(), test, task)
            };
            let all = ["linear", "linear", "wide", "wide"].into_iter().enumerate();
            let drawn = ErrorCount {
                visible: 1000,
                false_positives: drawn as u64,
                ..ErrorCount::default()
            };
            let errors = [
                drawn,
                ErrorCount {
                    false_positives: 0,
                    ..drawn
                },
            ]
            .repeat(2);
            let answered = CheckedAnswers {
                answers: vec![Vec::new(); 4],
                errors: errors.into_iter().map(|own| Some(vec![own])).collect(),
            };
            let cell = |(name, kind, ns): (&str, &str, f64)| {
                let mut cell = structure(name, kind, 1);
                let of_frame = cell.metrics["query_ns"].clone();
                cell.metrics.insert("frame_ns".to_owned(), of_frame);
                cell.path.motion = frame.map_or(String::new(), |_| "drift".to_owned());
                let metrics = cell.metrics.values_mut();
                metrics.for_each(|metric| metric.value = ns);
                cell
            };
            let [scan, tree] = frame.unwrap_or([times[0], times[2]]);
            let mut taken = StructureChoice {
                name: Some("linear".to_owned()),
                ties: vec!["wide".to_owned()],
                rows: vec![cell(("linear", "scan", scan)), cell(("wide", "tree", tree))],
            };
            let choice = {
                let tests = all.map(task).collect();
                TestChoice::of([1.0; 2], &mut taken, tests, &answered, &over(&times, 10))
            };
            assert_eq!(choice.structure, taken.name);
            let axes = choice.axes.unwrap();
            assert_eq!(Some(axes.on), choice.structure);
            let ties = [taken.ties.join(" "), choice.ties.join(" ")];
            let name = format!("{} {}", choice.structure.unwrap(), choice.name.unwrap());
            (name, ties, choice.costs.map(|[tree, scan]| tree < scan))
        };
        let told =
            |name: &str, ties: [&str; 2], costs| (name.to_owned(), ties.map(str::to_owned), costs);
        let kitchen = [134.0, 434.0, 142.0, 296.0];
        // Drawing is cheap: six planes, of which the cells decide.
        assert_eq!(
            of(kitchen, 50.0, None),
            told("linear six-plane", ["wide", ""], None)
        );
        // It is dear: the exact test costs less with the tree.
        let costs = Some(true);
        assert_eq!(
            of(kitchen, 900.0, None),
            told("wide exact", ["", ""], costs)
        );
        // A scan with six planes and a tree with the exact test tie.
        let slower = [134.0, 434.0, 170.0, 296.0];
        let costs = Some(true);
        let tie = told("linear six-plane", ["wide", "exact on wide"], costs);
        assert_eq!(of(slower, 165.0, None), tie);
        // A scan that is faster with the exact test too: the tie of six planes does not count.
        let costs = Some(false);
        let faster = [134.0, 200.0, 142.0, 296.0];
        assert_eq!(
            of(faster, 900.0, None),
            told("linear exact", ["", ""], costs)
        );
        // In motion the rest of the frame counts.
        let frame = Some([300.0, 600.0]);
        let costs = Some(false);
        assert_eq!(
            of(kitchen, 900.0, frame),
            told("linear exact", ["", ""], costs)
        );
    }
}
