//! How close to the physical limit, and how far ahead of other crates: the goals
//! of this project, each judged in one run against the fastest structure of
//! another crate whose answers are right, and against the bounds. Exits 3 if one
//! is missed. Where that is a stand-in for a crate, the fastest crate proper is
//! judged as well. Crates far behind the fastest in a heat are left out of a row, for
//! time. What is to be reached stands in `table`. Words after `--` choose rows by what
//! their names contain; `-- --test` only checks, on a thousand items, that every row
//! runs.

mod table;

use std::process::ExitCode;

use cullbench::culling::{Culling, CullingTest};
use cullbench::index::{
    FrustumQuery, Info, Input, Kind, Origin, RegionIndex, Registry, StructureSpec, Wide, caught,
};
use cullbench::measure::{
    BOUNDS, Group, GroupPlan, Machine, Metric, Protocol, ReportCell, SceneInfo, Status, Stopwatch,
    Subject, Workload, cameras_within, measure, median,
};
use cullbench::query::AnyVolume;
use cullbench::scene::Scene;
use cullbench::{path, scene};
use table::{
    ALL, LEAST_OF_TREES, MOST_BUILD_NS, MOST_BYTES, MOST_RANGES_US, TINY, TREES, WORLDS, Way, World,
};

/// Views per row in the heat, which comes before the row.
const HEAT_VIEWS: usize = 4;
/// Time of a crate / time of the fastest crate proper, in the heat, from which on
/// it is left out of the row: no noise makes up for that.
const FAR_BEHIND: f64 = 4.0;
/// The structure that is to meet the goals.
const SUBJECT: &str = Wide::INFO.name;

impl World {
    fn row(&self, way: &Way) -> String {
        let (name, rest) = way.path.split_once(':').unwrap_or((way.path, ""));
        let cache = if self.cold { "cold" } else { "warm" };
        format!("{}, {name}:frames={},{rest}", self.scene, self.frames)
            .trim_end_matches(',')
            .to_owned()
            + ", "
            + cache
    }

    fn path(&self, way: &Way) -> String {
        let (name, rest) = way.path.split_once(':').unwrap_or((way.path, ""));
        let frames = self.frames;
        match rest {
            "" => format!("{name}:frames={frames}"),
            rest => format!("{name}:frames={frames},{rest}"),
        }
    }
}

/// Counts of checked and of missed goals.
struct Judge {
    only_test: bool,
    missed: u32,
    judged: u32,
}

/// Which side of the goal is good.
#[derive(Clone, Copy, PartialEq)]
enum Goal {
    AtLeast(f64),
    AtMost(f64),
}

impl Judge {
    fn line(&mut self, what: &str, metric: &Metric, goal: Goal) {
        let holds = match goal {
            Goal::AtLeast(least) => metric.value >= least,
            Goal::AtMost(most) => metric.value <= most,
        };
        let verdict = match (self.only_test, holds) {
            (true, _) => "not judged",
            (false, true) => "ok",
            (false, false) => "MISSED",
        };
        self.judged += u32::from(!self.only_test);
        self.missed += u32::from(!self.only_test && !holds);
        let interval = match metric.lower.zip(metric.upper) {
            Some((lower, upper)) => format!(" [{lower:.2}, {upper:.2}]"),
            None => String::new(),
        };
        let wanted = match goal {
            Goal::AtLeast(LEAST_OF_TREES) => ">= 1/3".to_owned(),
            Goal::AtLeast(least) => format!(">= {least}"),
            Goal::AtMost(most) => format!("<= {most}"),
        };
        println!(
            "  {what}: {:.2}{interval}, goal {wanted}: {verdict}",
            metric.value
        );
    }
}

/// Time of `base` / time of `other`, without an interval: this is one process.
fn quotient(base: &ReportCell, other: &ReportCell) -> Option<Metric> {
    Some(Metric {
        value: query_ns(base)? / query_ns(other)?,
        lower: None,
        upper: None,
        unit: "1".to_owned(),
    })
}

/// Time per query of a structure; `None` if its answers are wrong.
fn query_ns(cell: &ReportCell) -> Option<f64> {
    let sound = cell.status == Status::Ok;
    let time = cell.metrics.get("query_ns").filter(|_| sound);
    time.map(|time| time.value)
}

fn subjects(names: &[&str], twin: &str, scene: &Scene) -> Vec<Subject> {
    let entered = names
        .iter()
        .map(|name| (*name, false))
        .chain([(twin, true)]);
    entered
        .map(|(name, is_twin)| {
            let spec = StructureSpec::parse(name).expect(name);
            Subject::build(spec, is_twin, scene, CullingTest::SixPlane)
        })
        .collect()
}

fn is_peer(info: &Info) -> bool {
    !info.origin.is_ours()
}

