//! Planes of a camera to 250 bits.
//!
//! Pose and lens count as exact real numbers; roots, sines and cosines are computed far more
//! precisely than any tie could need. Exact sums and products are shared with the cameras under
//! test; tests check both with rationals.

use glam::DVec3;

use super::Oracle;
use super::evaluate::{HalfSpace, Number, Precision};
use crate::arithmetic::Expansion;
use crate::arithmetic::exact::{self, ExactVector};
use crate::camera::{Lens, LensKind, Pose, ViewProjection};

const PRECISION: Precision = Precision::CAMERA;

fn times(a: &Expansion, b: &Expansion) -> Expansion {
    (a * b).leading(PRECISION.terms + 1)
}

/// Cross product, rounded to the working precision.
fn cross(a: &ExactVector, b: &ExactVector) -> ExactVector {
    exact::cross(a, b).map(|component| component.leading(PRECISION.terms + 1))
}

fn unit(v: &ExactVector) -> ExactVector {
    let terms = PRECISION.terms + 1;
    let squares = exact::dot(v, v).leading(terms);
    let inverse = squares.sqrt(terms).reciprocal(terms);
    [0, 1, 2].map(|k| times(&v[k], &inverse))
}

impl Oracle {
    /// Oracle at camera level: the view volume of a pose and a lens as real numbers.
    ///
    /// In coordinates relative to `origin`.
    ///
    /// Each verdict is correct for the real volume, or is a touch marked as undecided if the
    /// precision does not suffice. Pose and lens count as exact; lengths from 1e-60 to 1e60 and
    /// angles from 1e-12 degrees are represented without loss; a window narrower than 2^-150 of its
    /// depth has zero width if it looks along an axis. A matrix is the volume itself, and its
    /// planes have no error at all. Costs some ten times [`Oracle::of_volume`].
    ///
    /// `None` if pose and lens make no camera: a value that is not finite, no direction of view,
    /// `up` zero or exactly parallel to it.
    pub fn of_camera(pose: &Pose, lens: &Lens, origin: DVec3) -> Option<Oracle> {
        if let LensKind::Matrix(matrix) = lens.kind() {
            let constraints = planes_of_matrix(matrix, origin);
            let oracle = || Oracle::new(constraints, PRECISION);
            return origin.is_finite().then(oracle);
        }
        let (eye, towards, up) = match *pose {
            Pose::LookAt { eye, look, up } => (eye, look, up),
            Pose::Forward { eye, forward, up } => (eye, forward, up),
        };
        let finite = [eye, towards, up, origin].iter().all(|v| v.is_finite());
        if !finite {
            return None;
        }
        let forward = pose.direction()?;
        let up = exact::near_unit(exact::vector(up))?;
        let right = exact::near_unit(cross(&forward, &up))?;
        let u = unit(&right);
        let back = unit(&forward).map(|c| -&c);
        let v = cross(&back, &u);
        let eye = exact::difference(eye, origin);
        let constraints = planes(&CameraAxes { u, v, back, eye }, lens);
        Some(Oracle::new(constraints, PRECISION))
    }
}

struct CameraAxes {
    u: ExactVector,
    v: ExactVector,
    back: ExactVector,
    eye: ExactVector,
}

impl CameraAxes {
    /// Half-space of the points x with `normal . (x - eye) + offset >= 0`.
    fn half_space(&self, normal: &ExactVector, offset: &Expansion) -> HalfSpace {
        let p = PRECISION;
        // Products of three normals and an offset must stay within f64.
        let exponent = exact::exponent(normal).unwrap_or(0);
        let normal = normal.clone().map(|n| n.scaled(-exponent));
        let offset = offset.scaled(-exponent);
        // Noise in each component is relative to the whole normal.
        let sizes = normal.iter().map(|n| n.estimate().abs());
        let size = sizes.fold(0.0, f64::max);
        let normal = normal.map(|n| {
            let value = n.leading(p.terms);
            p.cleaned(Number { value, size })
        });
        let along = (0..3).map(|k| p.multiply(&normal[k], &Number::from(self.eye[k].clone())));
        let d = along.fold(Number::from(offset), |d, part| p.subtract(&d, &part));
        HalfSpace { normal, d }
    }
}

