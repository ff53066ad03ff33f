//! Cameras: a frame (eye, u, v, n), a lens, and the matrices and planes of both.

mod controls;
mod frame;
mod lens;
mod margin;
mod matrix;
mod planes;
mod projection;
mod unprojected;

pub use frame::{Frame, Pose, look_at};
pub use lens::{Lens, LensKind};
pub(crate) use margin::check_sums;
pub use matrix::{FARTHEST, MATRIX_CONVENTIONS, MATRIX_ENTRIES, MatrixConvention, ViewProjection};
pub use planes::{DEFAULT_EPSILON, PLANE_METHODS, PlaneMethod, PlaneOptions, Surroundings};
pub use projection::ClipSpace;
pub use unprojected::Unprojected;

use std::fmt::Arguments;

use crate::geometry::VolumeError;

/// A frame (position and orientation) and a lens.
///
/// World coordinates are f64; the planes that a query needs come from [`Camera::volume`] in
/// scene-local f32.
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
    /// Position and orientation.
    pub frame: Frame,
    /// Window, near and far plane.
    pub lens: Lens,
}

/// A result about cameras.
pub type Result<T, E = CameraError> = std::result::Result<T, E>;

/// Numbers that define no camera, or a camera whose planes f32 cannot hold.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// Eye, direction, lens or matrix outside the allowed range.
    #[error("{found}; expected {expected}")]
    Invalid {
        /// The argument and its value.
        found: String,
        /// The rule it breaks.
        expected: &'static str,
    },
    /// A plane that f32 cannot store.
    #[error(
        "the view volume does not fit f32: {0}; expected planes within its range; f64 arithmetic has a larger one"
    )]
    Volume(#[from] VolumeError),
    /// A sum of the plane test that could overflow f32.
    #[error(
        "sums of the plane test reach {largest:e} in scene coordinates; expected at most 1.7e38, half of what f32 holds; f64 arithmetic, if the test has it, has no such limit"
    )]
    Sums {
        /// Upper bound of the sums.
        largest: f64,
    },
}

impl CameraError {
    fn invalid(found: impl Into<String>, expected: &'static str) -> CameraError {
        let found = found.into();
        CameraError::Invalid { found, expected }
    }

    /// The error for matrix cameras, which cannot be moved or given a lens.
    fn of_matrix(what: &str) -> CameraError {
        let found = format!("the camera is a matrix, which has {what} of its own");
        CameraError::invalid(found, "an eye and a lens for another")
    }
}

/// Checks a rule of camera arguments; formats `found` only if it is broken.
fn require(holds: bool, found: Arguments<'_>, expected: &'static str) -> Result<()> {
    match holds {
        true => Ok(()),
        false => Err(CameraError::invalid(found.to_string(), expected)),
    }
}

fn finite(name: &str, value: f64) -> Result<()> {
    let found = format_args!("{name} is {value}");
    require(value.is_finite(), found, "a finite number")
}
