//! Spring arms, and the six methods that step them.
//!
//! A camera on a spring follows a target that is known at frame ends and moves on a straight line
//! in between.

use crate::kernel::each;

/// Position and velocity.
pub type State = [f64; 2];

/// Spring arm `x'' = k d (1 + s d^2) - c x'` with stretch `d = T - x`, and a stop.
#[derive(Clone, Copy, Debug)]
pub struct Arm {
    /// k in 1/s^2.
    pub stiffness: f64,
    /// c in 1/s.
    pub friction: f64,
    /// s: 0 for a linear spring, 1 for Duffing's.
    pub stiffening: f64,
    /// Position that the arm cannot pass; hitting it stops the arm.
    pub stop: f64,
}

/// Target during one frame, as a function of the seconds since the frame began.
#[derive(Clone, Copy, Default, Debug)]
pub struct TargetLine {
    /// Start time of the frame.
    pub start: f64,
    pub base: f64,
    pub speed: f64,
}

impl TargetLine {
    #[inline(always)]
    pub fn at(&self, t: f64) -> f64 {
        self.base + t * self.speed
    }
}

/// Computes `exp(-zeta angle) (cosh r, sinh(r)/r)`, `r = angle sqrt(zeta^2 - 1)`.
///
/// Below critical damping `r` is imaginary.
///
/// The usual formulas subtract two decaying exponentials and divide by the difference of their
/// rates, which is zero at critical damping; near it they have no digits left.
fn damped_pair(zeta: f64, angle: f64) -> (f64, f64) {
    // (zeta - 1)(zeta + 1), since zeta^2 - 1 cancels.
    let excess = (zeta - 1.0) * (zeta + 1.0);
    let root = excess.abs().sqrt();
    // Near zero both sines equal their argument.
    let r = (angle * root).max(1e-100);
    let fall = libm::exp(-zeta * angle);
    if excess < 0.0 {
        (fall * libm::cos(r), fall * libm::sin(r) / r)
    } else if r < 1.0 {
        (fall * libm::cosh(r), fall * libm::sinh(r) / r)
    } else {
        // Two exponentials instead of exp times cosh, which overflows; the slow rate zeta - root
        // without its cancellation.
        let slow = libm::exp(-angle / (zeta + root));
        let fast = libm::exp(-angle * (zeta + root));
        ((slow + fast) / 2.0, (slow - fast) / (2.0 * r))
    }
}

/// Position and velocity after `h` seconds, for a target at rest at zero.
fn decayed(stiffness: f64, zeta: f64, [x, v]: State, h: f64) -> State {
    let omega = stiffness.sqrt();
    let (cosh, sinhc) = damped_pair(zeta, omega * h);
    let (rate, sinhc) = (zeta * omega, sinhc * h);
    [
        (cosh + rate * sinhc) * x + sinhc * v,
        -stiffness * sinhc * x + (cosh - rate * sinhc) * v,
    ]
}

/// The arm `h` seconds after `t`.
///
/// Behind a target of constant speed it settles `2 zeta/omega` seconds behind; its deviation from
/// that decays as for a target at rest.
pub fn exact_linear(arm: &Arm, line: &TargetLine, t: f64, [x, v]: State, h: f64) -> State {
    let stretch = line.at(t) - x;
    let secant = arm.stiffness * (1.0 + arm.stiffening * stretch * stretch);
    let omega = secant.sqrt();
    let zeta = arm.friction / (2.0 * omega);
    let behind = 2.0 * zeta / omega;
    let steady = |t: f64| line.at(t) - behind * line.speed;
    let [x, v] = decayed(secant, zeta, [x - steady(t), v - line.speed], h);
    [steady(t + h) + x, line.speed + v]
}

named! {
    /// Kind of spring arm.
    #[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Serialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum ArmKind {
        /// A linear spring behind the target `sin t`.
        Linear = "linear",
        /// A spring that stiffens as it is stretched, and a stop at 0.6.
        ///
        /// The stop takes all velocity.
        Collision = "collision",
    }
}

/// An arm behind a target that is known at frames of equal length.
pub struct ArmRun {
    pub arm: Arm,
    pub start: State,
    pub frames: Vec<TargetLine>,
    /// Length of a frame.
    pub frame_s: f64,
}

