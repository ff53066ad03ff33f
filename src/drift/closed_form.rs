//! The spring arm in closed form, for every damping. A stiffening spring is frozen
//! as it is when the step begins.

/// Position and velocity.
pub type State = [f64; 2];

/// `x'' = k d (1 + s d^2) - c x'` with the stretch `d = T - x` and a stop.
#[derive(Clone, Copy, Debug)]
pub struct Arm {
    /// k in 1/s^2.
    pub stiffness: f64,
    /// c in 1/s.
    pub friction: f64,
    /// s: 0 for a linear spring, 1 for Duffing's.
    pub stiffening: f64,
    /// Position that the arm cannot pass; meeting it takes all velocity.
    pub stop: f64,
}

/// The target during one frame, in seconds since the frame began.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// When the frame begins.
    pub start: f64,
    pub base: f64,
    pub speed: f64,
}

impl Line {
    #[inline(always)]
    pub fn at(&self, t: f64) -> f64 {
        self.base + t * self.speed
    }
}

/// Below this, the square of the angle (or of its hyperbolic kin) goes into
/// series instead of being divided by; their first term left out is 3e-17.
const SERIES_BELOW: f64 = 1e-2;

/// `exp(-zeta angle) (cosh r, sinh(r)/r)` with `r = angle sqrt(zeta^2 - 1)`.
/// Below critical damping `r` is imaginary.
///
/// The usual formulas divide by r, which is zero at critical damping and
/// without digits beside it. Written as functions of `r^2` both are smooth
/// there, and their series is short.
fn damped_pair(zeta: f64, angle: f64) -> (f64, f64) {
    // (zeta - 1)(zeta + 1), since zeta^2 - 1 cancels.
    let excess = (zeta - 1.0) * (zeta + 1.0);
    let square = excess * angle * angle;
    if square.abs() < SERIES_BELOW {
        let fall = libm::exp(-zeta * angle);
        let polynomial = |c: [f64; 4]| 1.0 + c.iter().rev().fold(0.0, |sum, c| (sum + c) * square);
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

/// Position and velocity `h` seconds later, if the target rests at zero.
fn released(stiffness: f64, zeta: f64, [x, v]: State, h: f64) -> State {
    let omega = stiffness.sqrt();
    let (cosh, sinhc) = damped_pair(zeta, omega * h);
    let (rate, sinhc) = (zeta * omega, sinhc * h);
    [
        (cosh + rate * sinhc) * x + sinhc * v,
        -stiffness * sinhc * x + (cosh - rate * sinhc) * v,
    ]
}

/// The arm `h` seconds after `t`. Behind a target of constant speed it stays
/// `2 zeta/omega` seconds behind; how it differs from that is released.
pub fn chased(arm: &Arm, line: &Line, t: f64, [x, v]: State, h: f64) -> State {
    let stretch = line.at(t) - x;
    let secant = arm.stiffness * (1.0 + arm.stiffening * stretch * stretch);
    let omega = secant.sqrt();
    let zeta = arm.friction / (2.0 * omega);
    let behind = 2.0 * zeta / omega;
    let steady = |t: f64| line.at(t) - behind * line.speed;
    let [x, v] = released(secant, zeta, [x - steady(t), v - line.speed], h);
    [steady(t + h) + x, line.speed + v]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arithmetic::Expansion;

    /// The series of the matrix exponential in 200 bits: no case distinction,
    /// no square root of anything but k.
    fn by_series(k: f64, zeta: f64, [x, v]: State, t: f64) -> State {
        let [k, zeta, t] = [k, zeta, t].map(Expansion::from);
        let omega = k.sqrt(5);
        let friction = (&(&zeta * &omega) * &Expansion::from(2.0)).leading(5);
        let (mut x, mut v) = (Expansion::from(x), Expansion::from(v));
        let mut sum = [x.clone(), v.clone()];
        for n in 1..400 {
            let share = t.over(f64::from(n), 5);
            let pull = &-&(&k * &x) - &(&friction * &v);
            (x, v) = (
                (&v * &share).leading(5),
                (&pull.leading(5) * &share).leading(5),
            );
            sum = [(&sum[0] + &x).leading(5), (&sum[1] + &v).leading(5)];
        }
        sum.map(|sum| sum.estimate())
    }

    #[test]
    fn the_released_arm_is_right_at_and_near_critical_damping() {
        let near = [0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2];
        let near = near.into_iter().flat_map(|d| [1.0 - d, 1.0 + d]);
        for zeta in near.chain([0.1, 0.5, 2.0, 5.0]) {
            for (k, t) in [(1.0, 0.01), (1e2, 1.0 / 60.0), (1e4, 0.05), (1e6, 0.008)] {
                let state = [1.0, -3.0];
                let (found, wanted) = (released(k, zeta, state, t), by_series(k, zeta, state, t));
                let off = (found[0] - wanted[0]).abs();
                let off = off.max((found[1] - wanted[1]).abs() / k.sqrt());
                assert!(off < 2e-15, "{k} {zeta} {t}: {off:e}");
            }
        }
        // exp times cosh would be zero times infinity here.
        assert!(released(1e6, 2.0, [1.0, -3.0], 20.0)[0].abs() < 1e-300);
    }
}
