//! Planes of a camera's view volume, by selectable derivations.
//!
//! Derivations start at the frame or at a matrix, in f32 or f64; a conservative epsilon makes a
//! false negative impossible.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::margin::Margin;
use super::projection::{double, single};
use super::{Camera, CameraError, ClipSpace, LensKind, Result};
use crate::geometry::{
    Aabb, ConvexVolume, ConvexVolumeF64, FrustumPlane, Plane, PlaneF64, RelativeVolume,
};

named! {
    /// Derivation of the planes.
    #[derive(Clone, Copy, PartialEq, Eq, Default, Debug, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum PlaneMethod, PLANE_METHODS {
        ///
        /// For a camera given as a matrix, the planes come from its rows.
        #[default]
        Frame = "frame", "from the camera's frame in f64, rounded once (default)";
        FrameF32 = "frame-f32", "from the frame, every operation in f32";
        GhGlF32 = "gh-gl-f32", "Gribb-Hartmann from an f32 OpenGL matrix";
        GhGlF64 = "gh-gl-f64", "Gribb-Hartmann from an f64 OpenGL matrix";
        GhD3dF32 = "gh-d3d-f32", "Gribb-Hartmann from an f32 D3D/Vulkan matrix";
        GhD3dF64 = "gh-d3d-f64", "Gribb-Hartmann from an f64 D3D/Vulkan matrix";
        GhRevzF32 = "gh-revz-f32", "Gribb-Hartmann from an f32 reversed-Z matrix";
        GhRevzF64 = "gh-revz-f64", "Gribb-Hartmann from an f64 reversed-Z matrix";
    }
}

/// Factor c of the conservative epsilon.
///
/// The epsilon covers the rounding of the planes (f64 to f32) and of the plane test itself.
pub const DEFAULT_EPSILON: f64 = 8.0;

defaults! {
    /// Derivation of the planes, and their epsilon.
    #[derive(Clone, Copy, PartialEq, Debug)]
    pub struct PlaneOptions {
        /// Method and arithmetic of the derivation.
        pub method: PlaneMethod = PlaneMethod::default(),
        /// The factor c; 0 leaves the planes unmoved.
        pub epsilon: f64 = DEFAULT_EPSILON,
    }
}

impl PlaneOptions {
    /// The same derivation without an epsilon.
    pub fn without_epsilon(mut self) -> PlaneOptions {
        self.epsilon = 0.0;
        self
    }
}

/// Origin and extent of a scene, for which planes are rounded and moved.
///
/// Computed once per scene, so that all structures are queried with the same planes.
#[derive(Clone, Copy, PartialEq, Default, Debug)]
pub struct Surroundings {
    /// World position of the scene's local origin.
    pub origin: DVec3,
    /// Largest absolute local coordinate of any item, per axis.
    ///
    /// It bounds the epsilon and the sums of the plane test; no guarantee holds for items beyond
    /// it. Zero means unknown: the epsilon is then the volume's own (and too small without a far
    /// plane), and sums are not checked for items.
    pub reach: Vec3,
}

impl Surroundings {
    /// Surroundings of boxes in world coordinates.
    pub fn of_boxes(items: &[Aabb]) -> Surroundings {
        Surroundings {
            origin: DVec3::ZERO,
            reach: Aabb::union_of(items).reach(),
        }
    }
}

impl Camera {
    /// The view volume in scene-local f32 coordinates.
    ///
    /// With a positive epsilon c each plane is moved outward to
    /// `d' = round_up(d + c*u*(sum |n_k|*x_k + |d|) + ...)`, u = 2^-24, where x is the worst
    /// visible point near enough to the plane. This suffices: a box that meets the volume contains
    /// a point x of it, and the p-vertex evaluates no lower than x (rounding is monotone); the
    /// error at x is less than the margin. docs/NUMERICS.md has the proof.
    ///
    /// # Errors
    /// [`CameraError::Volume`] if a plane does not fit f32 (or the chosen method loses it);
    /// [`CameraError::Sums`] if a sum of the plane test could overflow within the surroundings'
    /// reach; [`CameraError::Invalid`] for an epsilon or a reach that is negative or NaN, or an
    /// infinite epsilon.
    pub fn volume(&self, options: &PlaneOptions, around: &Surroundings) -> Result<ConvexVolume> {
        self.volume_with(&[], options, around)
    }

    /// The view volume with further planes (scene-local, of unit length).
    ///
    /// Each plane is rounded to f32 and moved outward like the six: its own error must be small
    /// against 2^-24. Planes that f32 cannot hold are omitted, which is always safe.
    ///
    /// # Errors
    /// The errors of [`Camera::volume`]; more planes than a volume can hold.
    pub fn volume_with(
        &self,
        more: &[PlaneF64],
        options: &PlaneOptions,
        around: &Surroundings,
    ) -> Result<ConvexVolume> {
        let of_scene = around.reach.as_dvec3();
        let zero = [around.origin];
        let named = self.derive(&zero, options.method)?;
        let by_frame = options.method == PlaneMethod::Frame;
        let margin = Margin::new(self, &zero, of_scene, options.epsilon, by_frame)?;
        margin.volume(&named, more, of_scene, 0.0)
    }

