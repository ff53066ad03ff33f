//! Generated scenes, seen from street level.

use glam::{DVec3, Vec3};

use super::super::{Interleaved, MaskedCentre, MaskedInner, OcclusionBuffer};
use super::by_rays::{Ready, missing, seen_by_rays, with_view};
use super::{case_count, kept};
use crate::camera::{Camera, Frame, Lens};
use crate::kernel::Kernel;
use crate::scene::{LoadOptions, SeededRng, load};
use crate::visibility::SampleGrid;
use crate::visibility::truth::{RayIndex, visible_by_random_rays};

const GRID: SampleGrid = SampleGrid::new(160, 90);

/// Cameras 1.7 above the lowest point, outside of all boxes, in random directions.
pub fn cameras(ready: &Ready, count: usize) -> Vec<Camera> {
    let mut rng = SeededRng::new(11);
    let world = ready.scene.world_bounds();
    let mut cameras = Vec::new();
    while cameras.len() < count {
        let (low, high) = (world.min * 0.8, world.max * 0.8);
        let mut eye = low + (high - low) * rng.point();
        eye.z = world.min.z + 1.7;
        let local = (eye - ready.scene.origin).as_vec3();
        let reach = Vec3::splat(0.3);
        let near = |b: &crate::geometry::Aabb| {
            (b.min - reach).cmple(local).all() && local.cmple(b.max + reach).all()
        };
        let angle = rng.unit() * std::f64::consts::TAU;
        if ready.scene.items.iter().any(near) {
            continue;
        }
        let forward = DVec3::new(libm::cos(angle), libm::sin(angle), 0.0);
        let frame = Frame::looking_along(eye, forward, DVec3::Z).unwrap();
        let lens = Lens::perspective(60.0, 16.0 / 9.0, 0.1, None).unwrap();
        cameras.push(Camera { frame, lens });
    }
    cameras
}

pub fn ready(spec: &str) -> Ready {
    Ready::of(load(spec, &LoadOptions::default()).unwrap())
}

const SCENES: [&str; 3] = ["city:n=3000", "rooms:n=3000", "forest:n=3000"];

fn lost<B: OcclusionBuffer>(spec: &str) -> (usize, usize, usize) {
    let ready = ready(spec);
    let mut rng = SeededRng::new(5);
    let (mut lost, mut hidden, mut removed) = (0, 0, 0);
    for camera in cameras(&ready, 4) {
        with_view(&ready, &camera, GRID, |view, rays| {
            let seen = seen_by_rays(rays, &ready.solids.boxes, 3000, &mut rng);
            let in_view = ready.in_view(view.volume);
            hidden += in_view.len() - seen.len();
            for kept in kept::<B>(&ready, view, Kernel::best()) {
                assert!(missing(&kept, &in_view).is_empty());
                lost += missing(&seen, &kept).len();
                removed += in_view.len() - kept.len();
            }
        });
    }
    (lost, hidden, removed / 2)
}

#[test]
fn streets_lose_nothing_and_most_of_what_is_hidden_is_removed() {
    for (spec, least) in SCENES.into_iter().zip([0.9, 0.95, 0.0]) {
        let (lost, hidden, removed) = lost::<MaskedInner>(spec);
        assert_eq!(lost, 0, "{spec}");
        let share = removed as f64 / hidden as f64;
        assert!(share > least, "{spec}: {share}");
    }
}

#[test]
fn every_instruction_set_gives_the_same_answer() {
    for spec in SCENES {
        let ready = ready(spec);
        for (n, mut camera) in cameras(&ready, 3).into_iter().enumerate() {
            if n == 0 {
                camera.lens = Lens::orthographic(60.0, 1.6, 0.0, 2000.0).unwrap();
            }
            with_view(&ready, &camera, GRID, |view, _| {
                let plain = kept::<MaskedInner>(&ready, view, Kernel::Portable);
                let centres = kept::<MaskedCentre>(&ready, view, Kernel::Portable);
                for kernel in Kernel::available() {
                    assert_eq!(kept::<MaskedInner>(&ready, view, kernel), plain, "{kernel}");
                    assert_eq!(
                        kept::<MaskedCentre>(&ready, view, kernel),
                        centres,
                        "{kernel}"
                    );
                }
            });
        }
    }
}

/// Counts of six views.
///
/// The numbers of tested, drawn and kept boxes depend only on the order of the traversal: a faster
/// traversal has the same counts.
#[test]
fn the_walk_tests_draws_and_keeps_pinned_numbers_of_boxes() {
    let pinned = [[2067, 202, 398], [1160, 214, 183], [6003, 2535, 3529]];
    for (spec, pinned) in SCENES.into_iter().zip(pinned) {
        let ready = ready(spec);
        for kernel in Kernel::available() {
            let mut walk = Interleaved::new(MaskedInner::new(GRID), kernel);
            let mut total = [0; 3];
            for camera in cameras(&ready, 6) {
                with_view(&ready, &camera, GRID, |view, _| {
                    let mut kept = Vec::new();
                    let stats = walk.cull(&ready.occluders, view, &mut kept);
                    for (total, count) in
                        total.iter_mut().zip([stats.boxes, stats.drawn, kept.len()])
                    {
                        *total += count;
                    }
                });
            }
            assert_eq!(total, pinned, "{spec} {kernel}");
        }
    }
}

/// Runs for minutes over `OCCLUSION_RAYS` rays between the samples.
#[test]
#[ignore = "minutes"]
fn streets_lose_nothing_along_many_more_rays() {
    let scenes = ["city:n=10k", "city:n=100k", "rooms:n=50k", "forest:n=50k"];
    let (views, threads) = (8, 2);
    let rays_each = case_count("OCCLUSION_RAYS", 100_000_000) / (scenes.len() * views);
    for spec in scenes {
        let ready = ready(spec);
        let index = RayIndex::build(&ready.solids);
        let (mut seen_by_all, mut removed) = (0, 0);
        for (number, camera) in cameras(&ready, views).into_iter().enumerate() {
            let grid = [GRID, SampleGrid::new(320, 180)][number % 2];
            with_view(&ready, &camera, grid, |view, rays| {
                let seed = number as u64;
                let seen = visible_by_random_rays(&index, rays, rays_each, seed, threads);
                let in_view = ready.in_view(view.volume).len();
                seen_by_all += seen.len();
                for kept in kept::<MaskedInner>(&ready, view, Kernel::best()) {
                    removed += in_view - kept.len();
                    assert!(missing(&seen, &kept).is_empty(), "{spec}, view {number}");
                }
            });
        }
        println!("{spec}: {seen_by_all} seen along {rays_each} rays a view, {removed} removed");
    }
}
