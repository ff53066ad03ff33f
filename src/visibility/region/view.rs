//! Rectangles of openings in the image, in camera coordinates: right, up, and the
//! depth along the axis of view.
//!
//! All are grown by a slack, so that no rounding ever loses a line of sight. The slack's
//! proof is at [`SLACK`].

use glam::DVec3;

use super::graph::Opening;
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

/// A camera and the sides of its image.
#[derive(Clone, Debug)]
pub struct View {
    /// World coordinates.
    pub eye: DVec3,
    axes: [DVec3; 3],
    /// The whole image.
    pub window: Window,
    far: f64,
    /// Normals of the planes through the eye and each side, not of unit length.
    sides: [DVec3; 4],
}

impl View {
    /// The view of a camera whose rays share an eye: not orthographic.
    pub fn of(rays: &Rays) -> View {
        let camera = &rays.camera;
        let frame = &camera.frame;
        let window @ [left, right, bottom, top] = rays.window;
        View {
            eye: frame.eye,
            axes: [frame.u(), frame.v(), frame.forward()],
            window,
            far: camera.lens.far().unwrap_or(f64::INFINITY),
            sides: [
                DVec3::new(1.0, 0.0, -left),
                DVec3::new(-1.0, 0.0, right),
                DVec3::new(0.0, 1.0, -bottom),
                DVec3::new(0.0, -1.0, top),
            ],
        }
    }

    /// The smallest window that surely holds an opening, grown by the slack.
    ///
    /// `None` if it is surely not in the image, or beyond the far plane.
    pub fn rectangle(&self, opening: &Opening) -> Option<Window> {
        let corners = each(opening.corners, |c| {
            DVec3::from(each(self.axes, |axis| axis.dot(c - self.eye)))
        });
        let sizes = each(corners, |c| c.abs().element_sum());
        let reach = sizes.into_iter().fold(0.0, f64::max);
        if corners.iter().all(|c| c.z - reach * SLACK > self.far) {
            return None;
        }
        let outside = |normal: &DVec3| {
            let slack = SLACK * normal.abs().element_sum() * reach;
            corners.iter().all(|c| normal.dot(*c) < -slack)
        };
        if self.sides.iter().any(outside) {
            return None;
        }
        // Nothing is known of the directions to corners at depths about zero.
        if corners.iter().any(|c| c.z <= 4.0 * SLACK * reach) {
            return Some(self.window);
        }
        let (most, least) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut rectangle = [most, least, most, least];
        for c in &corners {
            let (x, y) = (c.x / c.z, c.y / c.z);
            // Both coordinates of x / z are off by below 2^-48 reach.
            let slack = 2.0 * SLACK * reach / c.z;
            let (sx, sy) = (slack * (1.0 + x.abs()), slack * (1.0 + y.abs()));
            rectangle[0] = rectangle[0].min(x - sx);
            rectangle[1] = rectangle[1].max(x + sx);
            rectangle[2] = rectangle[2].min(y - sy);
            rectangle[3] = rectangle[3].max(y + sy);
        }
        Some(rectangle)
    }
}