/// Not a crate, so no goal is set against it; its ratio is shown.
fn is_own_grid<Name>(kind: Kind, origin: &Origin<Name>) -> bool {
    origin.is_ours() && kind == Kind::Grid
}

/// Splits the subjects into those of the row and those left out.
///
/// Peers far behind the fastest crate over some of the views are left out. A subject
/// that fails stays, so that the row shows its failure.
fn heat(entered: Vec<Subject>, workload: &Workload) -> (Vec<Subject>, Vec<Subject>) {
    let step = workload.views.len().div_ceil(HEAT_VIEWS);
    let time = |subject: &Subject| {
        let built = subject.built.as_ref().ok()?;
        let mut ids = Vec::new();
        // The first lap makes the room.
        let mut lap = || {
            let watch = Stopwatch::start();
            for view in workload.views.iter().step_by(step) {
                ids.clear();
                built.items.query(view.as_any(), &mut ids);
            }
            watch.lap().cpu_ns
        };
        let laps = caught(|| [lap(), lap()]);
        laps.ok().map(|[_, second]| second)
    };
    let of_peers = |c: &Subject| is_peer(c.spec.info()).then(|| time(c)).flatten();
    let times: Vec<Option<f64>> = entered.iter().map(of_peers).collect();
    let timed = entered.iter().zip(&times);
    let of_crates = timed.filter(|(c, _)| matches!(c.spec.info().origin, Origin::Crate(_)));
    let fastest = of_crates
        .filter_map(|(_, time)| *time)
        .fold(f64::INFINITY, f64::min);
    let (mut stay, mut out) = (Vec::new(), Vec::new());
    for (subject, time) in entered.into_iter().zip(times) {
        match time.map(|time| time / fastest) {
            Some(times) if times > FAR_BEHIND => {
                println!(
                    "  {}: left out, {times:.0} x the fastest crate in the heat",
                    subject.spec.label
                );
                out.push(subject);
            }
            _ => stay.push(subject),
        }
    }
    (stay, out)
}

fn judge_row(judge: &mut Judge, world: &World, way: &Way, group: &Group) {
    let cell = |name: &str| group.cells.iter().find(|c| c.structure == name);
    let noise = group.twin.as_ref();
    let noise = noise.map_or(f64::NAN, |twin| (twin.ratio - 1.0).abs() * 100.0);
    println!("  {SUBJECT} entered twice differs by {noise:.1} %");
    for c in &group.cells {
        if c.status != Status::Ok {
            let reason = c.reason.as_deref().unwrap_or_default();
            println!("  {}: {}: {reason}", c.structure, c.status.name());
        }
    }
    let Some(own) = cell(SUBJECT) else { return };
    assert_eq!(own.status, Status::Ok, "{:?}", own.reason);
    let fastest = |among: fn(&Origin) -> bool| {
        let declared = |c: &&ReportCell| c.origin.as_ref().is_some_and(among);
        let timed = |c| Some((c, query_ns(c)?));
        let cells = group.cells.iter().filter(declared).filter_map(timed);
        cells.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(c, _)| c)
    };
    let (peer, proper) = (
        fastest(|origin| !origin.is_ours()),
        fastest(|origin| matches!(origin, Origin::Crate(_))),
    );
    let trees = TREES.map(|name| {
        let suited = world.ahead.contains(&name);
        (name, if suited { 1.0 } else { LEAST_OF_TREES })
    });
    let mut ahead = |peer: &ReportCell, name: &str, least: f64| {
        if let Some(times) = cell(name).and_then(|own| quotient(peer, own)) {
            let what = format!("{} / {name}", peer.structure);
            judge.line(&what, &times, Goal::AtLeast(least));
        }
    };
    if let Some(peer) = peer {
        ahead(peer, SUBJECT, way.peers);
        for (name, least) in trees {
            ahead(peer, name, least);
        }
    }
    if let Some(proper) =
        proper.filter(|proper| peer.is_some_and(|p| p.structure != proper.structure))
    {
        ahead(proper, SUBJECT, way.peers);
    }
    let is_grid = |c: &&ReportCell| {
        let declared = c.kind.zip(c.origin.as_ref());
        declared.is_some_and(|(kind, origin)| is_own_grid(kind, origin))
    };
    for grid in group.cells.iter().filter(is_grid) {
        if let Some(times) = quotient(grid, own) {
            let name = &grid.structure;
            println!("  {name} (no crate) / {SUBJECT}: {:.2}", times.value);
        }
    }
    if let Some((metric, most)) = way.bound
        && let Some(times) = own.metrics.get(metric)
    {
        judge.line(&format!("{SUBJECT}, {metric}"), times, Goal::AtMost(most));
    }
    // Where little is visible the scan does little but read.
    if way.path == TINY
        && let Some(times) = cell("linear").and_then(|c| c.metrics.get("times_read"))
    {
        judge.line("linear, times_read", times, Goal::AtMost(world.scan));
    }
}

