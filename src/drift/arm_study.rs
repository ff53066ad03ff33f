//! The study of spring arms: errors, time, stability, and which method to take.
//!
//! Every method with every number of steps per frame on every arm, stiffness and frame rate.

use std::hint::black_box;

use clap::Args;
use serde::Serialize;

use super::arm::{ARMS, Arm, ArmKind, Chase, Line, METHODS, Method, State, rk4, rk4_of_sine};
use super::exact::larger;
use super::frames::task;
use super::rated::{Recommendation, recommended};
use crate::measure::{OverProcesses, TimedTask};
use crate::spec::values;
use crate::statistics::{Estimate, flat};

/// Steps per frame that each method is tried with.
const SUBSTEPS: [u32; 5] = [1, 2, 4, 16, 64];

/// Damping ratios that limits are found for.
const DAMPING_RATIOS: [f64; 4] = [0.1, 0.5, 1.0, 2.0];

/// A method that is stable up to here is stable always.
const ALWAYS: f64 = 1e4;

/// Slack of the conditions of stability, for rounding.
const SLACK: f64 = 1e-12;

/// Tests that an error does not grow behind a target at rest, where `omega` is one.
///
/// Both eigenvalues of the matrix of one step lie in the unit circle by Jury's conditions
/// `|trace| <= 1 + det` and `det <= 1`, which need no square root.
fn is_stable(method: &Method, zeta: f64, h: f64) -> bool {
    let arm = Arm {
        stiffness: 1.0,
        friction: 2.0 * zeta,
        stiffening: 0.0,
        stop: f64::INFINITY,
    };
    let column = |start| (method.step)(&arm, &Line::default(), 0.0, start, h);
    let [[a, c], [b, d]] = [[1.0, 0.0], [0.0, 1.0]].map(column);
    let (trace, determinant) = (a + d, a * d - b * c);
    trace.abs() <= 1.0 + determinant + SLACK && determinant <= 1.0 + SLACK
}

/// The least `omega h` where a method is no longer stable, by growing steps and
/// bisection; `None` if it is stable up to [`ALWAYS`].
fn limit(method: &Method, zeta: f64) -> Option<f64> {
    let (mut good, mut bad) = (1e-3, 1e-3);
    while is_stable(method, zeta, bad) {
        (good, bad) = (bad, bad * 1.01);
        if bad > ALWAYS {
            return None;
        }
    }
    for _ in 0..60 {
        let middle = (good + bad) / 2.0;
        match is_stable(method, zeta, middle) {
            true => good = middle,
            false => bad = middle,
        }
    }
    Some(good)
}

/// One method at one damping.
#[derive(Debug, Serialize)]
pub struct StabilityLimit {
    /// Name of the method.
    pub method: &'static str,
    /// Damping / critical damping.
    pub damping_ratio: f64,
    /// `None` if it is stable always.
    pub limit_omega_h: Option<f64>,
}

pub fn limits() -> Vec<StabilityLimit> {
    let of = |method: &'static Method| {
        DAMPING_RATIOS.map(|damping_ratio| StabilityLimit {
            method: method.name,
            damping_ratio,
            limit_omega_h: limit(method, damping_ratio),
        })
    };
    METHODS.iter().flat_map(of).collect()
}

/// Scope of the study: every kind of arm with every stiffness.
#[derive(Args, Debug)]
pub struct ArmOptions {
    /// Spring arms to study: linear, collision (stiffens when stretched, has a stop)
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    #[arg(default_value = "linear,collision", value_parser = values::choice("arm", &ARMS))]
    pub arm: Vec<ArmKind>,
    /// Stiffnesses of the spring arms, k in 1/s^2, critically damped
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    #[arg(default_value = "1e2,1e4,1e6", value_parser = values::within(0.01..=1e8))]
    pub stiffness: Vec<f64>,
    /// Frames per second of the spring arms
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = values::whole(1u32..=1000))]
    pub rate: u32,
    /// Simulated time over which the largest error of a spring arm is taken
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = values::within(1.0..=1e3))]
    pub seconds: f64,
    /// Largest position error of a spring arm to recommend; the target swings by 1
    #[arg(long, value_name = "ERROR", default_value_t = 1e-3, value_parser = values::above_zero)]
    pub arm_tolerance: f64,
}

/// An arm at a frame rate.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Setting {
    /// The kind of arm.
    pub arm: ArmKind,
    /// k in 1/s^2, critically damped.
    pub stiffness: f64,
    /// Frames per second.
    pub rate_hz: f64,
    /// sqrt(k) in units of the frame rate: how stiff the arm is to a frame.
    pub omega_h: f64,
}

/// One method with one number of steps per frame on one arm.
#[derive(Debug, Serialize)]
pub struct ArmPoint {
    /// The arm and its frame rate.
    #[serde(flatten)]
    pub setting: Setting,
    /// Name of the method.
    pub method: &'static str,
    /// Equal steps per frame.
    pub substeps: u32,
    /// Largest distance from the arm's true way at the ends of all frames; NaN if it
    /// blew up.
    pub position_error: f64,
    /// The same from the way behind straight lines between frame ends: the method's own
    /// share of `position_error`.
    pub own_error: f64,
    /// Power of the step by which `own_error` falls from the number of steps before.
    pub observed_order: Option<f64>,
    /// Thread CPU time per simulated second, with its 95 % interval.
    #[serde(flatten, serialize_with = "flat::us_per_second")]
    pub us_per_second: Option<Estimate>,
}

