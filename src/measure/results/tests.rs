//! Cells from handmade parts.

use serde_json::json;

use super::super::{Answer, GroupKey, KeyedSchedule, PathInfo, SceneInfo, Schedule, TaskPlan};
use super::*;
use crate::index::{Kind, Origin};

/// Time per query of a task in each process, ns.
type Times<'t> = (&'t str, TaskKind, &'t [f64]);

/// Cameras, ids per answer and rounds of every schedule here.
const CAMERAS: u64 = 4;
const IDS: u64 = 5;
const ROUNDS: u64 = 3;

fn subject(label: &str, build_ms: f64) -> SubjectPart {
    SubjectPart {
        label: label.to_owned(),
        params: Value::Null,
        kind: Kind::Tree,
        origin: Origin::Ours,
        verdict: Verdict::default(),
        build_ms: Some(build_ms),
        memory_bytes: Some(4000),
        update_cpu_ms: None,
        memory_after_bytes: None,
        ageing_ln: BTreeMap::new(),
        counts: BTreeMap::new(),
        chose: None,
    }
}

/// A part per process; builds take 1 ms for `linear`, 2 ms for all others.
fn parts(times: &[Times]) -> Vec<Part> {
    let mut labels: Vec<&str> = times.iter().map(|(label, ..)| *label).collect();
    labels.dedup();
    let answer = Answer {
        count: IDS,
        digest: 7,
    };
    let schedule = |of: fn(TaskKind) -> bool| {
        let keys: Vec<(String, TaskKind)> = times
            .iter()
            .filter(|(_, task, _)| of(*task))
            .map(|(label, task, _)| ((*label).to_owned(), *task))
            .collect();
        let tasks = keys.iter().map(|_| TaskPlan { batch: 2, every: 1 });
        Some(KeyedSchedule {
            schedule: Schedule {
                cameras: (0..CAMERAS as u32).collect(),
                rounds: ROUNDS as u32,
                cold: false,
                tasks: tasks.collect(),
            },
            keys,
        })
    };
    let known = ReferenceResults {
        visible: vec![answer; CAMERAS as usize],
        located: vec![answer; CAMERAS as usize],
        query: schedule(|task| task == TaskKind::Query),
        locate: schedule(|task| task != TaskKind::Query),
        lens_scale: None,
    };
    let key = GroupKey {
        scene: "s".to_owned(),
        path: "p".to_owned(),
        cache: "warm".to_owned(),
        test: "six-plane".to_owned(),
        arithmetic: "f32".to_owned(),
        planes: "frame".to_owned(),
        epsilon: 8.0,
        motion: String::new(),
    };
    let processes = times[0].2.len();
    let part = |process: usize| Part {
        scene: SceneInfo {
            total_count: 1000,
            ..SceneInfo::unknown("s")
        },
        path: PathInfo::unknown(&key),
        key: key.clone(),
        process: process as u32,
        known: Some(known.clone()).filter(|_| process == 0),
        judged: None,
        subjects: labels
            .iter()
            .map(|label| subject(label, if *label == YARDSTICK { 1.0 } else { 2.0 }))
            .collect(),
        failed: BTreeMap::new(),
        bounds: Vec::new(),
        tasks: times
            .iter()
            .map(|(label, task, ns)| TaskPart {
                label: (*label).to_owned(),
                task: *task,
                verdict: Verdict::default(),
                rounds_ns: vec![ns[process]; ROUNDS as usize],
                wall_ln_ns: Some(ns[process].ln()),
                tail_ns: Vec::new(),
            })
            .collect(),
    };
    (0..processes).map(part).collect()
}

/// Times of twelve processes on a machine of two speeds.
///
/// `factor` times those of the yardstick, with their own scatter.
fn times(factor: f64, salt: u64) -> Vec<f64> {
    let process = |n: u64| {
        let machine = if n.is_multiple_of(3) { 1.3 } else { 1.0 };
        let mixed = (n * 31 + salt).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let own = ((mixed >> 33) % 11) as f64 - 5.0;
        1000.0 * factor * machine * (1.0 + 0.002 * own)
    };
    (0..12).map(process).collect()
}

