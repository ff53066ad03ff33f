//! Search and stored rows from an eye, compared with rays.

use super::super::*;
use super::follow;
use super::worlds::*;
use crate::scene::SeededRng;
use crate::visibility::Rays;

/// Regions that random rays of the camera pass.
fn sampled(graph: &RegionGraph, rays: &Rays, count: usize, rng: &mut SeededRng) -> Vec<u32> {
    let mut seen = IdSet::default();
    seen.clear(graph.len());
    for _ in 0..count {
        let ray = rays.through(rng.unit(), rng.unit());
        follow::boxes(graph, &ray, &mut seen);
    }
    let mut out = Vec::new();
    seen.list(&mut out);
    out
}

/// Number of regions on rays that are missing in the search's answers.
pub fn missing(graph: &RegionGraph, truth: &RegionGraph, eyes: usize, seed: u64) -> usize {
    let mut rng = SeededRng::new(seed);
    let (mut scratch, mut out) = (Scratch::default(), Vec::new());
    let mut missing = 0;
    for _ in 0..eyes {
        let rays = eye_in(truth, &mut rng);
        let seen = sampled(truth, &rays, 500, &mut rng);
        graph.seen_by(&rays, None, &mut scratch, &mut out);
        assert!(out.is_sorted());
        missing += seen
            .iter()
            .filter(|r| out.binary_search(r).is_err())
            .count();
    }
    missing
}

#[test]
fn a_stored_row_answers_what_is_stored() {
    let (_, graph) = rooms("rooms:n=1600,seed=1");
    let (mut rng, mut scratch, mut homes) = (SeededRng::new(8), Scratch::default(), Vec::new());
    let some = Pvs::of_pairs(graph.len(), |from, to| (from * 7 + to * 3) % 5 < 2);
    let pvs = some.unwrap();
    let [mut answer, mut wanted] = [Vec::new(), Vec::new()];
    for _ in 0..200 {
        let rays = eye_in(&graph, &mut rng);
        let inside = graph.seen_by(&rays, Some(&pvs), &mut scratch, &mut answer);
        assert_eq!(graph.homes(&rays, &mut homes), inside);
        let all = 0..graph.len() as u32;
        wanted.clear();
        wanted.extend(
            all.filter(|&to| !inside || homes.iter().any(|&from| pvs.row(from).contains(&to))),
        );
        assert_eq!(answer, wanted);
    }
}

const WORLDS: [&str; 4] = [
    "rooms:n=1600,seed=1",
    "rooms:n=700,seed=2,storeys=2",
    "rooms:n=3000,seed=3,storeys=8",
    "rooms:n=2000,seed=4,storeys=1,room=3",
];

#[test]
fn no_region_that_a_ray_passes_is_missed() {
    for world in WORLDS {
        let (_, graph) = rooms(world);
        assert_eq!(missing(&graph, &graph, 60, 9), 0, "{world}");
    }
}

#[test]
fn no_cube_that_a_ray_passes_is_missed() {
    let mut rng = SeededRng::new(17);
    for count in [[5, 1, 1], [4, 4, 1], [3, 3, 3], [2, 2, 4]] {
        let graph = cubes(count, &mut rng);
        assert_eq!(missing(&graph, &graph, 60, 9), 0, "{count:?}");
    }
}

#[test]
fn a_forgotten_opening_is_noticed() {
    let (_, graph) = rooms(WORLDS[0]);
    for opening in [0, 20, 33] {
        let wrong = without_opening(&graph, opening);
        assert!(missing(&wrong, &graph, 800, 9) > 0, "{opening}");
    }
}

#[test]
fn openings_with_a_thickness_are_seen_through() {
    use crate::geometry::Aabb;
    use crate::scene::{Portal, Tiling};
    use glam::{DVec3, Vec3};
    let b = |low: [f32; 3], high: [f32; 3]| Aabb::new(Vec3::from(low), Vec3::from(high));
    let tiling = Tiling {
        boxes: vec![
            b([0.0; 3], [3.0; 3]),
            b([3.0, 0.0, 0.0], [6.0, 3.0, 3.0]),
            b([6.0, 0.0, 0.0], [9.0, 3.0, 3.0]),
        ],
        portals: vec![
            Portal {
                between: [0, 1],
                opening: b([2.9, 1.0, 1.0], [3.1, 2.0, 2.0]),
            },
            Portal {
                between: [2, 1],
                opening: b([6.0, 1.0, 1.0], [6.0, 2.0, 2.0]),
            },
        ],
        ..Default::default()
    };
    let graph = RegionGraph::of_tiling(&tiling, DVec3::splat(1e3));
    let answer = |forward: DVec3| {
        let eye = DVec3::splat(1e3) + 1.5;
        let frame = crate::camera::Frame::looking_along(eye, forward, DVec3::Z).unwrap();
        let lens = crate::camera::Lens::perspective(60.0, 1.0, 0.1, None).unwrap();
        let rays = Rays::of(&crate::camera::Camera { frame, lens }).unwrap();
        let mut out = Vec::new();
        graph.seen_by(&rays, None, &mut Scratch::default(), &mut out);
        out.len()
    };
    assert_eq!(answer(DVec3::X), 3);
    assert_eq!(answer(DVec3::NEG_X), 1);
}
