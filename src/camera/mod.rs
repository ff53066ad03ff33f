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
pub use matrix::{MATRIX_CONVENTIONS, MATRIX_ENTRIES, MatrixConvention, ViewProjection};
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
    pub frame: Frame,
    pub lens: Lens,
}

/// Why there is no such camera. Every message names the value and the rule.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum CameraError {
    #[error("{name} is {value}; expected a finite number")]
    NotFinite { name: &'static str, value: f64 },
    #[error("eye and look are the same point; expected two different points")]
    EyeIsLook,
    #[error("forward is zero; expected a direction")]
    ForwardIsZero,
    #[error(
        "up is zero or parallel to the direction of view; expected an up vector that is neither"
    )]
    UpParallel,
    #[error(
        "up is {sine:e} rad from the direction of view or its opposite; expected more than 8.9e-16"
    )]
    UpNearlyParallel { sine: f64 },
    #[error("the vertical field of view is {fovy_deg} degrees; expected 0 < fov < 180")]
    FieldOfView { fovy_deg: f64 },
    #[error("the aspect ratio is {aspect}; expected a number above 0")]
    Aspect { aspect: f64 },
    #[error("near is {near}; expected near > 0 for a perspective lens")]
    Near { near: f64 },
    #[error("near is {near} and far {far}; expected near < far")]
    NearFar { near: f64, far: f64 },
    #[error("the window is empty: {low} to {high} ({name}); expected low < high")]
    Window {
        name: &'static str,
        low: f64,
        high: f64,
    },
    #[error("the matrix has {name} = {value:e}; expected 0 or a size from 1e-60 to 1e60")]
    MatrixEntry { name: &'static str, value: f64 },
    #[error("the matrix is singular; expected one that has an inverse")]
    MatrixSingular,
    #[error("the matrix has no eye (is it orthographic?); expected a perspective one")]
    MatrixWithoutEye,
    #[error(
        "the matrix sees nothing, no point has w > 0 within its clip volume; expected another sign or --matrix-convention"
    )]
    MatrixSeesNothing,
    #[error(
        "the camera is a matrix, which has {what} of its own; expected an eye and a lens for another"
    )]
    MatrixFixed { what: &'static str },
    #[error("the camera is a matrix, which has planes of its own; expected --planes frame")]
    MatrixMethod,
    #[error("the zoom factor is {factor}; expected a number above 0")]
    Zoom { factor: f64 },
    #[error("the axis of the orbit is zero or not finite; expected a direction")]
    Axis,
    #[error("the view volume does not fit f32: {0}; expected planes within its range")]
    Volume(#[from] VolumeError),
    #[error(
        "sums of the plane test reach {largest:e} in scene coordinates; expected at most 1.7e38, half of what f32 holds"
    )]
    Sums { largest: f64 },
}

pub(crate) fn finite(name: &'static str, value: f64) -> Result<f64, CameraError> {
    let error = CameraError::NotFinite { name, value };
    value.is_finite().then_some(value).ok_or(error)
}
