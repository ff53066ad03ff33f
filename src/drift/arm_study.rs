//! Study of spring arms: errors, time, stability, and the recommended method.
//!
//! Every method with every number of steps per frame on every arm and stiffness.

use std::hint::black_box;

use serde::Serialize;

use super::arm::{Arm, ArmKind, ArmRun, METHODS, Method, State, TargetLine, rk4_of_sine};
use super::bases::task;
use super::exact::larger;
use super::recommendation::{Recommendation, recommended};
use crate::measure::{OverProcesses, TimedTask};
use crate::statistics::{Estimate, flat};

/// Numbers of steps per frame that each method is tried with.
pub const SUBSTEPS: [u32; 5] = [1, 2, 4, 16, 64];

/// Stiffnesses, k in 1/s^2.
const STIFFNESSES: [f64; 3] = [1e2, 1e4, 1e6];
/// Frames per second.
pub const RATE_HZ: f64 = 60.0;
/// Simulated time over which the largest error is taken, in seconds.
pub const SECONDS: f64 = 10.0;
/// Starts whose errors count, as multiples of the arm's own.
///
/// From a single one an error may be within the tolerance by chance.
pub const STARTS: [f64; 3] = [0.8, 1.0, 1.2];
/// Largest position error of a recommended method; the target's amplitude is 1.
pub const ARM_TOLERANCE: f64 = 1e-3;

/// A method that is stable up to this `omega h` counts as always stable.
const STABLE_OMEGA_H: f64 = 1e4;

/// Slack of the stability conditions, for rounding.
const SLACK: f64 = 1e-12;

/// Tests that an error does not grow behind a target at rest, where `omega` is 1.
///
/// Both eigenvalues of the matrix of one step lie in the unit circle if Jury's conditions `|trace|
/// <= 1 + det` and `det <= 1` hold; these need no square root.
fn is_stable(method: &Method, zeta: f64, h: f64) -> bool {
    let arm = Arm {
        stiffness: 1.0,
        friction: 2.0 * zeta,
        stiffening: 0.0,
        stop: f64::INFINITY,
    };
    let column = |start| (method.step)(&arm, &TargetLine::default(), 0.0, start, h);
    let [[a, c], [b, d]] = [[1.0, 0.0], [0.0, 1.0]].map(column);
    let (trace, determinant) = (a + d, a * d - b * c);
    trace.abs() <= 1.0 + determinant + SLACK && determinant <= 1.0 + SLACK
}

/// Smallest unstable `omega h` of a method, by bisection.
///
/// `None` if it is stable up to [`STABLE_OMEGA_H`].
fn limit(method: &Method, zeta: f64) -> Option<f64> {
    let (mut good, mut bad) = (1e-3, STABLE_OMEGA_H);
    if is_stable(method, zeta, bad) {
        return None;
    }
    for _ in 0..100 {
        let middle = (good + bad) / 2.0;
        match is_stable(method, zeta, middle) {
            true => good = middle,
            false => bad = middle,
        }
    }
    Some(good)
}

/// A method and its stability limit.
#[derive(Debug, Serialize)]
pub struct Stability {
    /// The method.
    #[serde(flatten)]
    pub method: &'static Method,
    /// Smallest unstable `omega h` at critical damping; null if always stable.
    pub limit_omega_h: Option<f64>,
}

pub fn stability() -> impl Iterator<Item = Stability> {
    METHODS.iter().map(|method| Stability {
        method,
        limit_omega_h: limit(method, 1.0),
    })
}

/// A critically damped arm.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct ArmSetting {
    /// Kind of arm.
    pub arm: ArmKind,
    /// k in 1/s^2.
    pub stiffness: f64,
}

/// Result of one method with one number of steps per frame on one arm.
#[derive(Debug, Serialize)]
pub struct ArmPoint {
    /// Arm.
    #[serde(flatten)]
    pub setting: ArmSetting,
    /// Name of the method.
    pub method: &'static str,
    /// Number of equal steps per frame.
    pub substeps: u32,
    /// Largest position error at the ends of all frames; NaN if it diverged.
    ///
    /// The worst of three starts.
    pub position_error: f64,
    /// Thread CPU time per simulated second, in microseconds, with its 95 % interval.
    #[serde(flatten, serialize_with = "flat::us_per_second")]
    pub us_per_second: Option<Estimate>,
}

/// Recommended method for an arm.
#[derive(Debug, Serialize)]
pub struct ArmChoice {
    /// Arm.
    #[serde(flatten)]
    pub setting: ArmSetting,
    /// Method, with the number of steps and the reason.
    #[serde(flatten)]
    pub choice: Recommendation,
}

/// Every arm with every stiffness.
pub fn settings() -> impl Iterator<Item = ArmSetting> {
    let of = |arm| STIFFNESSES.map(|stiffness| ArmSetting { arm, stiffness });
    ArmKind::ALL.into_iter().flat_map(of)
}

/// Every method with every number of steps per frame.
fn variants() -> impl Iterator<Item = (&'static Method, u32)> {
    let methods = METHODS.iter();
    methods.flat_map(|method| SUBSTEPS.map(|n| (method, n)))
}

