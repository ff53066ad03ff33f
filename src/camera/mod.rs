//! The camera of the lectures: a frame (eye, u, v, n), a lens, and what
//! follows from the two: matrices and the planes of the view volume. It knows
//! nothing of scenes, files or indexes.

mod controls;
mod frame;
mod lens;
mod margin;
mod matrix;
mod planes;
mod pose;
mod projection;

pub use frame::{Frame, look_at};
pub use lens::Lens;
pub(crate) use margin::check_sums;
pub use matrix::{FARTHEST, MATRIX_CONVENTIONS, MATRIX_ENTRIES, MatrixConvention, ViewProjection};
pub use planes::{DEFAULT_EPSILON, PLANE_METHODS, PlaneMethod, PlaneOptions, Surroundings};
pub use pose::Pose;
pub use projection::ClipSpace;

use crate::geometry::VolumeError;

/// Where the camera stands and what its lens takes in.
///
/// World coordinates are f64; the planes that a query needs come from
/// [`Camera::volume`] in scene-local f32.
///
/// ```
/// use cullbench::camera::{Camera, Lens, PlaneOptions, Surroundings, look_at};
/// use cullbench::geometry::{Aabb, FrustumPlane};
/// use glam::{DVec3, Vec3};
///
/// let frame = look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y)?;
/// let lens = Lens::perspective(90.0, 1.0, 1.0, Some(8.0))?;
/// let camera = Camera { frame, lens };
/// let volume = camera.volume(&PlaneOptions::default(), &Surroundings::default())?;
/// let ahead = Aabb::new(Vec3::new(-1.0, -1.0, -4.0), Vec3::new(1.0, 1.0, -2.0));
/// let behind = Aabb::new(Vec3::splat(1.0), Vec3::splat(2.0));
/// assert!(volume.sees(&ahead) && !volume.sees(&behind));
/// assert!(volume.plane(FrustumPlane::Far).is_some());
/// # Ok::<(), cullbench::camera::CameraError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Camera {
    /// Where it is and how it is turned.
    pub frame: Frame,
    /// What it takes in.
    pub lens: Lens,
}

/// Why there is no such camera. Every message names the value and the rule.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// A number that is infinite or no number.
    #[error("{name} is {value}; expected a finite number")]
    NotFinite {
        /// Name of the argument.
        name: &'static str,
        /// What was given.
        value: f64,
    },
    /// There is no direction of view.
    #[error("eye and look are the same point; expected two different points")]
    EyeIsLook,
    /// There is no direction of view.
    #[error("forward is zero; expected a direction")]
    ForwardIsZero,
    /// There is no side that is up.
    #[error(
        "up is zero or parallel to the direction of view; expected an up vector that is neither"
    )]
    UpParallel,
    /// The direction of up is all rounding.
    #[error(
        "up is {sine:e} rad from the direction of view or its opposite; expected more than 8.9e-16"
    )]
    UpNearlyParallel {
        /// Sine of the angle between up and the direction of view.
        sine: f64,
    },
    /// No angle that a perspective lens can have.
    #[error("the vertical field of view is {fovy_deg} degrees; expected 0 < fov < 180")]
    FieldOfView {
        /// What was given.
        fovy_deg: f64,
    },
    /// No ratio of width to height.
    #[error("the aspect ratio is {aspect}; expected a number above 0")]
    Aspect {
        /// What was given.
        aspect: f64,
    },
    /// A near plane at or behind the eye.
    #[error("near is {near}; expected near > 0 for a perspective lens")]
    Near {
        /// What was given.
        near: f64,
    },
    /// A depth range that is empty.
    #[error("near is {near} and far {far}; expected near < far")]
    NearFar {
        /// What was given.
        near: f64,
        /// What was given.
        far: f64,
    },
    /// An orthographic lens without an end.
    #[error(
        "far is {far:e}; expected at most 1.7e38, half of what f32 holds, for an orthographic lens"
    )]
    FarOrthographic {
        /// What was given.
        far: f64,
    },
    /// An off-axis window that is empty.
    #[error("the window is empty: {low} to {high} ({name}); expected low < high")]
    Window {
        /// Which sides.
        name: &'static str,
        /// The side that should be lower.
        low: f64,
        /// The side that should be higher.
        high: f64,
    },
    /// An entry whose products would leave the range of f64.
    #[error("the matrix has {name} = {value:e}; expected 0 or a size from 1e-60 to 1e60")]
    MatrixEntry {
        /// Row and column, `m03`.
        name: &'static str,
        /// What was given.
        value: f64,
    },
    /// A matrix without inverse.
    #[error("the matrix is singular; expected one that has an inverse")]
    MatrixSingular,
    /// A matrix that maps no point to the centre of projection.
    #[error("the matrix has no eye (is it orthographic?); expected a perspective one")]
    MatrixWithoutEye,
    /// A matrix with an empty clip volume.
    #[error(
        "the matrix sees nothing, no point has w > 0 within its clip volume; expected another sign or --matrix-convention"
    )]
    MatrixSeesNothing,
    /// A matrix camera cannot be moved or given a lens.
    #[error(
        "the camera is a matrix, which has {what} of its own; expected an eye and a lens for another"
    )]
    MatrixFixed {
        /// What was to be changed.
        what: &'static str,
    },
    /// Planes of a matrix are not derived by another method.
    #[error("the camera is a matrix, which has planes of its own; expected --planes frame")]
    MatrixMethod,
    /// A zoom that is not positive.
    #[error("the zoom factor is {factor}; expected a number above 0")]
    Zoom {
        /// What was given.
        factor: f64,
    },
    /// No axis to turn about.
    #[error("the axis of the orbit is zero or not finite; expected a direction")]
    Axis,
    /// The planes cannot be stored in f32.
    #[error("the view volume does not fit f32: {0}; expected planes within its range")]
    Volume(#[from] VolumeError),
    /// Sums of the plane test could overflow f32.
    #[error(
        "sums of the plane test reach {largest:e} in scene coordinates; expected at most 1.7e38, half of what f32 holds"
    )]
    Sums {
        /// Largest sum that may come up.
        largest: f64,
    },
}

pub(crate) fn finite(name: &'static str, value: f64) -> Result<f64, CameraError> {
    let error = CameraError::NotFinite { name, value };
    value.is_finite().then_some(value).ok_or(error)
}
