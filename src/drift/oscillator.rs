//! The spring arm in closed form: how it comes to rest by itself, for every
//! damping, and how it follows a swinging target. How programs step it is in
//! `spring`.

/// A camera of mass one on a spring: `x'' = k (T - x) - 2 zeta omega x'` with
/// `omega = sqrt(k)` and the target T.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Spring {
    /// k in 1/s^2.
    pub stiffness: f64,
    /// zeta: one is critical, below it swings over.
    pub damping_ratio: f64,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct State {
    pub position: f64,
    pub velocity: f64,
}

impl State {
    pub const fn new(position: f64, velocity: f64) -> State {
        State { position, velocity }
    }
}

/// Below this, the square of the angle (or of its hyperbolic kin) goes into
/// series instead of being divided by; their first term left out is 3e-17.
const SERIES_BELOW: f64 = 1e-2;

impl Spring {
    pub fn omega(&self) -> f64 {
        self.stiffness.sqrt()
    }

    /// `exp(-zeta omega t) (cosh r, sinh(r)/r)` with
    /// `r = omega t sqrt(zeta^2 - 1)`, imaginary below critical damping.
    ///
    /// The usual formulas divide by r, which is zero at critical damping and
    /// without digits beside it. Written as functions of `r^2` both are smooth
    /// there, and their series is short.
    fn damped_pair(&self, t: f64) -> (f64, f64) {
        let (zeta, angle) = (self.damping_ratio, self.omega() * t);
        // (zeta - 1)(zeta + 1), since zeta^2 - 1 cancels.
        let excess = (zeta - 1.0) * (zeta + 1.0);
        let square = excess * angle * angle;
        if square.abs() < SERIES_BELOW {
            let polynomial = |c: [f64; 4]| {
                let tail = c.into_iter().rev().fold(0.0, |sum, c| (sum + c) * square);
                1.0 + tail
            };
            let fall = libm::exp(-zeta * angle);
            let cosh = polynomial([1.0 / 2.0, 1.0 / 24.0, 1.0 / 720.0, 1.0 / 40_320.0]);
            let sinhc = polynomial([1.0 / 6.0, 1.0 / 120.0, 1.0 / 5_040.0, 1.0 / 362_880.0]);
            (fall * cosh, fall * sinhc)
        } else if square < 0.0 {
            let (fall, r) = (libm::exp(-zeta * angle), (-square).sqrt());
            (fall * libm::cos(r), fall * libm::sin(r) / r)
        } else {
            // Two decays instead of exp times cosh, which overflows; the slow
            // rate zeta - root without its cancellation.
            let root = excess.sqrt();
            let slow = libm::exp(-angle / (zeta + root));
            let fast = libm::exp(-angle * (zeta + root));
            ((slow + fast) / 2.0, (slow - fast) / (2.0 * square.sqrt()))
        }
    }

    /// Where the arm is after a time `t` in seconds if its target rests at
    /// zero.
    pub fn released(&self, state: State, t: f64) -> State {
        let (cosh, sinhc) = self.damped_pair(t);
        let State { position, velocity } = state;
        let (rate, sinhc) = (self.damping_ratio * self.omega(), sinhc * t);
        State::new(
            (cosh + rate * sinhc) * position + sinhc * velocity,
            (cosh - rate * sinhc) * velocity - self.stiffness * sinhc * position,
        )
    }

