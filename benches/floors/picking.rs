//! Floor of picking: finding the first item is no slower than with `obvhs`.
//!
//! Items are boxes and triangles.

use std::hint::black_box;

use cullbench::kernel::Kernel;
use cullbench::measure::Stopwatch;
use cullbench::visibility::pick::{BACK_ENDS, Pick};
use cullbench::visibility::truth::{Boxes, Facets};
use cullbench::visibility::{Ray, Rays, Solids, surfaces_of};

use super::{loaded, over_builds, ratio, verdict};

const PATH: &str = "street:frames=32";
const SCENES: [&str; 11] = [
    "city:n=10000",
    "city:n=100000",
    "forest:n=50000",
    "rooms:n=50000",
    "uniform:n=100000",
    "helsinki",
    "freedm-map12",
    "freedm-map20",
    "mesh:spheres:n=30000",
    "mesh:forest:n=100000",
    "mesh:statue:n=100000",
];
/// Cursors of a view, across and down.
const CURSORS: [u32; 2] = [16, 9];
/// How often both are built.
const BUILDS: usize = 9;
/// Time / time of obvhs, at most: more than that must not be proven.
const MOST_TIMES: f64 = 1.0;

/// Times every scene on every instruction set; returns how many floors are missed.
///
/// Only instruction sets with vectors have a floor.
pub fn missed(only_test: bool, turns: usize) -> u32 {
    let missed_in = |source| missed_in(source, only_test, turns);
    SCENES.into_iter().map(missed_in).sum()
}

fn missed_in(source: &str, only_test: bool, turns: usize) -> u32 {
    let (typed, scene, cameras) = loaded(source, PATH, only_test);
    let mut rays: Vec<Ray> = Vec::new();
    for camera in &cameras.cameras {
        let of_view = Rays::of(camera).expect("rays");
        let part = |at: u32, axis: usize| (f64::from(at) + 0.5) / f64::from(CURSORS[axis]);
        for row in 0..CURSORS[1] {
            let places = (0..CURSORS[0]).map(|column| (part(column, 0), part(row, 1)));
            rays.extend(places.map(|(x, y)| of_view.through(x, y)));
        }
    }
    let facets = surfaces_of(&scene);
    let facets = facets.map(|surfaces| Facets::solid(&surfaces, scene.items.len()));
    let boxes = Boxes::of(&Solids::of(&scene));
    let built = |name: &str, kernel: Kernel| -> Box<dyn Pick> {
        let row = BACK_ENDS.iter().find(|row| row.name == name).expect(name);
        let pick = match &facets {
            Some(facets) => (row.build.facets)(facets, kernel),
            None => (row.build.boxes)(&boxes, kernel),
        };
        pick.expect(name)
    };
    let time = |pick: &dyn Pick| {
        let watch = Stopwatch::start();
        for ray in &rays {
            black_box(pick.first(ray));
        }
        watch.lap().cpu_ns / rays.len() as f64
    };
    let mut missed = 0;
    // Kept, so that the next ones lie elsewhere.
    let mut earlier = Vec::new();
    for kernel in Kernel::available() {
        let mut ns = 0.0;
        let [times, low, high] = over_builds(if only_test { 3 } else { BUILDS }, |_| {
            let ours = built("wide-ray", kernel);
            let theirs = built("obvhs-cwbvh", Kernel::Portable);
            let by_ours = || {
                ns = time(&*ours);
                ns
            };
            let [times, ..] = ratio((turns / 4).max(3), by_ours, || time(&*theirs));
            earlier.push([ours, theirs]);
            times
        });
        let not_judged = only_test || kernel == Kernel::Portable;
        let holds = not_judged || low <= MOST_TIMES;
        missed += u32::from(!holds);
        println!(
            "{typed}, {kernel}: the first item in {times:.3} x [{low:.3}, {high:.3}] the time of obvhs \
             (last {ns:.0} ns), at most {MOST_TIMES} x: {}",
            verdict(not_judged, holds)
        );
    }
    missed
}