/// `omega h` of the reference's steps: the error of RK4 is then below 1e-12.
const REFERENCE_STEP: f64 = 1e-3;

/// Error that counts as divergence, in units of the arm's own motion.
const DIVERGED: f64 = 1e3;

impl ArmSetting {
    fn run(self, seconds: f64) -> ArmRun {
        ArmRun::new(self.arm, self.stiffness, RATE_HZ, seconds)
    }

    /// Errors of all methods and numbers of steps on this arm.
    pub fn errors(self, seconds: f64) -> Vec<ArmPoint> {
        let runs = STARTS.map(|share| {
            let run = self.run(seconds);
            let start = run.start.map(|own| share * own);
            ArmRun { start, ..run }
        });
        let all = runs.iter();
        let states = |step, substeps| all.clone().flat_map(move |own| own.states(step, substeps));
        let omega_h = self.stiffness.sqrt() / RATE_HZ;
        let truth = states(rk4_of_sine, (omega_h / REFERENCE_STEP).ceil() as u32);
        let truth: Vec<State> = truth.collect();
        let point = |(method, substeps): (&'static Method, u32)| {
            let both = states(method.step, substeps).zip(&truth);
            let apart = both.map(|(a, b)| (a[0] - b[0]).abs());
            let worst = apart.fold(0.0, larger);
            ArmPoint {
                setting: self,
                method: method.name,
                substeps,
                position_error: if worst < DIVERGED { worst } else { f64::NAN },
                us_per_second: None,
            }
        };
        variants().map(point).collect()
    }

    /// Tasks of all points: the first second, while the arm settles.
    pub fn tasks(self) -> impl Iterator<Item = TimedTask<'static>> {
        variants().map(move |(method, substeps)| {
            let run = self.run(1.0);
            task(move || black_box(&run).follow(method.step, substeps, |y| _ = black_box(y)))
        })
    }
}

/// Fills in the times of the points of one setting and recommends a method.
///
/// The setting's tasks start at index `first`.
pub fn conclude(points: &mut [ArmPoint], times: &OverProcesses, first: usize) -> ArmChoice {
    let mut candidates = Vec::new();
    for (task, point) in (first..).zip(&mut *points) {
        let label = match point.substeps {
            1 => point.method.to_owned(),
            substeps => format!("{} x{substeps}", point.method),
        };
        candidates.push((label, point.position_error, times.ln_ns(task)));
        if !point.position_error.is_nan() {
            point.us_per_second = times.ns(task).map(|ns| ns.per(1e3));
        }
    }
    let rule = format!("an error within {ARM_TOLERANCE:e}");
    ArmChoice {
        setting: points[0].setting,
        choice: recommended(&candidates, ARM_TOLERANCE, &rule),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn method(name: &str) -> &'static Method {
        METHODS.iter().find(|m| m.name == name).expect(name)
    }

    /// `|1 + z + z^2/2 + z^3/6 + z^4/24|` at `z = h (-zeta + i sqrt(1 - zeta^2))`.
    fn rk4_left(zeta: f64, h: f64) -> f64 {
        let (re, im) = (-zeta * h, (1.0 - zeta * zeta).sqrt() * h);
        let (mut x, mut y) = (1.0, 0.0);
        for divisor in [4.0, 3.0, 2.0, 1.0] {
            (x, y) = (
                1.0 + (re * x - im * y) / divisor,
                (re * y + im * x) / divisor,
            );
        }
        f64::hypot(x, y)
    }

    /// The eigenvalues are `omega (-zeta +- sqrt(zeta^2 - 1))`.
    ///
    /// Explicit Euler and RK4 are stable while `|R(h lambda)| <= 1` (on the negative axis RK4 up to
    /// the root of z^3 + 4 z^2 + 12 z + 24: Hairer and Wanner 1996, "Solving Ordinary Differential
    /// Equations II", IV.2), semi-implicit Euler by Jury's conditions.
    #[test]
    fn limits_found_are_the_limits_of_the_formulas() {
        for zeta in [0.1f64, 0.5, 1.0, 2.0] {
            let fast = zeta + (zeta * zeta - 1.0).max(0.0).sqrt();
            let explicit = if zeta <= 1.0 { 2.0 * zeta } else { 2.0 / fast };
            let found = |name| limit(method(name), zeta);
            let near = |name, wanted: f64| {
                let found = found(name).expect(name);
                assert!(
                    (found / wanted - 1.0).abs() < 1e-6,
                    "{name} {zeta}: {found}"
                );
            };
            near("explicit-euler", explicit);
            near(
                "semi-implicit-euler",
                2.0 * ((1.0 + zeta * zeta).sqrt() - zeta),
            );
            if zeta >= 1.0 {
                near("rk4", 2.785_293_563_405_282 / fast);
            } else {
                let limit = found("rk4").expect("a limit");
                assert!((rk4_left(zeta, limit) - 1.0).abs() < 1e-9, "{limit}");
            }
            for name in ["implicit-euler", "implicit-midpoint", "exact-linear"] {
                assert_eq!(found(name), None, "{name} is stable always");
            }
        }
    }
}