    /// The arm at time `t` that was at `start` at time zero and whose target
    /// is at `sin t`.
    pub fn follows_sine(&self, start: State, t: f64) -> State {
        // The steady answer is Im(H e^it), H = k / (k - 1 + 2 i zeta omega).
        let re = self.stiffness - 1.0;
        let im = 2.0 * self.damping_ratio * self.omega();
        let size = self.stiffness / (re * re + im * im);
        let steady = |t: f64| State {
            position: size * (re * libm::sin(t) - im * libm::cos(t)),
            velocity: size * (re * libm::cos(t) + im * libm::sin(t)),
        };
        let (first, now) = (steady(0.0), steady(t));
        let (x, v) = (first.position, first.velocity);
        let rest = State::new(start.position - x, start.velocity - v);
        let rest = self.released(rest, t);
        State::new(now.position + rest.position, now.velocity + rest.velocity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arithmetic::Expansion;

    const RELEASED: State = State {
        position: 1.0,
        velocity: -3.0,
    };

    /// The series of the matrix exponential in 200 bits: no case distinction,
    /// no square root of anything but k.
    fn by_series(spring: &Spring, state: State, t: f64) -> State {
        let [k, zeta, t] = [spring.stiffness, spring.damping_ratio, t].map(Expansion::from);
        let omega = k.sqrt(5);
        let friction = (&(&zeta * &omega) * &Expansion::from(2.0)).leading(5);
        let (mut x, mut v) = (state.position.into(), state.velocity.into());
        let mut sum: [Expansion; 2] = [Expansion::clone(&x), Expansion::clone(&v)];
        for n in 1..400 {
            let share = (&t * &Expansion::from(f64::from(n)).reciprocal(5)).leading(5);
            let pull = &-&(&k * &x) - &(&friction * &v);
            (x, v) = (
                (&v * &share).leading(5),
                (&pull.leading(5) * &share).leading(5),
            );
            sum = [(&sum[0] + &x).leading(5), (&sum[1] + &v).leading(5)];
        }
        State {
            position: sum[0].estimate(),
            velocity: sum[1].estimate(),
        }
    }

    /// Largest error of a state, velocities in units of omega.
    fn off(spring: &Spring, found: State, wanted: State) -> f64 {
        let position = (found.position - wanted.position).abs();
        position.max((found.velocity - wanted.velocity).abs() / spring.omega())
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
                let error = off(&spring, spring.released(RELEASED, t), wanted);
                assert!(error < 2e-15, "{spring:?} {t}: {error:e}");
            }
        }
        let stiff = Spring {
            stiffness: 1e6,
            damping_ratio: 2.0,
        };
        // exp times cosh would be zero times infinity here.
        assert!(stiff.released(RELEASED, 20.0).position.abs() < 1e-300);
    }

    /// The textbook's overdamped formula in f32: two exponentials whose
    /// factors are divided by the difference of their rates.
    fn textbook_in_single(spring: &Spring, state: State, t: f64) -> f32 {
        let (omega, zeta) = (spring.omega() as f32, spring.damping_ratio as f32);
        let root = omega * (zeta * zeta - 1.0).sqrt();
        let (slow, fast) = (root - zeta * omega, -root - zeta * omega);
        let (x, v, t) = (state.position as f32, state.velocity as f32, t as f32);
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
            let wanted = by_series(&spring, RELEASED, 1.0 / 60.0).position;
            let error = f64::from(textbook_in_single(&spring, RELEASED, 1.0 / 60.0)) - wanted;
            (
                error.abs(),
                off(
                    &spring,
                    spring.released(RELEASED, 1.0 / 60.0),
                    State {
                        position: wanted,
                        velocity: by_series(&spring, RELEASED, 1.0 / 60.0).velocity,
                    },
                ),
            )
        };
        assert!(near(1e-9).0.is_nan() && near(1e-9).1 < 2e-15);
        // Far from critical it is right, nearer it loses digits.
        assert!(near(1.0).0 < 1e-6);
        assert!(near(1e-6).0 > 1e-5, "{:?}", near(1e-6));
    }

    #[test]
    fn following_a_sine_solves_the_equation() {
        let start = State {
            position: 1.0,
            velocity: 0.0,
        };
        for damping_ratio in [0.1, 1.0, 2.0] {
            let spring = Spring {
                stiffness: 30.0,
                damping_ratio,
            };
            let at = |t: f64| spring.follows_sine(start, t);
            assert!(off(&spring, at(0.0), start) < 1e-15);
            for t in [0.0, 0.3, 2.0, 19.0] {
                // Central differences of fourth order.
                let h = 1e-3;
                let slope = |of: fn(State) -> f64| {
                    let value = |steps: f64| of(at(t + steps * h));
                    (8.0 * (value(1.0) - value(-1.0)) - (value(2.0) - value(-2.0))) / (12.0 * h)
                };
                let now = at(t);
                assert!((slope(|s| s.position) - now.velocity).abs() < 1e-8);
                let pull = 30.0 * (t.sin() - now.position)
                    - 2.0 * damping_ratio * spring.omega() * now.velocity;
                assert!(
                    (slope(|s| s.velocity) - pull).abs() < 1e-6,
                    "{damping_ratio} {t}"
                );
            }
        }
    }
}
