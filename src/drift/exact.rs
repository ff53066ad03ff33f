//! References in arithmetic of about 200 bits: rotations with the errors of an
//! approximate one, and the way of a linear spring arm.

use glam::DMat3;

use crate::arithmetic::{Expansion, exact};

/// Leading doubles kept of every number: about 2e-63 relative. Raised to the
/// power 1e10, that still leaves more than 50 digits.
const TERMS: usize = 4;

/// Changes of a series that end it: below the last digit of one.
const NEGLIGIBLE: f64 = 1e-70;

/// Sine and cosine of an angle in degrees.
///
/// Whole turns are taken off first, which is exact in degrees.
fn sin_cos_degrees(degrees: &Expansion) -> (Expansion, Expansion) {
    let turns = (degrees.estimate() / 360.0).round();
    let rest = degrees - &Expansion::product(360.0, turns);
    let radians = &rest * &exact::pi().over(180.0, TERMS + 1);
    exact::sin_cos(&radians.leading(TERMS), TERMS)
}

/// Position and velocity of the linear arm at the ends of frames.
///
/// The arm is `x'' = omega^2 (sin t - x) - 2 omega x'`, from rest at one.
/// Position, velocity, sine and cosine of the time are one linear system: each frame
/// multiplies them by the exponential of its matrix.
pub fn linear_way(omega: f64, frame_s: f64, frames: usize) -> Vec<[f64; 2]> {
    let square = Expansion::product(omega, omega);
    let mut rates = Matrix::from_entries(|_, _| Expansion::ZERO);
    rates.0[0][1] = 1.0.into();
    rates.0[1] = [-&square, (-2.0 * omega).into(), square, Expansion::ZERO];
    rates.0[2][3] = 1.0.into();
    rates.0[3][2] = (-1.0).into();
    let step = rates.scaled(&frame_s.into()).exponential();
    let mut state: [Expansion; 4] = [1.0, 0.0, 0.0, 1.0].map(Expansion::from);
    let frame = |_| {
        state = step.applied(&state);
        [state[0].estimate(), state[1].estimate()]
    };
    (0..frames).map(frame).collect()
}

/// A square matrix of numbers of 200 bits. The columns of a camera basis are u, v
/// and n.
#[derive(Clone, Debug)]
pub struct Matrix<const N: usize = 3>([[Expansion; N]; N]);

impl<const N: usize> Matrix<N> {
    fn from_entries(entry: impl Fn(usize, usize) -> Expansion) -> Self {
        let row = |i| std::array::from_fn(|j| entry(i, j));
        Matrix(std::array::from_fn(row))
    }

    pub fn identity() -> Self {
        Matrix::from_entries(|i, j| Expansion::from(f64::from(u8::from(i == j))))
    }

    fn scaled(&self, factor: &Expansion) -> Self {
        Matrix::from_entries(|i, j| (&self.0[i][j] * factor).leading(TERMS))
    }

    fn plus(&self, other: &Self) -> Self {
        Matrix::from_entries(|i, j| (&self.0[i][j] + &other.0[i][j]).leading(TERMS))
    }

    pub fn times(&self, other: &Self) -> Self {
        let columns = other.transposed().0.map(|column| self.applied(&column));
        Matrix(columns).transposed()
    }

    /// The product with a column.
    fn applied(&self, column: &[Expansion; N]) -> [Expansion; N] {
        let sum = |row: &[Expansion; N]| {
            let products = row.iter().zip(column).map(|(a, b)| (a * b).leading(TERMS));
            let sum = products.fold(Expansion::ZERO, |sum, product| &sum + &product);
            sum.leading(TERMS)
        };
        self.0.each_ref().map(sum)
    }

    fn transposed(&self) -> Self {
        Matrix::from_entries(|i, j| self.0[j][i].clone())
    }

    /// The matrix `exponent` times over, by repeated squaring.
    pub fn power(&self, mut exponent: u64) -> Self {
        let (mut power, mut square) = (Matrix::identity(), self.clone());
        while exponent > 0 {
            if exponent & 1 == 1 {
                power = power.times(&square);
            }
            square = square.times(&square);
            exponent >>= 1;
        }
        power
    }

    /// The exponential: halved until its series converges, then squared as often.
    fn exponential(&self) -> Self {
        let size = self.largest_difference(&Matrix::from_entries(|_, _| Expansion::ZERO));
        let halvings = (size.log2().ceil() as i32 + 4).max(0);
        let small = Matrix::from_entries(|i, j| self.0[i][j].scaled(-halvings));
        let (mut sum, mut term, mut n) = (Matrix::identity(), Matrix::identity(), 0.0);
        loop {
            n += 1.0;
            let next = term.times(&small);
            term = Matrix::from_entries(|i, j| next.0[i][j].over(n, TERMS));
            let longer = sum.plus(&term);
            if longer.largest_difference(&sum) <= NEGLIGIBLE {
                return (0..halvings).fold(longer, |power, _| power.times(&power));
            }
            sum = longer;
        }
    }

