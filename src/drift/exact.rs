//! Exact rotation in about 200 bits, and the errors of axes against it.

use glam::{DMat3, DVec3};

use crate::arithmetic::{Expansion, exact};

/// Leading doubles kept of every number: about 2e-63 relative.
///
/// After raising to the power 1e10, more than 50 digits are left.
const TERMS: usize = 4;

/// Sine and cosine of an angle in degrees.
///
/// Whole turns are subtracted first, which is exact in degrees.
fn sin_cos_degrees(degrees: &Expansion) -> (Expansion, Expansion) {
    let turns = (degrees.estimate() / 360.0).round();
    let rest = degrees - &Expansion::product(360.0, turns);
    let radians = &rest * &exact::pi().over(180.0, TERMS + 1);
    exact::sin_cos(&radians.leading(TERMS), TERMS)
}

/// Columns u, v and n of a camera basis, as numbers of 200 bits.
#[derive(Clone, Debug)]
pub struct Matrix([exact::ExactVector; 3]);

impl Matrix {
    fn from_entries(entry: impl Fn(usize, usize) -> Expansion) -> Self {
        let column = |j| std::array::from_fn(|i| entry(i, j));
        Matrix(std::array::from_fn(column))
    }

    fn transposed(&self) -> Self {
        Matrix::from_entries(|i, j| self.0[i][j].clone())
    }

    /// Product of the transpose with another matrix.
    fn transposed_times(&self, other: &Self) -> Self {
        let entry = |i: usize, j: usize| exact::dot(&self.0[i], &other.0[j]);
        Matrix::from_entries(|i, j| entry(i, j).leading(TERMS))
    }

    pub fn times(&self, other: &Self) -> Self {
        self.transposed().transposed_times(other)
    }

    /// Raises the matrix to a power by repeated squaring.
    pub fn power(&self, exponent: u64) -> Self {
        match exponent {
            0 => Matrix::from(DMat3::IDENTITY),
            _ if exponent & 1 == 1 => self.power(exponent - 1).times(self),
            _ => self.times(self).power(exponent / 2),
        }
    }

    /// Counter-clockwise rotation by exact degrees about the axis 0, 1 or 2.
    pub fn rotation(axis: usize, degrees: &Expansion) -> Self {
        let (sin, cos) = sin_cos_degrees(degrees);
        let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut turn = Matrix::from(DMat3::IDENTITY);
        turn.0[last][next] = -&sin;
        turn.0[next][last] = sin;
        (turn.0[next][next], turn.0[last][last]) = (cos.clone(), cos);
        turn
    }

    /// The matrix minus the identity, rounded.
    fn minus_identity(&self) -> DMat3 {
        let one = Matrix::from(DMat3::IDENTITY);
        let entry = |i: usize, j: usize| (&self.0[j][i] - &one.0[j][i]).estimate();
        DMat3::from_cols_array_2d(&[0, 1, 2].map(|j| [0, 1, 2].map(|i| entry(i, j))))
    }
}

impl From<DMat3> for Matrix {
    fn from(m: DMat3) -> Self {
        Matrix::from_entries(|i, j| Expansion::from(m.col(j)[i]))
    }
}

/// Larger of two errors; NaN counts as the largest, which `max` would drop.
pub fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

fn largest_entry(matrix: &DMat3) -> f64 {
    let sizes = matrix.to_cols_array().map(f64::abs);
    sizes.into_iter().fold(0.0, larger)
}

/// Most Newton steps: more would amplify the rounding of a zero to one.
const MOST_STEPS: u32 = 60;

/// Errors of axes X whose exact value is R, without cancellation.
///
/// Largest entry of `X^T X - I`, which is zero for a rotation, and the angle in radians.
pub fn errors(axes: DMat3, exact: &Matrix) -> [f64; 2] {
    let axes = Matrix::from(axes);
    let gram = axes.transposed_times(&axes).minus_identity();
    let off = exact.transposed_times(&axes).minus_identity();
    [largest_entry(&gram), angle(off)]
}

