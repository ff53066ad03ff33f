//! View-projection matrices in eight conventions, as engines write them.
//!
//! Planes, corners and the eye are computed exactly from the entries and rounded once.

use glam::DVec3;

use super::{CameraError, Result};
use crate::arithmetic::{Expansion, exact};
use crate::geometry::{FrustumPlane, PlaneF64};

named! {
    /// Reading of a matrix: order of entries and range of depth.
    ///
    /// For a matrix with an eye reversed depth is detected, under either name: the plane in front
    /// of the eye is near. For an orthographic one the name decides.
    #[derive(Clone, Copy, PartialEq, Eq, Debug)]
    #[non_exhaustive]
    pub enum MatrixConvention, MATRIX_CONVENTIONS {
        ColumnGl = "column-gl", "clip = M x, depth -1 to 1 (OpenGL)";
        ColumnD3d = "column-d3d", "clip = M x, depth 0 to 1 (Vulkan, Metal, WebGPU)";
        RowGl = "row-gl", "clip = x M, depth -1 to 1";
        RowD3d = "row-d3d", "clip = x M, depth 0 to 1 (Direct3D)";
        ColumnGlReversed = "column-gl-reversed", "clip = M x, depth 1 to -1";
        ColumnD3dReversed = "column-d3d-reversed", "clip = M x, depth 1 to 0";
        RowGlReversed = "row-gl-reversed", "clip = x M, depth 1 to -1";
        RowD3dReversed = "row-d3d-reversed", "clip = x M, depth 1 to 0";
    }
}

/// Differences of conventions, as bits of their index in the table.
const FROM_ZERO: usize = 1;
const BY_ROWS: usize = 2;
const REVERSED: usize = 4;

impl MatrixConvention {
    const fn is(self, bit: usize) -> bool {
        self as usize & bit != 0
    }

    /// The convention with rows and columns exchanged.
    pub fn transposed(self) -> MatrixConvention {
        MatrixConvention::ALL[self as usize ^ BY_ROWS]
    }

    /// The convention with near and far exchanged.
    pub fn reversed(self) -> MatrixConvention {
        MatrixConvention::ALL[self as usize ^ REVERSED]
    }

    /// Converts entries in this convention to those for column vectors, or back.
    pub(super) fn in_columns(self, entries: [[f64; 4]; 4]) -> [[f64; 4]; 4] {
        match self.is(BY_ROWS) {
            false => entries,
            true => [0, 1, 2, 3].map(|i| entries.map(|row| row[i])),
        }
    }
}

/// The names of the entries, as written on paper: row, then column.
pub const MATRIX_ENTRIES: [&str; 16] = [
    "m00", "m01", "m02", "m03", "m10", "m11", "m12", "m13", "m20", "m21", "m22", "m23", "m30",
    "m31", "m32", "m33",
];

/// Entry sizes for which products of four neither overflow nor lose a digit.
const SIZES: std::ops::RangeInclusive<f64> = 1e-60..=1e60;

/// Distance beyond which a far plane counts as infinite.
///
/// f32 has no such plane, and engines write the largest f32 if there is none. Omitting it returns
/// more, never less.
pub const FARTHEST: f64 = (f32::MAX / 2.0) as f64;

/// A plane (normal and offset) or a point in homogeneous coordinates.
type Four = [Expansion; 4];

/// A view-projection matrix.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ViewProjection {
    /// For column vectors: clip = rows * (x, y, z, 1).
    pub(super) rows: [[f64; 4]; 4],
    convention: MatrixConvention,
    /// True if depth is larger at the near plane.
    pub(super) is_reversed: bool,
    /// True if it is orthographic.
    pub(super) is_parallel: bool,
    /// Rounded; the centre of the near plane for an orthographic matrix.
    pub(super) eye: DVec3,
    /// Rounded distances of the eye from the near and the far plane: a scale.
    pub(super) near: f64,
    /// `None` if the view volume is infinite.
    pub(super) far: Option<f64>,
}