    /// Largest entry of `X^T X - I`: zero for a rotation.
    pub fn orthogonality_error(&self) -> f64 {
        let gram = self.transposed().times(self);
        gram.largest_difference(&Matrix::identity())
    }

    pub fn largest_difference(&self, other: &Self) -> f64 {
        let entries = self.0.iter().flatten().zip(other.0.iter().flatten());
        let differences = entries.map(|(a, b)| (a - b).estimate().abs());
        differences.fold(0.0, larger)
    }
}

/// The larger of two errors. NaN is the largest: `max` would lose it.
pub fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

impl Matrix {
    /// The turn by exact degrees about the axis 0, 1 or 2, counter-clockwise.
    pub fn about(axis: usize, degrees: &Expansion) -> Self {
        let (sin, cos) = sin_cos_degrees(degrees);
        let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut turn = Matrix::identity();
        turn.0[next][next] = cos.clone();
        turn.0[last][last] = cos;
        turn.0[next][last] = -&sin;
        turn.0[last][next] = sin;
        turn
    }

    /// Length of the difference of two columns, and how much longer than one
    /// the column of `self` is.
    pub fn column_error(&self, exact: &Matrix, column: usize) -> (f64, f64) {
        let (mut square, mut length) = (0.0, Expansion::from(-1.0));
        for row in 0..3 {
            let entry = &self.0[row][column];
            square += (entry - &exact.0[row][column]).estimate().powi(2);
            length = &length + &(entry * entry).leading(TERMS);
        }
        // |x| - 1 = (|x|^2 - 1)/(|x| + 1), without cancellation.
        let longer = length.estimate();
        (square.sqrt(), longer / ((longer + 1.0).sqrt() + 1.0))
    }

    /// The nearest rotation (polar factor) by Newton's iteration
    /// X(3I - X^T X)/2 (Higham 1986, eq. 3.1 in its inverse-free form); `None`
    /// if there is none to find.
    fn nearest_rotation(&self) -> Option<Matrix> {
        let sum: f64 = self.0.iter().flatten().map(|e| e.estimate().powi(2)).sum();
        // Scaled so that the squares of the singular values add to 3: each is
        // then below sqrt(3), where the iteration converges.
        let scale = (3.0 / sum).sqrt();
        if !scale.is_finite() {
            return None;
        }
        let mut x = self.scaled(&scale.into());
        for _ in 0..100 {
            let gram = x.transposed().times(&x);
            if gram.largest_difference(&Matrix::identity()) < 1e-40 {
                return Some(x);
            }
            let step = Matrix::from_entries(|i, j| {
                let three = Expansion::from(if i == j { 3.0 } else { 0.0 });
                &(&three - &gram.0[i][j]) * &Expansion::from(0.5)
            });
            x = x.times(&step);
        }
        None
    }

    /// The angle in radians between the rotation nearest to `self` and an
    /// exact one; NaN if there is no nearest one.
    pub fn angle_to(&self, exact: &Matrix) -> f64 {
        let Some(nearest) = self.nearest_rotation() else {
            return f64::NAN;
        };
        let between = exact.transposed().times(&nearest).0;
        // trace = 1 + 2 cos; the antisymmetric part is sin times the axis.
        // Together they give every angle to full precision.
        let mut square = 0.0;
        for (i, j) in [(1, 2), (2, 0), (0, 1)] {
            square += ((&between[i][j] - &between[j][i]).estimate() / 2.0).powi(2);
        }
        let diagonal = &(&between[0][0] + &between[1][1]) + &between[2][2];
        let cos = (&diagonal - &Expansion::from(1.0)).estimate() / 2.0;
        square.sqrt().atan2(cos)
    }
}

