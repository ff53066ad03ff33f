//! Rectangles of openings in the image, in camera coordinates.
//!
//! Right, up, and the depth along the axis of view.
//!
//! All are grown by a slack, so that no rounding ever loses a line of sight. The slack's
//! proof is at [`SLACK`].

use glam::DVec3;

use super::graph::Opening;
use crate::camera::Camera;
use crate::kernel::each;
use crate::visibility::Rays;

/// A part of the image: left, right, bottom, top, slopes per unit of depth.
pub type Window = [f64; 4];

/// Distance within which a point outside of a half-space `n . x >= 0` is kept.
///
/// Relative to bounds of |n| and |x| (sums of absolute coordinates).
///
/// The errors to cover, with u = 2^-53 and X = |x|:
/// - A corner minus the eye is rounded by u relative; three products and two sums
///   with axes whose coordinates are at most 1 add 3 u X a coordinate: below 2^-49 X.
/// - A ray of the camera is `u a + v b + forward`, rounded: u relative an operation,
///   and the axes are orthonormal to 2^-50: below 2^-48 X.
/// - The product of a corner with a normal adds below 2^-50 |n| X.
///
/// The sum is far below the 2^-36 |n| X that thresholds are shifted by.
const SLACK: f64 = 1.0 / (1u64 << 36) as f64;

/// The smallest window that surely holds an opening, grown by the slack.
///
/// `None` if it is surely not in the image, or beyond the far plane. All rays share an eye:
/// the lens is not orthographic.
pub fn window_of(rays: &Rays, opening: &Opening) -> Option<Window> {
    let Camera { frame, lens } = &rays.camera;
    let axes = [frame.u(), frame.v(), frame.forward()];
    let corners = each(opening.corners, |c| {
        DVec3::from(each(axes, |axis| axis.dot(c - frame.eye)))
    });
    let sizes = each(corners, |c| c.abs().element_sum());
    let reach = sizes.into_iter().fold(0.0, f64::max);
    let far = lens.far().unwrap_or(f64::INFINITY);
    if corners.iter().all(|c| c.z - reach * SLACK > far) {
        return None;
    }
    let outside = |normal: DVec3| {
        let slack = SLACK * normal.abs().element_sum() * reach;
        corners.iter().all(|c| normal.dot(*c) < -slack)
    };
    // By the planes through the eye and each side of the image.
    let [left, right, bottom, top] = rays.window;
    if outside(DVec3::new(1.0, 0.0, -left))
        || outside(DVec3::new(-1.0, 0.0, right))
        || outside(DVec3::new(0.0, 1.0, -bottom))
        || outside(DVec3::new(0.0, -1.0, top))
    {
        return None;
    }
    // Nothing is known of the directions to corners at depths about zero.
    if corners.iter().any(|c| c.z <= 4.0 * SLACK * reach) {
        return Some(rays.window);
    }
    let (most, least) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut window = [most, least, most, least];
    for c in &corners {
        let (x, y) = (c.x / c.z, c.y / c.z);
        // Both coordinates of x / z are off by below 2^-48 reach.
        let slack = 2.0 * SLACK * reach / c.z;
        let (sx, sy) = (slack * (1.0 + x.abs()), slack * (1.0 + y.abs()));
        window[0] = window[0].min(x - sx);
        window[1] = window[1].max(x + sx);
        window[2] = window[2].min(y - sy);
        window[3] = window[3].max(y + sy);
    }
    Some(window)
}
