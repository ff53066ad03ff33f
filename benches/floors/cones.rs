//! Floor of cones: how much faster they are than the test of meshoptimizer.
//!
//! `cones` tests sixteen clusters at a time, with a margin for rounding. The documented
//! test of meshoptimizer, one cone at a time, is measured as a stand-in, and as the crate
//! itself with feature `peers`.

use std::hint::black_box;
use std::sync::Arc;

use cullbench::kernel::Kernel;
use cullbench::measure::Stopwatch;
use cullbench::visibility::surfaces_of;
use cullbench::visibility::triangle::{
    Clusters, Counts, Eye, MOST_TRIANGLES, Selection, TRIANGLE_ROWS, TriangleCull, facing,
};

use super::{loaded, over_builds, ratio, verdict};

const PATH: &str = "street:frames=32";
const SCENES: [&str; 5] = [
    "mesh:spheres:n=100000",
    "mesh:terrain:n=200000",
    "mesh:forest:n=200000",
    "mesh:statue:n=100000",
    "mesh:statue:n=1000000",
];
const OURS: &str = "cone-f32-safe";
/// Those of these that the features have.
const THEIRS: [&str; 2] = ["cone-f32", "meshopt"];
/// How often both are built.
const BUILDS: usize = 5;
/// Time of theirs / time of ours, at least: less must not be proven.
const LEAST_AHEAD: f64 = 4.0;

/// Times every scene on every instruction set; returns how many floors are missed.
///
/// Only instruction sets with vectors have a floor.
pub fn missed(only_test: bool, turns: usize) -> u32 {
    let missed_in = |source| missed_in(source, only_test, turns);
    SCENES.into_iter().map(missed_in).sum()
}

fn missed_in(source: &str, only_test: bool, turns: usize) -> u32 {
    let (typed, scene, cameras) = loaded(source, PATH, only_test);
    let surfaces = surfaces_of(&scene).expect("triangles");
    let clusters = Arc::new(Clusters::of(surfaces, MOST_TRIANGLES));
    let cameras = cameras.cameras.iter();
    let eyes: Vec<Eye> = cameras.map(|c| Eye::of(c, scene.origin)).collect();
    let all = Selection::all(&clusters);
    let built = |name: &str| {
        let row = TRIANGLE_ROWS.iter().find(|row| row.name == name);
        row.map(|row| (row.build)(&clusters))
    };

    let ours = built(OURS).expect(OURS);
    let lost = eyes.iter().map(|eye| {
        let mut kept = all.clone();
        ours.cull(eye, Kernel::best(), &mut kept);
        let truth = facing(&clusters, eye, &all);
        Counts::of(&all, &kept, &truth).false_negatives
    });
    let lost: usize = lost.sum();

    let mut missed = 0;
    let tests = (eyes.len() * clusters.len()) as f64;
    // Kept, so that the next ones lie elsewhere.
    let mut earlier = Vec::new();
    for kernel in Kernel::available() {
        for theirs in THEIRS.into_iter().filter(|name| built(name).is_some()) {
            let mut ns = 0.0;
            let [ahead, low, high] = over_builds(if only_test { 3 } else { BUILDS }, |_| {
                let pair = [OURS, theirs].map(|name| built(name).expect(name));
                // What was taken away once is taken away again, in the same time.
                let mut kept = [all.clone(), all.clone()];
                let [of_ours, of_theirs] = &mut kept;
                let time = |cull: &dyn TriangleCull, kept: &mut Selection| {
                    let watch = Stopwatch::start();
                    for eye in &eyes {
                        cull.cull(eye, kernel, black_box(kept));
                    }
                    watch.lap().cpu_ns / tests
                };
                let by_ours = || {
                    ns = time(&*pair[0], of_ours);
                    ns
                };
                let by_theirs = || time(&*pair[1], of_theirs);
                let [ahead, ..] = ratio((turns / 4).max(3), by_theirs, by_ours);
                earlier.push((pair, kept));
                ahead
            });
            // Whatever is not timed: nothing may be lost.
            let not_judged = lost == 0 && (only_test || kernel == Kernel::Portable);
            let holds = not_judged || lost == 0 && high >= LEAST_AHEAD;
            missed += u32::from(!holds);
            println!(
                "{typed}, {kernel}: {OURS} is {ahead:.2} x [{low:.2}, {high:.2}] as fast as {theirs} \
                 (last {ns:.2} ns a cluster), at least {LEAST_AHEAD} x, {lost} triangles lost: {}",
                verdict(not_judged, holds)
            );
        }
    }
    missed
}