/// Angle of the rotation nearest to I + E, its polar factor; NaN without one.
///
/// Newton's iteration Y(3I - Y^T Y)/2 (Higham 1986, eq. 3.1 in its inverse-free form) for Y = I +
/// E, in terms of E: an angle of any size keeps its digits.
fn angle(mut off: DMat3) -> f64 {
    // Scaled so that the squares of the singular values add to 3: each singular value is then at
    // most sqrt(3), where the iteration converges.
    let entries = (DMat3::IDENTITY + off).to_cols_array();
    let scale = (3.0 / entries.iter().map(|x| x * x).sum::<f64>()).sqrt();
    off = off * scale + DMat3::IDENTITY * (scale - 1.0);
    for _ in 0..MOST_STEPS {
        let gram = off + off.transpose() + off.transpose() * off;
        if largest_entry(&gram) < 1e-14 {
            // trace = 1 + 2 cos; the antisymmetric part is sin times the axis. Together they give
            // every angle to full precision.
            let apart = off - off.transpose();
            let twice = DVec3::new(apart.y_axis.z, apart.z_axis.x, apart.x_axis.y);
            let trace = off.x_axis.x + off.y_axis.y + off.z_axis.z;
            return (twice.length() / 2.0).atan2(1.0 + trace / 2.0);
        }
        off = off - gram * 0.5 - off * gram * 0.5;
    }
    f64::NAN
}

#[cfg(test)]
mod tests {
    use super::*;
    fn apart(a: &Matrix, b: &Matrix) -> f64 {
        let entries = a.0.iter().flatten().zip(b.0.iter().flatten());
        let apart = entries.map(|(a, b)| (a - b).estimate().abs());
        apart.fold(0.0, larger)
    }

    fn degrees(value: f64) -> Expansion {
        Expansion::from(value)
    }

    fn step() -> Matrix {
        let [yaw, pitch, roll] = [0.7, 0.3, 0.1].map(degrees);
        let rotated = Matrix::rotation(1, &yaw).times(&Matrix::rotation(0, &pitch));
        rotated.times(&Matrix::rotation(2, &roll))
    }

    #[test]
    fn sines_are_true_to_fifty_digits() {
        let one = Expansion::from(1.0);
        let off = |x: &Expansion, wanted: &Expansion| (x - wanted).estimate().abs();
        // Angles whose sine or cosine has a closed form, whole turns included.
        let half = Expansion::from(0.5);
        let root = half.sqrt(TERMS + 1);
        for turns in [-1e9, 0.0, 1.0, 7e6] {
            let at = |value: f64| sin_cos_degrees(&(&degrees(value) + &degrees(360.0 * turns)));
            assert!(off(&at(30.0).0, &half) < 1e-55);
            assert!(off(&at(150.0).0, &half) < 1e-55);
            assert!(off(&at(45.0).1, &root) < 1e-55);
            assert!(off(&at(-60.0).1, &half) < 1e-55);
            assert!(off(&at(180.0).1, &-&one) < 1e-55);
        }
        for angle in [0.7, 89.0, -179.9, 1e-5] {
            let (sin, cos) = sin_cos_degrees(&degrees(angle));
            let square = &(&sin * &sin) + &(&cos * &cos);
            assert!(off(&square, &one) < 1e-55);
            assert!((sin.estimate() - angle.to_radians().sin()).abs() < 2e-16);
        }
    }

    /// The power of the step as a quaternion, one factor at a time by half angles.
    ///
    /// Uses neither the matrices nor the squaring of `power`.
    fn by_quaternions(steps: u64) -> Matrix {
        type Quaternion = [Expansion; 4];
        let half = Expansion::from(0.5);
        let about = |axis: usize, angle: f64| -> Quaternion {
            let (sin, cos) = sin_cos_degrees(&(&degrees(angle) * &half));
            let mut q = [cos, Expansion::ZERO, Expansion::ZERO, Expansion::ZERO];
            q[axis + 1] = sin;
            q
        };
        let times = |a: &Quaternion, b: &Quaternion| -> Quaternion {
            let sum = |signs: [f64; 4], pairs: [(usize, usize); 4]| {
                let mut sum = Expansion::default();
                for (sign, (i, j)) in signs.into_iter().zip(pairs) {
                    sum = &sum + &(&(&a[i] * &b[j]) * &Expansion::from(sign));
                }
                sum.leading(TERMS)
            };
            [
                sum([1.0, -1.0, -1.0, -1.0], [(0, 0), (1, 1), (2, 2), (3, 3)]),
                sum([1.0, 1.0, 1.0, -1.0], [(0, 1), (1, 0), (2, 3), (3, 2)]),
                sum([1.0, -1.0, 1.0, 1.0], [(0, 2), (1, 3), (2, 0), (3, 1)]),
                sum([1.0, 1.0, -1.0, 1.0], [(0, 3), (1, 2), (2, 1), (3, 0)]),
            ]
        };
        let step = times(&times(&about(1, 0.7), &about(0, 0.3)), &about(2, 0.1));
        let mut q = step.clone();
        for _ in 1..steps {
            q = times(&q, &step);
        }
        let [w, x, y, z] = &q;
        let two = Expansion::from(2.0);
        let diagonal = |a: &Expansion, b: &Expansion| {
            let squares = &(a * a) + &(b * b);
            &Expansion::from(1.0) - &(&squares * &two)
        };
        let sum = |a: &Expansion, b: &Expansion| (a + b).leading(TERMS);
        let product = |a: &Expansion, b: &Expansion| (&(a * b) * &two).leading(TERMS);
        let minus = |a: Expansion| -&a;
        let rows = Matrix([
            [
                diagonal(y, z),
                sum(&product(x, y), &minus(product(w, z))),
                sum(&product(x, z), &product(w, y)),
            ],
            [
                sum(&product(x, y), &product(w, z)),
                diagonal(x, z),
                sum(&product(y, z), &minus(product(w, x))),
            ],
            [
                sum(&product(x, z), &minus(product(w, y))),
                sum(&product(y, z), &product(w, x)),
                diagonal(x, y),
            ],
        ]);
        rows.transposed()
    }

