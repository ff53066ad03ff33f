//! One thread against two, by wall time: the build of the wide tree, one query
//! split over a crew, and many cameras. Contenders are interleaved and paired
//! by the harness of `cullbench run`; one thread is entered twice, which is a
//! check. Beside it stands the same ratio of the caller's CPU time: what is
//! left to its own thread, also where no second core is free. Answers are compared
//! before anything is timed. A word keeps the rows that hold it, `--large` adds
//! ten million items, and `-- --test` only checks that every row runs.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::thread::scope;
use std::time::Instant;

use cullbench::culling::{CameraView, Culling};
use cullbench::geometry::Aabb;
use cullbench::index::{Crew, DynIndex, Wide, WideParams, see_each};
use cullbench::measure::{Ask, Competitor, Machine, Protocol, Timed, Workload, timed_rounds};
use cullbench::query::{AnyView, ItemId};
use cullbench::statistics::median;
use cullbench::{path, scene};

const THREADS: usize = 2;

/// From where a query is too short to all of a scene.
const PATHS: [&str; 6] = [
    "flythrough:frames=64,visible=0.1%",
    "flythrough:frames=64,visible=2%",
    "orbit:frames=64,visible=5%",
    "orbit:frames=64,visible=20%",
    "orbit:frames=64,visible=40%",
    "outside:frames=16",
];

/// Wall time and the caller's CPU time of every sample by round and frame.
fn times(timed: &Timed) -> BTreeMap<(u32, u32), [f64; 2]> {
    let samples = timed.samples.iter();
    samples
        .map(|s| ((s.round, s.frame), [s.wall_ns, s.cpu_ns]))
        .collect()
}

/// "one thread us, one / two, A/A, one / two of the caller's CPU time" of the
/// contenders one, its twin and two.
fn row(name: &str, timed: &[Timed]) {
    let [one, twin, two] = [0, 1, 2].map(|i| times(&timed[i]));
    let ratio = |other: &BTreeMap<(u32, u32), [f64; 2]>, clock: usize| {
        let pairs = one
            .iter()
            .filter_map(|(key, a)| Some(a[clock] / other.get(key)?[clock]));
        median(&pairs.collect::<Vec<_>>()).expect("at least one sample")
    };
    let (gain, again, freed) = (ratio(&two, 0), ratio(&twin, 0), ratio(&two, 1));
    let us = median(&one.values().map(|t| t[0]).collect::<Vec<_>>()).unwrap_or(f64::NAN) / 1e3;
    let cells = [gain, again, freed].map(|ratio| format!("{ratio:.2}"));
    println!("| {name} | {us:.1} | {} |", cells.join(" | "));
}

fn timed(count: usize, competitors: &[Competitor], protocol: &Protocol) -> Vec<Timed> {
    let timed = timed_rounds(count, competitors, protocol, &|| false).expect("not stopped");
    let sound = |t: Result<Timed, _>| t.expect("every answer has the expected length");
    timed.into_iter().map(sound).collect()
}

/// A build answers with the depth of its tree.
fn builds(name: &str, items: &[Aabb], protocol: &Protocol) {
    let build =
        |threads| Wide::build_on(threads, items, &WideParams::default()).expect("finite items");
    let (started, one) = (Instant::now(), build(1));
    let build_ns = started.elapsed().as_nanos() as f64;
    assert!(build(THREADS).same_as(&one), "{name}: not the same tree");
    let depth = one.depth() as u64;
    drop(one);
    let competitor = |threads| Competitor {
        ask: Box::new(move |_, out: &mut Vec<ItemId>| {
            out.extend(0..build(threads).depth() as ItemId);
        }) as Ask,
        ask_many: None,
        expected: vec![depth],
        least_ns: Some(build_ns),
    };
    let timed = timed(1, &[1, 1, THREADS].map(competitor), protocol);
    row(&format!("{name}, build"), &timed);
}

