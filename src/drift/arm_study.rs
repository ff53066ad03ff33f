//! The study of spring arms: errors, time, stability, and which method to take.
//!
//! Every method with every number of steps per frame on every arm, stiffness and frame rate.

use std::hint::black_box;

use serde::Serialize;

use super::arm::{Arm, ArmKind, Chase, EXACT, Line, METHODS, Method, State, rk4, rk4_of_sine};
use super::exact::linear_way;
use super::frames::task;
use super::rated::{Candidate, Recommendation, recommended, small_margin};
use crate::measure::{OverProcesses, TimedTask};
use crate::statistics::{Estimate, flat};

/// Damping ratios that limits are found for.
const DAMPING_RATIOS: [f64; 4] = [0.1, 0.5, 1.0, 2.0];

/// `omega h` of the stiffest arm of interest: k = 1e6 at 60 frames per second.
const STIFFEST: f64 = 1e3 / 60.0;

/// A method that is stable up to here is stable always.
const ALWAYS: f64 = 1e4;

/// Slack of the conditions of stability, for rounding.
const SLACK: f64 = 1e-12;

/// Relative distance of two eigenvalues below which they are one.
///
/// The discriminant of a double one is the rounding of its terms.
const DOUBLE: f64 = 1e-9;

/// Trace and determinant of the matrix of one step, for a target at rest at zero.
/// `omega` is one and `h` is `omega_h`.
fn trace_and_determinant(method: &Method, zeta: f64, omega_h: f64) -> (f64, f64) {
    let arm = Arm {
        stiffness: 1.0,
        friction: 2.0 * zeta,
        stiffening: 0.0,
        stop: f64::INFINITY,
    };
    let rest = Line {
        start: 0.0,
        base: 0.0,
        speed: 0.0,
    };
    let column = |start| Chase {
        arm,
        start,
        frames: vec![rest],
        frame_s: omega_h,
    };
    let column = |start| column(start).states(method.follow, 1)[0];
    let ([a, c], [b, d]) = (column([1.0, 0.0]), column([0.0, 1.0]));
    (a + d, a * d - b * c)
}

/// Tests that both eigenvalues lie in the unit circle: Jury's conditions
/// `|trace| <= 1 + det` and `det <= 1`, which need no square root.
fn is_stable(method: &Method, zeta: f64, omega_h: f64) -> bool {
    let (trace, determinant) = trace_and_determinant(method, zeta, omega_h);
    trace.abs() <= 1.0 + determinant + SLACK && determinant <= 1.0 + SLACK
}

/// The eigenvalue of largest size, or the size of a complex pair.
fn left_per_step(method: &Method, zeta: f64, omega_h: f64) -> f64 {
    let (trace, determinant) = trace_and_determinant(method, zeta, omega_h);
    let middle = trace / 2.0;
    match middle * middle - determinant {
        apart if apart.abs() <= DOUBLE * middle * middle => middle,
        apart if apart < 0.0 => determinant.sqrt(),
        apart => middle + apart.sqrt().copysign(middle),
    }
}

/// The least `omega h` where a method is no longer stable, by growing steps and
/// bisection; `None` if it is stable up to [`ALWAYS`].
pub fn limit(method: &Method, zeta: f64) -> Option<f64> {
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
    /// The share of an error that one step leaves at the highest stiffness:
    /// negative if its sign alternates (the camera rings), above one in size
    /// if unstable.
    pub stiffest_left_per_step: f64,
}

pub fn limits() -> Vec<StabilityLimit> {
    let rows = METHODS
        .iter()
        .flat_map(|method| DAMPING_RATIOS.map(|zeta| (method, zeta)));
    rows.map(|(method, zeta)| StabilityLimit {
        method: method.name,
        damping_ratio: zeta,
        limit_omega_h: limit(method, zeta),
        stiffest_left_per_step: left_per_step(method, zeta, STIFFEST),
    })
    .collect()
}

