//! Matrices through glam: the projections of OpenGL, of D3D and Vulkan, and
//! with reversed Z, in f32 and f64, and the planes that Gribb and Hartmann
//! read off them. The default path never needs a matrix; this file exists so
//! that its error can be measured against the frame-derived planes.

use glam::{DMat4, DVec4, Mat4, Vec4};

use super::{Frame, Lens};

/// What a projection maps near and far to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ClipSpace {
    /// near -> -1, far -> 1.
    OpenGl,
    /// near -> 0, far -> 1 (D3D, Vulkan, Metal, WebGPU).
    D3d,
    /// near -> 1, far -> 0.
    ReversedZ,
}

/// The projection matrix in one precision. Everything that glam offers comes
/// from glam; the infinite far planes that it lacks are the limit of its
/// finite matrix. Only the cotangent is taken again: glam's sine and cosine
/// are the platform's, and platforms round them differently.
macro_rules! projection {
    ($name:ident, $float:ty, $mat:ty, $glam:ident, $sin:path, $cos:path) => {
        /// The projection matrix of a lens; not a number for a matrix, which is
        /// no projection without a view.
        pub fn $name(lens: &Lens, clip: ClipSpace) -> $mat {
            use glam::$glam::rh::proj::{directx, opengl};
            let mut matrix = match *lens {
                Lens::Perspective {
                    fovy_deg,
                    aspect,
                    near,
                    far: Some(far),
                } => {
                    let fovy = fovy_deg.to_radians() as $float;
                    let (aspect, near, far) = (aspect as $float, near as $float, far as $float);
                    match clip {
                        ClipSpace::OpenGl => opengl::perspective(fovy, aspect, near, far),
                        ClipSpace::D3d => directx::perspective(fovy, aspect, near, far),
                        ClipSpace::ReversedZ => directx::perspective(fovy, aspect, far, near),
                    }
                }
                Lens::Perspective {
                    fovy_deg,
                    aspect,
                    near,
                    far: None,
                } => {
                    let fovy = fovy_deg.to_radians() as $float;
                    let (aspect, near) = (aspect as $float, near as $float);
                    match clip {
                        ClipSpace::OpenGl => {
                            let mut m = directx::perspective_infinite(fovy, aspect, near);
                            m.w_axis.z = -2.0 * near;
                            m
                        }
                        ClipSpace::D3d => directx::perspective_infinite(fovy, aspect, near),
                        ClipSpace::ReversedZ => {
                            directx::perspective_infinite_reverse(fovy, aspect, near)
                        }
                    }
                }
                Lens::Orthographic { near, far, .. } => {
                    let [l, r, b, t] = lens.window().map(|v| v as $float);
                    let (near, far) = (near as $float, far as $float);
                    match clip {
                        ClipSpace::OpenGl => opengl::orthographic(l, r, b, t, near, far),
                        ClipSpace::D3d => directx::orthographic(l, r, b, t, near, far),
                        ClipSpace::ReversedZ => directx::orthographic(l, r, b, t, far, near),
                    }
                }
                Lens::OffAxis {
                    window,
                    near,
                    far: Some(far),
                } => {
                    // glam's window lies on its near plane, which reversed Z
                    // swaps with the far one.
                    let grow = if clip == ClipSpace::ReversedZ {
                        far / near
                    } else {
                        1.0
                    };
                    let [l, r, b, t] = window.map(|v| (v * grow) as $float);
                    let (near, far) = (near as $float, far as $float);
                    match clip {
                        ClipSpace::OpenGl => opengl::frustum(l, r, b, t, near, far),
                        ClipSpace::D3d => directx::frustum(l, r, b, t, near, far),
                        ClipSpace::ReversedZ => directx::frustum(l, r, b, t, far, near),
                    }
                }
                Lens::OffAxis {
                    window,
                    near,
                    far: None,
                } => {
                    let [l, r, b, t] = window.map(|v| v as $float);
                    let near = near as $float;
                    let mut m = directx::frustum(l, r, b, t, near, 2.0 * near);
                    (m.z_axis.z, m.w_axis.z) = match clip {
                        ClipSpace::OpenGl => (-1.0, -2.0 * near),
                        ClipSpace::D3d => (-1.0, -near),
                        ClipSpace::ReversedZ => (0.0, near),
                    };
                    m
                }
                Lens::Matrix(_) => return <$mat>::NAN,
            };
            if let Lens::Perspective {
                fovy_deg, aspect, ..
            } = *lens
            {
                let half = 0.5 * fovy_deg.to_radians() as $float;
                let cotangent = $cos(half) / $sin(half);
                matrix.x_axis.x = cotangent / aspect as $float;
                matrix.y_axis.y = cotangent;
            }
            matrix
        }
    };
}

projection!(projection_f32, f32, Mat4, camera, libm::sinf, libm::cosf);
projection!(projection_f64, f64, DMat4, dcamera, libm::sin, libm::cos);

/// The six rows (normal, d) of a clip matrix as inward planes, in the order
/// left, right, bottom, top, near, far; not normalised. A far plane at
/// infinity comes out with a zero normal.
///
/// Gribb and Hartmann 2001, "Fast extraction of viewing frustum planes from
/// the world-view-projection matrix".
pub fn gribb_hartmann(clip_from_world: &DMat4, clip: ClipSpace) -> [DVec4; 6] {
    let m = clip_from_world.transpose();
    let (x, y, z, w) = (m.x_axis, m.y_axis, m.z_axis, m.w_axis);
    let (near, far) = match clip {
        ClipSpace::OpenGl => (w + z, w - z),
        ClipSpace::D3d => (z, w - z),
        ClipSpace::ReversedZ => (w - z, z),
    };
    [w + x, w - x, w + y, w - y, near, far]
}

/// The same, every operation in f32.
pub(super) fn gribb_hartmann_f32(clip_from_world: &Mat4, clip: ClipSpace) -> [Vec4; 6] {
    let m = clip_from_world.transpose();
    let (x, y, z, w) = (m.x_axis, m.y_axis, m.z_axis, m.w_axis);
    let (near, far) = match clip {
        ClipSpace::OpenGl => (w + z, w - z),
        ClipSpace::D3d => (z, w - z),
        ClipSpace::ReversedZ => (w - z, z),
    };
    [w + x, w - x, w + y, w - y, near, far]
}

/// The world-to-eye matrix as an engine that keeps everything in f32 has it:
/// rounded frame, rounded eye, and `-e.u` and its kin in f32.
pub(super) fn view_f32(frame: &Frame) -> Mat4 {
    let (u, v, n) = (
        frame.u().as_vec3(),
        frame.v().as_vec3(),
        frame.n().as_vec3(),
    );
    let e = frame.eye.as_vec3();
    Mat4::from_cols(
        Vec4::new(u.x, v.x, n.x, 0.0),
        Vec4::new(u.y, v.y, n.y, 0.0),
        Vec4::new(u.z, v.z, n.z, 0.0),
        Vec4::new(-e.dot(u), -e.dot(v), -e.dot(n), 1.0),
    )
}

impl Lens {
    /// The projection matrix in f64.
    pub fn projection(&self, clip: ClipSpace) -> DMat4 {
        projection_f64(self, clip)
    }
}