/// One query of every camera; `whole` answers as one thread does.
fn queries(name: &str, trees: &[Wide; 3], views: &[CameraView], protocol: &Protocol) {
    let (mut expected, mut total_ns) = (Vec::new(), 0.0);
    let (mut whole, mut split) = (Vec::new(), Vec::new());
    scope(|scope| {
        let mut crew = Crew::new(scope, &trees[2], THREADS);
        for view in views {
            whole.clear();
            split.clear();
            let started = Instant::now();
            trees[0].see(view.as_any(), &mut whole);
            total_ns += started.elapsed().as_nanos() as f64;
            crew.see(view.as_any(), &mut split);
            expected.push(whole.len() as u64);
            whole.sort_unstable();
            split.sort_unstable();
            assert!(whole == split, "{name}: another set on {THREADS} threads");
        }
        let crew = RefCell::new(crew);
        let asks: [Ask; 3] = [
            Box::new(|place, out| trees[0].see(views[place].as_any(), out)),
            Box::new(|place, out| trees[1].see(views[place].as_any(), out)),
            Box::new(|place, out| crew.borrow_mut().see(views[place].as_any(), out)),
        ];
        let competitors = asks.map(|ask| Competitor {
            ask,
            ask_many: None,
            expected: expected.clone(),
            // The same for all: samples are paired, so batches must be too.
            least_ns: Some(total_ns / views.len() as f64),
        });
        row(
            &format!("{name}, one query"),
            &timed(views.len(), &competitors, protocol),
        );
    });
    // All cameras at once answer with the length of every list.
    let views: Vec<AnyView> = views.iter().map(CameraView::as_any).collect();
    let all = expected.iter().map(|&length| length as ItemId);
    let all: Vec<ItemId> = all.collect();
    let competitor = |(tree, threads): (usize, usize)| {
        let (lists, views, all) = (RefCell::new(Vec::new()), &views, &all);
        Competitor {
            ask: Box::new(move |_, out: &mut Vec<ItemId>| {
                let mut lists = lists.borrow_mut();
                see_each(&trees[tree], views, threads, &mut lists);
                let right = lists
                    .iter()
                    .zip(all)
                    .filter(|(list, n)| list.len() == **n as usize);
                out.extend(right.map(|(_, &n)| n));
            }) as Ask,
            ask_many: None,
            expected: vec![views.len() as u64],
            least_ns: Some(total_ns),
        }
    };
    let competitors = [(0, 1), (1, 1), (2, THREADS)].map(competitor);
    row(
        &format!("{name}, {} cameras", views.len()),
        &timed(1, &competitors, protocol),
    );
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let only_test = words.iter().any(|word| word == "--test");
    let large = words.iter().any(|word| word == "--large");
    let wanted: Vec<&String> = words.iter().filter(|w| !w.starts_with('-')).collect();
    let protocol = Protocol {
        rounds: if only_test { [1, 1] } else { [9, 60] },
        task_ns: 1e9,
        cameras: if only_test { 8 } else { 64 },
        cold: false,
        seed: 1,
        cache_bytes: Machine::capture().cache_sweep_bytes(),
    };
    let mut sources = vec!["uniform:n=100000", "uniform:n=1000000", "city:n=1000000"];
    sources.extend(large.then_some("uniform:n=10000000"));
    println!("| | one thread, us | one / {THREADS} threads | A/A | the caller's CPU time |");
    println!("|---|---|---|---|---|");
    for source in sources {
        if !wanted.iter().all(|word| source.contains(word.as_str())) {
            continue;
        }
        let small = source.replace("000000", "00000").replace("100000", "70000");
        let source = if only_test { small.as_str() } else { source };
        let scene = scene::load(source, &Default::default()).expect(source);
        builds(source, &scene.items, &protocol);
        let build = || Wide::build_on(THREADS, &scene.items, &WideParams::default());
        let trees = [(); 3].map(|()| build().expect("finite items"));
        for way in PATHS {
            let cameras = path::load(way, &scene, &Default::default()).expect(way);
            let workload = Workload::new(&scene, &cameras, &Culling::default()).expect(way);
            queries(
                &format!("{source}, {way}"),
                &trees,
                &workload.views,
                &protocol,
            );
        }
    }
}