impl ArmRun {
    /// A critically damped arm behind `sin t`, for `seconds` in frames at `rate_hz`.
    pub fn new(kind: ArmKind, stiffness: f64, rate_hz: f64, seconds: f64) -> ArmRun {
        let (stiffening, stop, from) = match kind {
            ArmKind::Linear => (0.0, f64::INFINITY, 1.0),
            ArmKind::Collision => (1.0, 0.6, -1.0),
        };
        let (frame_s, mut start, mut frames) = (1.0 / rate_hz, 0.0, Vec::new());
        while start < seconds * (1.0 - 1e-9) {
            let (base, end) = (libm::sin(start), start + frame_s);
            let speed = (libm::sin(end) - base) / frame_s;
            frames.push(TargetLine { start, base, speed });
            start = end;
        }
        ArmRun {
            arm: Arm {
                stiffness,
                friction: 2.0 * stiffness.sqrt(),
                stiffening,
                stop,
            },
            start: [from, 0.0],
            frames,
            frame_s,
        }
    }

    /// Steps through all frames with `count` equal steps each.
    ///
    /// Passes the state at the end of each frame to `keep`.
    pub fn follow(&self, step: Step, count: u32, mut keep: impl FnMut(State)) {
        let h = self.frame_s / f64::from(count);
        let mut y = self.start;
        for line in &self.frames {
            for i in 0..count {
                y = step(&self.arm, line, h * f64::from(i), y, h);
                if y[0] >= self.arm.stop {
                    y = [self.arm.stop, if 0.0 < y[1] { 0.0 } else { y[1] }];
                }
            }
            keep(y);
        }
    }

    /// States at the ends of all frames.
    pub fn states(&self, step: Step, count: u32) -> Vec<State> {
        let mut states = Vec::with_capacity(self.frames.len());
        self.follow(step, count, |y| states.push(y));
        states
    }
}

/// State `h` seconds after `t`.
pub type Step = fn(&Arm, &TargetLine, f64, State, f64) -> State;

/// An integration method of the study.
#[derive(Debug, serde::Serialize)]
pub struct Method {
    /// Name in tables and JSON.
    pub name: &'static str,
    /// One-line description.
    pub summary: &'static str,
    /// Classical order of the error, for steps far below 1/omega.
    ///
    /// On the collision arm the closed form has its order because it freezes the stretch.
    pub order: u32,
    #[serde(skip)]
    pub(super) step: Step,
}

pub const METHODS: &[Method] = rows! { Method { name, summary, order, step }
    "explicit-euler", "position and velocity by the values before the step", 1,
        |arm, line, t, y, h| along(y, h, arm.slope(line.at(t), y));
    "semi-implicit-euler", "velocity first, position by the new velocity", 1,
        |arm, line, t, y, h| {
            let v = y[1] + h * arm.slope(line.at(t), y)[1];
            [y[0] + h * v, v]
        };
    "rk4", "the classical Runge-Kutta method of order 4", 4, rk4;
    "implicit-euler", "position and velocity by the values after the step; L-stable", 1,
        |arm, line, t, y, h| arm.stage(line.at(t + h), y, h);
    "implicit-midpoint", "by the values in the middle of the step; A-stable, but rings when stiff", 2,
        |arm, line, t, y, h| {
            let middle = arm.stage(line.at(t + h / 2.0), y, h / 2.0);
            each([0, 1], |i| 2.0 * middle[i] - y[i])
        };
    "exact-linear", "the closed form for a target on a straight line between frames", 1, exact_linear;
};

fn rk4(arm: &Arm, line: &TargetLine, t: f64, y: State, h: f64) -> State {
    arm.rk4(|t| line.at(t), t, y, h)
}

/// RK4 behind `sin t` itself instead of the lines between frame ends.
pub fn rk4_of_sine(arm: &Arm, line: &TargetLine, t: f64, y: State, h: f64) -> State {
    arm.rk4(|t| libm::sin(line.start + t), t, y, h)
}

/// Computes `y + h slope`.
#[inline(always)]
fn along(y: State, h: f64, slope: State) -> State {
    [y[0] + h * slope[0], y[1] + h * slope[1]]
}

/// Most iterations of a stage: one that needs more has no solution nearby.
const MOST_ITERATIONS: u32 = 20;
/// Change, relative to 1 + |y|, below which the iteration stops.
const NEGLIGIBLE: f64 = 1e-14;