    #[test]
    fn the_power_agrees_with_quaternions_step_by_step() {
        for steps in [1, 2, 7, 2000] {
            let off = apart(&step().power(steps), &by_quaternions(steps));
            assert!(off < 1e-50, "{steps}: {off:e}");
        }
        assert_eq!(apart(&step().power(0), &Matrix::from(DMat3::IDENTITY)), 0.0);
    }

    #[test]
    fn ten_million_steps_are_good_to_forty_digits() {
        // Rotations about one axis have a closed form, and a power is a product of powers: 10^7 =
        // 3^14 + 5217031.
        let rotated = Matrix::rotation(2, &degrees(0.7)).power(10_000_000);
        let closed = Matrix::rotation(2, &Expansion::product(0.7, 1e7));
        assert!(apart(&rotated, &closed) < 1e-45);
        let mut cubed = step();
        for _ in 0..14 {
            cubed = cubed.times(&cubed).times(&cubed);
        }
        let split = cubed.times(&step().power(5_217_031));
        let whole = step().power(10_000_000);
        assert!(apart(&whole, &split) < 1e-45);
        let gram = whole.transposed_times(&whole);
        assert!(apart(&gram, &Matrix::from(DMat3::IDENTITY)) < 1e-45);
    }

    #[test]
    fn powers_are_those_of_another_program() {
        // The x of the axis n in two doubles, by mpmath 1.3 with 60 digits.
        for (steps, high, low) in [
            (1_000, 0.692_348_166_997_714_5, -4.287_065_946_121_089e-17),
            (100_000, 0.934_132_705_979_641_3, -4.821_140_014_882_436e-17),
            (
                10_000_000,
                -0.667_655_193_524_963_9,
                2.828_620_622_082_605e-17,
            ),
        ] {
            let entry = &step().power(steps).0[2][0];
            let off = &(entry - &Expansion::from(high)) - &Expansion::from(low);
            assert!(off.estimate().abs() < 1e-32, "{steps}: {off:?}");
        }
    }

    #[test]
    fn angles_are_measured_from_1e_15_to_pi() {
        // Axes with exact errors: the reference is rotated instead.
        let stretched = DMat3::from_diagonal(DVec3::new(1.2, 1.0, 0.9));
        for degree in [1e-15, 1e-9, 0.3, 90.0, 179.999_999, 180.0] {
            for axes in [DMat3::IDENTITY, stretched] {
                let [_, found] = errors(axes, &Matrix::rotation(1, &degrees(degree)));
                let found = found.to_degrees();
                assert!((found / degree - 1.0).abs() < 1e-9, "{degree}: {found}");
            }
        }
        let shear = DMat3::from_cols(DVec3::X, DVec3::new(1e-5, 1.0, 0.0), DVec3::Z);
        let [_, found] = errors(shear, &Matrix::from(DMat3::IDENTITY));
        assert!((found / libm::atan(0.5e-5) - 1.0).abs() < 1e-9, "{found}");
        let found = errors(stretched, &Matrix::from(DMat3::IDENTITY));
        for (found, wanted) in found.into_iter().zip([0.44, 0.0]) {
            assert!((found - wanted).abs() < 1e-12, "{found}");
        }
        for nothing in [DMat3::ZERO, DMat3::from_diagonal(DVec3::X), DMat3::NAN] {
            assert!(errors(nothing, &step())[1].is_nan());
        }
        assert!(errors(DMat3::NAN, &step())[0].is_nan());
    }
}
