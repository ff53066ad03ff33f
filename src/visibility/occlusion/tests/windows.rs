//! Windows from far below to far above the range of f32.

use glam::DVec3;

use super::super::MaskedInner;
use super::by_rays::{Ready, missing, seen_by_rays, with_view};
use super::kept;
use crate::camera::{Camera, Frame, Lens};
use crate::kernel::Kernel;
use crate::scene::{Scene, SeededRng, WorldBox};
use crate::visibility::SampleGrid;

/// Boxes at depths from 4 to 30 units, some on the axis of view.
fn boxes(unit: f64, rng: &mut SeededRng) -> Vec<WorldBox> {
    let mut random = |n: usize| {
        let spread = [0.0, 2.0, 12.0][n % 3];
        let aside = (rng.point() - 0.5) * spread;
        let at = aside.with_x(4.0 + 26.0 * rng.unit());
        let size = DVec3::splat(0.2) + rng.point() * 2.0;
        WorldBox::new((at - size / 2.0) * unit, (at + size / 2.0) * unit)
    };
    (0..40).map(&mut random).collect()
}

/// Number of items visible through each lens, none of which is removed.
fn seen_through(unit: f64, lenses: impl IntoIterator<Item = Lens>) -> Vec<usize> {
    let mut rng = SeededRng::new(8);
    let ready = Ready::of(Scene::from_boxes("few", &boxes(unit, &mut rng)).unwrap());
    let frame = Frame::looking_along(DVec3::ZERO, DVec3::X, DVec3::Z).unwrap();
    let of_lens = |lens| {
        let camera = Camera { frame, lens };
        with_view(&ready, &camera, SampleGrid::new(64, 40), |view, rays| {
            let seen = seen_by_rays(rays, &ready.solids.boxes, 600, &mut rng);
            for kept in kept::<MaskedInner>(&ready, view, Kernel::best()) {
                let lost = missing(&seen, &kept);
                assert!(lost.is_empty(), "{unit:e} {lens:?}: {lost:?}");
            }
            seen.len()
        })
    };
    lenses.into_iter().map(of_lens).collect()
}

#[test]
fn no_window_is_too_narrow_or_too_wide() {
    let lenses = |unit: f64| {
        let fov = [1e-43, 1e-39, 1e-30, 1e-9, 1.0, 60.0, 178.0, 179.99];
        let perspective = fov.map(|fov| Lens::perspective(fov, 1.6, unit, None));
        let across = [1e-44, 1e-38, 1e-30, 1e-6, 1.0, 20.0, 1e7, 1e30, 1e38];
        let parallel =
            across.map(|w| Lens::orthographic((w * unit).min(1e37), 1.6, unit, 50.0 * unit));
        let beside = [1e-40, 1e-20, 1e-3, 1.0, 1e10, 1e30];
        let beside = beside.map(|w| Lens::off_axis([-0.1 * w, w, -w, 0.3 * w], unit, None));
        // Windows on the near plane.
        let at_near = [1e-40, 1e-3, 1.0, 1e10].map(|w| {
            let [low, high] = [0.2 * unit, (0.2 + w) * unit];
            Lens::off_axis([low, high, low, high], unit, None)
        });
        let all = perspective.into_iter().chain(parallel);
        let all = all.chain(beside).chain(at_near);
        all.filter_map(Result::ok).collect::<Vec<_>>()
    };
    for unit in [1.0, 1e-12, 1e-24, 1e-41, 1e12, 1e24, 1e36] {
        let lenses = lenses(unit);
        let seen = seen_through(unit, lenses.iter().copied());
        let some = seen.iter().filter(|&&count| count > 0).count();
        assert!(
            lenses.len() >= 18 && some >= 10,
            "the premise: {unit:e} {seen:?}"
        );
    }
}
