//! Lenses of a path's cameras as used, and matrices as they were read.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::camera::{Camera, Lens, LensKind};

/// Lenses of all cameras. Pairs are the least and the largest value.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct CameraFacts {
    /// Vertical field of view, degrees; null where all lenses are orthographic.
    pub fovy_deg: Option<[f64; 2]>,
    /// Height of the view of orthographic lenses, world units.
    pub ortho_height: Option<[f64; 2]>,
    /// Width / height.
    pub aspect: Option<[f64; 2]>,
    /// Distance of the near plane; null without cameras.
    pub near: Option<[f64; 2]>,
    /// Distance of the far plane; null for none.
    pub far: [Option<f64>; 2],
    /// How matrices were read; null for cameras with an eye and a lens.
    pub matrix: Option<MatrixFacts>,
}

/// First matrix of a path, taken apart.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct MatrixFacts {
    /// Name of the convention.
    pub convention: String,
    /// Clip-space depth of the near and the far plane.
    pub depth: [f64; 2],
    /// Position of the camera, world coordinates.
    pub eye: [f64; 3],
    /// Direction to the right in the image.
    pub right: [f64; 3],
    /// Direction upward in the image.
    pub up: [f64; 3],
    /// Direction of view.
    pub forward: [f64; 3],
    /// True for a clip space with y downward or a left-handed world.
    pub is_mirrored: bool,
}

impl CameraFacts {
    /// Facts of the cameras of a path.
    pub fn of(cameras: &[Camera]) -> CameraFacts {
        let lenses: Vec<Lens> = cameras.iter().map(plain_lens).collect();
        let all = |of: &dyn Fn(&Lens) -> Option<f64>| range(lenses.iter().filter_map(of));
        let fars = all(&|lens| Some(lens.far().unwrap_or(f64::INFINITY)));
        CameraFacts {
            fovy_deg: all(&fovy_deg),
            ortho_height: all(&|lens| lens.height_at(1.0).filter(|_| lens.is_orthographic())),
            aspect: all(&aspect),
            near: all(&|lens| Some(lens.near())),
            far: finite(fars),
            matrix: cameras.first().and_then(MatrixFacts::of),
        }
    }

    /// The facts of both; matrices of the first.
    pub fn with(self, other: CameraFacts) -> CameraFacts {
        let both = |a, b| range([a, b].into_iter().flatten().flatten());
        let fars = |facts: &CameraFacts| facts.far.map(|far| far.unwrap_or(f64::INFINITY));
        let [least, most] = [fars(&self), fars(&other)];
        let far = range([least, most].into_iter().flatten());
        CameraFacts {
            fovy_deg: both(self.fovy_deg, other.fovy_deg),
            ortho_height: both(self.ortho_height, other.ortho_height),
            aspect: both(self.aspect, other.aspect),
            near: both(self.near, other.near),
            far: finite(far),
            matrix: self.matrix,
        }
    }
}

impl MatrixFacts {
    fn of(camera: &Camera) -> Option<MatrixFacts> {
        let LensKind::Matrix(matrix) = camera.lens.kind() else {
            return None;
        };
        let found = matrix.unprojected().ok()?;
        let frame = found.camera.frame;
        let [eye, right, up, forward] =
            [frame.eye, frame.u(), frame.v(), frame.forward()].map(|v: DVec3| v.to_array());
        Some(MatrixFacts {
            convention: matrix.convention().name().to_owned(),
            depth: found.depths,
            eye,
            right,
            up,
            forward,
            is_mirrored: found.is_mirrored,
        })
    }
}

/// A range with `None` for what is infinite.
fn finite(range: Option<[f64; 2]>) -> [Option<f64>; 2] {
    let finite = |value: f64| Some(value).filter(|value| value.is_finite());
    range.map_or([None; 2], |range| range.map(finite))
}

/// Lens of a camera; that of a matrix without one stays the matrix.
fn plain_lens(camera: &Camera) -> Lens {
    match camera.lens.kind() {
        LensKind::Matrix(matrix) => matrix
            .unprojected()
            .map_or(camera.lens, |found| found.camera.lens),
        _ => camera.lens,
    }
}

fn fovy_deg(lens: &Lens) -> Option<f64> {
    match *lens.kind() {
        LensKind::Perspective { fovy_deg, .. } => Some(fovy_deg),
        LensKind::OffAxis { .. } => {
            let [_, _, bottom, top] = lens.window();
            Some((libm::atan(top) - libm::atan(bottom)).to_degrees())
        }
        _ => None,
    }
}

fn aspect(lens: &Lens) -> Option<f64> {
    match *lens.kind() {
        LensKind::Perspective { aspect, .. } | LensKind::Orthographic { aspect, .. } => {
            Some(aspect)
        }
        LensKind::OffAxis {
            window: [left, right, bottom, top],
        } => Some((right - left) / (top - bottom)),
        LensKind::Matrix(_) => None,
    }
}

/// Least and largest of some values; `None` for none.
fn range(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    values
        .map(|value| [value; 2])
        .reduce(|[low, high], [value, _]| [low.min(value), high.max(value)])
}