/// Scope of the study.
#[derive(Clone, Debug)]
pub struct ArmOptions {
    /// Kinds of arm, each with every stiffness and rate.
    pub arms: Vec<ArmKind>,
    /// k in 1/s^2.
    pub stiffnesses: Vec<f64>,
    /// Frames per second.
    pub rates_hz: Vec<f64>,
    /// Simulated time that errors are the maxima of.
    pub seconds: f64,
    /// Largest position error of a recommended method.
    pub tolerance: f64,
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
    /// Largest distance from the arm's true way at the ends of all frames; null if it
    /// blew up.
    pub position_error: Option<f64>,
    /// The same of the velocity, per second.
    pub velocity_error: Option<f64>,
    /// The same of the position, from the way behind straight lines between frame ends:
    /// the method's own share of `position_error`.
    pub own_error: Option<f64>,
    /// Power of the step by which `own_error` falls from the number of steps before.
    pub observed_order: Option<f64>,
    /// Half a power or more below the classical order.
    pub order_reduced: bool,
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

/// Every arm, stiffness and rate.
pub fn settings(options: &ArmOptions) -> Vec<Setting> {
    let mut all = Vec::new();
    for &arm in &options.arms {
        for &stiffness in &options.stiffnesses {
            let setting = |&rate_hz: &f64| Setting {
                arm,
                stiffness,
                rate_hz,
                omega_h: stiffness.sqrt() / rate_hz,
            };
            all.extend(options.rates_hz.iter().map(setting));
        }
    }
    all
}

impl Setting {
    fn chase(&self, seconds: f64) -> Chase {
        Chase::new(self.arm, self.stiffness, self.rate_hz, seconds)
    }

