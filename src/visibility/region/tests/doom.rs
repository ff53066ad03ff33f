//! Rows over the sectors of maps, with the REJECT table, compared with rays.

use std::sync::Arc;

use super::super::doom::DoomMap;
use super::super::*;
use super::follow;
use super::worlds::*;
use crate::scene::{Scene, SeededRng, load};

fn sample(scene: &Scene) -> (Arc<DoomMap>, RegionGraph) {
    let map = DoomMap::of_scene(scene).unwrap();
    let graph = map.graph().unwrap();
    (map, graph)
}

#[test]
fn no_row_misses_a_sector_that_a_ray_passes() {
    for name in ["freedm-map12", "freedm-map20"] {
        let scene = load(name, &Default::default()).unwrap();
        let (map, graph) = sample(&scene);
        let reject = map.reject().unwrap();
        let pairs = [None, Some(&reject)];
        let mut rng = SeededRng::new(8);
        let (mut scratch, mut out) = (Scratch::default(), Vec::new());
        let (mut sums, mut seen_sum) = ([0; 2], 0);
        for place in scene.places.iter().take(30) {
            let rays = looking(place.eye, &mut rng);
            let mut seen = IdSet::default();
            seen.clear(graph.len());
            for _ in 0..300 {
                let ray = rays.through(rng.unit(), rng.unit());
                follow::sectors(&map, &graph, &ray, &mut seen);
            }
            let mut truth = Vec::new();
            seen.list(&mut truth);
            seen_sum += truth.len();
            for (sum, pairs) in sums.iter_mut().zip(pairs) {
                graph.seen_by(&rays, pairs, &mut scratch, &mut out);
                let lost = truth
                    .iter()
                    .filter(|r| out.binary_search(r).is_err())
                    .count();
                assert_eq!(lost, 0, "{name} {pairs:?}");
                *sum += out.len();
            }
        }
        println!("{name} {sums:?}, {seen_sum} seen");
        // The search narrows the answer down, and rays see something.
        assert!(sums[0] < graph.len() * scene.places.len().min(30) && seen_sum > 60);
    }
}

#[test]
fn an_eye_at_a_wall_or_below_the_floor_is_nowhere() {
    let (map, graph) = sample(&load("freedm-map12", &Default::default()).unwrap());
    let wall = map.lines.iter().find(|l| l.sectors[1].is_none()).unwrap();
    let [from, to] = wall.ends.map(|[x, y]| glam::DVec2::new(x.into(), y.into()));
    let [floor, _] = map.sectors[wall.sectors[0].unwrap() as usize];
    let (middle, right) = ((from + to) * 0.5, -(to - from).perp().normalize());
    let mut rng = SeededRng::new(1);
    // The near window is some 0.1 wide; the right of a linedef is its front.
    for (away, height, place) in [
        (4.0, 41.0, true),
        (0.01, 41.0, false),
        (-4.0, 41.0, false),
        (4.0, -1.0, false),
    ] {
        let eye = (middle + right * away).extend(floor + height);
        let rays = looking(eye, &mut rng);
        let mut out = Vec::new();
        let answer = graph.seen_by(&rays, None, &mut Scratch::default(), &mut out);
        assert_eq!(answer, place, "{away} {height}");
    }
}
