//! Where a camera stands as it was written, beside the frame that was made of
//! it. It defines the exact arithmetic between the two; judging by it is left to
//! others.

use glam::DVec3;

use super::{CameraError, finite};
use crate::arithmetic::Expansion;

/// Where a camera stands, as the numbers that say so: all are exact.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Pose {
    /// From the eye to a point.
    LookAt {
        /// Position of the camera.
        eye: DVec3,
        /// The point looked at; not the eye.
        look: DVec3,
        /// Any vector that is not parallel to the direction of view.
        up: DVec3,
    },
    /// From the eye in a direction.
    Forward {
        /// Position of the camera.
        eye: DVec3,
        /// Direction of view, of any length above 0.
        forward: DVec3,
        /// Any vector that is not parallel to the direction of view.
        up: DVec3,
    },
}

/// The sine of the least angle between up and the direction of view, 4 units
/// of 2^-52: an up that was computed to be parallel is no nearer to it.
const PARALLEL: f64 = 4.0 * f64::EPSILON;

impl Pose {
    /// Position of the camera in world coordinates.
    pub fn eye(&self) -> DVec3 {
        match *self {
            Pose::LookAt { eye, .. } | Pose::Forward { eye, .. } => eye,
        }
    }

    /// The direction of view without any rounding, but for a power of two; its
    /// largest component is near 1. `None` for zero.
    fn direction(&self) -> Option<Vector> {
        let exact = |v: DVec3| v.to_array().map(Expansion::from);
        near_unit(match *self {
            Pose::Forward { forward, .. } => exact(forward),
            Pose::LookAt { eye, look, .. } => {
                // Quartered where the difference could overflow.
                let share = if eye.abs().max(look.abs()).max_element() > 1e300 {
                    0.25
                } else {
                    1.0
                };
                let (eye, look) = (exact(eye * share), exact(look * share));
                [0, 1, 2].map(|k| &look[k] - &eye[k])
            }
        })
    }

    /// The axes u and n of this pose, true to some units of 2^-53 however near up
    /// is to the direction of view, and look to the eye: nothing is rounded before
    /// the cross product.
    ///
    /// # Errors
    /// As [`look_at`](super::look_at).
    pub(super) fn axes(&self) -> Result<[DVec3; 2], CameraError> {
        let (eye, towards, up) = match *self {
            Pose::LookAt { eye, look, up } => (eye, (["look x", "look y", "look z"], look), up),
            Pose::Forward { eye, forward, up } => {
                (eye, (["forward x", "forward y", "forward z"], forward), up)
            }
        };
        check_finite(["eye x", "eye y", "eye z"], eye)?;
        check_finite(towards.0, towards.1)?;
        check_finite(["up x", "up y", "up z"], up)?;
        let forward = self.direction().ok_or(match self {
            Pose::LookAt { .. } => CameraError::EyeIsLook,
            Pose::Forward { .. } => CameraError::ForwardIsZero,
        })?;
        let up = near_unit(up.to_array().map(Expansion::from)).ok_or(CameraError::UpParallel)?;
        // up x n, but for its length.
        let across = [(1, 2), (2, 0), (0, 1)]
            .map(|(i, j)| &(&forward[i] * &up[j]) - &(&forward[j] * &up[i]));
        let (forward, up) = (estimate(&forward), estimate(&up));
        let Some(u) = near_unit(across.clone()).and_then(|across| unit(estimate(&across))) else {
            return Err(CameraError::UpParallel);
        };
        let sine = estimate(&across).length() / (forward.length() * up.length());
        if sine <= PARALLEL {
            return Err(CameraError::UpNearlyParallel { sine });
        }
        let n = -unit(forward).ok_or(CameraError::ForwardIsZero)?;
        Ok([u, n])
    }
}

/// The unit vector along `v`, whatever its length; `None` for zero.
pub(super) fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    if largest == 0.0 {
        return None;
    }
    // Twice: 1/largest alone overflows for subnormal lengths.
    let scaled = v / largest;
    Some(scaled / scaled.length())
}

type Vector = [Expansion; 3];

fn check_finite(names: [&'static str; 3], v: DVec3) -> Result<(), CameraError> {
    for (name, value) in names.into_iter().zip(v.to_array()) {
        finite(name, value)?;
    }
    Ok(())
}

fn estimate(v: &Vector) -> DVec3 {
    DVec3::new(v[0].estimate(), v[1].estimate(), v[2].estimate())
}

/// The vector times a power of two that brings its largest component near 1,
/// so that no product overflows; `None` for zero.
fn near_unit(v: Vector) -> Option<Vector> {
    let largest = estimate(&v).abs().max_element();
    let exponent = (largest > 0.0).then(|| libm::ilogb(largest))?;
    Some(v.map(|component| component.scaled(-exponent)))
}
