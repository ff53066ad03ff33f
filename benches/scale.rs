//! How builds, memory and queries grow from ten thousand to ten million boxes,
//! and with `--huge` to a hundred million: build time and bytes an item, the
//! peak of resident memory, query times at five hundred visible items and at
//! 2 %, and the exponent e of N^e at the fixed count. Every number of ids is
//! compared with a scan. Words keep structures of these names and sizes of these
//! numbers; `-- --test` only checks that everything runs. Exits 3 if a goal of
//! `wide` is missed.

use std::process::ExitCode;
use std::time::Duration;

use cullbench::culling::Culling;
use cullbench::index::StructureSpec;
use cullbench::measure::{
    Machine, Protocol, Schedule, Stopwatch, Timed, TimedTask, Workload, cameras_within, median,
    slope, timed,
};
use cullbench::query::AnyVolume;
use cullbench::{path, scene};

/// Each with the largest number of items that it is built over.
const STRUCTURES: [(&str, usize); 6] = [
    ("wide", usize::MAX),
    ("wide:order=morton", usize::MAX),
    ("linear", usize::MAX),
    ("bvh", 10_000_000),
    ("bsp", 10_000_000),
    ("octree", 10_000_000),
];

/// Goals of the wide tree, on one thread and a quiet machine.
const MOST_BUILD_NS: f64 = 90.0;
const MOST_BYTES: f64 = 30.0;
const MOST_EXPONENT: f64 = 0.35;

/// Number of visible items, as in the suite `growth`.
const FIXED: usize = 500;

/// Builds are repeated this often, or until they have taken this long.
const BUILDS: usize = 7;
const BUILD_TIME: Duration = Duration::from_secs(4);

/// Peak of resident memory of this process so far, MiB, where the system says.
fn peak_mib() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM:"));
    let kib = line.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok());
    kib.unwrap_or(f64::NAN) / 1024.0
}