impl Arm {
    /// Derivative `y'` for a target position.
    #[inline(always)]
    fn slope(&self, target: f64, [x, v]: State) -> State {
        let stretch = target - x;
        let pull = self.stiffness * stretch * (1.0 + self.stiffening * stretch * stretch);
        [v, pull - self.friction * v]
    }

    #[inline(always)]
    fn rk4(&self, target: impl Fn(f64) -> f64, t: f64, y: State, h: f64) -> State {
        let half = h / 2.0;
        let a = self.slope(target(t), y);
        let b = self.slope(target(t + half), along(y, half, a));
        let c = self.slope(target(t + half), along(y, half, b));
        let d = self.slope(target(t + h), along(y, h, c));
        let sum = each([0, 1], |i| a[i] + 2.0 * (b[i] + c[i]) + d[i]);
        along(y, h / 6.0, sum)
    }

    /// Solves `Y = y + g F(Y)` by Newton's iteration: one step on a linear arm.
    fn stage(&self, target: f64, base: State, g: f64) -> State {
        let mut y = base;
        for _ in 0..MOST_ITERATIONS {
            let slope = self.slope(target, y);
            let [dx, dv] = each([0, 1], |i| base[i] + g * slope[i] - y[i]);
            let stretch = target - y[0];
            let tangent = 1.0 + 3.0 * self.stiffening * stretch * stretch;
            let k = self.stiffness * tangent;
            let dv = (dv - g * k * dx) / (1.0 + g * (self.friction + g * k));
            let change = [dx + g * dv, dv];
            y = along(y, 1.0, change);
            let size = |y: State| y[0].abs().max(y[1].abs());
            let continues = size(change) > NEGLIGIBLE * (1.0 + size(y));
            if self.stiffening == 0.0 || !continues {
                break;
            }
        }
        y
    }
}

#[cfg(test)]
mod tests {
    use super::super::arm_study::{ArmPoint, ArmSetting};
    use super::*;
    use crate::arithmetic::Expansion;

