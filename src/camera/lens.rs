//! Lenses: perspective, orthographic, off-axis and matrices.
//!
//! Each has a near plane and a far plane, which may be infinite except for orthographic lenses.

use std::cmp::Ordering;

use glam::DVec3;

use super::{
    Camera, CameraError, FARTHEST, Frame, MatrixConvention, Pose, Result, ViewProjection, finite,
    require,
};

/// Window, near and far plane of a camera. Lengths are world units.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Lens {
    kind: LensKind,
    near: f64,
    far: Option<f64>,
}

/// Window of a lens.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum LensKind {
    /// Symmetric about the axis of view.
    Perspective {
        /// Full vertical angle of view, 0 < fovy < 180.
        fovy_deg: f64,
        /// Width / height.
        aspect: f64,
    },
    /// A box; near and far may lie behind the eye.
    Orthographic {
        /// Height of the box.
        height: f64,
        /// Width / height.
        aspect: f64,
    },
    /// Any window on the near plane: stereo, tiled displays, portals.
    OffAxis {
        /// `[left, right, bottom, top]` about the axis of view.
        window: [f64; 4],
    },
    /// The whole camera as a matrix, see [`Camera::of_matrix`].
    ///
    /// The frame does not affect visibility.
    ///
    /// [`Camera::of_matrix`]: super::Camera::of_matrix
    Matrix(ViewProjection),
}

impl Lens {
    /// A lens by its full vertical angle in degrees and width / height.
    ///
    /// Without `far` the view volume is infinite.
    ///
    /// # Errors
    /// fov outside (0, 180), aspect outside 1e-100 to 1e100, near not above 0, beyond 1e100 or
    /// not below far, a value that is not finite. A far plane beyond [`FARTHEST`] is infinite.
    pub fn perspective(fovy_deg: f64, aspect: f64, near: f64, far: Option<f64>) -> Result<Lens> {
        Lens::new(LensKind::Perspective { fovy_deg, aspect }, near, far)
    }

    /// A lens of parallel rays by its height in world units and width / height.
    ///
    /// # Errors
    /// Height or aspect outside 1e-100 to 1e100, near beyond 1e100, far beyond
    /// [`FARTHEST`], near >= far, a value that is not finite.
    pub fn orthographic(height: f64, aspect: f64, near: f64, far: f64) -> Result<Lens> {
        Lens::new(LensKind::Orthographic { height, aspect }, near, Some(far))
    }

    /// A lens by its window on the near plane: left, right, bottom, top.
    ///
    /// # Errors
    /// An empty window or one outside 1e-100 to 1e100 of near, near not above 0,
    /// near >= far, a value that is not finite.
    pub fn off_axis(window: [f64; 4], near: f64, far: Option<f64>) -> Result<Lens> {
        Lens::new(LensKind::OffAxis { window }, near, far)
    }

    /// A lens of any kind but a matrix.
    ///
    /// # Errors
    /// The errors of the kind's constructor; an orthographic lens without far plane; a matrix.
    pub fn new(kind: LensKind, near: f64, far: Option<f64>) -> Result<Lens> {
        match kind {
            LensKind::Perspective { fovy_deg, aspect } => {
                let found = format_args!("the vertical field of view is {fovy_deg} degrees");
                require(fovy_deg > 0.0 && fovy_deg < 180.0, found, "0 < fov < 180")?;
                check_aspect(aspect)?;
            }
            LensKind::Orthographic { height, aspect } => {
                check_aspect(aspect)?;
                check_window("height", [0.0, height], 1.0)?;
            }
            LensKind::OffAxis {
                window: [left, right, bottom, top],
            } => {
                let unit = if near > 0.0 { near } else { 1.0 };
                check_window("left to right", [left, right], unit)?;
                check_window("bottom to top", [bottom, top], unit)?;
            }
            LensKind::Matrix(_) => return Err(CameraError::of_matrix("near and far planes")),
        }
        finite("near", near)?;
        let (found, is_held) = (format_args!("near is {near:e}"), near.abs() <= *EXACT.end());
        require(is_held, found, "at most 1e100 from the eye")?;
        let parallel = matches!(kind, LensKind::Orthographic { .. });
        let rule = "near > 0 for a perspective lens";
        require(parallel || near > 0.0, format_args!("near is {near}"), rule)?;
        if let Some(far) = far.or(parallel.then_some(f64::INFINITY)) {
            finite("far", far)?;
            let found = format_args!("near is {near} and far {far}");
            require(near < far, found, "near < far")?;
            let (found, is_held) = (format_args!("far is {far:e}"), !parallel || far <= FARTHEST);
            let rule = "at most 1.7e38, half of what f32 holds, for an orthographic lens";
            require(is_held, found, rule)?;
        }
        let far = far.filter(|far| *far <= FARTHEST);
        Ok(Lens { kind, near, far })
    }

