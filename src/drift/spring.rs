//! The chase camera on a spring arm, stepped frame by frame: one row of
//! [`INTEGRATORS`] per way to do it, and how far each is off. The closed form
//! is in `oscillator`, the limits of stability in `stability`.

use std::hint::black_box;

use serde::Serialize;

use super::oscillator::{Spring, State};

/// Frames per second.
pub const FRAME_RATE_HZ: f64 = 60.0;

/// Frames of the comparison: 20 seconds.
const FRAMES: usize = 1200;

/// Stiffnesses in 1/s^2, critically damped.
pub const STIFFNESSES: [f64; 7] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6];

/// Where the arm begins: one away from its target `sin t`, so that both the
/// way in and the steady chase count.
const START: State = State::new(1.0, 0.0);

/// A camera a thousand times as far away as its target ever is has blown up.
const BLOWN_UP: f64 = 1e3;

/// The target during one step.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Target {
    pub start: f64,
    pub middle: f64,
    pub end: f64,
}

impl Target {
    pub const AT_REST: Target = Target {
        start: 0.0,
        middle: 0.0,
        end: 0.0,
    };
}

/// One step of `h` seconds.
pub type Step = fn(&Spring, State, &Target, f64) -> State;

pub struct Integrator {
    pub name: &'static str,
    pub summary: &'static str,
    pub step: Step,
    /// The states after each frame of `1/FRAME_RATE_HZ` seconds.
    follow: fn(&Spring, &[Target]) -> Vec<State>,
}

/// Rows whose loops are compiled for their steps, not called through a pointer.
macro_rules! integrators {
    ($($name:literal, $summary:literal, $step:ident;)+) => {
        rows! { Integrator { name, summary, step, follow } $($name, $summary, $step,
            |spring, targets| {
                let mut state = START;
                let follow = targets.iter().map(|target| {
                    // Hidden, since frame times vary: factors that depend on
                    // the step are part of every step's work.
                    let h = black_box(1.0 / FRAME_RATE_HZ);
                    state = $step(spring, state, target, h);
                    state
                });
                follow.collect()
            };)+
        }
    };
}

pub const INTEGRATORS: &[Integrator] = integrators! {
    "explicit-euler", "position and velocity by the values before the step", explicit_euler;
    "semi-implicit-euler", "velocity first, position by the new velocity", semi_implicit_euler;
    "rk4", "the classical Runge-Kutta method of order 4", rk4;
    "implicit-euler", "position and velocity by the values after the step", implicit_euler;
    "implicit-midpoint", "by the mean of the values before and after", implicit_midpoint;
    "exact-held", "the closed form for the newest target, held still", exact_held;
    "exact-linear", "the closed form for a target on a straight line between frames", exact_linear;
};

fn acceleration(spring: &Spring, state: State, target: f64) -> f64 {
    let friction = 2.0 * spring.damping_ratio * spring.omega();
    spring.stiffness * (target - state.position) - friction * state.velocity
}

fn explicit_euler(spring: &Spring, state: State, target: &Target, h: f64) -> State {
    let pull = acceleration(spring, state, target.start);
    State::new(
        state.position + h * state.velocity,
        state.velocity + h * pull,
    )
}

fn semi_implicit_euler(spring: &Spring, state: State, target: &Target, h: f64) -> State {
    let velocity = state.velocity + h * acceleration(spring, state, target.start);
    State::new(state.position + h * velocity, velocity)
}

fn rk4(spring: &Spring, state: State, target: &Target, h: f64) -> State {
    let slope = |at: State, target| State::new(at.velocity, acceleration(spring, at, target));
    let ahead = |slope: State, h: f64| {
        let State { position, velocity } = slope;
        State::new(state.position + h * position, state.velocity + h * velocity)
    };
    let first = slope(state, target.start);
    let second = slope(ahead(first, h / 2.0), target.middle);
    let third = slope(ahead(second, h / 2.0), target.middle);
    let fourth = slope(ahead(third, h), target.end);
    let mean =
        |of: fn(State) -> f64| (of(first) + 2.0 * of(second) + 2.0 * of(third) + of(fourth)) / 6.0;
    ahead(State::new(mean(|s| s.position), mean(|s| s.velocity)), h)
}

/// `v' = v + h a(x + h v', v')`, solved for v'.
fn implicit_euler(spring: &Spring, state: State, target: &Target, h: f64) -> State {
    let k = spring.stiffness;
    let friction = 2.0 * spring.damping_ratio * spring.omega();
    let push = h * k * (target.end - state.position);
    let velocity = (state.velocity + push) / (1.0 + h * friction + h * h * k);
    State::new(state.position + h * velocity, velocity)
}

/// Half a step of implicit Euler to the middle and as far again.
fn implicit_midpoint(spring: &Spring, state: State, target: &Target, h: f64) -> State {
    let end = target.middle;
    let middle = implicit_euler(spring, state, &Target { end, ..*target }, h / 2.0);
    let beyond = |middle: f64, from: f64| 2.0 * middle - from;
    State::new(
        beyond(middle.position, state.position),
        beyond(middle.velocity, state.velocity),
    )
}

fn exact_held(spring: &Spring, state: State, target: &Target, h: f64) -> State {
    let offset = State::new(state.position - target.end, state.velocity);
    let offset = spring.released(offset, h);
    State::new(target.end + offset.position, offset.velocity)
}

