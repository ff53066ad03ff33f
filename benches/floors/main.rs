//! The speed floors this project promises, each a ratio in one run: all
//! subjects of a row are interleaved and paired by the same harness as
//! `cullbench run`. Before them, that harness beside a loop written by hand, the floors
//! of the stages of visibility, and region search beside itself in f32 alone. Exits 3 if
//! a floor is missed. Words after `--` choose by name what runs: `harness`, `occlusion`,
//! `hidden`, `stored-rows`, `truth`, `region-search`, or rows with the word in their scene
//! or structure. `-- --test` only checks that every row runs.

mod hidden;
mod occlusion;
mod region_search;
mod stored_rows;
mod truth;

use std::process::ExitCode;

use cullbench::culling::{Culling, CullingTest};
use cullbench::index::Registry;
use cullbench::measure::{
    Group, GroupPlan, Machine, Protocol, ReportCell, SceneInfo, Schedule, Status, Stopwatch,
    Subject, TimedTask, Workload, measure, timed, trimmed_mean,
};
use cullbench::path::{self, CameraPath};
use cullbench::scene::{self, Scene};

/// `structure` must be at least `floor` times as fast as the textbook loop.
struct Floor {
    scene: &'static str,
    path: &'static str,
    structure: &'static str,
    floor: f64,
}

const FLOORS: [Floor; 8] = [
    Floor {
        scene: "uniform:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "bvh",
        floor: 20.0,
    },
    Floor {
        scene: "uniform:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "bsp",
        floor: 20.0,
    },
    Floor {
        scene: "uniform:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "octree",
        floor: 20.0,
    },
    Floor {
        scene: "city:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "bvh",
        floor: 20.0,
    },
    Floor {
        scene: "city:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "bsp",
        floor: 20.0,
    },
    Floor {
        scene: "city:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "octree",
        floor: 20.0,
    },
    Floor {
        scene: "city:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "quadtree",
        floor: 20.0,
    },
    Floor {
        scene: "clustered:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "bvh",
        floor: 20.0,
    },
];

/// Structure to whose time every floor is a ratio.
const YARDSTICK: &str = "linear-scalar";

/// Share of a query's time that the harness may add.
const MOST_OVERHEAD: f64 = 0.01;
/// Passes of the harness and of the loop, in turns.
const TURNS: usize = 41;

/// Compares the harness with a plain loop over the same cameras.
///
/// Returns the number of structures for which the ratio of times is significantly above
/// 1 + [`MOST_OVERHEAD`]. Structures have short and long queries.
fn harness_overhead(only_test: bool, turns: usize) -> u32 {
    let (_, scene, cameras) = loaded("city:n=20000", "flythrough:frames=512,visible=2%", false);
    let workload = Workload::new(&scene, &cameras, &Culling::default()).expect("views");
    let protocol = Protocol {
        rounds: [4, 4],
        task_ns: 1e6,
        cameras: 512,
        cold: false,
        seed: 1,
        cache_bytes: 0,
    };
    let mut missed = 0;
    for spec in Registry::builtin()
        .structures("wide,bvh,linear")
        .expect("structures")
    {
        let index = spec.build(&scene.items).expect("a build");
        let see =
            |camera: usize, out: &mut Vec<_>| index.query(workload.views[camera].as_any(), out);
        let mut out = Vec::new();
        let expected: Vec<u64> = (0..workload.views.len())
            .map(|camera| {
                out.clear();
                see(camera, &mut out);
                out.len() as u64
            })
            .collect();
        let tasks = [TimedTask {
            all_threads: false,
            ask: Box::new(see),
            ask_many: None,
            expected,
            least_ns: Some(100.0),
        }];
        let schedule = Schedule::new(workload.views.len(), &tasks, &protocol);
        let by_harness = || {
            let passes = timed(&tasks, &schedule, &protocol, &|_| ());
            passes[0]
                .as_ref()
                .expect("right answers")
                .ln_ns()
                .expect("rounds")
                .exp()
        };
        let by_hand = || {
            // A list of its own, grown before the clock starts, as in the harness.
            let mut out = Vec::new();
            for &camera in &schedule.cameras {
                out.clear();
                see(camera as usize, &mut out);
            }
            let queries = schedule.rounds as usize * schedule.cameras.len();
            let watch = Stopwatch::start();
            for _ in 0..schedule.rounds {
                for &camera in &schedule.cameras {
                    out.clear();
                    see(camera as usize, &mut out);
                    std::hint::black_box(&out);
                }
            }
            watch.lap().cpu_ns / queries as f64
        };
        let [added, low, high] = ratio(turns, by_harness, by_hand).map(|times| times - 1.0);
        let holds = only_test || low <= MOST_OVERHEAD;
        missed += u32::from(!holds);
        println!(
            "harness: {} takes {:+.2} % [{:+.2}, {:+.2}] beside a loop by hand, at most {:.0} %: {}",
            spec.label,
            100.0 * added,
            100.0 * low,
            100.0 * high,
            100.0 * MOST_OVERHEAD,
            verdict(only_test, holds)
        );
    }
    missed
}