    /// Window of the lens.
    pub fn kind(&self) -> &LensKind {
        &self.kind
    }

    /// The matrix, if that is the lens.
    pub fn matrix(&self) -> Option<&ViewProjection> {
        match &self.kind {
            LensKind::Matrix(matrix) => Some(matrix),
            _ => None,
        }
    }

    /// Distance of the near plane along the direction of view.
    pub fn near(&self) -> f64 {
        self.near
    }

    /// Distance of the far plane; `None` for an infinite one.
    pub fn far(&self) -> Option<f64> {
        self.far
    }

    /// The same lens with another far plane.
    ///
    /// # Errors
    /// near >= far, no far plane for an orthographic lens, a value that is not
    /// finite; a matrix.
    pub fn with_far(&self, far: Option<f64>) -> Result<Lens> {
        Lens::new(self.kind, self.near, far)
    }

    /// Left, right, bottom and top of the window.
    ///
    /// Slopes (offset per unit of depth) for a lens with a centre, plain offsets for an
    /// orthographic one. Unspecified for a matrix, which has planes and corners instead.
    pub fn window(&self) -> [f64; 4] {
        let (y, aspect) = match self.kind {
            LensKind::Perspective { fovy_deg, aspect } => (slope(fovy_deg), aspect),
            LensKind::Orthographic { height, aspect } => (height / 2.0, aspect),
            LensKind::OffAxis { window } => return window.map(|offset| offset / self.near),
            LensKind::Matrix(_) => return [f64::NAN; 4],
        };
        [-y * aspect, y * aspect, -y, y]
    }

    /// Height of the view at a depth, in world units.
    ///
    /// `None` for a matrix, which has no window.
    pub fn height_at(&self, depth: f64) -> Option<f64> {
        let [_, _, bottom, top] = self.window();
        let reach = if self.is_orthographic() { 1.0 } else { depth };
        Some((top - bottom) * reach).filter(|height| height.is_finite())
    }

    /// Returns whether all lines of sight are parallel.
    pub fn is_orthographic(&self) -> bool {
        match self.kind {
            LensKind::Matrix(matrix) => matrix.is_parallel,
            kind => matches!(kind, LensKind::Orthographic { .. }),
        }
    }

    /// The eight corners of the view volume in the frame's world, near ones first.
    ///
    /// `None` if the far plane is infinite.
    pub fn corners(&self, frame: &Frame) -> Option<[DVec3; 8]> {
        if let LensKind::Matrix(matrix) = self.kind {
            return matrix.corners_about(&[]);
        }
        let ends = [self.near, self.far?].map(|depth| self.corners_at(frame, depth));
        ends.concat().try_into().ok()
    }

    /// The four corners of the view volume at a depth: bit 0 is right, bit 1 top.
    pub(super) fn corners_at(&self, frame: &Frame, depth: f64) -> [DVec3; 4] {
        let [left, right, bottom, top] = self.window();
        let reach = if self.is_orthographic() { 1.0 } else { depth };
        [0, 1, 2, 3].map(|i| {
            let x = reach * if i & 1 == 0 { left } else { right };
            let y = reach * if i & 2 == 0 { bottom } else { top };
            frame.eye + frame.u * x + frame.v * y - frame.n * depth
        })
    }
}

