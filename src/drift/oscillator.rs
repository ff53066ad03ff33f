//! The spring arm in closed form: how it comes to rest by itself, for every
//! damping, and how it chases a target that moves along a parabola. How programs
//! step it is in `arm`.

use super::real::Real;

/// A camera of mass one on a spring: `x'' = k (T - x) - 2 zeta omega x'` with
/// `omega = sqrt(k)` and the target T.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Spring<R> {
    /// k in 1/s^2.
    pub stiffness: R,
    /// zeta: one is critical, below it swings over.
    pub damping_ratio: R,
}

/// Below this, the square of the angle (or of its hyperbolic kin) goes into
/// series instead of being divided by; their first term left out is 3e-17.
const SERIES_BELOW: f64 = 1e-2;

impl<R: Real> Spring<R> {
    pub fn omega(&self) -> R {
        self.stiffness.sqrt()
    }

    /// `exp(-zeta omega t) (cosh r, sinh(r)/r)` with
    /// `r = omega t sqrt(zeta^2 - 1)`, imaginary below critical damping.
    ///
    /// The usual formulas divide by r, which is zero at critical damping and
    /// without digits beside it. Written as functions of `r^2` both are smooth
    /// there, and their series is short.
    fn damped_pair(&self, t: R) -> (R, R) {
        let (zero, one, two) = (R::of(0.0), R::of(1.0), R::of(2.0));
        let (zeta, angle) = (self.damping_ratio, self.omega() * t);
        // (zeta - 1)(zeta + 1), since zeta^2 - 1 cancels.
        let excess = (zeta - one) * (zeta + one);
        let square = excess * angle * angle;
        if square.abs() < R::of(SERIES_BELOW) {
            let polynomial = |c: [f64; 4]| {
                let terms = c.into_iter().rev();
                one + terms.fold(zero, |sum, c| (sum + R::of(c)) * square)
            };
            let fall = (-zeta * angle).exp();
            let cosh = polynomial([1.0 / 2.0, 1.0 / 24.0, 1.0 / 720.0, 1.0 / 40_320.0]);
            let sinhc = polynomial([1.0 / 6.0, 1.0 / 120.0, 1.0 / 5_040.0, 1.0 / 362_880.0]);
            (fall * cosh, fall * sinhc)
        } else if square < zero {
            let (fall, r) = ((-zeta * angle).exp(), (-square).sqrt());
            (fall * r.cos(), fall * r.sin() / r)
        } else {
            // Two decays instead of exp times cosh, which overflows; the slow
            // rate zeta - root without its cancellation.
            let root = excess.sqrt();
            let slow = (-angle / (zeta + root)).exp();
            let fast = (-angle * (zeta + root)).exp();
            ((slow + fast) / two, (slow - fast) / (two * square.sqrt()))
        }
    }

    /// What a time `t` in seconds makes of position and velocity if the target
    /// rests at zero: the matrix exponential, by rows.
    pub fn transition(&self, t: R) -> [[R; 2]; 2] {
        let (cosh, sinhc) = self.damped_pair(t);
        let (rate, sinhc) = (self.damping_ratio * self.omega(), sinhc * t);
        [
            [cosh + rate * sinhc, sinhc],
            [-self.stiffness * sinhc, cosh - rate * sinhc],
        ]
    }

    /// Position and velocity that stay as they are beside a target at `place`, with
    /// `speed` and a constant `acceleration`: the polynomial that solves the
    /// equation, `T - 2 zeta/omega T' + (4 zeta^2 - 1)/k T''`.
    pub fn steady(&self, place: R, speed: R, acceleration: R) -> [R; 2] {
        let zeta = self.damping_ratio;
        let behind = R::of(2.0) * zeta / self.omega();
        let bent = (R::of(4.0) * zeta * zeta - R::of(1.0)) / self.stiffness;
        [
            place - behind * speed + bent * acceleration,
            speed - behind * acceleration,
        ]
    }
}