/// Behind a target of constant speed s the arm settles `2 zeta s / omega`
/// behind it, at its speed.
fn exact_linear(spring: &Spring, state: State, target: &Target, h: f64) -> State {
    let speed = (target.end - target.start) / h;
    let behind = 2.0 * spring.damping_ratio / spring.omega() * speed;
    let from = state.position - (target.start - behind);
    let offset = spring.released(State::new(from, state.velocity - speed), h);
    let position = target.end - behind + offset.position;
    State::new(position, speed + offset.velocity)
}

/// One integrator at one stiffness.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SpringError {
    pub integrator: &'static str,
    /// k in 1/s^2.
    pub stiffness: f64,
    pub omega_h: f64,
    /// Root mean square of the position's error over 20 s behind a target that
    /// swings by one; `None` if it blew up.
    pub rms_error: Option<f64>,
}

/// The target `sin t` during each frame.
fn targets() -> Vec<Target> {
    let at = |frame: f64| libm::sin(frame / FRAME_RATE_HZ);
    let frames = (0..FRAMES).map(|frame| frame as f64);
    let target = frames.map(|frame| Target {
        start: at(frame),
        middle: at(frame + 0.5),
        end: at(frame + 1.0),
    });
    target.collect()
}

fn critical(stiffness: f64) -> Spring {
    Spring {
        stiffness,
        damping_ratio: 1.0,
    }
}

impl Integrator {
    pub fn error(&self, stiffness: f64) -> SpringError {
        let spring = critical(stiffness);
        let mut squares = 0.0;
        let mut blown_up = false;
        for (frame, state) in (self.follow)(&spring, &targets()).into_iter().enumerate() {
            let t = (frame + 1) as f64 / FRAME_RATE_HZ;
            let exact = spring.follows_sine(START, t);
            // Asked this way round so that NaN is not near.
            let is_near = state.position.abs() < BLOWN_UP;
            blown_up |= !is_near;
            squares += (state.position - exact.position).powi(2);
        }
        SpringError {
            integrator: self.name,
            stiffness,
            omega_h: spring.omega() / FRAME_RATE_HZ,
            rms_error: (!blown_up).then(|| (squares / FRAMES as f64).sqrt()),
        }
    }
}

/// Runs of the comparison in one sample of the clock.
const RUNS: u64 = 10;

/// Median thread CPU time of one step of each integrator, in nanoseconds, at
/// a stiffness of 100 where all are stable.
pub fn times() -> Vec<f64> {
    let (spring, targets) = (critical(1e2), targets());
    let steps = RUNS * targets.len() as u64;
    super::walk::ns_per_step(INTEGRATORS, steps, |integrator| {
        for _ in 0..RUNS {
            black_box((integrator.follow)(black_box(&spring), &targets));
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(name: &str, stiffness: f64) -> Option<f64> {
        let integrator = INTEGRATORS.iter().find(|i| i.name == name).expect(name);
        integrator.error(stiffness).rms_error
    }

    #[test]
    fn errors_are_those_of_the_reference() {
        // Computed apart from this code, at k = 1e2, 1e4, 1e5 and 1e6.
        let unstable = f64::INFINITY;
        let table = [
            ("explicit-euler", [3.74e-3, 0.119, unstable, unstable]),
            (
                "semi-implicit-euler",
                [4.68e-3, unstable, unstable, unstable],
            ),
            ("rk4", [7.76e-7, 9.90e-3, unstable, unstable]),
            ("implicit-euler", [3.40e-3, 6.85e-3, 7.84e-3, 3.19e-3]),
            ("implicit-midpoint", [8.95e-5, 3.02e-3, 7.71e-3, 2.27e-2]),
            ("exact-held", [5.85e-3, 5.81e-3, 4.13e-3, 1.43e-3]),
            ("exact-linear", [1.59e-5, 1.68e-5, 1.73e-5, 9.57e-6]),
        ];
        assert_eq!(table.len(), INTEGRATORS.len());
        for (name, errors) in table {
            for (stiffness, wanted) in [1e2, 1e4, 1e5, 1e6].into_iter().zip(errors) {
                match error(name, stiffness) {
                    None => assert_eq!(wanted, unstable, "{name} at {stiffness}"),
                    Some(found) => assert!(
                        (found / wanted - 1.0).abs() < 0.01,
                        "{name} at {stiffness}: {found:e}, not {wanted:e}"
                    ),
                }
            }
        }
    }

    #[test]
    fn the_closed_form_is_exact_for_the_target_it_assumes() {
        let state = State {
            position: 0.4,
            velocity: -2.0,
        };
        let target = Target {
            start: 0.3,
            middle: 0.3,
            end: 0.3,
        };
        for damping_ratio in [0.2, 1.0, 3.0] {
            let spring = Spring {
                stiffness: 50.0,
                damping_ratio,
            };
            let held = exact_held(&spring, state, &target, 0.1);
            let linear = exact_linear(&spring, state, &target, 0.1);
            assert!((held.position - linear.position).abs() < 1e-14);
            // Against ten thousand small steps towards a moving target.
            let moving = Target {
                end: 0.5,
                middle: 0.4,
                ..target
            };
            let at = |share: f64| 0.3 + 0.2 * share;
            let mut fine = state;
            for i in 0..10_000 {
                let share = f64::from(i) / 1e4;
                let piece = Target {
                    start: at(share),
                    middle: at(share + 0.5e-4),
                    end: at(share + 1e-4),
                };
                fine = rk4(&spring, fine, &piece, 1e-5);
            }
            let linear = exact_linear(&spring, state, &moving, 0.1);
            assert!((linear.position - fine.position).abs() < 1e-12);
            assert!((linear.velocity - fine.velocity).abs() < 1e-11);
        }
    }
}
