//! Accumulated errors of camera bases and of spring arms.
//!
//! Compares methods with their references and recommends one.

mod arm;
mod arm_study;
mod bases;
mod exact;
mod recommendation;
mod rotation;

use serde::Serialize;

pub use arm::ArmKind;
pub use arm_study::{
    ARM_TOLERANCE, ArmChoice, ArmPoint, RATE_HZ, SECONDS, STARTS, SUBSTEPS, Stability,
};
pub use bases::STEADY;
pub use recommendation::Recommendation;

use crate::measure::{OverProcesses, ProcessTimes, Protocol, QueryFn, Schedule, TimedTask, timed};
use crate::spec::{SpecError, parse_number, values};
use crate::statistics::{Estimate, flat};
use bases::{QUERIES, QUERY_STEPS, task_of};
use exact::larger;
use recommendation::recommended;
use rotation::{METHODS, Method, Period};

/// Most steps: beyond, an f32 frame overflows and a run takes hours.
const MOST_STEPS: f64 = 1e9;

/// Parses a number of steps, such as `1e7` or `10M`.
pub fn steps(text: &str) -> Result<u64, SpecError> {
    let steps = parse_number(text)
        .filter(|_| !text.trim_end().ends_with('%'))
        .filter(|n| n.fract() == 0.0 && (1.0..=MOST_STEPS).contains(n));
    let what = format_args!("a whole number from 1 to {MOST_STEPS:e}");
    values::expected(steps, what).map(|steps| steps as u64)
}

/// Largest error of a recommended rotation method, radians.
pub const TOLERANCE_RAD: f64 = 1e-6;

/// A rotation method with its errors and time.
#[derive(Debug, Serialize)]
pub struct Rotation {
    /// Rotation method.
    #[serde(flatten)]
    pub method: &'static Method,
    /// Largest entry of `X^T X - I` for the axes X.
    pub orthogonality_error: f64,
    /// Angle between the rotation nearest to the axes and the exact one; NaN if lost.
    pub angle_error_rad: f64,
    /// Thread CPU time per step with its 95 % interval, which needs three processes.
    #[serde(flatten, serialize_with = "flat::ns_per_step")]
    pub time_per_step: Option<Estimate>,
}

impl Rotation {
    fn of(method: &'static Method, period: &Period) -> Rotation {
        let [orthogonality_error, angle_error_rad] = method.errors(period);
        Rotation {
            method,
            orthogonality_error,
            angle_error_rad,
            time_per_step: None,
        }
    }

    /// The larger of the two errors; NaN for a basis that is lost.
    fn error(&self) -> f64 {
        larger(self.angle_error_rad, self.orthogonality_error)
    }
}

/// Results of `cullbench drift`.
#[derive(Default, Debug, Serialize)]
pub struct DriftReport {
    /// Number of steps of the camera bases.
    pub steps: u64,
    /// Number of timed processes; an interval needs three or more.
    pub processes: usize,
    /// Rounds in each process.
    pub rounds: usize,
    /// Rotation methods.
    pub rotation: Vec<Rotation>,
    /// Recommended rotation method.
    pub recommended_rotation: Recommendation,
    /// Methods that step spring arms.
    pub arm_methods: Vec<Stability>,
    /// Every method with every number of steps on every arm.
    pub arm_points: Vec<ArmPoint>,
    /// Recommended method for every arm.
    pub arm_choices: Vec<ArmChoice>,
}

/// Finds all errors after a number of steps: a report without times.
pub fn prepare(steps: u64) -> DriftReport {
    let period = Period::new(steps);
    let rotation = METHODS.iter().map(|method| Rotation::of(method, &period));
    let points = arm_study::settings().flat_map(|setting| setting.errors(SECONDS));
    DriftReport {
        steps,
        rotation: rotation.collect(),
        arm_methods: arm_study::stability().collect(),
        arm_points: points.collect(),
        ..DriftReport::default()
    }
}

/// All timed tasks: bases, then arms.
fn tasks() -> Vec<TimedTask<'static>> {
    let bases = METHODS.iter().map(|method| task_of(method.walk));
    let arms = arm_study::settings().flat_map(arm_study::ArmSetting::tasks);
    bases.chain(arms).collect()
}

/// Plans the timed pass, the same in every process.
pub fn plan(protocol: &Protocol) -> Schedule {
    Schedule::new(QUERIES, &tasks(), protocol)
}

/// Times the planned tasks in this process.
pub fn time(schedule: &Schedule, protocol: &Protocol) -> ProcessTimes {
    ProcessTimes::of(&timed(&tasks(), schedule, protocol, &|_| ()))
}

impl DriftReport {
    /// Fills in the times of all processes, `rounds` in each, and the recommendations.
    pub fn conclude(&mut self, processes: &[ProcessTimes], rounds: u32) {
        let times = OverProcesses::of(processes);
        (self.processes, self.rounds) = (processes.len(), rounds as usize);
        let mut candidates = Vec::new();
        for (task, row) in self.rotation.iter_mut().enumerate() {
            candidates.push((row.method.name.to_owned(), row.error(), times.ln_ns(task)));
            row.time_per_step = times.ns(task).map(|ns| ns.per(QUERY_STEPS as f64));
        }
        let steps = self.steps as f64;
        let rule = format!("an error within {TOLERANCE_RAD:e} after {steps:e} steps");
        self.recommended_rotation = recommended(&candidates, TOLERANCE_RAD, &rule);
        let mut first = self.rotation.len();
        let settings = self.arm_points.chunk_by_mut(|a, b| a.setting == b.setting);
        for points in settings {
            let choice = arm_study::conclude(points, &times, first);
            self.arm_choices.push(choice);
            first += points.len();
        }
    }
}

/// Error of a rotation method after a number of steps, and a query for timing.
///
/// The query walks [`QUERY_STEPS`] steps. The error of a basis that is lost is `None`.
pub fn walk(name: &str, steps: u64) -> (Option<f64>, QueryFn<'static>) {
    let method = METHODS.iter().find(|method| method.name == name);
    let method = method.expect("a name of the table");
    let error = Rotation::of(method, &Period::new(steps)).error();
    ((!error.is_nan()).then_some(error), task_of(method.walk).ask)
}
