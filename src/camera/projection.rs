//! Planes of a view volume in f32 and f64, from the frame and from matrices.
//!
//! Matrices come from glam: projections of OpenGL, of D3D and Vulkan, and with reversed Z, from
//! which Gribb and Hartmann extract planes. The default path needs no matrix; matrices exist so
//! that their error can be measured against the planes of the frame.

use glam::{DMat4, DVec3, Vec3};

use super::{Frame, Lens, LensKind};
use crate::geometry::{FrustumPlane, Plane, PlaneF64};

/// Depths to which a projection maps near and far.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ClipSpace {
    /// near -> -1, far -> 1.
    OpenGl,
    /// near -> 0, far -> 1 (D3D, Vulkan, Metal, WebGPU).
    D3d,
    /// near -> 1, far -> 0.
    ReversedZ,
}

/// Matrices and their planes, with every operation in one precision.
///
/// Matrices are glam's. Infinite far planes, which glam lacks, are the limit of its finite matrix.
/// The cotangent is computed again: glam's sine and cosine are the platform's, and platforms round
/// them differently.
macro_rules! precision {
    ($module:ident, $float:ty, $Vec:ident, $Vec4:ident, $Mat:ident, $Plane:ident, $glam:ident, $sin:ident, $cos:ident) => {
        pub mod $module {
            use glam::$glam::rh::proj::{directx, opengl};
            use glam::{$Mat, $Vec, $Vec4};

            use super::*;

            /// The projection matrix of a lens.
            ///
            /// NaN for a matrix lens, which has no projection apart from its view.
            pub fn projection(lens: &Lens, clip: ClipSpace) -> $Mat {
                let (near, is_gl) = (lens.near(), clip == ClipSpace::OpenGl);
                // Depths at the near and the far end of clip space.
                let depths = match (clip, lens.far()) {
                    (ClipSpace::ReversedZ, Some(far)) => [far, near],
                    (_, far) => [near, far.unwrap_or(2.0 * near)],
                };
                let [first, last] = depths.map(|depth| depth as $float);
                let windowed = |[l, r, b, t]: [f64; 4]| {
                    let of: fn($float, $float, $float, $float, $float, $float) -> $Mat =
                        match (lens.is_orthographic(), is_gl) {
                            (true, true) => opengl::orthographic,
                            (true, false) => directx::orthographic,
                            (false, true) => opengl::frustum,
                            (false, false) => directx::frustum,
                        };
                    let [l, r, b, t] = [l, r, b, t].map(|edge| edge as $float);
                    of(l, r, b, t, first, last)
                };
                let mut matrix = match *lens.kind() {
                    LensKind::Perspective { fovy_deg, aspect } => {
                        let fovy = fovy_deg.to_radians() as $float;
                        let aspect = aspect as $float;
                        let of = match is_gl {
                            true => opengl::perspective,
                            false => directx::perspective,
                        };
                        let mut matrix = of(fovy, aspect, first, last);
                        let half = 0.5 * fovy;
                        let cotangent = libm::$cos(half) / libm::$sin(half);
                        matrix.x_axis.x = cotangent / aspect;
                        matrix.y_axis.y = cotangent;
                        matrix
                    }
                    LensKind::Orthographic { .. } => return windowed(lens.window()),
                    // glam's window lies on its near plane, which reversed Z swaps with the far
                    // one.
                    LensKind::OffAxis { window } => match (clip, lens.far()) {
                        (ClipSpace::ReversedZ, Some(far)) => {
                            windowed(window.map(|edge| edge * (far / near)))
                        }
                        _ => windowed(window),
                    },
                    LensKind::Matrix(_) => return $Mat::NAN,
                };
                if lens.far().is_none() {
                    let near = near as $float;
                    (matrix.z_axis.z, matrix.w_axis.z) = match clip {
                        ClipSpace::OpenGl => (-1.0, -2.0 * near),
                        ClipSpace::D3d => (-1.0, -near),
                        ClipSpace::ReversedZ => (0.0, near),
                    };
                }
                matrix
            }

            /// Axes and eye in this precision.
            fn rounded(frame: &Frame) -> [$Vec; 4] {
                let convert = |v: DVec3| $Vec::from(v.to_array().map(|x| x as $float));
                [frame.u(), frame.v(), frame.n(), frame.eye].map(convert)
            }

            /// The planes from the camera's frame.
            ///
            /// The side planes pass through the eye along the window's edges (for an orthographic
            /// lens, parallel to the axis); near and far face each other.
            pub fn from_frame(frame: &Frame, lens: &Lens) -> Vec<(FrustumPlane, $Plane)> {
                let [u, v, n, eye] = rounded(frame);
                let [left, right, bottom, top] = lens.window().map(|edge| edge as $float);
                // The side plane at `edge` along `axis`, facing inward.
                let side = |axis: $Vec, edge: $float| {
                    if lens.is_orthographic() {
                        return $Plane::new(axis, -axis.dot(eye) - edge);
                    }
                    let normal = (axis + n * edge) / (1.0 + edge * edge).sqrt();
                    $Plane::new(normal, -normal.dot(eye))
                };
                let near = $Plane::new(-n, n.dot(eye) - lens.near() as $float);
                let mut planes = vec![
                    (FrustumPlane::Left, side(u, left)),
                    (FrustumPlane::Right, side(-u, -right)),
                    (FrustumPlane::Bottom, side(v, bottom)),
                    (FrustumPlane::Top, side(-v, -top)),
                    (FrustumPlane::Near, near),
                ];
                planes.extend(lens.far().map(|far| {
                    let far = $Plane::new(n, far as $float - n.dot(eye));
                    (FrustumPlane::Far, far)
                }));
                planes
            }

            /// The world-to-eye matrix, in this precision.
            ///
            /// Rows u, v, n with `-e.u`, `-e.v`, `-e.n` in the last column, all rounded to
            /// this precision.
            pub fn view(frame: &Frame) -> $Mat {
                let [u, v, n, e] = rounded(frame);
                $Mat::from_cols(
                    $Vec4::new(u.x, v.x, n.x, 0.0),
                    $Vec4::new(u.y, v.y, n.y, 0.0),
                    $Vec4::new(u.z, v.z, n.z, 0.0),
                    $Vec4::new(-e.dot(u), -e.dot(v), -e.dot(n), 1.0),
                )
            }

            /// The six planes of the clip matrix: left, right, bottom, top, near, far.
            ///
            /// A far plane at infinity has a normal that is zero or not finite.
            ///
            /// Gribb and Hartmann 2001, "Fast extraction of viewing frustum planes from the
            /// world-view-projection matrix".
            pub fn planes(frame: &Frame, lens: &Lens, clip: ClipSpace) -> [Plane; 6] {
                let m = (projection(lens, clip) * view(frame)).transpose();
                let (x, y, z, w) = (m.x_axis, m.y_axis, m.z_axis, m.w_axis);
                let (near, far) = match clip {
                    ClipSpace::OpenGl => (w + z, w - z),
                    ClipSpace::D3d => (z, w - z),
                    ClipSpace::ReversedZ => (w - z, z),
                };
                let narrow = |v: $Vec| Vec3::from(v.to_array().map(|x| x as f32));
                [w + x, w - x, w + y, w - y, near, far].map(|row| {
                    let normal = row.truncate();
                    let length = normal.length();
                    Plane::new(narrow(normal / length), (row.w / length) as f32)
                })
            }
        }
    };
}
precision!(single, f32, Vec3, Vec4, Mat4, Plane, camera, sinf, cosf);
precision!(
    double, f64, DVec3, DVec4, DMat4, PlaneF64, dcamera, sin, cos
);

impl Frame {
    /// The world-to-eye matrix.
    ///
    /// Rows u, v, n with `-e.u`, `-e.v`, `-e.n` in the last column.
    pub fn world_to_eye(&self) -> DMat4 {
        double::view(self)
    }
}

impl Lens {
    /// The projection matrix in f64.
    pub fn projection(&self, clip: ClipSpace) -> DMat4 {
        double::projection(self, clip)
    }
}