impl ViewProjection {
    /// A camera by the rows of its matrix as written on paper.
    ///
    /// Transpose an array stored by columns.
    ///
    /// # Errors
    /// An entry that is not finite, or neither zero nor of a size from 1e-60 to 1e60; a singular
    /// matrix; one whose clip volume is empty.
    pub fn new(entries: [[f64; 4]; 4], convention: MatrixConvention) -> Result<ViewProjection> {
        for (&name, value) in MATRIX_ENTRIES.iter().zip(entries.concat()) {
            super::finite(name, value)?;
            let found = format_args!("the matrix has {name} = {value:e}");
            let is_sound = value == 0.0 || SIZES.contains(&value.abs());
            super::require(is_sound, found, "0 or a size from 1e-60 to 1e60")?;
        }
        let mut matrix = ViewProjection {
            rows: convention.in_columns(entries),
            convention,
            is_reversed: false,
            is_parallel: false,
            eye: DVec3::ZERO,
            near: 0.0,
            far: None,
        };
        let inverse = matrix.inverse().ok_or_else(|| {
            CameraError::invalid("the matrix is singular", "one that has an inverse")
        })?;
        let eye;
        (eye, matrix.is_reversed) = eye_of(&inverse, convention.is(REVERSED));
        matrix.is_parallel = eye.is_none();
        let sign = |corner| unprojected(&inverse, corner)[3].sign();
        let ahead = matrix.clip_corners().map(sign);
        let found =
            format_args!("the matrix sees nothing, no point has w > 0 within its clip volume");
        let sees_any = ahead.iter().any(|&sign| sign > 0);
        super::require(sees_any, found, "another sign or --matrix-convention")?;
        let centre = || matrix.axis().map(|[near, _]| near);
        matrix.eye = eye.or_else(centre).ok_or_else(|| {
            let found = "the matrix has its near plane at infinity";
            let rule = "a view that f64 holds, or another --matrix-convention if it is transposed";
            CameraError::invalid(found, rule)
        })?;
        let is_bounded = ahead.iter().all(|&sign| sign > 0);
        for (name, plane) in matrix.planes_about(&[matrix.eye]) {
            match name {
                // An orthographic matrix has no eye: the origin here lies on the near plane itself.
                FrustumPlane::Near if !matrix.is_parallel => matrix.near = plane.d.abs(),
                FrustumPlane::Far if is_bounded => matrix.far = Some(plane.d.abs()),
                _ => {}
            }
        }
        Ok(matrix)
    }

    /// The rows for column vectors: clip = rows * (x, y, z, 1).
    pub fn rows(&self) -> &[[f64; 4]; 4] {
        &self.rows
    }

    /// The convention that the matrix was read by.
    pub fn convention(&self) -> MatrixConvention {
        self.convention
    }

    /// The matrix of the same entries with rows and columns exchanged.
    pub fn transposed(&self) -> Option<ViewProjection> {
        let entries = self.convention.in_columns(self.rows);
        ViewProjection::new(entries, self.convention.transposed()).ok()
    }

    /// Returns whether depth begins at 0 rather than at -w.
    pub fn is_from_zero(&self) -> bool {
        self.convention.is(FROM_ZERO)
    }

    /// The planes in f64 relative to the sum of some points, of unit length.
    ///
    /// Sums and offsets are exact before they are rounded: every number of a plane is true to 3
    /// units of 2^-53 of itself, up to a factor common to the plane.
    ///
    /// A row with a zero normal is no plane (an infinite far plane); neither is one beyond
    /// [`FARTHEST`].
    pub(super) fn planes_about(&self, zero: &[DVec3]) -> Vec<(FrustumPlane, PlaneF64)> {
        let [x, y, z, w] = self.exact_rows();
        let sum = |a: &Four, b: &Four| [0, 1, 2, 3].map(|k| &a[k] + &b[k]);
        let difference = |a: &Four, b: &Four| [0, 1, 2, 3].map(|k| &a[k] - &b[k]);
        let low = match self.is_from_zero() {
            true => z.clone(),
            false => sum(&w, &z),
        };
        let (at_low, at_high) = match self.is_reversed {
            false => (FrustumPlane::Near, FrustumPlane::Far),
            true => (FrustumPlane::Far, FrustumPlane::Near),
        };
        let faces = [
            (FrustumPlane::Left, sum(&w, &x)),
            (FrustumPlane::Right, difference(&w, &x)),
            (FrustumPlane::Bottom, sum(&w, &y)),
            (FrustumPlane::Top, difference(&w, &y)),
            (at_low, low),
            (at_high, difference(&w, &z)),
        ];
        let planes = faces.iter().filter_map(|(name, face)| {
            let plane = plane_about(face, zero)?;
            (plane.d < FARTHEST).then_some((*name, plane))
        });
        planes.collect()
    }

    /// The corners of the clip volume relative to the sum of some points.
    ///
    /// True to some units of 2^-53 of each coordinate; `None` if the volume is infinite.
    pub(super) fn corners_about(&self, zero: &[DVec3]) -> Option<[DVec3; 8]> {
        let inverse = self.inverse()?;
        let mut corners = [DVec3::ZERO; 8];
        for (corner, clip) in corners.iter_mut().zip(self.clip_corners()) {
            *corner = about(&unprojected(&inverse, clip), zero)?;
        }
        Some(corners)
    }

