//! Floors of the occlusion stage: time of the guarantee and per removed item.
//!
//! The guarantee is compared with the same buffer without one. Cameras are at street level.

use std::hint::black_box;

use cullbench::culling::Culling;
use cullbench::kernel::Kernel;
use cullbench::measure::{Stopwatch, Workload, trimmed_mean};
use cullbench::query::AnyVolume;
use cullbench::visibility::occlusion::{
    Interleaved, MaskedCentre, MaskedInner, OccluderTree, OcclusionBuffer, View,
};
use cullbench::visibility::{Rays, SampleGrid, Solids};

use super::{loaded, over_builds, ratio, verdict};

const PATH: &str = "street:frames=32";
const GRID: SampleGrid = SampleGrid::new(320, 180);
/// Time with the guarantee / time without, at most.
const MOST_TIMES: f64 = 1.05;
/// Number of builds of scene and buffers.
///
/// Their addresses change times by a few percent, as much as the difference measured.
const BUILDS: usize = 7;

/// Items of a scene, at most, for the floor of the guarantee.
///
/// In larger scenes most items are smaller than a pixel and none covers one; their ratio
/// is printed only.
const MOST_ITEMS: usize = 100_000;

/// Time per removed item, at most, by scene.
const REMOVED: [(&str, f64); 6] = [
    ("city:n=10000", 22.0),
    ("city:n=100000", 4.0),
    ("city:n=1000000", 1.5),
    ("forest:n=50000", 6.0),
    ("rooms:n=50000", 7.0),
    ("helsinki", 16.0),
];

/// Judges every scene; how many floors are missed.
pub fn missed(only_test: bool, turns: usize) -> u32 {
    let missed_in = |(source, most)| missed_in(source, most, only_test, turns);
    REMOVED.into_iter().map(missed_in).sum()
}

/// Time of all views of a pass.
fn timed<'v>(views: &'v [(View<'v>, usize)], mut cull: impl FnMut(&View)) -> f64 {
    let watch = Stopwatch::start();
    for (view, _) in views {
        cull(view);
    }
    watch.lap().cpu_ns
}

fn missed_in(source: &str, most_ns: f64, only_test: bool, turns: usize) -> u32 {
    let kernel = Kernel::best();
    let (typed, scene, cameras) = loaded(source, PATH, only_test);
    let workload = Workload::new(&scene, &cameras, &Culling::default()).expect("views");
    let occluders = OccluderTree::of(&Solids::of(&scene));
    let views = cameras.cameras.iter().zip(&workload.views);
    let views = views.map(|(camera, view)| {
        let AnyVolume::Planes(volume) = view.as_any() else {
            unreachable!("a perspective camera's default test")
        };
        let seen = scene.items.iter().filter(|b| volume.sees(b)).count();
        let rays = Rays::of(camera).expect("rays");
        (View::new(&rays, volume, &occluders, GRID), seen)
    });
    let views: Vec<(View, usize)> = views.collect();

    let mut kept = 0;
    let mut laps = Vec::new();
    // Kept, so that the next ones lie elsewhere.
    let mut earlier = Vec::new();
    let [times, low, high] = over_builds(if only_test { 3 } else { BUILDS }, |_| {
        let occluders = occluders.clone();
        let mut safe = Interleaved::new(MaskedInner::new(GRID), kernel);
        let mut unsafe_one = Interleaved::new(MaskedCentre::new(GRID), kernel);
        let (mut out, mut unsafe_out) = (Vec::new(), Vec::new());
        let by_safe = || {
            kept = 0;
            let ns = timed(&views, |view| {
                out.clear();
                safe.cull(&occluders, view, &mut out);
                kept += black_box(&out).len();
            });
            laps.push(ns);
            ns
        };
        let by_unsafe = || {
            timed(&views, |view| {
                unsafe_out.clear();
                unsafe_one.cull(&occluders, view, &mut unsafe_out);
                black_box(&unsafe_out);
            })
        };
        let [times, ..] = ratio(turns, by_safe, by_unsafe);
        earlier.push((occluders, safe, unsafe_one));
        times
    });
    let not_judged = only_test || scene.items.len() > MOST_ITEMS;
    let cheap = not_judged || times <= MOST_TIMES;
    println!(
        "{typed}: with the guarantee {times:.3} x [{low:.3}, {high:.3}] the time without, at most \
         {MOST_TIMES} x: {}",
        verdict(not_judged, cheap)
    );
    let missed = u32::from(!cheap);

    let candidates: usize = views.iter().map(|(_, seen)| seen).sum();
    let removed = (candidates - kept).max(1) as f64;
    let each: Vec<f64> = laps.iter().map(|ns| ns / removed).collect();
    let ns = trimmed_mean(&each).expect("turns");
    let (low, high) = ns.interval(0.95);
    let cheap = only_test || ns.mean <= most_ns;
    println!(
        "{typed}: {:.2} ns [{low:.2}, {high:.2}] per removed item of {:.0} in view, {:.1} left, at \
         most {most_ns} ns: {}",
        ns.mean,
        candidates as f64 / views.len() as f64,
        kept as f64 / views.len() as f64,
        verdict(only_test, cheap)
    );
    missed + u32::from(!cheap)
}
