//! Floor of the sample truth: exact rays per second and thread.
//!
//! The rays meet boxes and triangles.

use std::hint::black_box;

use cullbench::measure::{Stopwatch, trimmed_mean};
use cullbench::visibility::truth::{RayIndex, SampleTruth, SurfaceIndex};
use cullbench::visibility::{Rays, SampleGrid, Solids, surfaces_of};

use super::{loaded, verdict};

const PATH: &str = "street:frames=32";
const SCENES: [&str; 10] = [
    "city:n=10000",
    "city:n=100000",
    "city:n=1000000",
    "forest:n=50000",
    "rooms:n=50000",
    "helsinki",
    "freedm-map12",
    "freedm-map20",
    "mesh:forest:n=100000",
    "mesh:statue:n=1000000",
];
const GRID: SampleGrid = SampleGrid::new(320, 180);
/// Rays a second, at least.
const LEAST_RATE: f64 = 1e6;

/// Judges every scene; how many floors are missed.
pub fn missed(only_test: bool, turns: usize) -> u32 {
    let missed_in = |source| missed_in(source, only_test, turns);
    SCENES.into_iter().map(missed_in).sum()
}

fn missed_in(source: &str, only_test: bool, turns: usize) -> u32 {
    let (typed, scene, cameras) = loaded(source, PATH, only_test);
    let solids = Solids::of(&scene);
    let views: Vec<Rays> = cameras
        .cameras
        .iter()
        .map(|camera| Rays::of(camera).expect("rays"))
        .collect();
    let see: Box<dyn Fn(&Rays) -> SampleTruth> = match surfaces_of(&scene) {
        Some(surfaces) => {
            let index = SurfaceIndex::build(&surfaces);
            Box::new(move |rays| {
                let truth =
                    SampleTruth::of_opaque(&index, &|_, _, _| true, rays, GRID, 1, u64::MAX);
                truth.expect("no limit")
            })
        }
        None => {
            let index = RayIndex::build(&solids);
            Box::new(move |rays| {
                let truth =
                    SampleTruth::of_opaque(&index, &|_, _, _| true, rays, GRID, 1, u64::MAX);
                truth.expect("no limit")
            })
        }
    };
    let rates = (0..(turns / 8).max(3)).map(|_| {
        let watch = Stopwatch::start();
        for rays in &views {
            black_box(see(rays));
        }
        (views.len() * GRID.samples()) as f64 / watch.lap().cpu_ns * 1e9
    });
    let rates: Vec<f64> = rates.collect();
    let rate = trimmed_mean(&rates).expect("turns");
    let (low, high) = rate.interval(0.95);
    let holds = only_test || high >= LEAST_RATE;
    println!(
        "{typed}: {:.2} million exact rays a second [{:.2}, {:.2}] on one thread, at least {}: {}",
        rate.mean / 1e6,
        low / 1e6,
        high / 1e6,
        LEAST_RATE / 1e6,
        verdict(only_test, holds)
    );
    u32::from(!holds)
}