/// A matrix times a column.
pub fn times<R: Real>([[a, b], [c, d]]: [[R; 2]; 2], [x, v]: [R; 2]) -> [R; 2] {
    [a * x + b * v, c * x + d * v]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arithmetic::Expansion;

    const RELEASED: [f64; 2] = [1.0, -3.0];

    fn released(spring: &Spring<f64>, t: f64) -> [f64; 2] {
        times(spring.transition(t), RELEASED)
    }

    /// The series of the matrix exponential in 200 bits: no case distinction,
    /// no square root of anything but k.
    fn by_series(spring: &Spring<f64>, [x, v]: [f64; 2], t: f64) -> [f64; 2] {
        let [k, zeta, t] = [spring.stiffness, spring.damping_ratio, t].map(Expansion::from);
        let omega = k.sqrt(5);
        let friction = (&(&zeta * &omega) * &Expansion::from(2.0)).leading(5);
        let (mut x, mut v) = (Expansion::from(x), Expansion::from(v));
        let mut sum = [x.clone(), v.clone()];
        for n in 1..400 {
            let share = (&t * &Expansion::from(f64::from(n)).reciprocal(5)).leading(5);
            let pull = &-&(&k * &x) - &(&friction * &v);
            (x, v) = (
                (&v * &share).leading(5),
                (&pull.leading(5) * &share).leading(5),
            );
            sum = [(&sum[0] + &x).leading(5), (&sum[1] + &v).leading(5)];
        }
        sum.map(|sum| sum.estimate())
    }

    /// Largest error of a state, velocities in units of omega.
    fn off(spring: &Spring<f64>, found: [f64; 2], wanted: [f64; 2]) -> f64 {
        let position = (found[0] - wanted[0]).abs();
        position.max((found[1] - wanted[1]).abs() / spring.omega())
    }

    fn dampings() -> impl Iterator<Item = f64> {
        let near = [0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2];
        let near = near.into_iter().flat_map(|d| [1.0 - d, 1.0 + d]);
        near.chain([0.1, 0.5, 2.0, 5.0])
    }

    #[test]
    fn the_released_arm_is_right_at_and_near_critical_damping() {
        for damping_ratio in dampings() {
            for (stiffness, t) in [(1.0, 0.01), (1e2, 1.0 / 60.0), (1e4, 0.05), (1e6, 0.008)] {
                let spring = Spring {
                    stiffness,
                    damping_ratio,
                };
                let wanted = by_series(&spring, RELEASED, t);
                let error = off(&spring, released(&spring, t), wanted);
                assert!(error < 2e-15, "{spring:?} {t}: {error:e}");
            }
        }
        let stiff = Spring {
            stiffness: 1e6,
            damping_ratio: 2.0,
        };
        // exp times cosh would be zero times infinity here.
        assert!(released(&stiff, 20.0)[0].abs() < 1e-300);
    }

    /// The textbook's overdamped formula in f32: two exponentials whose
    /// factors are divided by the difference of their rates.
    fn textbook_in_single(spring: &Spring<f64>, state: [f64; 2], t: f64) -> f32 {
        let (omega, zeta) = (spring.omega() as f32, spring.damping_ratio as f32);
        let root = omega * (zeta * zeta - 1.0).sqrt();
        let (slow, fast) = (root - zeta * omega, -root - zeta * omega);
        let (x, v, t) = (state[0] as f32, state[1] as f32, t as f32);
        let first = (v - fast * x) / (slow - fast);
        first * (slow * t).exp() + (x - first) * (fast * t).exp()
    }

    #[test]
    fn the_textbooks_formula_in_single_precision_is_no_alternative() {
        let near = |excess: f64| {
            let spring = Spring {
                stiffness: 1e2,
                damping_ratio: 1.0 + excess,
            };
            let frame = 1.0 / 60.0;
            let wanted = by_series(&spring, RELEASED, frame);
            let error = f64::from(textbook_in_single(&spring, RELEASED, frame)) - wanted[0];
            (error.abs(), off(&spring, released(&spring, frame), wanted))
        };
        assert!(near(1e-9).0.is_nan() && near(1e-9).1 < 2e-15);
        // Far from critical it is right, nearer it loses digits.
        assert!(near(1.0).0 < 1e-6);
        assert!(near(1e-6).0 > 1e-5, "{:?}", near(1e-6));
    }

    #[test]
    fn the_steady_chase_of_a_parabola_solves_the_equation() {
        for damping_ratio in [0.1, 1.0, 2.0] {
            let spring = Spring {
                stiffness: 30.0,
                damping_ratio,
            };
            let at = |t: f64| {
                let target = 0.3 - 0.7 * t + 2.0 * t * t;
                (target, spring.steady(target, -0.7 + 4.0 * t, 4.0))
            };
            for t in [-1.0, 0.0, 0.25, 2.0] {
                let (target, [x, v]) = at(t);
                // Central differences are exact for parabolas.
                let (before, after) = (at(t - 0.5).1, at(t + 0.5).1);
                assert!((after[0] - before[0] - v).abs() < 1e-12);
                let pull = 30.0 * (target - x) - 2.0 * damping_ratio * spring.omega() * v;
                assert!((after[1] - before[1] - pull).abs() < 1e-12, "{t}");
            }
        }
    }
}