/// Checks some floors, given `only_test` and `turns`; returns how many are missed.
type Part = fn(bool, usize) -> u32;

/// Time of one task / time of another, from turns of both: the mean of the ratios'
/// logarithms as a ratio, with its interval.
fn ratio(turns: usize, mut one: impl FnMut() -> f64, mut other: impl FnMut() -> f64) -> [f64; 3] {
    let ratios = (0..turns).map(|turn| match turn % 2 {
        0 => (one() / other()).ln(),
        _ => -(other() / one()).ln(),
    });
    as_ratio(&ratios.collect::<Vec<_>>())
}

/// Mean ratio over pairs of builds, with its interval.
///
/// Each pair is built again, since addresses in memory change times by some percent.
fn over_builds(builds: usize, of_one: impl FnMut(usize) -> f64) -> [f64; 3] {
    as_ratio(&(0..builds).map(of_one).map(f64::ln).collect::<Vec<_>>())
}

/// The mean of logarithms as a ratio, with its interval.
fn as_ratio(logs: &[f64]) -> [f64; 3] {
    let found = trimmed_mean(logs).expect("logarithms");
    let (low, high) = found.interval(0.95);
    [found.mean, low, high].map(f64::exp)
}

/// A scene, or a small one like it where nothing is timed.
fn shortened(source: &str, only_test: bool) -> String {
    let (kind, count) = source.split_once(":n=").unwrap_or((source, ""));
    match only_test && !count.is_empty() {
        true => format!("{kind}:n=1000"),
        false => source.to_owned(),
    }
}

/// Name of a scene, the scene, and a path through it; see [`shortened`].
fn loaded(source: &str, path: &str, only_test: bool) -> (String, Scene, CameraPath) {
    let source = shortened(source, only_test);
    let scene = scene::load(&source, &Default::default()).expect(&source);
    let cameras = path::load(path, &scene, &Default::default()).expect(path);
    (source, scene, cameras)
}

fn verdict(only_test: bool, holds: bool) -> &'static str {
    match (only_test, holds) {
        (true, _) => "not judged",
        (false, true) => "ok",
        (false, false) => "MISSED",
    }
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let only_test = words.iter().any(|word| word == "--test");
    let wanted: Vec<&String> = words.iter().filter(|w| !w.starts_with('-')).collect();
    let chosen = |name: &str| wanted.is_empty() || wanted.iter().any(|w| name.contains(w.as_str()));
    let protocol = Protocol {
        rounds: if only_test { [1, 1] } else { [9, 25] },
        task_ns: 3e9,
        cameras: if only_test { 8 } else { 64 },
        cold: false,
        seed: 1,
        cache_bytes: Machine::capture().cache_sweep_bytes(),
    };
    let turns = if only_test { 3 } else { TURNS };
    let mut missed = 0;
    let parts: [(&str, Part); 6] = [
        ("harness", harness_overhead),
        ("occlusion", occlusion::missed),
        ("hidden", hidden::missed),
        ("stored-rows", stored_rows::missed),
        ("truth", truth::missed),
        ("region-search", region_search::missed),
    ];
    for (_, part) in parts.iter().filter(|(name, _)| chosen(name)) {
        missed += part(only_test, turns);
    }
    for row in FLOORS
        .iter()
        .filter(|row| chosen(row.scene) || chosen(row.structure))
    {
        let (source, scene, cameras) = loaded(row.scene, row.path, only_test);
        let workload = Workload::new(&scene, &cameras, &Culling::default()).expect(row.path);
        let specs = Registry::builtin()
            .structures(&format!("{YARDSTICK},{}", row.structure))
            .expect(row.structure);
        let twin = specs[1].clone();
        let mut subjects: Vec<Subject> = specs
            .into_iter()
            .map(|spec| Subject::build(spec, false, &scene, CullingTest::SixPlane))
            .collect();
        subjects.push(Subject::build(twin, true, &scene, CullingTest::SixPlane));
        let info = SceneInfo::of(&scene);
        let plan = GroupPlan::new(&workload, &info, protocol);
        let group = Group::of(&[measure(&workload, &subjects, plan).0]);
        let query_ns = |cell: &ReportCell| {
            assert_eq!(cell.status, Status::Ok, "{:?}", cell.reason);
            cell.metrics["query_ns"].value
        };
        let ratio = query_ns(&group.cells[0]) / query_ns(&group.cells[1]);
        let noise = group
            .twin
            .map_or(f64::NAN, |twin| (twin.ratio - 1.0).abs() * 100.0);
        let holds = only_test || ratio >= row.floor;
        missed += u32::from(!holds);
        println!(
            "{source}, {}: {} {ratio:.1} x {YARDSTICK}, floor {} x, twin differs by {noise:.1} %: {}",
            row.path,
            row.structure,
            row.floor,
            verdict(only_test, holds)
        );
    }
    ExitCode::from(if missed > 0 { 3 } else { 0 })
}
