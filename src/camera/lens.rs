//! Lenses: perspective, orthographic and off-axis, each with a finite or (but
//! for orthographic) infinite far plane. It owns their validation and the
//! corners of what they see.

use glam::DVec3;

use super::{CameraError, Frame, finite};

/// What the camera's lens takes in. Lengths are world units. Use the checked
/// constructors; the planes of an unchecked lens may be nonsense.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Lens {
    /// Symmetric; `fovy_deg` is the full vertical angle, aspect = width/height.
    Perspective {
        fovy_deg: f64,
        aspect: f64,
        near: f64,
        /// `None` is infinite: the volume has five planes.
        far: Option<f64>,
    },
    /// A box `height` high; near and far may lie behind the eye.
    Orthographic {
        height: f64,
        aspect: f64,
        near: f64,
        far: f64,
    },
    /// Any window `[left, right, bottom, top]` on the near plane: stereo,
    /// tiled displays, portals.
    OffAxis {
        window: [f64; 4],
        near: f64,
        far: Option<f64>,
    },
}

impl Lens {
    /// # Errors
    /// fov outside (0, 180), aspect or near not above 0, near >= far, a value
    /// that is not finite.
    pub fn perspective(
        fovy_deg: f64,
        aspect: f64,
        near: f64,
        far: Option<f64>,
    ) -> Result<Lens, CameraError> {
        // The negations catch NaN too.
        if !(fovy_deg > 0.0 && fovy_deg < 180.0) {
            return Err(CameraError::FieldOfView { fovy_deg });
        }
        check_aspect(aspect)?;
        check_depth(near, far)?;
        Ok(Lens::Perspective {
            fovy_deg,
            aspect,
            near,
            far,
        })
    }

    /// # Errors
    /// Height or aspect not above 0, near >= far, a value that is not finite.
    pub fn orthographic(
        height: f64,
        aspect: f64,
        near: f64,
        far: f64,
    ) -> Result<Lens, CameraError> {
        check_aspect(aspect)?;
        check_window("height", 0.0, height)?;
        finite("near", near)?;
        finite("far", far)?;
        if near >= far {
            return Err(CameraError::NearFar { near, far });
        }
        Ok(Lens::Orthographic {
            height,
            aspect,
            near,
            far,
        })
    }

    /// # Errors
    /// An empty window, near not above 0, near >= far, a value that is not
    /// finite.
    pub fn off_axis(window: [f64; 4], near: f64, far: Option<f64>) -> Result<Lens, CameraError> {
        let [left, right, bottom, top] = window;
        check_window("left to right", left, right)?;
        check_window("bottom to top", bottom, top)?;
        check_depth(near, far)?;
        Ok(Lens::OffAxis { window, near, far })
    }

    pub fn near(&self) -> f64 {
        match *self {
            Lens::Perspective { near, .. }
            | Lens::Orthographic { near, .. }
            | Lens::OffAxis { near, .. } => near,
        }
    }

    /// `None` for an infinite far plane.
    pub fn far(&self) -> Option<f64> {
        match *self {
            Lens::Perspective { far, .. } | Lens::OffAxis { far, .. } => far,
            Lens::Orthographic { far, .. } => Some(far),
        }
    }

    /// The same lens with another far plane.
    ///
    /// # Errors
    /// near >= far, or no far plane for an orthographic lens.
    pub fn with_far(&self, far: Option<f64>) -> Result<Lens, CameraError> {
        self.with_depth(self.near(), far)
    }

    /// The same angles (or, orthographic, the same height) between other
    /// planes near and far.
    ///
    /// # Errors
    /// near >= far, near not above 0 but for an orthographic lens, which also
    /// needs a far plane; a value that is not finite.
    pub fn with_depth(&self, near: f64, far: Option<f64>) -> Result<Lens, CameraError> {
        match *self {
            Lens::Perspective {
                fovy_deg, aspect, ..
            } => Lens::perspective(fovy_deg, aspect, near, far),
            Lens::OffAxis {
                window,
                near: measured_at,
                ..
            } => {
                // Exactly 1 where near stays.
                let scale = near / measured_at;
                Lens::off_axis(window.map(|edge| edge * scale), near, far)
            }
            Lens::Orthographic { height, aspect, .. } => {
                Lens::orthographic(height, aspect, near, far.unwrap_or(f64::INFINITY))
            }
        }
    }