/// Checks the goals that do not depend on the path: build time and memory.
fn judge_build(judge: &mut Judge, world: &World, subject: &Subject, items: usize) {
    let (Ok(built), false) = (&subject.built, world.cold) else {
        return;
    };
    let per_item = |sum: f64, unit: &str| Metric {
        value: sum / items as f64,
        lower: None,
        upper: None,
        unit: unit.to_owned(),
    };
    let name = &subject.spec.label;
    println!("{}", world.scene);
    let build = per_item(built.build_ms * 1e6, "ns");
    judge.line(
        &format!("{name}, build ns/item"),
        &build,
        Goal::AtMost(MOST_BUILD_NS),
    );
    let memory = per_item(built.memory.total() as f64, "bytes");
    judge.line(
        &format!("{name}, bytes/item"),
        &memory,
        Goal::AtMost(MOST_BYTES),
    );
}

/// Median time of `wide` answering in ranges, where everything is visible.
fn judge_ranges(judge: &mut Judge, workload: &Workload) {
    let tree =
        Wide::build(&Input::new(&workload.items), &Default::default()).expect("finite boxes");
    let mut ranges = Vec::new();
    let mut laps = Vec::new();
    for _ in 0..64 {
        let watch = Stopwatch::start();
        for view in &workload.views {
            if let AnyVolume::Planes(volume) = view.as_any() {
                ranges.clear();
                tree.visible_ranges(std::hint::black_box(volume), &mut ranges);
                std::hint::black_box(&ranges);
            }
        }
        laps.push(watch.lap().cpu_ns / 1e3 / workload.views.len() as f64);
    }
    let us = Metric {
        value: median(&laps).unwrap_or(f64::NAN),
        lower: None,
        upper: None,
        unit: "us".to_owned(),
    };
    judge.line(
        "wide, answer in ranges, us",
        &us,
        Goal::AtMost(MOST_RANGES_US),
    );
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let only_test = words.iter().any(|word| word == "--test");
    let wanted: Vec<&String> = words.iter().filter(|w| !w.starts_with('-')).collect();
    let chosen = |row: &str| wanted.is_empty() || wanted.iter().any(|w| row.contains(w.as_str()));
    let registry = Registry::builtin();
    let named = |is_one: fn(&Info) -> bool| -> Vec<&str> {
        let infos = registry.rows().iter().map(|row| row.info);
        infos.filter(is_one).map(|info| info.name).collect()
    };
    let peers = named(is_peer);
    if peers.is_empty() {
        println!("no structures of other crates (feature `peers`): judged against the bounds only");
    }
    let protocol = Protocol {
        rounds: if only_test { [1, 1] } else { [9, 25] },
        task_ns: 4e8,
        cameras: 0,
        cold: false,
        seed: 1,
        cache_bytes: Machine::capture().cache_sweep_bytes(),
    };
    let mut judge = Judge {
        only_test,
        missed: 0,
        judged: 0,
    };
    for world in &WORLDS {
        let ways = world.ways.iter().filter(|way| chosen(&world.row(way)));
        let ways: Vec<&Way> = ways.collect();
        if ways.is_empty() {
            continue;
        }
        let source = match (only_test, world.scene.split_once('=')) {
            (true, Some((family, _))) => format!("{family}=1000"),
            _ => world.scene.to_owned(),
        };
        let scene = scene::load(&source, &Default::default()).expect(world.scene);
        let mut names = vec!["linear", SUBJECT];
        if !peers.is_empty() {
            names.extend(TREES);
            names.extend(&peers);
            names.extend(named(|info| is_own_grid(info.kind, &info.origin)));
        }
        let mut subjects = subjects(&names, SUBJECT, &scene);
        judge_build(&mut judge, world, &subjects[1], scene.items.len());
        for way in ways {
            let source = world.path(way);
            let cameras = path::load(&source, &scene, &Default::default()).expect(way.path);
            let workload = Workload::new(&scene, &cameras, &Culling::default()).expect(way.path);
            let protocol = Protocol {
                cold: world.cold,
                cameras: match only_test {
                    true => 8,
                    false => cameras_within(4e8, scene.items.len()),
                },
                ..protocol
            };
            println!("{}", world.row(way));
            let (stay, out) = heat(subjects, &workload);
            let info = SceneInfo::of(&scene);
            let plan = GroupPlan {
                bounds: BOUNDS,
                ..GroupPlan::new(&workload, &info, protocol)
            };
            let group = Group::of(&[measure(&workload, &stay, plan).0]);
            judge_row(&mut judge, world, way, &group);
            subjects = stay.into_iter().chain(out).collect();
            if way.path == ALL && !world.cold {
                judge_ranges(&mut judge, &workload);
            }
        }
    }
    println!("{} judged, {} missed", judge.judged, judge.missed);
    ExitCode::from(if judge.missed > 0 { 3 } else { 0 })
}
