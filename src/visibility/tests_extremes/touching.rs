//! Faces that touch, coincide or just miss each other, and eyes next to them.

use glam::DVec3;

use super::case::{StageCase, along_x, flat, looking};
use crate::camera::Lens;
use crate::scene::{SeededRng, WorldBox};

/// `x` or one of its neighbours in f64 or f32.
fn next_to(rng: &mut SeededRng, x: f64) -> f64 {
    match rng.below(5) {
        0 => x,
        1 => x.next_up(),
        2 => x.next_down(),
        3 => f64::from((x as f32).next_up()),
        _ => f64::from((x as f32).next_down()),
    }
}

/// A random interval within two bounds.
fn interval(rng: &mut SeededRng, low: f64, high: f64) -> [f64; 2] {
    let [a, b] = [rng.between(low, high), rng.between(low, high)];
    [a.min(b), a.max(b)]
}

/// Walls with flat boxes in or next to the planes of their front faces.
pub fn decals(rng: &mut SeededRng) -> StageCase {
    let mut boxes = Vec::new();
    let mut aims = Vec::new();
    for _ in 0..1 + rng.below(4) {
        let front = rng.between(5.0, 20.0).round();
        let (across, up) = (interval(rng, -8.0, 8.0), interval(rng, -5.0, 5.0));
        let mut wall = flat(front, across, up);
        wall.max.x += rng.below(2) as f64;
        boxes.push(wall);
        for _ in 0..8 {
            let (x, y) = (next_to(rng, front), interval(rng, across[0], across[1]));
            let decal = flat(x, y, interval(rng, up[0], up[1]));
            aims.push((decal.min + decal.max) / 2.0);
            boxes.push(decal);
        }
    }
    StageCase {
        aims,
        ..StageCase::new(rng, boxes, along_x(0.1))
    }
    .with_slivers(rng)
}

/// An eye in the plane of a face, or one unit in the last place beside it.
pub fn eye_at_face(rng: &mut SeededRng) -> StageCase {
    let boxes: Vec<WorldBox> = (0..20)
        .map(|_| {
            let low = (rng.point() * 16.0 - 8.0).round();
            WorldBox::new(low, low + (rng.point() * 6.0).ceil())
        })
        .collect();
    let (touched, axis) = (boxes[0], rng.below(3));
    let mut eye = touched.min + (touched.max - touched.min) * (rng.point() * 1.5 - 0.25);
    let face = [touched.min, touched.max][rng.below(2)];
    eye[axis] = next_to(rng, face[axis]);
    let mut forward = rng.point() * 2.0 - 1.0 + DVec3::X * 1e-3;
    if rng.below(2) == 0 && axis != 2 {
        // Looks along the face.
        forward[axis] = 0.0;
        forward[1 - axis] = 1.0;
    }
    let near = [1e-12, 1e-6, 0.1][rng.below(3)];
    let lens = Lens::perspective(rng.between(40.0, 110.0), 1.6, near, None);
    StageCase::new(rng, boxes, looking(eye, forward, lens.expect("a lens"))).with_slivers(rng)
}

/// Pairs of rectangles that cover the same part of the image.
///
/// The farther one is exactly as large in the image as the nearer one, or protrudes by
/// at most 0.0001.
pub fn same_size(rng: &mut SeededRng) -> StageCase {
    let (mut boxes, mut aims) = (Vec::new(), Vec::new());
    for _ in 0..12 {
        // Few bits, so that doubling a coordinate is exact.
        let low = ((rng.point() * 10.0 - 5.0) * 16.0).round() / 16.0;
        let size = ((rng.point() * 3.0 + 0.1) * 16.0).ceil() / 16.0;
        let (across, up) = ([low.y, low.y + size.y], [low.z, low.z + size.z]);
        let x = [6.0, 7.0, 8.0, 9.0][rng.below(4)];
        boxes.push(flat(x, across, up));
        let rim = [0.0, 1e-12, 1e-9, 1e-4][rng.below(4)];
        let mut twice = flat(2.0 * x, across.map(|y| 2.0 * y), up.map(|z| 2.0 * z));
        twice.max.y += rim;
        aims.push(DVec3::new(
            twice.max.x,
            twice.max.y - rim / 2.0,
            (twice.min.z + twice.max.z) / 2.0,
        ));
        boxes.push(twice);
    }
    StageCase {
        aims,
        ..StageCase::new(rng, boxes, along_x(0.1))
    }
}

/// Boxes of similar sizes in the image, at distances from 2 to 20 million.
pub fn infinite_far(rng: &mut SeededRng) -> StageCase {
    let boxes = (0..60).map(|_| {
        let distance = 2.0 * libm::pow(10.0, rng.between(0.0, 7.0));
        let at = DVec3::new(1.0, rng.between(-1.0, 1.0), rng.between(-0.6, 0.6));
        let half = rng.point() * 0.3 * DVec3::new(1.0, 1.0, 0.8);
        WorldBox::around(at * distance, half * distance)
    });
    let boxes = boxes.collect();
    StageCase::new(rng, boxes, along_x(1.0))
}

/// Long walls that cross the near plane: beside the window, at its edge, within it.
pub fn near_plane(rng: &mut SeededRng) -> StageCase {
    let near = [0.5, 2.0, 8.0][rng.below(3)];
    let camera = along_x(near);
    let [left, right, bottom, top] = camera.lens.window().map(|slope| slope * near);
    let mut boxes = Vec::new();
    for _ in 0..6 {
        let edge = [left, right][rng.below(2)];
        let beside = edge * [0.5, 1.0, 1.0, 1.0 + 1e-9, 1.5][rng.below(5)];
        let at = next_to(rng, beside);
        let end = at + at.signum() * rng.unit();
        let (low, high) = (bottom * rng.between(0.1, 9.0), top * rng.between(0.1, 9.0));
        let from = [-50.0, next_to(rng, near)][rng.below(2)];
        boxes.push(WorldBox::new(
            DVec3::new(from, at.min(end), low),
            DVec3::new(near * rng.between(1.0, 40.0), at.max(end), high),
        ));
    }
    for _ in 0..30 {
        let at = DVec3::new(1.0, rng.between(left, right), rng.between(bottom, top));
        let distance = rng.between(0.5, 60.0);
        boxes.push(WorldBox::around(at * distance, rng.point()));
    }
    StageCase::new(rng, boxes, camera).with_slivers(rng)
}
