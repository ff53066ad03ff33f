//! Cubes strewn about a frustum: what the sweep over size tests.
//!
//! The unit of length is the depth.

use glam::{DVec3, Vec3};

use crate::camera::{Camera, Frame, Lens};
use crate::geometry::Aabb;
use crate::scene::SeededRng;

/// Cubes of one frustum on each axis of a grid, one in each of its cells: spread
/// evenly they tell a frustum's share better than as many anywhere.
const GRID: usize = 8;
pub(super) const BATCH: usize = GRID * GRID * GRID;
const FOVY_DEG: f64 = 60.0;
const ASPECT: f64 = 16.0 / 9.0;
/// Near plane / depth.
const NEAR: f64 = 0.01;

/// A frustum in any direction, at zero, of depth 1.
pub(super) fn random_camera(rng: &mut SeededRng) -> Camera {
    let lens = Lens::perspective(FOVY_DEG, ASPECT, NEAR, Some(1.0)).expect("a lens");
    loop {
        let (forward, up) = (rng.normal3(), rng.normal3());
        if let Ok(frame) = Frame::looking_along(DVec3::ZERO, forward, up) {
            return Camera { frame, lens };
        }
    }
}

/// The corners of a box about the centres of all cubes that any of the tests
/// can return, in the camera's own frame: across, up, depth.
pub(super) fn region(ratio: f64) -> [DVec3; 2] {
    let radius = ratio * 3f64.sqrt() / 2.0;
    // The sphere test returns the most: centres within the frustum whose
    // planes are all moved outward by the radius. That is a truncated pyramid
    // from near - radius to far + radius.
    let slope_y = libm::tan(FOVY_DEG.to_radians() / 2.0);
    let slope_x = slope_y * ASPECT;
    let far = 1.0 + radius;
    // An outer plane lies radius / cos of the half angle beside the old one.
    let reach = |slope: f64| far * slope + radius * (1.0 + slope * slope).sqrt();
    let (x, y) = (reach(slope_x), reach(slope_y));
    [DVec3::new(-x, -y, NEAR - radius), DVec3::new(x, y, far)]
}

/// The cube with this centre in the camera's own frame.
pub(super) fn cube_at(camera: &Camera, ratio: f64, at: DVec3) -> Aabb {
    let frame = &camera.frame;
    let centre = frame.u() * at.x + frame.v() * at.y - frame.n() * at.z;
    Aabb::around(centre.as_vec3(), Vec3::splat((ratio / 2.0) as f32))
}

/// Cubes whose centres are strewn evenly over the region.
pub(super) fn strewn(rng: &mut SeededRng, camera: &Camera, ratio: f64) -> Vec<Aabb> {
    let [low, high] = region(ratio);
    let cell = (high - low) / GRID as f64;
    let cube = |i: usize| {
        let corner = [i % GRID, i / GRID % GRID, i / GRID / GRID].map(|at| at as f64);
        let at = low + (DVec3::from(corner) + rng.point()) * cell;
        cube_at(camera, ratio, at)
    };
    (0..BATCH).map(cube).collect()
}
