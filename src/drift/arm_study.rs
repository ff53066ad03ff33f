//! The study of spring arms: every method with every number of steps per frame on
//! every arm, stiffness and frame rate, its errors and its time, and which one to take.

use std::hint::black_box;

use serde::Serialize;

use super::arm::{ArmKind, Chase, EXACT, METHODS, Method, State, rk4, rk4_of_sine};
use super::exact::linear_way;
use super::rated::{Candidate, Recommendation, recommended, small_margin};
use super::stability;
use super::walk::task;
use crate::measure::{OverProcesses, TimedTask};
use crate::statistics::{Estimate, flat};

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
        Some(1.0 - step / stability::limit(method?, 1.0)?)
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