/// The tangent of half an angle in degrees, true to some units of 2^-53; 1 at 90.
///
/// Also near 180 degrees, where the angle's difference from 180 is small and exact.
fn slope(degrees: f64) -> f64 {
    let below = |degrees: f64| libm::tan(degrees.to_radians() / 2.0);
    match degrees.total_cmp(&90.0) {
        Ordering::Less => below(degrees),
        // The tangent of the rounded angle is not exactly 1.
        Ordering::Equal => 1.0,
        Ordering::Greater => 1.0 / below(180.0 - degrees),
    }
}

/// Sizes for which products of four neither overflow nor underflow in the oracle.
const EXACT: std::ops::RangeInclusive<f64> = 1e-100..=1e100;

fn check_aspect(aspect: f64) -> Result<()> {
    let found = format_args!("the aspect ratio is {aspect:?}");
    require(EXACT.contains(&aspect), found, "1e-100 to 1e100")
}

/// Checks two sides of a window.
///
/// Sizes are relative to `unit`: for a lens with rays near, since ray directions depend on their
/// quotient.
fn check_window(name: &str, [low, high]: [f64; 2], unit: f64) -> Result<()> {
    finite(name, low)?;
    finite(name, high)?;
    let found = format_args!("the window is empty: {low} to {high} ({name})");
    require(low < high, found, "low < high")?;
    let far_out = low.abs().max(high.abs()) / unit;
    let is_held = EXACT.contains(&((high - low) / unit)) && far_out <= *EXACT.end();
    let found = format_args!("the window is {low:e} to {high:e} ({name})");
    let rule = "sizes from 1e-100 to 1e100 (off axis, times near)";
    require(is_held, found, rule)
}

