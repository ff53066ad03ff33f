//! The camera's orthonormal frame in f64, and the pose it was made from.

use glam::{DMat3, DVec3};

use super::{Camera, CameraError, Result, require};
use crate::arithmetic::exact::{self, ExactVector};

/// Position and direction of a camera; the numbers are exact as written.
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

/// Sine of the least angle between up and the direction of view.
///
/// 4 units of 2^-52: covers an up vector that was computed to be parallel.
const PARALLEL: f64 = 4.0 * f64::EPSILON;

impl Pose {
    /// The pose that the camera's frame was made from.
    ///
    /// After a turn or a move: the frame's current eye, direction and up.
    pub fn of(camera: &Camera) -> Pose {
        let frame = &camera.frame;
        match frame.written {
            Some(pose) if pose.eye() == frame.eye => pose,
            _ => Pose::Forward {
                eye: frame.eye,
                forward: frame.forward(),
                up: frame.v(),
            },
        }
    }

    /// The frame of this pose.
    ///
    /// # Errors
    /// The errors of [`look_at`] and [`Frame::looking_along`].
    pub fn frame(&self) -> Result<Frame> {
        let [u, n] = self.axes()?;
        let mut frame = Frame {
            eye: self.eye(),
            u,
            v: n.cross(u),
            n,
            rotations: 0,
            written: None,
        };
        // Corrects the last digit or two of orthogonality.
        frame.orthonormalise();
        frame.written = Some(*self);
        Ok(frame)
    }

    /// Position of the camera in world coordinates.
    pub fn eye(&self) -> DVec3 {
        match *self {
            Pose::LookAt { eye, .. } | Pose::Forward { eye, .. } => eye,
        }
    }

    /// The direction of view, exact up to a power of two; `None` for zero.
    ///
    /// The largest component is near 1.
    pub(crate) fn direction(&self) -> Option<ExactVector> {
        exact::near_unit(match *self {
            Pose::Forward { forward, .. } => exact::vector(forward),
            // Quartered if the difference could overflow.
            Pose::LookAt { eye, look, .. } if eye.abs().max(look.abs()).max_element() > 1e300 => {
                exact::difference(look / 4.0, eye / 4.0)
            }
            Pose::LookAt { eye, look, .. } => exact::difference(look, eye),
        })
    }

    /// The axes u and n, true to some units of 2^-53.
    ///
    /// However near up is to the direction of view and look to the eye: the cross product is exact.
    ///
    /// # Errors
    /// The errors of [`look_at`].
    pub(super) fn axes(&self) -> Result<[DVec3; 2]> {
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
        // up x n, not normalised.
        let across = exact::cross(&forward, &up);
        let length = |v: &ExactVector| exact::estimate(v).length();
        let sine = length(&across) / (length(&forward) * length(&up));
        let n = -unit(exact::estimate(&forward));
        let u = exact::near_unit(across).ok_or_else(parallel)?;
        let found = format_args!("up is {sine:e} rad from the direction of view or its opposite");
        require(sine > PARALLEL, found, "more than 8.9e-16")?;
        Ok([unit(exact::estimate(&u)), n])
    }
}

/// Unit vector along `v`, for any length above 0.
pub(super) fn unit(v: DVec3) -> DVec3 {
    // Twice: 1/largest alone overflows for subnormal vectors.
    let scaled = v / v.abs().max_element();
    scaled / scaled.length()
}

pub(super) fn check_finite(name: &str, v: DVec3) -> Result<()> {
    for (axis, value) in ["x", "y", "z"].into_iter().zip(v.to_array()) {
        let found = format_args!("{name} {axis} is {value}");
        require(value.is_finite(), found, "a finite number")?;
    }
    Ok(())
}

/// Position and orientation of a camera.
///
/// Eye position and the unit vectors u (right), v (up) and n (backward: the camera looks along -n).
/// Right-handed: `u x v = n`.
///
/// From "3D Viewing and Camera Control" (E. Agu, CS 543), with the lecture's names. A frame turned
/// or moved by a number that is not finite has no view: [`Camera::volume`] refuses it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Frame {
    /// Position of the camera in world coordinates.
    pub eye: DVec3,
    pub(super) u: DVec3,
    pub(super) v: DVec3,
    pub(super) n: DVec3,
    /// Rotations since the last correction, see `controls`.
    pub(super) rotations: u32,
    /// Pose that the frame was made from, until the frame is turned.
    pub(super) written: Option<Pose>,
}

/// The frame that looks from `eye` to `look` with `up` upward.
///
/// `n = (eye - look)/|eye - look|`, `u = (up x n)/|up x n|`, `v = n x u`.
///
/// The difference and the cross product are exact: the axes are true to some units of 2^-53 however
/// near `up` is to the direction of view and `look` to the eye. Vectors are scaled before they are
/// squared, so lengths from 1e-300 to 1e300 work.
///
/// # Errors
/// A value that is not finite, `eye == look`, `up` zero or within 9e-16 rad of the direction of
/// view or its opposite.
pub fn look_at(eye: DVec3, look: DVec3, up: DVec3) -> Result<Frame> {
    Pose::LookAt { eye, look, up }.frame()
}

