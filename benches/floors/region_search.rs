//! Overhead of exact region search over a search in f32, on a tiling.
//!
//! One structure is queried with f64 points and with the same points rounded to f32.

use std::hint::black_box;

use cullbench::index::Registry;
use cullbench::measure::Stopwatch;
use cullbench::query::ItemId;
use cullbench::scene::{self, Scene, SeededRng};
use glam::{DVec3, Vec3};

use super::{ratio, shortened, verdict};

const SCENE: &str = "rooms:n=1000000";
const STRUCTURES: &str = "bsp,octree,quadtree,bvh,wide,uniform-grid";
const POINTS: usize = 1 << 14;
/// Time of exact search / time in f32.
const MOST_TIMES: f64 = 1.25;

/// Random points in random regions, or within an f32 ulp of their faces.
fn points(scene: &Scene, beside_faces: bool) -> Vec<DVec3> {
    let boxes = scene.regions.boxes(&scene.items);
    let mut rng = SeededRng::new(18);
    let mut point = || {
        let region = boxes[rng.below(boxes.len())];
        let [low, high] = [region.min, region.max].map(Vec3::as_dvec3);
        let mut at = low + (high - low) * rng.point();
        if beside_faces {
            let (axis, side) = (rng.below(3), rng.below(2));
            let face = [region.min, region.max][side][axis];
            let ulp = f64::from(face.abs().next_up()) - f64::from(face.abs());
            at[axis] = f64::from(face) + rng.between(-1.0, 1.0) * ulp;
        }
        scene.origin + at
    };
    (0..POINTS).map(|_| point()).collect()
}

/// CPU time of asking for all points, ns.
fn lap(points: &[DVec3], ask: &dyn Fn(DVec3, &mut Vec<ItemId>)) -> f64 {
    let mut out = Vec::with_capacity(64);
    let watch = Stopwatch::start();
    for &p in points {
        out.clear();
        ask(p, &mut out);
        black_box(&out);
    }
    watch.lap().cpu_ns
}

/// Judges each structure on both kinds of points; how many are missed.
pub fn missed(only_test: bool, turns: usize) -> u32 {
    let source = shortened(SCENE, only_test);
    let scene = scene::load(&source, &Default::default()).expect(SCENE);
    let boxes = scene.regions.boxes(&scene.items);
    let asked = [("anywhere", false), ("beside faces", true)];
    let asked = asked.map(|(where_, beside_faces)| (where_, points(&scene, beside_faces)));
    let mut missed = 0;
    let specs = Registry::builtin().structures(STRUCTURES);
    for spec in specs.expect(STRUCTURES) {
        let index = spec.build(boxes).expect("a build");
        let in_f32 = |p: DVec3, out: &mut Vec<ItemId>| {
            index.locate((p - scene.origin).as_vec3(), out);
        };
        let exactly = |p: DVec3, out: &mut Vec<ItemId>| {
            scene.search(&scene.search_point(p), out, |p, out| index.locate(p, out));
        };
        for (where_, points) in &asked {
            let exact = || lap(points, &exactly);
            let [times, low, high] = ratio(turns, exact, || lap(points, &in_f32));
            let holds = only_test || times <= MOST_TIMES;
            missed += u32::from(!holds);
            println!(
                "{source}: {} finds the regions of points {where_} exactly in {times:.2} x \
                 [{low:.2}, {high:.2}] the time in f32, at most {MOST_TIMES} x: {}",
                spec.label,
                verdict(only_test, holds)
            );
        }
    }
    missed
}
