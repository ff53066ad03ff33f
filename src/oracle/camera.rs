//! The planes of a camera to 250 bits: camera parameters are exact reals here,
//! and roots and tangents are carried far beyond what any tie could need.
//! Nothing is shared with the derivations that are put to the test.

use glam::DVec3;

use super::Oracle;
use super::half_space::HalfSpace;
use super::number::{Number, Precision};
use crate::arithmetic::Expansion;
use crate::camera::{Lens, Pose, ViewProjection};

const PRECISION: Precision = Precision::CAMERA;

/// Pi as a sum of doubles (true to 2^-330).
const PI: [f64; 6] = [
    std::f64::consts::PI,
    1.2246467991473532e-16,
    -2.9947698097183397e-33,
    1.1124542208633653e-49,
    5.672231979640316e-66,
    1.7449862161352486e-83,
];

fn pi() -> Expansion {
    let terms = PI.iter().rev();
    terms.fold(Expansion::ZERO, |pi, &term| &pi + &Expansion::from(term))
}

fn times(a: &Expansion, b: &Expansion) -> Expansion {
    (a * b).leading(PRECISION.terms() + 1)
}

type Vector = [Expansion; 3];

fn dot(a: &Vector, b: &Vector) -> Expansion {
    let products = (0..3).map(|k| times(&a[k], &b[k]));
    products.fold(Expansion::ZERO, |sum, p| &sum + &p)
}

fn cross(a: &Vector, b: &Vector) -> Vector {
    [(1, 2), (2, 0), (0, 1)]
        .map(|(i, j)| (&times(&a[i], &b[j]) - &times(&a[j], &b[i])).leading(PRECISION.terms() + 1))
}

fn unit(v: &Vector) -> Vector {
    let terms = PRECISION.terms() + 1;
    let inverse = dot(v, v).leading(terms).sqrt(terms).reciprocal(terms);
    [0, 1, 2].map(|k| times(&v[k], &inverse))
}

fn exact(v: DVec3) -> Vector {
    v.to_array().map(Expansion::from)
}

/// `a - b`, exact.
fn difference(a: DVec3, b: DVec3) -> Vector {
    let (a, b) = (exact(a), exact(b));
    [0, 1, 2].map(|k| &a[k] - &b[k])
}

/// The exponent of the largest component; `None` for the zero vector.
fn exponent(v: &Vector) -> Option<i32> {
    let largest = v.iter().map(|c| c.estimate().abs()).fold(0.0, f64::max);
    (largest > 0.0).then(|| libm::ilogb(largest))
}

/// The vector times a power of two that brings it near unit length: its square
/// could overflow otherwise. `None` for the zero vector.
fn near_unit(v: Vector) -> Option<Vector> {
    let exponent = exponent(&v)?;
    Some(v.map(|component| component.scaled(-exponent)))
}

/// Sine and cosine of an angle in [0, pi/2]: Taylor series of a sixteenth of
/// it, then four times the double-angle formulas.
fn sine_and_cosine(angle: &Expansion) -> (Expansion, Expansion) {
    let terms = PRECISION.terms() + 1;
    let x = times(angle, &Expansion::from(1.0 / 16.0));
    let square = times(&x, &x);
    let mut sine = x.clone();
    // 1 - cos: doubling it loses nothing, doubling the cosine would.
    let mut versine = Expansion::ZERO;
    let mut power = Expansion::from(1.0);
    let mut odd = x;
    for k in 1..40 {
        let step = |p: &Expansion, divisor: f64| -&times(p, &square).over(divisor, terms);
        let even_order = f64::from(2 * k);
        power = step(&power, (even_order - 1.0) * even_order);
        odd = step(&odd, even_order * (even_order + 1.0));
        versine = (&versine - &power).leading(terms);
        sine = (&sine + &odd).leading(terms);
        if odd.estimate().abs() < 1e-110 {
            break;
        }
    }
    let one = Expansion::from(1.0);
    let two = Expansion::from(2.0);
    for _ in 0..4 {
        let cosine = &one - &versine;
        let next = times(&two, &times(&sine, &sine));
        sine = times(&two, &times(&sine, &cosine));
        versine = next;
    }
    (sine, (&one - &versine).leading(terms))
}

impl Oracle {
    /// Camera level: the view volume of a pose and a lens, in coordinates about
    /// `origin`, as real numbers.
    ///
    /// Every verdict is that about the real volume, or a touch marked as
    /// undecided, where the two cannot be told apart: pose and lens count as
    /// exact, lengths from 1e-60 to 1e60 and angles from 1e-12 degrees are
    /// carried without loss. A matrix is the volume alone, and its planes are
    /// carried without any error. Some ten times the cost of
    /// [`Oracle::of_volume`].
    ///
    /// `None` if pose and lens make no camera: a value that is not finite, no
    /// direction of view, `up` zero or exactly parallel to it, a lens that its
    /// constructor would refuse.
    pub fn of_camera(pose: &Pose, lens: &Lens, origin: DVec3) -> Option<Oracle> {
        if let Lens::Matrix(matrix) = lens {
            let constraints = planes_of_matrix(matrix, origin);
            return origin
                .is_finite()
                .then(|| Oracle::new(&constraints, PRECISION));
        }
        let (eye, towards, up) = match *pose {
            Pose::LookAt { eye, look, up } => (eye, look, up),
            Pose::Forward { eye, forward, up } => (eye, forward, up),
        };
        let finite = [eye, towards, up, origin].iter().all(|v| v.is_finite());
        if !finite || lens.with_far(lens.far()).is_err() {
            return None;
        }
        let forward = match pose {
            // Quartered where the difference could overflow.
            Pose::LookAt { .. } if towards.abs().max(eye.abs()).max_element() > 1e300 => {
                difference(towards / 4.0, eye / 4.0)
            }
            Pose::LookAt { .. } => difference(towards, eye),
            Pose::Forward { .. } => exact(towards),
        };
        let forward = near_unit(forward)?;
        let right = near_unit(cross(&forward, &near_unit(exact(up))?))?;
        let u = unit(&right);
        let back = unit(&forward).map(|c| -&c);
        let v = cross(&back, &u);
        let eye = difference(eye, origin);
        let constraints = planes(&View { u, v, back, eye }, lens);
        Some(Oracle::new(&constraints, PRECISION))
    }
}

