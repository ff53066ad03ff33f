//! Thousands of small random worlds: no item that a ray sees may be missing.

use glam::DVec3;

use super::super::{MaskedCentre, MaskedInner, NoOcclusion, OcclusionBuffer, ZBuffer};
use super::by_rays::{Ready, missing, point_between, seen_by_rays, with_view};
use super::{case_count, kept};
use crate::camera::{Camera, Frame, Lens};
use crate::kernel::Kernel;
use crate::scene::{Scene, SeededRng, WorldBox};
use crate::visibility::SampleGrid;

/// Boxes of any shape, 4 to 43 and some duplicates.
///
/// Half of the worlds are on an integer grid, so that faces coincide; in half of them boxes stand
/// on a floor.
fn world(rng: &mut SeededRng, far_out: f64) -> Vec<WorldBox> {
    let count = 4 + rng.below(40);
    let whole = rng.below(2) == 0;
    let standing = rng.below(2) == 0;
    let flat = rng.below(4) == 0;
    let centre = DVec3::new(far_out, -far_out, 0.0);
    let mut boxes = Vec::new();
    for _ in 0..count {
        let mut low = point_between(DVec3::splat(-10.0), DVec3::splat(10.0), rng);
        let largest = if rng.below(2) == 0 { 12.0 } else { 1.5 };
        let mut size = rng.point() * largest;
        if flat {
            size[rng.below(3)] = 0.0;
        }
        if whole {
            (low, size) = (low.round(), size.round());
        }
        if standing && rng.below(3) > 0 {
            low.z = -10.0;
        }
        boxes.push(WorldBox::new(low + centre, low + size + centre));
        if rng.below(8) == 0 {
            boxes.push(boxes[boxes.len() - 1]);
        }
    }
    boxes
}

/// A camera around the boxes; half of the eyes are within their bounds.
fn camera(rng: &mut SeededRng, far_out: f64, parallel: bool) -> Camera {
    let reach = if rng.below(2) == 0 { 9.0 } else { 25.0 };
    let mut eye = point_between(DVec3::splat(-reach), DVec3::splat(reach), rng);
    let mut forward = point_between(DVec3::splat(-6.0), DVec3::splat(6.0), rng) - eye;
    if rng.below(3) == 0 {
        // Along an axis, from integer coordinates.
        (eye, forward) = (eye.round(), [DVec3::X, DVec3::Y, -DVec3::Z][rng.below(3)]);
    }
    if rng.below(3) == 0 {
        forward.z = 0.0;
    }
    if forward.length() < 1e-3 {
        forward = DVec3::X;
    }
    let up = if forward.x == 0.0 && forward.y == 0.0 {
        DVec3::Y
    } else {
        DVec3::Z
    };
    let eye = eye + DVec3::new(far_out, -far_out, 0.0);
    let frame = Frame::looking_along(eye, forward, up).unwrap();
    let near = [0.01, 0.5, 2.0][rng.below(3)];
    let far = [None, Some(30.0), Some(1000.0)][rng.below(3)];
    let lens = if parallel {
        let near = [-20.0, 0.0, 3.0][rng.below(3)];
        Lens::orthographic(rng.between(2.0, 30.0), 1.6, near, 60.0).unwrap()
    } else if rng.below(3) == 0 {
        let side = |low: f64, rng: &mut SeededRng| near * (low + rng.unit());
        let (left, bottom) = (side(-1.5, rng), side(-1.5, rng));
        let window = [left, left + near * 1.2, bottom, bottom + near];
        Lens::off_axis(window, near, far).unwrap()
    } else {
        Lens::perspective(rng.between(20.0, 130.0), 1.6, near, far).unwrap()
    };
    Camera { frame, lens }
}

/// Numbers of items seen by rays that are missing, and of removed items.
fn losses<B: OcclusionBuffer>(
    worlds: std::ops::Range<u64>,
    far_out: f64,
    parallel: bool,
) -> (usize, usize) {
    let (mut lost, mut removed) = (0, 0);
    for seed in worlds {
        let mut rng = SeededRng::new(seed);
        let boxes = world(&mut rng, far_out);
        let ready = Ready::of(Scene::from_boxes("world", &boxes).unwrap());
        let camera = camera(&mut rng, far_out, parallel);
        let grid = [(16, 10), (40, 25), (64, 40)][rng.below(3)];
        let grid = SampleGrid::new(grid.0, grid.1);
        with_view(&ready, &camera, grid, |view, rays| {
            let in_view = ready.in_view(view.volume);
            let seen = seen_by_rays(rays, &ready.solids.boxes, 400, &mut rng);
            for kept in kept::<B>(&ready, view, Kernel::best()) {
                assert!(
                    missing(&kept, &in_view).is_empty(),
                    "only what is in the view"
                );
                let lost_here = missing(&seen, &kept);
                if !lost_here.is_empty() && B::COVERS_WHOLE {
                    println!(
                        "{} seed {seed}: lost {lost_here:?} of {seen:?}",
                        std::any::type_name::<B>()
                    );
                }
                lost += lost_here.len();
                removed += in_view.len() - kept.len();
            }
        });
    }
    (lost, removed)
}

#[test]
fn whole_pixels_lose_nothing_that_a_ray_sees() {
    for (far_out, parallel) in [(0.0, false), (0.0, true), (1e7, false), (1e7, true)] {
        let (lost, removed) = losses::<MaskedInner>(0..400, far_out, parallel);
        assert_eq!(lost, 0, "far out {far_out}, parallel {parallel}");
        assert!(removed > 400, "{removed}: the worlds hide something");
    }
}

#[test]
fn samples_at_centres_lose_what_rays_see() {
    for parallel in [false, true] {
        let lost = [
            losses::<MaskedCentre>(0..300, 0.0, parallel).0,
            losses::<ZBuffer>(0..300, 0.0, parallel).0,
        ];
        assert!(
            lost.iter().all(|&lost| lost > 0),
            "{lost:?}: the worlds are hard enough"
        );
    }
}

#[test]
fn no_occlusion_loses_nothing() {
    assert_eq!(losses::<NoOcclusion>(0..200, 0.0, false).0, 0);
}

/// Four times `OCCLUSION_WORLDS` worlds: too slow for the normal tests.
#[test]
#[ignore = "minutes"]
fn whole_pixels_lose_nothing_in_many_more_worlds() {
    let count = case_count("OCCLUSION_WORLDS", 25_000) as u64;
    for (far_out, parallel) in [(0.0, false), (0.0, true), (1e7, false), (1e7, true)] {
        let (lost, removed) = losses::<MaskedInner>(1000..1000 + count, far_out, parallel);
        println!("far out {far_out}, parallel {parallel}: {removed} removed, {lost} lost");
        assert_eq!(lost, 0, "far out {far_out}, parallel {parallel}");
    }
}