fn planes(view: &CameraAxes, lens: &Lens) -> Vec<HalfSpace> {
    let number = |x: f64| Expansion::from(x);
    let mut planes = Vec::with_capacity(6);
    // Left, right, bottom and top edges of the window, and its depth.
    let (edges, depth) = match *lens.kind() {
        LensKind::Perspective { fovy_deg, aspect } => {
            let half = times(&exact::pi(), &number(fovy_deg)).over(360.0, PRECISION.terms + 1);
            let (sine, cosine) = exact::sin_cos(&half, PRECISION.terms + 1);
            let wide = times(&sine, &number(aspect));
            ([-&wide, wide, -&sine, sine], cosine)
        }
        LensKind::OffAxis { window } => (window.map(number), number(lens.near())),
        // A matrix has its own planes, see `planes_of_matrix`.
        LensKind::Matrix(_) => return planes,
        LensKind::Orthographic { height, aspect } => {
            let half = number(height / 2.0);
            let wide = times(&half, &number(aspect));
            ([-&wide, wide, -&half, half], Expansion::ZERO)
        }
    };
    let axes = [&view.u, &view.u, &view.v, &view.v];
    // The normal at the lower edge of each axis points along the axis.
    for ((axis, edge), sign) in axes.into_iter().zip(&edges).zip([1.0, -1.0, 1.0, -1.0]) {
        let sign = number(sign);
        planes.push(if lens.is_orthographic() {
            let normal = axis.clone().map(|c| times(&sign, &c));
            view.half_space(&normal, &-&times(&sign, edge))
        } else {
            // Through the eye and the edge.
            let normal = [0, 1, 2].map(|k| {
                let lean = &times(&axis[k], &depth) + &times(&view.back[k], edge);
                times(&sign, &lean)
            });
            view.half_space(&normal, &Expansion::ZERO)
        });
    }
    let ahead = view.back.clone().map(|c| -&c);
    planes.push(view.half_space(&ahead, &number(-lens.near())));
    if let Some(far) = lens.far() {
        planes.push(view.half_space(&view.back, &number(far)));
    }
    planes
}

/// Exact planes of a matrix about `origin`: sums and differences of its rows.
///
/// (Gribb and Hartmann 2001.) Each is scaled by a power of two. A plane with a zero normal and a
/// positive offset (an infinite far plane) bounds nothing.
fn planes_of_matrix(matrix: &ViewProjection, origin: DVec3) -> Vec<HalfSpace> {
    let [x, y, z, w] = matrix.rows();
    let row = |signs: [f64; 2], parts: [&[f64; 4]; 2]| {
        let part = |k: usize, i: usize| Expansion::from(signs[i] * parts[i][k]);
        [0, 1, 2, 3].map(|k| &part(k, 0) + &part(k, 1))
    };
    let own = if matrix.is_from_zero() { 0.0 } else { 1.0 };
    let rows = [
        row([1.0, 1.0], [w, x]),
        row([1.0, -1.0], [w, x]),
        row([1.0, 1.0], [w, y]),
        row([1.0, -1.0], [w, y]),
        row([own, 1.0], [w, z]),
        row([1.0, -1.0], [w, z]),
    ];
    let about = rows.map(|[a, b, c, d]| {
        let along = [&a, &b, &c].into_iter().zip(origin.to_array());
        let d = along.fold(d, |d, (n, at)| &d + &(n * &Expansion::from(at)));
        let exponent = exact::exponent(&[a.clone(), b.clone(), c.clone()]).unwrap_or(0);
        HalfSpace {
            normal: [a, b, c].map(|n| Number::from(n.scaled(-exponent))),
            d: Number::from(d.scaled(-exponent)),
        }
    });
    about.into()
}