/// The method to take for an arm at a frame rate.
#[derive(Debug, Serialize)]
pub struct ArmChoice {
    /// The arm and its frame rate.
    #[serde(flatten)]
    pub setting: Setting,
    /// The method; null if none is precise enough.
    pub method: Option<&'static str>,
    /// Largest error of its position.
    pub position_error: Option<f64>,
    /// Thread CPU time per simulated second.
    pub us_per_second: Option<f64>,
    /// With the number of steps, and why.
    #[serde(flatten)]
    pub choice: Recommendation,
}

/// Every arm with every stiffness, once each and in order.
pub fn settings(options: &ArmOptions) -> Vec<Setting> {
    let rate_hz = f64::from(options.rate);
    let mut stiffnesses = options.stiffness.clone();
    stiffnesses.sort_by(f64::total_cmp);
    stiffnesses.dedup();
    let mut all = Vec::new();
    let is_studied = |arm: &ArmKind| options.arm.contains(arm);
    for arm in ArmKind::ALL.into_iter().filter(is_studied) {
        all.extend(stiffnesses.iter().map(|&stiffness| Setting {
            arm,
            stiffness,
            rate_hz,
            omega_h: stiffness.sqrt() / rate_hz,
        }));
    }
    all
}

/// Every method with every number of steps per frame.
fn efforts() -> impl Iterator<Item = (&'static Method, u32)> {
    let methods = METHODS.iter();
    methods.flat_map(|method| SUBSTEPS.map(|n| (method, n)))
}

/// `omega h` of the steps of the reference: RK4 is then off by less than 1e-12.
const REFERENCE_STEP: f64 = 1e-3;

/// An error of something that has blown up, in units of the arm's own motion.
const BLOWN_UP: f64 = 1e3;
/// Errors below this are rounding and have no order.
const LEAST_ORDERED: f64 = 1e-11;

/// Steps of the reference behind an arm.
pub fn reference_steps(stiffness: f64, seconds: f64) -> f64 {
    stiffness.sqrt() * seconds / REFERENCE_STEP
}

/// The errors of all points of a setting.
pub fn errors(setting: Setting, seconds: f64) -> Vec<ArmPoint> {
    let chase = Chase::new(setting.arm, setting.stiffness, setting.rate_hz, seconds);
    let count = (setting.omega_h / REFERENCE_STEP).ceil() as u32;
    let truth = match setting.arm {
        ArmKind::Linear => chase.linear_way(),
        ArmKind::Collision => chase.states(rk4_of_sine, count),
    };
    let behind_lines = chase.states(rk4, count);
    let mut points: Vec<ArmPoint> = Vec::new();
    for (method, substeps) in efforts() {
        let states = chase.states(method.step, substeps);
        let off = |way: &[State]| {
            let apart = states.iter().zip(way).map(|(a, b)| (a[0] - b[0]).abs());
            let worst = apart.fold(0.0, larger);
            if worst < BLOWN_UP { worst } else { f64::NAN }
        };
        let own_error = off(&behind_lines);
        let fewer = points.last().filter(|last| last.method == method.name);
        let order = fewer.map(|fewer| {
            let shorter = f64::from(substeps) / f64::from(fewer.substeps);
            libm::log(fewer.own_error / own_error) / libm::log(shorter)
        });
        points.push(ArmPoint {
            setting,
            method: method.name,
            substeps,
            position_error: off(&truth),
            own_error,
            observed_order: order.filter(|o| o.is_finite() && own_error >= LEAST_ORDERED),
            us_per_second: None,
        });
    }
    points
}

/// Tasks of all points of a setting: the first second, the arm on its way in.
pub fn tasks(setting: Setting) -> impl Iterator<Item = TimedTask<'static>> {
    efforts().map(move |(method, substeps)| {
        let chase = Chase::new(setting.arm, setting.stiffness, setting.rate_hz, 1.0);
        task(move || black_box(&chase).follow(method.step, substeps, |y| _ = black_box(y)))
    })
}

/// Fills in the times of the points of one setting and chooses a method.
///
/// The tasks of the setting begin at `first`.
pub fn conclude(
    points: &mut [ArmPoint],
    times: &OverProcesses,
    first: usize,
    tolerance: f64,
) -> Option<ArmChoice> {
    let setting = points.first()?.setting;
    let mut candidates = Vec::new();
    for (task, point) in (first..).zip(&mut *points) {
        candidates.push((point.label(), point.position_error, times.ln_ns(task)));
        if !point.position_error.is_nan() {
            point.us_per_second = times.ns(task).map(|ns| ns.per(1e3));
        }
    }
    let rule = format!("an error within {tolerance:e}");
    let choice = recommended(&candidates, tolerance, &rule);
    let mut points = points.iter();
    let taken = points.find(|point| choice.name.as_ref() == Some(&point.label()));
    Some(ArmChoice {
        setting,
        method: taken.map(|point| point.method),
        position_error: taken.map(|point| point.position_error),
        us_per_second: taken.and_then(|point| Some(point.us_per_second?.value)),
        choice,
    })
}

impl ArmPoint {
    /// Name with the number of steps: "rk4 x4".
    pub fn label(&self) -> String {
        match self.substeps {
            1 => self.method.to_owned(),
            substeps => format!("{} x{substeps}", self.method),
        }
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
    /// Explicit Euler and RK4 are stable while `|R(h lambda)| <= 1` (on the negative axis RK4 up to the
    /// root of z^3 + 4 z^2 + 12 z + 24: Hairer and Wanner 1996, "Solving Ordinary
    /// Differential Equations II", IV.2), semi-implicit Euler by Jury's conditions.
    #[test]
    fn limits_found_are_the_limits_of_the_formulas() {
        for zeta in DAMPING_RATIOS {
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