#[test]
fn counts_that_are_no_metrics_are_left_alone() {
    let mut parts = parts(&[("linear", TaskKind::Query, &[1000.0])]);
    let counts = [("items_tested", 3.0), ("items_boiled", 4.0)];
    parts[0].subjects[0].counts = counts.map(|(name, n)| (name.to_owned(), n)).into();
    let metrics = &Group::of(&parts).cells[0].metrics;
    assert_eq!(metrics["items_tested"].value, 3.0);
    assert!(!metrics.contains_key("items_boiled"));
}

#[test]
fn values_lie_in_their_intervals_and_ratios_are_those_of_the_shown_values() {
    let (linear, fast, slow, same) = (times(1.0, 1), times(0.2, 2), times(3.0, 3), times(0.2, 4));
    let group = Group::of(&parts(&[
        ("linear", TaskKind::Query, &linear),
        ("fast", TaskKind::Query, &fast),
        ("slow", TaskKind::Query, &slow),
        ("same", TaskKind::Query, &same),
    ]));
    let value = |cell: &ReportCell, metric: &str| cell.metrics[metric].value;
    for cell in &group.cells {
        for (name, metric) in &cell.metrics {
            let Some((lower, upper)) = metric.lower.zip(metric.upper) else {
                continue;
            };
            let held = lower <= metric.value && metric.value <= upper;
            assert!(held, "{}: {name} {metric:?}", cell.structure);
        }
        let has_interval = cell.metrics["query_ns"].lower.is_some();
        assert!(has_interval, "{}", cell.structure);
        // The same estimator, scaled by the number of items that a timed camera sees.
        let [query, per_visible] = ["query_ns", "ns_per_visible"].map(|m| &cell.metrics[m]);
        let ends = |m: &super::super::Metric| [Some(m.value), m.lower, m.upper];
        let scaled = ends(query).map(|ns| ns.map(|ns| ns / IDS as f64));
        assert_eq!(ends(per_visible), scaled, "{}", cell.structure);
        let of_shown = value(&group.cells[0], "query_ns") / value(cell, "query_ns");
        let found = value(cell, "speedup");
        assert!((found / of_shown - 1.0).abs() < 1e-12, "{found} {of_shown}");
        assert_eq!((cell.times.processes, cell.times.rounds), (12, 3));
        assert_eq!((cell.times.cameras_timed, cell.times.batch), (4, 2));
    }
    // The machine's speeds affect the time and not the ratio.
    let fast = &group.cells[1].metrics["speedup"];
    assert!((fast.value - 5.0).abs() < 0.05, "{fast:?}");
    assert!(fast.upper.unwrap() / fast.lower.unwrap() < 1.03, "{fast:?}");
}

#[test]
fn ranks_are_shared_by_what_no_test_tells_apart() {
    let (linear, fast, same, slow) = (times(1.0, 1), times(0.2, 2), times(0.2, 4), times(0.3, 3));
    let group = Group::of(&parts(&[
        ("linear", TaskKind::Query, &linear),
        ("slow", TaskKind::Query, &slow),
        ("fast", TaskKind::Query, &fast),
        ("same", TaskKind::Query, &same),
    ]));
    let ranks: Vec<_> = group.cells.iter().map(|cell| cell.rank).collect();
    assert_eq!(ranks, [Some(4), Some(3), Some(1), Some(1)]);
}

#[test]
fn one_process_has_values_and_no_intervals() {
    let group = Group::of(&parts(&[
        ("linear", TaskKind::Query, &[1000.0]),
        ("fast", TaskKind::Query, &[250.0]),
    ]));
    let fast = &group.cells[1];
    for name in ["query_ns", "speedup", "build_ms", "query_wall_ns"] {
        let metric = &fast.metrics[name];
        assert_eq!((metric.lower, metric.upper), (None, None), "{name}");
    }
    assert!((fast.metrics["query_ns"].value - 250.0).abs() < 1e-9);
    assert!((fast.metrics["speedup"].value - 4.0).abs() < 1e-12);
}

