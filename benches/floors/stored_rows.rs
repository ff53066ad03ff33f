//! Floor of a stored PVS: a query takes little more than reading the stored row.
//!
//! Also prints the time of finding the region of the eye.

use std::hint::black_box;

use cullbench::measure::Stopwatch;
use cullbench::visibility::Rays;
use cullbench::visibility::region::{Pvs, RegionGraph, RegionId, Scratch};

use super::{loaded, over_builds, ratio, verdict};

const PATH: &str = "street:frames=32";
const SCENE: &str = "rooms:n=50000";
/// Regions that are stored of each.
const SEEN: u32 = 32;
/// Number of builds of the stored rows.
const BUILDS: usize = 9;
/// Time of the answer / time of reading the row, at most: more must not be proven.
const MOST_TIMES: f64 = 1.5;
/// Passes over the views in a turn, as one takes a microsecond.
const PASSES: usize = 1000;

/// Returns 1 if the floor is missed, else 0.
pub fn missed(only_test: bool, turns: usize) -> u32 {
    let (typed, scene, cameras) = loaded(SCENE, PATH, only_test);
    let graph = RegionGraph::of_scene(&scene).expect("rooms");
    let near = |from: u32, to: u32| from.abs_diff(to) <= SEEN / 2;
    let stored = Pvs::of_pairs(graph.len(), near).expect("few regions");
    let eyes = cameras.cameras.iter().map(|c| Rays::of(c).expect("rays"));
    let eyes: Vec<Rays> = eyes.collect();
    let mut homes: Vec<RegionId> = Vec::new();
    for rays in &eyes {
        let mut of_eye = Vec::new();
        if graph.homes(rays, &mut of_eye) {
            homes.extend(of_eye);
        }
    }
    // The stored rows, one after the other.
    let rows = homes.iter().map(|home| stored.row(*home).to_vec());
    let rows: Vec<Vec<RegionId>> = rows.collect();

    let passes = if only_test { 1 } else { PASSES };
    let read_all = |row: &[RegionId]| {
        black_box(row.iter().fold(0, |all, region| all ^ region));
    };
    let time = |pass: &mut dyn FnMut()| {
        let watch = Stopwatch::start();
        for _ in 0..passes {
            pass();
        }
        watch.lap().cpu_ns / passes as f64
    };
    let mut answer_ns = 0.0;
    // Kept, so that the next ones lie elsewhere.
    let mut earlier: Vec<(Pvs, Vec<Vec<RegionId>>)> = Vec::new();
    let [times, low, high] = over_builds(if only_test { 3 } else { BUILDS }, |_| {
        let (stored, rows) = (stored.clone(), rows.clone());
        let own: &Pvs = black_box(&stored);
        let answer = || {
            answer_ns = time(&mut || {
                for home in &homes {
                    read_all(own.row(*home));
                }
            });
            answer_ns
        };
        let read = || {
            time(&mut || {
                for row in black_box(&rows) {
                    read_all(row);
                }
            })
        };
        let [times, ..] = ratio((turns / 4).max(3), answer, read);
        earlier.push((stored, rows));
        times
    });
    let pvs = black_box(&stored);
    let (mut scratch, mut out) = (Scratch::default(), Vec::new());
    let from_eye = time(&mut || {
        for rays in &eyes {
            black_box(graph.seen_by(rays, Some(pvs), &mut scratch, &mut out));
        }
    });
    let holds = only_test || low <= MOST_TIMES;
    println!(
        "{typed}: a stored row is answered and read in {times:.2} x [{low:.2}, {high:.2}] the time of reading it alone \
         ({:.1} ns), at most {MOST_TIMES} x: {}; from an eye, whose region has to be found, in {:.0} ns",
        answer_ns / homes.len() as f64,
        verdict(only_test, holds),
        from_eye / eyes.len() as f64
    );
    u32::from(!holds)
}