    /// Methods with their numbers of steps, those that make a difference on this arm.
    fn efforts(&self) -> impl Iterator<Item = (&'static Method, u32)> + use<> {
        let is_linear = self.arm == ArmKind::Linear;
        let of = |method: &'static Method| method.substeps.iter().map(move |n| (method, *n));
        let all = METHODS.iter().flat_map(of);
        all.filter(move |(method, n)| !is_linear || method.name != EXACT || *n == 1)
    }
}

/// `omega h` of the steps of the reference: RK4 is then off by less than 1e-12.
const REFERENCE_STEP: f64 = 1e-3;

/// The true way of an arm, and its way behind straight lines between frame ends.
fn ways(setting: &Setting, chase: &Chase) -> [Vec<State>; 2] {
    let count = (setting.omega_h / REFERENCE_STEP).ceil() as u32;
    let truth = match setting.arm {
        ArmKind::Linear => linear_way(setting.stiffness.sqrt(), chase.frame_s, chase.frames.len()),
        ArmKind::Collision => chase.states(rk4_of_sine, count),
    };
    [truth, chase.states(rk4, count)]
}

/// Size of a state that has blown up, in units of the arm's own motion.
const BLOWN_UP: f64 = 1e3;
/// Errors below this are rounding and have no order.
const LEAST_ORDERED: f64 = 1e-11;
/// Distance from the classical order that counts as a reduced order.
const REDUCED_BY: f64 = 0.5;

/// The errors of all points of a setting.
pub fn errors(setting: Setting, seconds: f64) -> Vec<ArmPoint> {
    let chase = setting.chase(seconds);
    let [truth, own_way] = ways(&setting, &chase);
    let fastest = BLOWN_UP * setting.stiffness.sqrt().max(1.0);
    let mut points: Vec<ArmPoint> = Vec::new();
    for (method, substeps) in setting.efforts() {
        let states = chase.states(method.follow, substeps);
        // Asked this way round so that NaN is not sound.
        let is_sound = |[x, v]: &State| x.abs() < BLOWN_UP && v.abs() < fastest;
        let is_sound = states.iter().all(is_sound);
        let off = |way: &[State], i: usize| {
            let apart = states.iter().zip(way).map(|(a, b)| (a[i] - b[i]).abs());
            is_sound.then(|| apart.fold(0.0, f64::max))
        };
        let own_error = off(&own_way, 0);
        let fewer = points.last().filter(|last| last.method == method.name);
        let fewer = fewer.and_then(|last| Some((last.own_error?, last.substeps)));
        let order = own_error.filter(|now| *now >= LEAST_ORDERED).zip(fewer);
        let order = order.map(|(now, (before, fewer))| {
            libm::log(before / now) / libm::log(f64::from(substeps) / f64::from(fewer))
        });
        points.push(ArmPoint {
            setting,
            method: method.name,
            substeps,
            position_error: off(&truth, 0),
            velocity_error: off(&truth, 1),
            own_error,
            observed_order: order,
            order_reduced: order.is_some_and(|order| order < f64::from(method.order) - REDUCED_BY),
            us_per_second: None,
        });
    }
    points
}

/// Steps of one query, about: a round is some tens of microseconds.
const STEPS: usize = 750;

/// Tasks of all points of a setting, each with the simulated seconds of a query.
///
/// They time the arm on its way in.
pub fn tasks(setting: Setting) -> impl Iterator<Item = (TimedTask<'static>, f64)> {
    setting.efforts().map(move |(method, substeps)| {
        let chase = setting.chase(1.0);
        let repeats = STEPS.div_ceil(chase.frames.len() * substeps as usize);
        let seconds = chase.frame_s * (chase.frames.len() * repeats) as f64;
        let run = move || {
            for _ in 0..repeats {
                (method.follow)(black_box(&chase), substeps, &mut |y| {
                    black_box(y);
                });
            }
        };
        (task(run), seconds)
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
    for ((task, point), (_, seconds)) in (first..).zip(&mut *points).zip(tasks(setting)) {
        if let Some(error) = point.position_error {
            let ln_ns = times.ln_ns(task).into_iter();
            candidates.push(Candidate {
                name: point.label(),
                error,
                ln_ns: ln_ns.map(|ns| ns - seconds.ln()).collect(),
            });
            point.us_per_second = times.ns(task).map(|ns| ns.per(1e3 * seconds));
        }
    }
    let rule = format!("an error within {tolerance:e}");
    let mut choice = recommended(&candidates, tolerance, &rule);
    let is_taken = |point: &&ArmPoint| choice.name.as_ref() == Some(&point.label());
    let taken = points.iter().find(is_taken);
    let free = taken.and_then(|point| {
        let method = METHODS.iter().find(|method| method.name == point.method);
        let step = setting.omega_h / f64::from(point.substeps);
        Some(1.0 - step / limit(method?, 1.0)?)
    });
    choice.reason += &small_margin("its step", "the limit of stability", free);
    Some(ArmChoice {
        setting,
        method: taken.map(|point| point.method),
        position_error: taken.and_then(|point| point.position_error),
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
            for name in ["implicit-euler", "tr-bdf2", "exact-linear"] {
                assert_eq!(found(name), None, "{name} is stable always");
            }
        }
    }

    /// At critical damping R(-omega h) is a double eigenvalue.
    ///
    /// It is 1 + z for explicit Euler, 1/(1 - z) for implicit Euler, exp(z), and for TR-BDF2
    /// `(1 + (sqrt(2) - 1) z) / (1 - (1 - 1/sqrt(2)) z)^2`, which is below zero from
    /// `omega h = sqrt(2) + 1` on and tends to zero from below.
    #[test]
    fn the_share_that_is_left_has_its_sign() {
        let root = std::f64::consts::SQRT_2;
        for h in [1e-3, 0.5, 2.4, 2.42, 1e1, STIFFEST, 1e3, 1e4] {
            let z: f64 = -h;
            let tr_bdf2 = (1.0 + (root - 1.0) * z) / (1.0 - (1.0 - 1.0 / root) * z).powi(2);
            assert_eq!(tr_bdf2 < 0.0, h > root + 1.0);
            for (name, wanted) in [
                ("explicit-euler", 1.0 + z),
                ("implicit-euler", 1.0 / (1.0 - z)),
                ("tr-bdf2", tr_bdf2),
            ] {
                let left = left_per_step(method(name), 1.0, h);
                assert!(
                    (left - wanted).abs() < 1e-5 * wanted.abs(),
                    "{name} {h}: {left:e}"
                );
            }
        }
        let left = left_per_step(method("exact-linear"), 1.0, STIFFEST);
        assert!((left / libm::exp(-STIFFEST) - 1.0).abs() < 1e-9, "{left:e}");
    }
}