    /// The planes of the frame in f64, without a margin.
    ///
    /// # Errors
    /// [`CameraError::Volume`] if a plane does not even fit f64.
    pub fn convex_volume_f64(&self, around: &Surroundings) -> Result<ConvexVolumeF64> {
        let planes = self.planes_f64(&[around.origin]).into_iter();
        let planes: Vec<PlaneF64> = planes.map(|(_, plane)| plane).collect();
        Ok(ConvexVolumeF64::from_planes(&planes)?)
    }

    /// The view volume in coordinates relative to the eye.
    ///
    /// The local eye, rounded to f32, becomes the origin; its rounding error goes into the offsets
    /// in f64, and each plane is rounded to f32 once.
    ///
    /// With a positive epsilon c the planes are moved outward as in [`Camera::volume`], but with
    /// coordinates relative to the eye instead of the scene's origin: that is the gain far away.
    /// Let u = 2^-24 and x a visible point of a box. `x_k - e_k` is rounded once, its product with
    /// `n_k` once, and the product goes through at most three sums: 5 roundings; the rounding of
    /// the normal is the sixth. Each is at most u of `|n_k| |x_k|`; the offset is rounded and goes
    /// through one sum, 2 of `|d|`. So slightly more than c = 6 covers all, and c = 8 does. Two
    /// smaller terms are added: the subtraction of the scene's origin in f64 (2^-53 of the local
    /// eye), and normals that underflow (2^-150 of x).
    ///
    /// Further planes are relative to the unrounded eye and of unit length: see
    /// [`Camera::volume_with`].
    ///
    /// # Errors
    /// [`CameraError::Volume`] if the eye or a plane does not fit f32; more planes than a volume
    /// can hold.
    pub fn relative_volume(
        &self,
        more: &[PlaneF64],
        epsilon: f64,
        around: &Surroundings,
    ) -> Result<RelativeVolume> {
        let local = self.frame.relative_to(around.origin);
        let eye = local.eye.as_vec3();
        let zero = eye.as_dvec3();
        // Exact: f64 holds the difference.
        let left = local.eye - zero;
        let about = [around.origin, zero];
        let named = self.derive(&about, PlaneMethod::Frame)?;
        let more: Vec<PlaneF64> = more.iter().map(|plane| plane.about(-left)).collect();
        let reach = around.reach.as_dvec3();
        let of_scene = match around.reach {
            Vec3::ZERO if self.lens.far().is_some() => DVec3::ZERO,
            _ => reach + zero.abs(),
        };
        let margin = Margin::new(self, &about, of_scene, epsilon, true)?;
        let of_eye = local.eye.abs().element_sum() * f64::EPSILON;
        let planes = margin.volume(&named, &more, reach + zero.abs(), of_eye)?;
        Ok(RelativeVolume::new(eye, planes)?)
    }

    fn planes_f64(&self, zero: &[DVec3]) -> Vec<(FrustumPlane, PlaneF64)> {
        match self.lens.kind() {
            LensKind::Matrix(matrix) => matrix.planes_about(zero),
            _ => double::from_frame(&self.frame_about(zero), &self.lens),
        }
    }

    fn derive(&self, zero: &[DVec3], method: PlaneMethod) -> Result<Vec<(FrustumPlane, Plane)>> {
        use ClipSpace::{D3d, OpenGl, ReversedZ};
        let (frame, lens) = (&self.frame_about(zero), &self.lens);
        let is_matrix = matches!(lens.kind(), LensKind::Matrix(_));
        let rows = match method {
            PlaneMethod::Frame => {
                let planes = self.planes_f64(zero).into_iter();
                return Ok(planes.map(|(name, plane)| (name, plane.narrow())).collect());
            }
            _ if is_matrix => {
                return Err(CameraError::invalid(
                    "the camera is a matrix, whose own rows are its planes (in f64)",
                    "--planes frame, which takes these, or cameras by eye and lens",
                ));
            }
            PlaneMethod::FrameF32 => return Ok(single::from_frame(frame, lens)),
            PlaneMethod::GhGlF32 => single::planes(frame, lens, OpenGl),
            PlaneMethod::GhGlF64 => double::planes(frame, lens, OpenGl),
            PlaneMethod::GhD3dF32 => single::planes(frame, lens, D3d),
            PlaneMethod::GhD3dF64 => double::planes(frame, lens, D3d),
            PlaneMethod::GhRevzF32 => single::planes(frame, lens, ReversedZ),
            PlaneMethod::GhRevzF64 => double::planes(frame, lens, ReversedZ),
        };
        // An infinite far plane is the absence of `far`, whatever its row holds.
        let count = if lens.far().is_some() { 6 } else { 5 };
        let named = FrustumPlane::ALL.into_iter().zip(rows);
        Ok(named.take(count).collect())
    }
}
