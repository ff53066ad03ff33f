//! Camera controls: slide, advance, zoom, orbit, yaw, pitch and roll.
//!
//! Angles are degrees, counter-clockwise about their axis (right-hand rule). Rotations correct
//! their own drift.

use glam::{DQuat, DVec3};

use super::frame::{check_finite, unit};
use super::{Camera, CameraError, Frame, Lens, LensKind, Result, finite, require};

/// Rotations between two corrections.
///
/// A rotation drifts by about 2e-16, so the frame stays orthonormal to 1e-13 at negligible cost.
const CORRECT_EVERY: u32 = 100;

/// Sine and cosine of degrees, through `libm`: the same on every platform.
fn sin_cos(degrees: f64) -> (f64, f64) {
    let angle = degrees * (std::f64::consts::PI / 180.0);
    (libm::sin(angle), libm::cos(angle))
}

impl Frame {
    /// Slides the eye by `du` right, `dv` up and `dn` backward.
    ///
    /// The lecture's example of a camera that is flown:
    ///
    /// ```
    /// use cullbench::camera::look_at;
    /// use glam::DVec3;
    ///
    /// let mut camera = look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y)?;
    /// camera.slide(-1.0, 0.0, -2.0); // forward and left
    /// camera.roll(30.0);
    /// camera.yaw(40.0);
    /// camera.pitch(20.0);
    /// assert_eq!(camera.eye, DVec3::new(-1.0, 0.0, -2.0));
    /// # Ok::<(), cullbench::camera::CameraError>(())
    /// ```
    pub fn slide(&mut self, du: f64, dv: f64, dn: f64) {
        self.eye += self.u * du + self.v * dv + self.n * dn;
    }

    /// Moves the eye along the direction of view (the lecture's `Move`).
    pub fn advance(&mut self, distance: f64) {
        self.slide(0.0, 0.0, -distance);
    }

    /// Turns the nose left for a positive angle: about v.
    pub fn yaw(&mut self, degrees: f64) {
        let (sin, cos) = sin_cos(degrees);
        (self.n, self.u) = (self.n * cos + self.u * sin, self.u * cos - self.n * sin);
        self.rotated();
    }

    /// Lifts the nose for a positive angle: about u.
    ///
    /// A level camera that looks along -z and turns by yaw a, then by pitch b, looks
    /// along (-sin a cos b, sin b, -cos a cos b):
    ///
    /// ```
    /// use cullbench::camera::look_at;
    /// use glam::DVec3;
    ///
    /// let mut camera = look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y)?;
    /// camera.yaw(40.0);
    /// camera.pitch(20.0);
    /// let (a, b) = (40f64.to_radians(), 20f64.to_radians());
    /// let along = DVec3::new(-a.sin() * b.cos(), b.sin(), -a.cos() * b.cos());
    /// assert!(camera.forward().distance(along) < 1e-15);
    /// # Ok::<(), cullbench::camera::CameraError>(())
    /// ```
    pub fn pitch(&mut self, degrees: f64) {
        let (sin, cos) = sin_cos(degrees);
        (self.v, self.n) = (self.v * cos + self.n * sin, self.n * cos - self.v * sin);
        self.rotated();
    }

    /// Banks left for a positive angle: about n, `u' = cos u + sin v`.
    ///
    /// This is the sign of the lecture's formula; its program listing has the opposite one.
    pub fn roll(&mut self, degrees: f64) {
        let (sin, cos) = sin_cos(degrees);
        (self.u, self.v) = (self.u * cos + self.v * sin, self.v * cos - self.u * sin);
        self.rotated();
    }

    /// Swings the whole camera about `centre`.
    ///
    /// First by `around` degrees about `axis` (through the centre), then by `over` degrees about
    /// the camera's own u. Keeps distance and bearing to the centre.
    ///
    /// # Errors
    /// An axis of length zero, or a value that is not finite; the frame is unchanged.
    pub fn orbit(&mut self, centre: DVec3, axis: DVec3, around: f64, over: f64) -> Result<()> {
        let found = format_args!("the axis of the orbit is zero or not finite");
        let is_direction = axis.is_finite() && axis != DVec3::ZERO;
        require(is_direction, found, "a direction")?;
        check_finite("centre", centre)?;
        finite("the angle around", around)?;
        finite("the angle over", over)?;
        self.swing(centre, unit(axis), around);
        // Read u only now: the first swing has turned it.
        self.swing(centre, self.u, over);
        Ok(())
    }

    /// Turns eye and axes about the unit vector `axis` through `centre`.
    fn swing(&mut self, centre: DVec3, axis: DVec3, degrees: f64) {
        let (sin, cos) = sin_cos(degrees / 2.0);
        let turn = DQuat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos);
        self.eye = centre + turn * (self.eye - centre);
        (self.u, self.v, self.n) = (turn * self.u, turn * self.v, turn * self.n);
        self.rotated();
    }

    fn rotated(&mut self) {
        self.written = None;
        self.rotations += 1;
        if self.rotations >= CORRECT_EVERY {
            self.orthonormalise();
        }
    }
}