    /// Left, right, bottom and top: slopes (offset per unit of depth) for a
    /// lens with a centre, plain offsets for an orthographic one.
    pub(super) fn window(&self) -> [f64; 4] {
        match *self {
            Lens::Perspective {
                fovy_deg, aspect, ..
            } => {
                let y = libm::tan(fovy_deg.to_radians() / 2.0);
                [-y * aspect, y * aspect, -y, y]
            }
            Lens::Orthographic { height, aspect, .. } => {
                let y = height / 2.0;
                [-y * aspect, y * aspect, -y, y]
            }
            Lens::OffAxis { window, near, .. } => window.map(|offset| offset / near),
        }
    }

    pub(super) fn is_orthographic(&self) -> bool {
        matches!(self, Lens::Orthographic { .. })
    }

    /// The eight corners of the view volume in the frame's world, near ones
    /// first; `None` if the far plane is infinite.
    pub fn corners(&self, frame: &Frame) -> Option<[DVec3; 8]> {
        let far = self.far()?;
        let [left, right, bottom, top] = self.window();
        let mut corners = [DVec3::ZERO; 8];
        for (i, corner) in corners.iter_mut().enumerate() {
            let depth = if i < 4 { self.near() } else { far };
            let reach = if self.is_orthographic() { 1.0 } else { depth };
            let x = reach * if i & 1 == 0 { left } else { right };
            let y = reach * if i & 2 == 0 { bottom } else { top };
            *corner = frame.eye + frame.u * x + frame.v * y - frame.n * depth;
        }
        Some(corners)
    }
}

fn check_aspect(aspect: f64) -> Result<(), CameraError> {
    if aspect > 0.0 && aspect.is_finite() {
        Ok(())
    } else {
        Err(CameraError::Aspect { aspect })
    }
}

fn check_depth(near: f64, far: Option<f64>) -> Result<(), CameraError> {
    finite("near", near)?;
    if near <= 0.0 {
        return Err(CameraError::Near { near });
    }
    let Some(far) = far else { return Ok(()) };
    finite("far", far)?;
    if near >= far {
        return Err(CameraError::NearFar { near, far });
    }
    Ok(())
}

fn check_window(name: &'static str, low: f64, high: f64) -> Result<(), CameraError> {
    finite(name, low)?;
    finite(name, high)?;
    if low < high {
        Ok(())
    } else {
        Err(CameraError::Window { name, low, high })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_lenses_are_typed_errors() {
        for fovy_deg in [0.0, 180.0, -10.0, 400.0, f64::NAN] {
            let lens = Lens::perspective(fovy_deg, 1.0, 1.0, None);
            assert!(
                matches!(lens, Err(CameraError::FieldOfView { .. })),
                "{fovy_deg}"
            );
        }
        for aspect in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let lens = Lens::perspective(60.0, aspect, 1.0, None);
            assert!(matches!(lens, Err(CameraError::Aspect { .. })), "{aspect}");
        }
        let near = |near, far| Lens::perspective(60.0, 1.0, near, far);
        assert!(matches!(near(0.0, None), Err(CameraError::Near { .. })));
        assert!(matches!(
            near(8.0, Some(8.0)),
            Err(CameraError::NearFar { .. })
        ));
        assert!(matches!(
            near(1.0, Some(f64::NAN)),
            Err(CameraError::NotFinite { .. })
        ));
        assert!(Lens::orthographic(0.0, 1.0, 0.0, 1.0).is_err());
        assert!(Lens::orthographic(1.0, 1.0, 1.0, 1.0).is_err());
        assert!(Lens::off_axis([1.0, 1.0, 0.0, 1.0], 1.0, None).is_err());
    }
}