struct View {
    u: Vector,
    v: Vector,
    back: Vector,
    eye: Vector,
}

impl View {
    /// The points x with `normal . (x - eye) + offset >= 0`.
    fn half_space(&self, normal: &Vector, offset: &Expansion) -> HalfSpace {
        let p = PRECISION;
        // Products of three normals and an offset must stay within f64.
        let exponent = exponent(normal).unwrap_or(0);
        let normal = normal.clone().map(|n| n.scaled(-exponent));
        let offset = offset.scaled(-exponent);
        // Each component is as large as the whole normal, as far as noise goes.
        let size = normal
            .iter()
            .map(|n| n.estimate().abs())
            .fold(0.0, f64::max);
        let normal = normal.map(|n| {
            let value = n.leading(p.terms());
            p.cleaned(Number { value, size })
        });
        let along = (0..3).map(|k| p.multiply(&normal[k], &Number::from(self.eye[k].clone())));
        let d = along.fold(Number::from(offset), |d, part| p.subtract(&d, &part));
        HalfSpace { normal, d }
    }

    /// The plane through the eye and an edge of the window at `offset` along
    /// `axis`, `depth` ahead; `sign` is +1 for the lower edge.
    fn side(&self, axis: &Vector, offset: &Expansion, depth: &Expansion, sign: f64) -> HalfSpace {
        let sign = Expansion::from(sign);
        let normal = [0, 1, 2].map(|k| {
            let lean = &times(&axis[k], depth) + &times(&self.back[k], offset);
            times(&sign, &lean)
        });
        self.half_space(&normal, &Expansion::ZERO)
    }
}

fn planes(view: &View, lens: &Lens) -> Vec<HalfSpace> {
    let number = |x: f64| Expansion::from(x);
    let mut planes = Vec::with_capacity(6);
    // Left, right, bottom and top edges of the window and how far ahead it is.
    let (edges, depth) = match *lens {
        Lens::Perspective {
            fovy_deg, aspect, ..
        } => {
            let half = times(&pi(), &number(fovy_deg)).over(360.0, PRECISION.terms() + 1);
            let (sine, cosine) = sine_and_cosine(&half);
            let wide = times(&sine, &number(aspect));
            ([-&wide, wide, -&sine, sine], cosine)
        }
        Lens::OffAxis { window, near, .. } => (window.map(number), number(near)),
        // Has planes of its own, see `planes_of_matrix`.
        Lens::Matrix(_) => return planes,
        Lens::Orthographic { height, aspect, .. } => {
            let half = number(height / 2.0);
            let wide = times(&half, &number(aspect));
            ([-&wide, wide, -&half, half], Expansion::ZERO)
        }
    };
    let axes = [&view.u, &view.u, &view.v, &view.v];
    for ((axis, edge), sign) in axes.into_iter().zip(&edges).zip([1.0, -1.0, 1.0, -1.0]) {
        planes.push(if matches!(lens, Lens::Orthographic { .. }) {
            let sign = number(sign);
            let normal = axis.clone().map(|c| times(&sign, &c));
            view.half_space(&normal, &-&times(&sign, edge))
        } else {
            view.side(axis, edge, &depth, sign)
        });
    }
    let ahead = view.back.clone().map(|c| -&c);
    planes.push(view.half_space(&ahead, &number(-lens.near())));
    if let Some(far) = lens.far() {
        planes.push(view.half_space(&view.back, &number(far)));
    }
    planes
}

/// The rows' sums and differences (Gribb and Hartmann 2001) about `origin`, each
/// times a power of two. All of it is exact. One without a normal and above zero
/// (an infinite far plane) bounds nothing.
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
        let exponent = exponent(&[a.clone(), b.clone(), c.clone()]).unwrap_or(0);
        HalfSpace {
            normal: [a, b, c].map(|n| Number::from(n.scaled(-exponent))),
            d: Number::from(d.scaled(-exponent)),
        }
    });
    about.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_of_known_angles_are_true_to_250_bits() {
        let pi = pi();
        for (divisor, sine_squared) in [(6.0, 0.25), (4.0, 0.5), (3.0, 0.75), (2.0, 1.0)] {
            let (sine, cosine) = sine_and_cosine(&pi.over(divisor, PRECISION.terms() + 1));
            let off = &times(&sine, &sine) - &Expansion::from(sine_squared);
            assert!(
                off.estimate().abs() < libm::exp2(-250.0),
                "{divisor}: {off:?}"
            );
            let off = &times(&cosine, &cosine) - &Expansion::from(1.0 - sine_squared);
            assert!(
                off.estimate().abs() < libm::exp2(-250.0),
                "{divisor}: {off:?}"
            );
        }
    }
}