impl Camera {
    /// Zooms by field of view: a factor of 2 halves the window's width.
    ///
    /// The window's edges, and so the tangent of half the angle, are divided; not the angle.
    ///
    /// # Errors
    /// A factor that is not above zero, or a lens that would have no window.
    pub fn zoom(&mut self, factor: f64) -> Result<()> {
        let found = format_args!("the zoom factor is {factor}");
        let is_sound = factor.is_finite() && factor > 0.0;
        require(is_sound, found, "a number above 0")?;
        let kind = match *self.lens.kind() {
            LensKind::Perspective { fovy_deg, aspect } => {
                let half = libm::tan(fovy_deg.to_radians() / 2.0) / factor;
                let fovy_deg = 2.0 * libm::atan(half).to_degrees();
                LensKind::Perspective { fovy_deg, aspect }
            }
            LensKind::Orthographic { height, aspect } => LensKind::Orthographic {
                height: height / factor,
                aspect,
            },
            LensKind::OffAxis { window } => LensKind::OffAxis {
                window: window.map(|edge| edge / factor),
            },
            LensKind::Matrix(_) => return Err(CameraError::of_matrix("a field of view")),
        };
        self.lens = Lens::new(kind, self.lens.near(), self.lens.far())?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{PlaneOptions, Surroundings, look_at};
    use proptest::prelude::*;

    fn level() -> Frame {
        look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y).unwrap()
    }

    fn close(a: DVec3, b: DVec3) -> bool {
        (a - b).abs().max_element() < 1e-12
    }

    #[test]
    fn quarter_turns_go_the_documented_way() {
        let mut frame = level();
        frame.yaw(90.0);
        assert!(close(frame.forward(), -DVec3::X), "nose left");
        let mut frame = level();
        frame.pitch(90.0);
        assert!(close(frame.forward(), DVec3::Y), "nose up");
        let mut frame = level();
        frame.roll(90.0);
        assert!(close(frame.u(), DVec3::Y) && close(frame.forward(), -DVec3::Z));
    }

    #[test]
    fn sliding_and_moving_follow_the_frame() {
        let mut frame = level();
        frame.yaw(90.0);
        frame.slide(1.0, 2.0, 3.0);
        assert!(
            close(frame.eye, DVec3::new(3.0, 2.0, -1.0)),
            "{}",
            frame.eye
        );
        frame.advance(3.0);
        assert!(
            close(frame.eye, DVec3::new(0.0, 2.0, -1.0)),
            "{}",
            frame.eye
        );
    }

    #[test]
    fn an_orbit_keeps_its_distance_and_its_target_in_view() {
        let centre = DVec3::new(5.0, -1.0, 2.0);
        let mut frame = look_at(centre + DVec3::X * 10.0, centre, DVec3::Z).unwrap();
        for _ in 0..1000 {
            frame.orbit(centre, DVec3::Z, 0.7, 0.0).unwrap();
        }
        let to_centre = centre - frame.eye;
        assert!((to_centre.length() - 10.0).abs() < 1e-10);
        assert!(close(to_centre / 10.0, frame.forward()));
        let swung = 700.0f64.to_radians();
        assert!(close(
            frame.eye - centre,
            DVec3::new(swung.cos(), swung.sin(), 0.0) * 10.0
        ));
        assert!(frame.orbit(centre, DVec3::ZERO, 1.0, 0.0).is_err());
        let before = frame;
        for bad in [f64::NAN, f64::INFINITY] {
            assert!(frame.orbit(DVec3::splat(bad), DVec3::Z, 1.0, 0.0).is_err());
            assert!(frame.orbit(centre, DVec3::Z, bad, 0.0).is_err());
            assert!(frame.orbit(centre, DVec3::Z, 1.0, bad).is_err());
            assert_eq!(frame, before);
            let mut turned = frame;
            turned.yaw(bad);
            let lens = Lens::perspective(90.0, 1.0, 1.0, None).unwrap();
            let camera = Camera {
                frame: turned,
                lens,
            };
            let volume = camera.volume(&PlaneOptions::default(), &Surroundings::default());
            assert!(volume.is_err(), "a turn by {bad}");
        }
    }

    #[test]
    fn zooming_halves_the_window() {
        let lens = Lens::perspective(90.0, 1.0, 1.0, None).unwrap();
        let mut camera = Camera {
            frame: level(),
            lens,
        };
        camera.zoom(2.0).unwrap();
        let LensKind::Perspective { fovy_deg, .. } = *camera.lens.kind() else {
            panic!("zooming keeps the kind of lens");
        };
        assert!((fovy_deg - 2.0 * 0.5f64.atan().to_degrees()).abs() < 1e-12);
        assert!(camera.zoom(0.0).is_err() && camera.zoom(f64::NAN).is_err());
    }

    proptest! {
        #[test]
        fn any_flight_keeps_the_frame_orthonormal_and_turns_undo(
            steps in prop::collection::vec((0..4usize, -400.0f64..400.0), 1..300)
        ) {
            let mut frame = level();
            for (what, amount) in &steps {
                match what {
                    0 => frame.yaw(*amount),
                    1 => frame.pitch(*amount),
                    2 => frame.roll(*amount),
                    _ => frame.slide(*amount, 0.0, -amount),
                }
            }
            prop_assert!(frame.orthogonality_error() < 1e-12);
            prop_assert!(close(frame.u().cross(frame.v()), frame.n()));
            for (what, amount) in steps.iter().rev() {
                match what {
                    0 => frame.yaw(-amount),
                    1 => frame.pitch(-amount),
                    2 => frame.roll(-amount),
                    _ => frame.slide(-amount, 0.0, *amount),
                }
            }
            prop_assert!((frame.n() - DVec3::Z).length() < 1e-10);
            prop_assert!(frame.eye.length() < 1e-8);
        }
    }
}