    /// Reference: power series of the matrix exponential in 200 bits.
    ///
    /// No case distinction, and no square root except that of k.
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
                let (found, wanted) = (decayed(k, zeta, state, t), by_series(k, zeta, state, t));
                let off = (found[0] - wanted[0]).abs();
                let off = off.max((found[1] - wanted[1]).abs() / k.sqrt());
                assert!(off < 2e-15, "{k} {zeta} {t}: {off:e}");
            }
        }
        // exp times cosh would be zero times infinity here.
        assert!(decayed(1e6, 2.0, [1.0, -3.0], 20.0)[0].abs() < 1e-300);
    }

    /// States of a linear arm behind `sin t` itself at the ends of all frames.
    ///
    /// The arm oscillates as `a sin t + b cos t`, and its deviation at the start decays.
    fn linear_way(run: &ArmRun) -> Vec<State> {
        let k = run.arm.stiffness;
        let share = k / ((k + 1.0) * (k + 1.0));
        let (a, b) = (share * (k - 1.0), -2.0 * share * k.sqrt());
        let rest = [run.start[0] - b, run.start[1] - a];
        let at = |line: &TargetLine| {
            let t = line.start + run.frame_s;
            let (sin, cos) = (libm::sin(t), libm::cos(t));
            let [x, v] = decayed(k, 1.0, rest, t);
            [a * sin + b * cos + x, a * cos - b * sin + v]
        };
        run.frames.iter().map(at).collect()
    }

    #[test]
    fn the_chase_of_a_sine_is_that_of_another_program() {
        // Position and velocity by the closed form with 50 digits, from (1, 0).
        let wanted = [
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
        ];
        for (stiffness, t, wanted) in wanted {
            let run = ArmRun::new(ArmKind::Linear, stiffness, 64.0, t);
            let way = linear_way(&run);
            let last = way.last().expect("a frame");
            for (found, wanted) in last.iter().zip(wanted) {
                assert!((found - wanted).abs() < 2e-15, "{stiffness} {t}: {found}");
            }
        }
    }

    #[test]
    fn the_reference_is_the_closed_form_where_there_is_one() {
        for stiffness in [1e2, 1e4, 1e6] {
            let run = ArmRun::new(ArmKind::Linear, stiffness, 30.0, 1.0);
            let omega = stiffness.sqrt();
            let count = (omega / 30.0 / 1e-3).ceil() as u32;
            let closed = linear_way(&run);
            for (a, b) in run.states(rk4_of_sine, count).iter().zip(&closed) {
                assert!((a[0] - b[0]).abs() < 1e-12, "{stiffness}: {a:?} {b:?}");
            }
            let lines = run.states(exact_linear, 1);
            for (a, b) in run.states(rk4, count).iter().zip(&lines) {
                assert!((a[0] - b[0]).abs() < 1e-12, "{stiffness}: {a:?} {b:?}");
            }
        }
    }

    /// Time of sin t = 0.6 on the way down: until then the arm is pushed into its stop.
    #[test]
    fn the_stop_is_met_and_left() {
        let run = ArmRun::new(ArmKind::Collision, 1e2, 60.0, 3.0);
        let left = std::f64::consts::PI - 0.6f64.asin();
        let states = run.states(rk4, 500);
        let at_stop = |i: &usize| states[*i] == [0.6, 0.0];
        let first = (0..states.len()).find(at_stop).expect("it is met");
        let last = (0..states.len()).rfind(at_stop).expect("it is met");
        assert!((first..=last).all(|i| at_stop(&i)) && first < 60);
        let end = |i: usize| run.frames[i].start + run.frame_s;
        assert!(end(last) <= left + 1e-9 && end(last + 1) > left - 1e-9);
    }

    fn points(arm: ArmKind, stiffness: f64, seconds: f64) -> Vec<ArmPoint> {
        ArmSetting { arm, stiffness }.errors(seconds)
    }

    /// Position error of a method with a number of steps per frame.
    fn error(points: &[ArmPoint], method: &str, substeps: u32) -> f64 {
        let is_it = |p: &&ArmPoint| (p.method, p.substeps) == (method, substeps);
        points.iter().find(is_it).expect(method).position_error
    }

    /// Orders of convergence, behind straight lines.
    ///
    /// From 1 to 2, to 4 and to 16 steps per frame; methods receive the target as such lines.
    fn orders(kind: ArmKind, seconds: f64, method: &Method) -> [f64; 3] {
        let run = ArmRun::new(kind, 1e2, 60.0, seconds);
        let way = run.states(rk4, 200);
        let error = |count| {
            let states = run.states(method.step, count).into_iter();
            let apart = states.zip(&way).map(|(a, b)| (a[0] - b[0]).abs());
            apart.fold(0.0, f64::max)
        };
        let [one, two, four, most] = [1, 2, 4, 16].map(error);
        [one / two, two / four, (four / most).sqrt()].map(f64::log2)
    }

    #[test]
    fn orders_show_and_are_reduced_at_the_stop() {
        let exact = METHODS.last().expect("the closed form");
        for method in &METHODS[..METHODS.len() - 1] {
            let [_, order, _] = orders(ArmKind::Linear, 2.0, method);
            let off = order - f64::from(method.order);
            assert!(off.abs() < 0.3, "{}: {order}", method.name);
        }
        let rk4 = METHODS.iter().find(|m| m.name == "rk4").expect("rk4");
        let reduced = orders(ArmKind::Collision, 4.0, rk4);
        assert!(reduced.iter().any(|order| *order < 3.5), "{reduced:?}");
        let [_, order, _] = orders(ArmKind::Collision, 4.0, exact);
        assert!((order - 1.0).abs() < 0.1, "{order}");
    }

    /// Pins the largest errors from three starts, as SciPy finds them.
    #[test]
    fn errors_of_the_collision_arm_have_their_known_size() {
        for (stiffness, method, substeps, wanted) in [
            (1e2, "implicit-midpoint", 1, 4.804_437_0e-3),
            (1e4, "rk4", 4, 1.596_447_8e-3),
            (1e6, "exact-linear", 1, 1.179_801_9e-3),
        ] {
            let points = points(ArmKind::Collision, stiffness, 1.0);
            let found = error(&points, method, substeps);
            assert!((found / wanted - 1.0).abs() < 1e-6, "{method}: {found:e}");
        }
    }

    #[test]
    fn explicit_methods_blow_up_exactly_beyond_their_limits() {
        let explicit = ["explicit-euler", "semi-implicit-euler", "rk4"];
        for (stiffness, unstable) in [
            (1e3, &explicit[..0]),
            (1e4, &explicit[1..2]),
            (1e5, &explicit[..]),
        ] {
            let points = points(ArmKind::Linear, stiffness, 2.0);
            for method in METHODS {
                let lost = error(&points, method.name, 1).is_nan();
                assert_eq!(lost, unstable.contains(&method.name), "{}", method.name);
            }
        }
    }
}