impl Camera {
    /// The camera of a view-projection matrix.
    ///
    /// The matrix is its lens. The frame has the position of the eye (the centre of the near plane
    /// if the matrix is orthographic) and the direction of view; turning or moving it does not
    /// change visibility.
    ///
    /// # Errors
    /// The errors of [`ViewProjection::new`].
    pub fn of_matrix(entries: [[f64; 4]; 4], convention: MatrixConvention) -> Result<Camera> {
        let matrix = ViewProjection::new(entries, convention)?;
        let [_, up, _, forward] = matrix.rows.map(|[x, y, z, _]| DVec3::new(x, y, z));
        let axis = matrix.is_parallel.then(|| matrix.axis()).flatten();
        let forward = axis.map_or(forward, |[_, ahead]| ahead);
        let eye = matrix.eye;
        // Visibility does not depend on the camera basis, so any up vector will do.
        let with = |up: DVec3| Pose::Forward { eye, forward, up }.frame();
        let frame = with(up).or_else(|_| with(forward.any_orthogonal_vector()))?;
        let (kind, near, far) = (LensKind::Matrix(matrix), matrix.near, matrix.far);
        let lens = Lens { kind, near, far };
        Ok(Camera { frame, lens })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The second row is nearly parallel to the fourth: refused as an up vector.
    #[test]
    fn a_matrix_needs_no_up() {
        for up in [1.0, 1e-14, 1e-16, 1e-20, 1e-60] {
            let entries = [
                [1.0, 0.0, 0.0, 0.0],
                [0.0, up, -1.0, 0.0],
                [0.0, 0.0, -1.0002, -0.20002],
                [0.0, 0.0, -1.0, 0.0],
            ];
            let camera = Camera::of_matrix(entries, MatrixConvention::ColumnGl).unwrap();
            assert_eq!(camera.frame.eye, DVec3::ZERO, "{up:e}");
            assert_eq!(camera.frame.forward(), -DVec3::Z, "{up:e}");
        }
    }

    #[test]
    fn slopes_keep_their_digits_up_to_180_degrees() {
        // 180 minus 2^-40 degrees: the tangent is 2 / (2^-40 pi/180), up to a relative error of
        // 1e-27.
        let missing = libm::exp2(-40.0);
        let true_slope = 2.0 / (missing * (std::f64::consts::PI / 180.0));
        let off = slope(180.0 - missing) / true_slope - 1.0;
        assert!(off.abs() < 1e-15, "{off:e}");
        assert!((slope(120.0) / 3f64.sqrt() - 1.0).abs() < 4e-16);
        assert_eq!(slope(90.0), 1.0);
    }

    /// Engines write the largest f32 if there is no far plane.
    #[test]
    fn a_far_plane_beyond_f32_is_none() {
        let largest = f64::from(f32::MAX);
        for far in [FARTHEST * (1.0 + f64::EPSILON), largest, 1e39, 1e308] {
            let lens = Lens::perspective(60.0, 1.0, 1.0, Some(far)).unwrap();
            assert_eq!(lens.far(), None, "{far:e}");
            assert_eq!(lens.with_far(Some(far)).unwrap(), lens);
            let lens = Lens::off_axis([-1.0, 1.0, -1.0, 1.0], 1.0, Some(far)).unwrap();
            assert_eq!(lens.far(), None, "{far:e}");
            let error = Lens::orthographic(1.0, 1.0, 1.0, far).unwrap_err();
            assert!(error.to_string().contains("orthographic"), "{error}");
        }
        let lens = Lens::perspective(60.0, 1.0, 1.0, Some(FARTHEST)).unwrap();
        assert_eq!(lens.far(), Some(FARTHEST));
        assert!(Lens::perspective(60.0, 1.0, 1e39, Some(largest)).is_err());
    }

    fn refused(lens: Result<Lens>, what: &str) -> bool {
        lens.is_err_and(|error| error.to_string().starts_with(what))
    }

    #[test]
    fn impossible_lenses_are_errors_that_name_the_value() {
        for fovy_deg in [
            0.0,
            -0.0,
            -1.0,
            180.0,
            180.00001,
            400.0,
            f64::NAN,
            f64::INFINITY,
        ] {
            let lens = Lens::perspective(fovy_deg, 1.0, 1.0, None);
            assert!(
                refused(lens, "the vertical field of view is "),
                "{fovy_deg}"
            );
        }
        for aspect in [0.0, -1.0, 1e-101, 1e101, f64::NAN, f64::INFINITY] {
            let lens = Lens::perspective(60.0, aspect, 1.0, None);
            assert!(refused(lens, "the aspect ratio is "), "{aspect}");
        }
        for size in [5e-324, 1e-101, 1e101] {
            let lens = Lens::orthographic(size, 1.0, 0.0, 1.0);
            assert!(refused(lens, "the window is 0e0 to "), "{size}");
            let lens = Lens::off_axis([0.0, 1.0, 0.0, size], 1.0, None);
            assert!(refused(lens, "the window is 0e0 to "), "{size}");
        }
        for at in [1e101, -1e300] {
            let lens = Lens::orthographic(1.0, 1.0, at, 1.0);
            assert!(refused(lens, "near is "), "{at}");
        }
        let near = |near, far| Lens::perspective(60.0, 1.0, near, far);
        for at in [0.0, -0.0, -1.0, -1e-300] {
            for lens in [near(at, Some(9.0)), near(at, None)] {
                assert!(refused(lens, "near is "), "{at}");
            }
        }
        for (at, far) in [(8.0, 8.0), (8.0, 4.0), (1e-300, 0.0), (1.0, -9.0)] {
            let lens = near(at, Some(far));
            let found = format!("near is {at} and far {far}");
            assert!(refused(lens, &found), "{at} {far}");
        }
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for lens in [near(bad, None), near(1.0, Some(bad))] {
                let Err(error) = lens else { panic!("{bad}") };
                assert!(error.to_string().ends_with("expected a finite number"));
            }
        }
        assert!(Lens::orthographic(0.0, 1.0, 0.0, 1.0).is_err());
        assert!(Lens::orthographic(1.0, 1.0, 1.0, 1.0).is_err());
        for window in [[1.0, 1.0, 0.0, 1.0], [0.0, 1.0, 1.0, 0.0]] {
            let lens = Lens::off_axis(window, 1.0, None);
            assert!(refused(lens, "the window is empty"), "{window:?}");
        }
    }
}