impl From<DMat3> for Matrix {
    fn from(m: DMat3) -> Self {
        Matrix::from_entries(|i, j| Expansion::from(m.col(j)[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn degrees(value: f64) -> Expansion {
        Expansion::from(value)
    }

    fn step() -> Matrix {
        let [yaw, pitch, roll] = [0.7, 0.3, 0.1].map(degrees);
        let turned = Matrix::about(1, &yaw).times(&Matrix::about(0, &pitch));
        turned.times(&Matrix::about(2, &roll))
    }

    #[test]
    fn sines_are_true_to_fifty_digits() {
        let one = Expansion::from(1.0);
        let off = |x: &Expansion, wanted: &Expansion| (x - wanted).estimate().abs();
        // Angles with a sine or cosine of closed form, whole turns included.
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

    /// The power of the step as a quaternion, one factor after the other by
    /// half angles: neither the matrices nor the squaring of `power`.
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
        Matrix([
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
        ])
    }

    #[test]
    fn the_power_agrees_with_quaternions_step_by_step() {
        for steps in [1, 2, 7, 2000] {
            let off = step()
                .power(steps)
                .largest_difference(&by_quaternions(steps));
            assert!(off < 1e-50, "{steps}: {off:e}");
        }
        assert_eq!(step().power(0).largest_difference(&Matrix::identity()), 0.0);
    }

    #[test]
    fn ten_million_steps_are_good_to_forty_digits() {
        // Turns about one axis have a closed form, and a power is a product of
        // powers: 10^7 = 3^14 + 5217031.
        let about = Matrix::about(2, &degrees(0.7)).power(10_000_000);
        let closed = Matrix::about(2, &Expansion::product(0.7, 1e7));
        assert!(about.largest_difference(&closed) < 1e-45);
        let mut cubed = step();
        for _ in 0..14 {
            cubed = cubed.times(&cubed).times(&cubed);
        }
        let split = cubed.times(&step().power(5_217_031));
        let whole = step().power(10_000_000);
        assert!(whole.largest_difference(&split) < 1e-45);
        assert!(whole.orthogonality_error() < 1e-45);
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
            let entry = &step().power(steps).0[0][2];
            let off = &(entry - &Expansion::from(high)) - &Expansion::from(low);
            assert!(off.estimate().abs() < 1e-32, "{steps}: {off:?}");
        }
    }

    #[test]
    fn angles_are_measured_from_1e_20_to_pi() {
        let base = step().power(12_345);
        for angle in [1e-20, 1e-9, 0.3, 90.0, 179.999_999, 180.0] {
            let off = base.times(&Matrix::about(1, &degrees(angle)));
            let found = off.angle_to(&base).to_degrees();
            assert!((found / angle - 1.0).abs() < 1e-9, "{angle}: {found}");
        }
        // Stretching is no turning, and twenty per cent of it are no problem.
        let stretched = DMat3::from_diagonal(DVec3::new(1.2, 1.0, 0.9));
        let turn = base.times(&Matrix::about(0, &degrees(0.3)));
        let found = turn.times(&Matrix::from(stretched)).angle_to(&base);
        assert!((found.to_degrees() / 0.3 - 1.0).abs() < 1e-12, "{found}");
        let off = Matrix::from(stretched);
        assert!(off.angle_to(&Matrix::identity()) < 1e-30);
        assert!((off.orthogonality_error() - 0.44).abs() < 1e-12);
        let (far, longer) = off.column_error(&Matrix::identity(), 0);
        assert!((far - 0.2).abs() < 1e-12 && (longer - 0.2).abs() < 1e-12);
        let (far, longer) = off.column_error(&Matrix::identity(), 2);
        assert!((far - 0.1).abs() < 1e-12 && (longer + 0.1).abs() < 1e-12);
        for nothing in [DMat3::ZERO, DMat3::from_diagonal(DVec3::X), DMat3::NAN] {
            assert!(Matrix::from(nothing).angle_to(&base).is_nan());
        }
        assert!(Matrix::from(DMat3::NAN).orthogonality_error().is_nan());
    }

    #[test]
    fn the_chase_of_a_sine_is_that_of_another_program() {
        // Position and velocity by the closed form with 50 digits, from (1, 0).
        for (stiffness, t, wanted) in [
            (
                1e2,
                0.25,
                [0.373_848_712_904_617_2, -1.346_139_945_323_537_3],
            ),
            (
                1e2,
                2.0,
                [0.964_056_336_238_460_4, -0.225_591_948_837_311_96],
            ),
            (
                1e4,
                0.25,
                [0.227_955_377_434_252_8, 0.973_568_851_059_739_9],
            ),
            (
                1e6,
                2.0,
                [0.910_126_990_946_457_1, -0.414_326_996_892_246_4],
            ),
        ] {
            for frames in [1, 64] {
                let way = linear_way(f64::sqrt(stiffness), t / frames as f64, frames);
                for (found, wanted) in way[frames - 1].into_iter().zip(wanted) {
                    assert!((found - wanted).abs() < 4e-16, "{stiffness} {t}: {found}");
                }
            }
        }
    }
}