#[test]
fn the_twin_is_no_cell_and_its_interval_holds_one() {
    let (linear, fast, again) = (times(1.0, 1), times(0.2, 2), times(0.2, 4));
    let group = Group::of(&parts(&[
        ("linear", TaskKind::Query, &linear),
        ("fast", TaskKind::Query, &fast),
        ("fast#twin", TaskKind::Query, &again),
    ]));
    assert_eq!(group.cells.len(), 2);
    let twin = group.twin.unwrap();
    assert_eq!(
        (&twin.structure[..], twin.holds_one()),
        ("fast", Some(true))
    );
    assert!((twin.ratio - 1.0).abs() < 0.01, "{twin:?}");
}

#[test]
fn what_failed_in_one_process_is_not_ok_and_has_no_time() {
    let (linear, fast) = (times(1.0, 1), times(0.2, 2));
    let sound = parts(&[
        ("linear", TaskKind::Query, &linear),
        ("fast", TaskKind::Query, &fast),
    ]);
    let failed = Verdict::new(Status::OutOfMemory, "killed while timing");
    let (mut as_subject, mut as_task) = (sound.clone(), sound);
    as_subject[7].subjects[1].verdict = failed.clone();
    as_subject[7].tasks.pop();
    as_task[7].tasks[1].verdict = failed.clone();
    as_task[7].tasks[1].rounds_ns.clear();
    for parts in [as_subject, as_task] {
        let group = Group::of(&parts);
        let [linear, fast] = &group.cells[..] else {
            panic!("two cells");
        };
        assert_eq!((fast.status, &fast.reason), (failed.status, &failed.reason));
        assert_eq!((fast.rank, linear.rank), (None, Some(1)));
        assert!(!fast.metrics.contains_key("query_ns"));
        assert_eq!(linear.times.processes, 12);
    }
}

#[test]
fn a_scene_is_the_one_that_some_process_has_loaded() {
    let linear = times(1.0, 1);
    let mut parts = parts(&[("linear", TaskKind::Query, &linear)]);
    parts[0].scene = SceneInfo::unknown("s");
    parts[2].scene.digest = "d".to_owned();
    let scene = &Group::of(&parts).cells[0].scene;
    assert_eq!((scene.total_count, scene.digest.as_str()), (1000, "d"));
}

#[test]
fn a_time_that_a_process_lacks_is_left_out_by_name() {
    let (linear, fast) = (times(1.0, 1), times(0.2, 2));
    let mut parts = parts(&[
        ("linear", TaskKind::Query, &linear),
        ("fast", TaskKind::Query, &fast),
    ]);
    parts[7].tasks[1].rounds_ns.clear();
    let cells = Group::of(&parts).cells;
    let named = |cell: &ReportCell| {
        cell.left_out
            .iter()
            .any(|why| why.starts_with("query_ns: "))
    };
    assert!(!named(&cells[0]) && named(&cells[1]));
}

#[test]
fn a_build_breaks_even_by_the_times_that_are_shown() {
    let (linear, fast) = (times(1.0, 1), times(0.2, 2));
    let group = Group::of(&parts(&[
        ("linear", TaskKind::Query, &linear),
        ("fast", TaskKind::Query, &fast),
    ]));
    let [linear, fast] = &group.cells[..] else {
        panic!("two cells");
    };
    let value = |cell: &ReportCell, metric: &str| cell.metrics[metric].value;
    let price = (value(fast, "build_ms") - value(linear, "build_ms")) * 1e6;
    let gain = value(linear, "query_ns") - value(fast, "query_ns");
    assert_eq!(value(fast, "break_even_queries"), (price / gain).ceil());
    assert!(!linear.metrics.contains_key("break_even_queries"));
    // Faster, with a build that costs no more.
    let mut cheap = parts(&[
        ("linear", TaskKind::Query, &times(1.0, 1)),
        ("fast", TaskKind::Query, &times(0.2, 2)),
    ]);
    for part in &mut cheap {
        part.subjects[1].build_ms = Some(1e-9);
    }
    let cells = Group::of(&cheap).cells;
    assert_eq!(value(&cells[1], "break_even_queries"), 0.0);
}

