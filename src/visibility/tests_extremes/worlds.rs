//! Random worlds full of contacts, seen by every kind of lens.

use glam::DVec3;

use super::case::{StageCase, looking};
use crate::camera::{Camera, Lens};
use crate::scene::{SeededRng, WorldBox};

/// Kind of projection.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Perspective,
    Parallel,
    OffAxis,
}

/// Boxes around a point `far_out` from the origin, and a camera that looks at them.
pub fn contacts(rng: &mut SeededRng, far_out: f64, kind: Kind) -> StageCase {
    let boxes = world(rng, far_out);
    let camera = camera(rng, far_out, kind);
    StageCase::new(rng, boxes, camera).with_slivers(rng)
}

/// Boxes of any shape around a point `far_out` from the origin.
///
/// In half of the worlds coordinates are integers, so that faces coincide; in half of them most
/// boxes stand on one floor.
fn world(rng: &mut SeededRng, far_out: f64) -> Vec<WorldBox> {
    let [whole, standing] = [rng.below(2) == 0, rng.below(2) == 0];
    let about = DVec3::new(far_out, -far_out, 0.0);
    let count = 4 + rng.below(40);
    let boxes = (0..count).map(|_| {
        let mut low = rng.point() * 20.0 - 10.0;
        let mut size = rng.point() * if rng.below(2) == 0 { 12.0 } else { 1.5 };
        if rng.below(6) == 0 {
            size[rng.below(3)] = 0.0;
        }
        if whole {
            (low, size) = (low.round(), size.round());
        }
        if standing && rng.below(3) > 0 {
            low.z = -10.0;
        }
        WorldBox::new(low + about, low + size + about)
    });
    boxes.collect()
}

/// A random camera.
///
/// Half of the eyes are within the bounds; a third of the views are along axes.
fn camera(rng: &mut SeededRng, far_out: f64, kind: Kind) -> Camera {
    let reach = if rng.below(2) == 0 { 9.0 } else { 25.0 };
    let mut eye = (rng.point() * 2.0 - 1.0) * reach;
    let mut forward = rng.point() * 12.0 - 6.0 - eye;
    if rng.below(3) == 0 {
        (eye, forward) = (eye.round(), [DVec3::X, DVec3::Y, -DVec3::X][rng.below(3)]);
    }
    if rng.below(3) == 0 {
        forward.z = 0.0;
    }
    // Never parallel to the up vector.
    forward.x += if forward.x.abs() < 1e-3 && forward.y.abs() < 1e-3 {
        1.0
    } else {
        0.0
    };
    let eye = eye + DVec3::new(far_out, -far_out, 0.0);
    let near = [0.01, 0.5, 2.0][rng.below(3)];
    let far = [None, Some(30.0), Some(1000.0)][rng.below(3)];
    let made = match kind {
        Kind::Parallel => Lens::orthographic(rng.between(2.0, 30.0), 1.6, -20.0, 60.0),
        Kind::OffAxis => {
            let [left, bottom] =
                [rng.between(-1.5, -0.1), rng.between(-1.5, -0.1)].map(|x| x * near);
            Lens::off_axis([left, left + near * 1.2, bottom, bottom + near], near, far)
        }
        Kind::Perspective => Lens::perspective(rng.between(20.0, 130.0), 1.6, near, far),
    };
    looking(eye, forward, made.expect("a lens"))
}