/// Starts a new peak, where the system can.
fn forget_peak() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// CPU time of a build, ns an item, median; the last one is kept.
fn built(
    name: &str,
    items: &[cullbench::geometry::Aabb],
    once: bool,
) -> (f64, Box<dyn cullbench::index::DynIndex>) {
    let spec = StructureSpec::parse(name).expect(name);
    let (mut times, mut index) = (Vec::new(), None);
    let mut left = BUILD_TIME.as_nanos() as f64;
    while times.is_empty() || (times.len() < BUILDS && left > 0.0 && !once) {
        // Never two at once.
        drop(index.take());
        let watch = Stopwatch::start();
        index = Some(spec.build(items).expect("finite items"));
        let lap = watch.lap();
        left -= lap.wall_ns;
        times.push(lap.cpu_ns / items.len() as f64);
    }
    let index = index.expect("built at least once");
    (median(&times).unwrap_or(f64::NAN), index)
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let has = |flag: &str| words.iter().any(|word| word == flag);
    let (only_test, huge) = (has("--test"), has("--huge"));
    let number = |word: &String| word.parse::<usize>().ok();
    let wanted_sizes: Vec<usize> = words.iter().filter_map(number).collect();
    let wanted: Vec<&String> = words
        .iter()
        .filter(|w| !w.starts_with('-') && number(w).is_none())
        .collect();
    let protocol = Protocol {
        rounds: if only_test { [1, 1] } else { [9, 45] },
        task_ns: 3e9,
        cameras: 0,
        cold: false,
        seed: 1,
        cache_bytes: Machine::capture().cache_sweep_bytes(),
    };
    let sizes: &[usize] = match (only_test, huge) {
        (true, _) => &[5_000, 10_000, 20_000],
        (_, true) => &[10_000, 100_000, 1_000_000, 10_000_000, 100_000_000],
        _ => &[10_000, 100_000, 1_000_000, 10_000_000],
    };
    println!(
        "| items | structure | build ns/item | bytes/item | peak MiB | visible | us | visible | us |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let mut logs = vec![Vec::new(); STRUCTURES.len()];
    let mut missed = Vec::new();
    for &n in sizes {
        if !wanted_sizes.is_empty() && !wanted_sizes.contains(&n) {
            continue;
        }
        forget_peak();
        let scene = scene::load(&format!("uniform:n={n}"), &Default::default()).expect("uniform");
        println!("| {n} | (the scene) | | 24.0 | {:.0} | | | | |", peak_mib());
        // Each view is a scan too.
        let frames = if n > 10_000_000 { 16 } else { 64 };
        let ways = [
            format!("flythrough:frames={frames},visible={FIXED}"),
            format!("flythrough:frames={frames},visible=2%"),
        ];
        let ways = ways.map(|way| path::load(&way, &scene, &Default::default()).expect("a path"));
        let workloads = ways
            .each_ref()
            .map(|way| Workload::new(&scene, way, &Culling::default()).expect("views within f32"));
        // The right numbers of ids, by the plainest loop there is.
        let seen = |view: AnyVolume| scene.items.iter().filter(|b| view.sees(b)).count() as u64;
        let expected = workloads.each_ref().map(|workload| -> Vec<u64> {
            workload
                .views
                .iter()
                .map(|view| seen(view.as_any()))
                .collect()
        });
        for (&(name, most), logs) in STRUCTURES.iter().zip(&mut logs) {
            let left_out = !wanted.is_empty() && !wanted.iter().any(|word| *word == name);
            if left_out || n > most {
                continue;
            }
            forget_peak();
            let (build_ns, index) = built(name, &scene.items, only_test);
            let (peak, bytes) = (peak_mib(), index.memory().total() as f64 / n as f64);
            let mut cells = String::new();
            for (which, workload) in workloads.iter().enumerate() {
                let task = TimedTask::new(expected[which].clone(), |place, out| {
                    index.query(workload.views[place].as_any(), out);
                });
                let protocol = Protocol {
                    cameras: if only_test { 8 } else { cameras_within(1e9, n) },
                    ..protocol
                };
                let tasks = [task];
                let schedule = Schedule::new(workload.views.len(), &tasks, &protocol);
                let mut timed = timed(&tasks, &schedule, &protocol, &|_| ());
                let timed: Timed = timed.remove(0).expect("as many ids as a scan finds");
                let ns = timed.ln_ns().map_or(f64::NAN, f64::exp);
                let count = expected[which].iter().sum::<u64>() / expected[which].len() as u64;
                cells += &format!(" {count} | {:.2} |", ns / 1e3);
                if which == 0 && n <= 10_000_000 {
                    logs.push(((n as f64).ln(), ns.ln()));
                }
            }
            println!("| {n} | {name} | {build_ns:.1} | {bytes:.1} | {peak:.0} |{cells}");
            if name == "wide" {
                if build_ns > MOST_BUILD_NS {
                    missed.push(format!(
                        "{n}: build {build_ns:.1} ns/item > {MOST_BUILD_NS}"
                    ));
                }
                if bytes > MOST_BYTES {
                    missed.push(format!("{n}: {bytes:.1} bytes/item > {MOST_BYTES}"));
                }
            }
        }
    }
    println!();
    for ((name, _), logs) in STRUCTURES.iter().zip(&logs) {
        let Some(exponent) = slope(logs) else {
            continue;
        };
        let value = exponent.value;
        let [lower, upper] = [exponent.lower, exponent.upper].map(|end| end.unwrap_or(f64::NAN));
        println!("{name}: N^{value:.3} [{lower:.3}, {upper:.3}] at {FIXED} visible items");
        if *name == "wide" && value > MOST_EXPONENT {
            missed.push(format!("exponent {value:.3} > {MOST_EXPONENT}"));
        }
    }
    if only_test {
        println!("not judged");
        return ExitCode::SUCCESS;
    }
    for goal in &missed {
        println!("MISSED: wide, {goal}");
    }
    ExitCode::from(if missed.is_empty() { 0 } else { 3 })
}