#[test]
fn a_tail_is_read_off_twenty_groups_and_not_fewer() {
    let linear = times(1.0, 1);
    for groups in [19, 20] {
        let mut parts = parts(&[("linear", TaskKind::Query, &linear)]);
        for part in &mut parts {
            part.tasks[0].tail_ns = (1..=groups).map(|ns| 100.0 * f64::from(ns)).collect();
        }
        let metrics = &Group::of(&parts).cells[0].metrics;
        for name in ["query_ns_p5", "query_ns_p95", "query_ns_p99"] {
            assert_eq!(metrics.contains_key(name), groups == 20, "{name}");
        }
        // Scaled to the reported mean, which has another estimator.
        let over_mean = |name: &str| Some(metrics.get(name)?.value / metrics["query_ns"].value);
        let wanted = (groups == 20).then_some(2000.0 / 1050.0);
        assert_eq!(over_mean("query_ns_max").is_some(), wanted.is_some());
        let slowest = over_mean("query_ns_max").unwrap_or_default();
        assert!((slowest - wanted.unwrap_or_default()).abs() < 1e-9);
        assert!(groups < 20 || over_mean("query_ns_p95") > Some(1.5));
    }
}

#[test]
fn the_worst_frame_is_of_three_readings_and_about_the_mean() {
    let tasks = [TaskKind::Query, TaskKind::Frame].map(|task| ("linear", task, &[9.0][..]));
    let mut all = parts(&tasks);
    all[0].known = None;
    all[0].key.motion = "drift".to_owned();
    let worst = |all: &[Part]| Group::of(all).cells[0].value("worst_frame_ns");
    for (slowest, wanted) in [(21.0, 13.5), (7.0, 9.0)] {
        all[0].tasks[1].tail_ns = vec![7.0, slowest];
        let worst = worst(&all).unwrap();
        assert!((worst - wanted).abs() < 1e-9, "{worst}");
    }
    all[0].tasks[1].rounds_ns.pop();
    assert_eq!(worst(&all), None);
    let left_out = &Group::of(&all).cells[0].left_out;
    assert!(
        left_out
            .iter()
            .any(|text| text.contains("fewer than 3 readings"))
    );
}

#[test]
fn without_the_yardstick_there_are_times_and_ranks_but_no_speed_ups() {
    let (bvh, octree) = (times(1.0, 1), times(2.0, 2));
    let group = Group::of(&parts(&[
        ("octree", TaskKind::Query, &octree),
        ("bvh", TaskKind::Query, &bvh),
    ]));
    let ranks: Vec<_> = group.cells.iter().map(|cell| cell.rank).collect();
    assert_eq!(ranks, [Some(2), Some(1)]);
    for cell in &group.cells {
        assert!(cell.metrics.contains_key("query_ns"));
        for absent in ["speedup", "break_even_queries"] {
            assert!(!cell.metrics.contains_key(absent), "{absent}");
        }
    }
}

/// The data behind cells survives in reports.
#[test]
fn times_of_cells_survive_json() {
    let linear = times(1.0, 1);
    let group = Group::of(&parts(&[("linear", TaskKind::Query, &linear)]));
    let times = &group.cells[0].times;
    let back: CellTimes = serde_json::from_value(json!(times)).unwrap();
    assert_eq!(&back, times);
    assert_eq!(back.by_process["query_ns"].len(), 12);
}
