//! Position and direction of a camera as written, and the exact way to its axes.

use glam::DVec3;

use super::{CameraError, require};
use crate::arithmetic::exact::{self, ExactVector};

/// Position and direction of a camera; the numbers as written count as exact.
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
    pub(crate) fn direction(&self) -> Option<ExactVector> {
        exact::near_unit(match *self {
            Pose::Forward { forward, .. } => exact::vector(forward),
            // Quartered where the difference could overflow.
            Pose::LookAt { eye, look, .. } if eye.abs().max(look.abs()).max_element() > 1e300 => {
                exact::difference(look / 4.0, eye / 4.0)
            }
            Pose::LookAt { eye, look, .. } => exact::difference(look, eye),
        })
    }

    /// The axes u and n, true to some units of 2^-53 however near up is to the
    /// direction of view, and look to the eye: the cross product is exact.
    ///
    /// # Errors
    /// The errors of [`look_at`](super::look_at).
    pub(super) fn axes(&self) -> Result<[DVec3; 2], CameraError> {
        let (eye, name, towards, up) = match *self {
            Pose::LookAt { eye, look, up } => (eye, "look", look, up),
            Pose::Forward { eye, forward, up } => (eye, "forward", forward, up),
        };
        check_finite("eye", eye)?;
        check_finite(name, towards)?;
        check_finite("up", up)?;
        let forward = self.direction().ok_or_else(|| match self {
            Pose::LookAt { .. } => {
                let found = "eye and look are the same point";
                CameraError::invalid(found, "two different points")
            }
            Pose::Forward { .. } => CameraError::invalid("forward is zero", "a direction"),
        })?;
        let parallel = || {
            let found = "up is zero or parallel to the direction of view";
            CameraError::invalid(found, "an up vector that is neither")
        };
        let up = exact::near_unit(exact::vector(up)).ok_or_else(parallel)?;
        // up x n, but for its length.
        let across = exact::cross(&forward, &up);
        let length = |v: &ExactVector| exact::estimate(v).length();
        let sine = length(&across) / (length(&forward) * length(&up));
        let n = -unit(exact::estimate(&forward));
        let u = exact::near_unit(across).ok_or_else(parallel)?;
        require(
            sine > PARALLEL,
            || format!("up is {sine:e} rad from the direction of view or its opposite"),
            "more than 8.9e-16",
        )?;
        Ok([unit(exact::estimate(&u)), n])
    }
}

/// Unit vector along `v`, for any length above 0.
pub(super) fn unit(v: DVec3) -> DVec3 {
    // Twice: 1/largest alone overflows for subnormal lengths.
    let scaled = v / v.abs().max_element();
    scaled / scaled.length()
}

fn check_finite(name: &str, v: DVec3) -> Result<(), CameraError> {
    for (axis, value) in ["x", "y", "z"].into_iter().zip(v.to_array()) {
        let found = || format!("{name} {axis} is {value}");
        require(value.is_finite(), found, "a finite number")?;
    }
    Ok(())
}