    fn exact_rows(&self) -> [Four; 4] {
        self.rows.map(|row| row.map(Expansion::from))
    }

    /// Corners of the clip volume: left or right, bottom or top, at both ends of depth.
    fn clip_corners(&self) -> [[f64; 4]; 8] {
        let lowest = if self.is_from_zero() { 0.0 } else { -1.0 };
        let side = |i: usize, bit: usize| if i & bit == 0 { -1.0 } else { 1.0 };
        std::array::from_fn(|i| {
            let depth = if i & 4 == 0 { lowest } else { 1.0 };
            [side(i, 1), side(i, 2), depth, 1.0]
        })
    }

    /// The inverse up to a positive factor; `None` if the matrix is singular.
    pub(super) fn inverse(&self) -> Option<[Four; 4]> {
        let rows = self.exact_rows();
        let cofactor = |i: usize, j: usize| {
            let minor = minor(&rows, i, j);
            match (i + j) % 2 {
                0 => minor,
                _ => -&minor,
            }
        };
        let adjugate: [Four; 4] = std::array::from_fn(|i| std::array::from_fn(|j| cofactor(j, i)));
        let first = (0..4).map(|i| &adjugate[i][0] * &rows[0][i]);
        let determinant = first.fold(Expansion::ZERO, |sum, part| &sum + &part);
        match determinant.sign() {
            0 => None,
            1 => Some(adjugate),
            _ => Some(adjugate.map(|row| row.map(|entry| -&entry))),
        }
    }
}

/// The preimage of x = y = w = 0, and whether depth is reversed.
///
/// The point is rounded; `None` at infinity. Depth is reversed (larger at near) if z is positive
/// there; if z is zero, the name of the convention decides.
fn eye_of(inverse: &[Four; 4], by_name: bool) -> (Option<DVec3>, bool) {
    let eye = unprojected(inverse, [0.0, 0.0, 1.0, 0.0]);
    let sign = eye[3].sign();
    let is_reversed = sign > 0 || sign == 0 && by_name;
    // The same point, with a positive w.
    let eye = if is_reversed { eye } else { eye.map(|e| -&e) };
    (about(&eye, &[]).filter(|eye| eye.is_finite()), is_reversed)
}

/// The determinant without a row and a column.
fn minor(rows: &[Four; 4], row: usize, column: usize) -> Expansion {
    let [a, b, c] = [0, 1, 2].map(|i| &rows[i + usize::from(i >= row)]);
    let [i, j, k] = [0, 1, 2].map(|i| i + usize::from(i >= column));
    let pair = |i: usize, j: usize| &(&b[i] * &c[j]) - &(&b[j] * &c[i]);
    let [first, second, third] =
        [(i, j, k), (j, i, k), (k, i, j)].map(|(i, j, k)| &a[i] * &pair(j, k));
    &(&first - &second) + &third
}

/// The inverse times a point of clip space.
pub(super) fn unprojected(inverse: &[Four; 4], clip: [f64; 4]) -> Four {
    [0, 1, 2, 3].map(|i| {
        let parts = inverse[i].iter().zip(clip).filter(|(_, c)| *c != 0.0);
        let parts = parts.map(|(entry, c)| entry * &Expansion::from(c));
        parts.fold(Expansion::ZERO, |sum, part| &sum + &part)
    })
}

/// Dehomogenises a point, relative to the sum of others.
///
/// `None` if it is at infinity or beyond.
pub(super) fn about(point: &Four, zero: &[DVec3]) -> Option<DVec3> {
    let [.., scale] = point;
    if scale.sign() <= 0 {
        return None;
    }
    let coordinate = |k: usize| {
        let shift = |sum: Expansion, zero: &DVec3| &sum - &(scale * &Expansion::from(zero[k]));
        zero.iter().fold(point[k].clone(), shift).estimate() / scale.estimate()
    };
    Some(DVec3::new(coordinate(0), coordinate(1), coordinate(2)))
}

/// A unit plane relative to the sum of some points; `None` without a normal.
fn plane_about(face: &Four, zero: &[DVec3]) -> Option<PlaneF64> {
    let [x, y, z, d] = face;
    let mut offset = d.clone();
    for zero in zero {
        for (n, at) in [x, y, z].into_iter().zip(zero.to_array()) {
            offset = &offset + &(n * &Expansion::from(at));
        }
    }
    let exponent = exact::exponent(&[x, y, z].map(Expansion::clone))?;
    // Scaled to about 1, so that no square overflows.
    let [x, y, z, d] = [x, y, z, &offset].map(|n| n.scaled(-exponent).estimate());
    let normal = DVec3::new(x, y, z);
    let length = normal.length();
    Some(PlaneF64::new(normal / length, d / length))
}