impl Frame {
    /// The frame at `eye` that looks along `forward`.
    ///
    /// # Errors
    /// The errors of [`look_at`]; `forward` zero in place of `eye == look`.
    pub fn looking_along(eye: DVec3, forward: DVec3, up: DVec3) -> Result<Frame> {
        Pose::Forward { eye, forward, up }.frame()
    }

    /// Right.
    pub fn u(&self) -> DVec3 {
        self.u
    }

    /// Up.
    pub fn v(&self) -> DVec3 {
        self.v
    }

    /// Backward.
    pub fn n(&self) -> DVec3 {
        self.n
    }

    /// The direction of view, -n.
    pub fn forward(&self) -> DVec3 {
        -self.n
    }

    /// The same frame relative to another origin.
    pub fn relative_to(&self, origin: DVec3) -> Frame {
        let eye = self.eye - origin;
        Frame { eye, ..*self }
    }

    /// One Newton step towards the nearest orthonormal frame.
    ///
    /// X(3I - X^T X)/2 towards the polar factor (Higham 1986, "Computing the polar
    /// decomposition", eq. 3.1 in its inverse-free form).
    pub fn orthonormalise(&mut self) {
        let x = DMat3::from_cols(self.u, self.v, self.n);
        let x = x * (DMat3::from_diagonal(DVec3::splat(3.0)) - x.transpose() * x) * 0.5;
        (self.u, self.v, self.n) = (x.x_axis, x.y_axis, x.z_axis);
        self.rotations = 0;
        self.written = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Frame {
        /// Largest deviation of u, v, n from an orthonormal basis.
        pub fn orthogonality_error(&self) -> f64 {
            let basis = DMat3::from_cols(self.u, self.v, self.n);
            let gram = basis.transpose() * basis - DMat3::IDENTITY;
            let errors = gram.to_cols_array().map(f64::abs);
            errors.into_iter().fold(0.0, f64::max)
        }

        /// This frame with the axes of another one but its own written pose.
        ///
        /// Wrong on purpose, for tests of the checks that must notice it.
        pub fn with_axes_of(self, other: &Frame) -> Frame {
            let (u, v, n) = (other.u, other.v, other.n);
            Frame { u, v, n, ..self }
        }
    }

    #[test]
    fn the_lectures_frame_from_eye_look_and_up() {
        let frame = look_at(DVec3::new(0.0, 0.0, 1.0), DVec3::ZERO, DVec3::Y).unwrap();
        assert_eq!(
            (frame.u(), frame.v(), frame.n()),
            (DVec3::X, DVec3::Y, DVec3::Z)
        );
        assert_eq!(frame.forward(), -DVec3::Z);
    }

    #[test]
    fn lengths_of_1e_30_and_1e30_work() {
        for length in [1e-300, 1e-30, 1.0, 1e30, 1e300] {
            let frame = look_at(DVec3::ZERO, -DVec3::Z * length, DVec3::Y * length).unwrap();
            assert_eq!(frame.n(), DVec3::Z, "{length}");
        }
        let far = look_at(-DVec3::X * 1.7e308, DVec3::X * 1.7e308, DVec3::Z).unwrap();
        assert_eq!(far.forward(), DVec3::X);
    }

    fn refused(frame: Result<Frame>, what: &str) -> bool {
        frame.is_err_and(|error| error.to_string().starts_with(what))
    }

    #[test]
    fn impossible_frames_are_errors_that_name_the_value() {
        const SAME: &str = "eye and look are the same point";
        const PARALLEL: &str = "up is zero or parallel";
        let (o, y) = (DVec3::ZERO, DVec3::Y);
        assert!(refused(look_at(o, o, y), SAME));
        assert!(refused(Frame::looking_along(o, o, y), "forward is zero"));
        assert!(refused(look_at(o, y, o), PARALLEL));
        let odd = DVec3::new(1.0, 2.0, 2.0);
        assert!(refused(look_at(o, odd, odd * 0.1), PARALLEL));
        for length in [1.0, 1e-300, 1e300] {
            let same = DVec3::splat(length);
            assert!(refused(look_at(same, same, y), SAME));
            for (look, up) in [(y, y), (-y, y), (odd, -odd)] {
                let frame = look_at(o, look * length, up);
                assert!(refused(frame, PARALLEL), "{look} {length:e}");
            }
        }
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for axis in 0..3 {
                let mut broken = DVec3::ONE;
                broken[axis] = bad;
                let attempts = [
                    ("eye", broken, -y, y),
                    ("look", o, broken, y),
                    ("up", o, -y, broken),
                ];
                for (named, eye, look, up) in attempts {
                    let found = format!("{named} {} is {bad}", ["x", "y", "z"][axis]);
                    assert!(refused(look_at(eye, look, up), &found), "{found}");
                }
            }
        }
    }

    #[test]
    fn a_nearly_parallel_up_still_gives_an_orthonormal_frame() {
        let look = DVec3::new(1e-6, -1.0, 2e-6);
        let frame = look_at(DVec3::ZERO, look, DVec3::Y).unwrap();
        assert!(
            frame.orthogonality_error() < 1e-15,
            "{}",
            frame.orthogonality_error()
        );
        let expected = DVec3::new(-2.0, 0.0, 1.0) / 5f64.sqrt();
        assert!((frame.u() - expected).length() < 1e-9, "{}", frame.u());
    }
}
