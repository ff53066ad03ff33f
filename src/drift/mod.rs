//! Small errors that add up, in bases, orbits and spring arms of cameras: the
//! methods that are compared, their references, and which method to take.

mod arm;
mod arm_study;
mod exact;
mod frames;
mod rated;
mod rotation;

use clap::Args;
use serde::Serialize;

pub use arm::{ARMS, ArmKind, Method as ArmMethod};
pub use arm_study::{ArmChoice, ArmOptions, ArmPoint, StabilityLimit, reference_steps};
pub use frames::Turn;
pub use rated::Recommendation;
pub use rotation::{ORBIT_RADIUS, PERIOD, RotationDrift, TurnDrift};

use crate::measure::{Ask, OverProcesses, ProcessTimes, Protocol, Schedule, TimedTask, timed};
use crate::spec::{SpecError, parse_number, values};
use crate::statistics::{Estimate, flat};
use frames::{QUERIES, QUERY_STEPS, STEADY, walking};
use rated::recommended;
use rotation::{METHODS, Period, TOOLKIT};

/// The most steps: beyond, an f32 frame overflows and a run takes hours.
const MOST_STEPS: f64 = 1e9;

/// `1e7` or `10M`.
fn steps(text: &str) -> Result<u64, SpecError> {
    let steps = parse_number(text)
        .filter(|_| !text.trim_end().ends_with('%'))
        .filter(|n| n.fract() == 0.0 && (1.0..=MOST_STEPS).contains(n));
    let what = format_args!("a whole number from 1 to {MOST_STEPS:e}");
    values::expected(steps, what).map(|steps| steps as u64)
}

/// Numbers of whole turns to measure, in steps of one degree.
const TURNS: [u64; 2] = [1, 1000];

/// Scope of the study.
#[derive(Args, Debug)]
pub struct DriftOptions {
    /// Number of steps; errors are shown at 1e3, 1e4, ... and at the last one
    #[arg(long, value_name = "N", default_value = "1e6", value_parser = steps)]
    pub steps: u64,
    /// Largest error after all steps of a method to recommend for camera bases
    #[arg(long, value_name = "RAD", default_value_t = 1e-6, value_parser = values::above_zero)]
    pub tolerance: f64,
    #[command(flatten)]
    pub arms: ArmOptions,
}

/// The study of spring arms.
#[derive(Default, Debug, Serialize)]
pub struct ArmReport {
    /// Simulated time.
    pub seconds: f64,
    /// Largest position error of a recommended method.
    pub tolerance: f64,
    /// All methods.
    pub methods: &'static [ArmMethod],
    /// Every method with every number of steps on every arm.
    pub points: Vec<ArmPoint>,
    /// Limits of stability of every method.
    pub stability: Vec<StabilityLimit>,
    /// One of every setting.
    pub choices: Vec<ArmChoice>,
}

/// A way to turn as a point of error against time.
#[derive(Debug, Serialize)]
pub struct Rated {
    /// Name in tables and JSON.
    pub name: &'static str,
    /// One line about what it does.
    pub summary: &'static str,
    /// The way of this toolkit's camera.
    pub is_default: bool,
    /// The larger of angle and orthogonality after the most steps; NaN if it is lost.
    pub error: f64,
    /// Thread CPU time with its 95 % interval, which needs three processes.
    #[serde(flatten, serialize_with = "flat::ns_per_step")]
    pub time_per_step: Option<Estimate>,
    /// Good enough to be recommended.
    pub qualifies: bool,
}

/// Everything `cullbench drift` finds.
#[derive(Default, Debug, Serialize)]
pub struct DriftReport {
    /// The most steps.
    pub steps: u64,
    /// The tolerance that recommendations keep to, radians.
    pub tolerance_rad: f64,
    /// Processes that were timed; an interval needs three or more.
    pub processes: usize,
    /// In each process.
    pub rounds: usize,
    /// Yaw, pitch and roll of one step, degrees.
    pub turn_per_step: Turn,
    /// Steps that the figures of `rotation` are the maxima of.
    pub period_steps: u64,
    /// Ways to turn, by method and number of steps.
    pub rotation: Vec<RotationDrift>,
    /// The same in whole turns of steps of one degree.
    pub one_degree_turns: Vec<TurnDrift>,
    /// Ways to turn, error against time.
    pub rotation_methods: Vec<Rated>,
    /// Which way to turn.
    pub recommended_rotation: Recommendation,
    /// The spring arms.
    pub arm: ArmReport,
}

/// Number of jobs that [`prepare`] reports to `progress`.
pub fn jobs(options: &DriftOptions) -> usize {
    METHODS.len() + arm_study::settings(&options.arms).len()
}

/// Powers of ten from a thousand on, and the most steps themselves.
fn looks(most: u64) -> Vec<u64> {
    let powers = (3..=18).map(|power| 10u64.pow(power));
    let below = powers.take_while(|&power| power < most);
    below.chain([most]).collect()
}

/// Finds all errors: a report without times.
///
/// `begin` gets each job's name before it starts.
pub fn prepare(options: &DriftOptions, begin: impl Fn(&str)) -> DriftReport {
    let looks = looks(options.steps).into_iter();
    let periods: Vec<Period> = looks.map(Period::new).collect();
    let mut report = DriftReport {
        steps: options.steps,
        tolerance_rad: options.tolerance,
        turn_per_step: STEADY,
        period_steps: PERIOD,
        ..DriftReport::default()
    };
    for method in METHODS {
        begin(method.name);
        let drifts = periods.iter().map(|period| method.drift(period));
        report.rotation.extend(drifts);
        let turns = TURNS.map(|turns| method.turn_drift(turns));
        report.one_degree_turns.extend(turns);
    }
    let mut points = Vec::new();
    for setting in arm_study::settings(&options.arms) {
        let (arm, k) = (setting.arm.name(), setting.stiffness);
        begin(&format!("{arm} arm, k = {k:e}"));
        points.extend(arm_study::errors(setting, options.arms.seconds));
    }
    report.arm = ArmReport {
        seconds: options.arms.seconds,
        tolerance: options.arms.arm_tolerance,
        methods: arm::METHODS,
        points,
        stability: arm_study::limits(),
        choices: Vec::new(),
    };
    report
}

/// All timed tasks: bases, then arms.
fn tasks(options: &DriftOptions) -> Vec<TimedTask<'static>> {
    let frames = METHODS.iter().map(|method| walking(method.walk));
    let settings = arm_study::settings(&options.arms).into_iter();
    let arms = settings.flat_map(arm_study::tasks);
    frames.chain(arms).collect()
}

/// Plans the timed pass, the same in every process.
pub fn plan(options: &DriftOptions, protocol: &Protocol) -> Schedule {
    Schedule::new(QUERIES, &tasks(options), protocol)
}

/// Times the planned tasks in this process.
pub fn time(options: &DriftOptions, schedule: &Schedule, protocol: &Protocol) -> ProcessTimes {
    ProcessTimes::of(&timed(&tasks(options), schedule, protocol, &|_| ()))
}

impl DriftReport {
    /// Fills in the times of all processes, `rounds` in each, and the choices.
    pub fn conclude(&mut self, processes: &[ProcessTimes], rounds: u32) {
        let times = OverProcesses::of(processes);
        (self.processes, self.rounds) = (processes.len(), rounds as usize);
        let last = self.rotation.iter().filter(|row| row.steps == self.steps);
        let mut candidates = Vec::new();
        for (task, (method, last)) in METHODS.iter().zip(last).enumerate() {
            let (name, error) = (method.name, last.error());
            candidates.push((name.to_owned(), error, times.ln_ns(task)));
            self.rotation_methods.push(Rated {
                name,
                summary: method.summary,
                is_default: name == TOOLKIT,
                error,
                time_per_step: times.ns(task).map(|ns| ns.per(QUERY_STEPS as f64)),
                qualifies: error <= self.tolerance_rad,
            });
        }
        let (tolerance, steps) = (self.tolerance_rad, self.steps as f64);
        let rule = format!("an error within {tolerance:e} after {steps:e} steps");
        self.recommended_rotation = recommended(&candidates, tolerance, &rule);
        let mut first = METHODS.len();
        let settings = self.arm.points.chunk_by_mut(|a, b| a.setting == b.setting);
        for points in settings {
            let choice = arm_study::conclude(points, &times, first, self.arm.tolerance);
            self.arm.choices.extend(choice);
            first += points.len();
        }
    }
}

/// Error of a way to turn after a number of steps, and a query of some of them.
///
/// A query walks [`QUERY_STEPS`]. The error of a basis that is lost is `None`.
pub fn walk(name: &str, steps: u64) -> (Option<f64>, Ask<'static>) {
    let method = METHODS.iter().find(|method| method.name == name);
    let method = method.expect("a name of the table");
    let error = method.drift(&Period::new(steps)).error();
    ((!error.is_nan()).then_some(error), walking(method.walk).ask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_taken_at_powers_of_ten_and_at_the_end() {
        assert_eq!(looks(7), [7]);
        assert_eq!(looks(1000), [1000]);
        assert_eq!(looks(20_000), [1000, 10_000, 20_000]);
        assert_eq!(looks(100_000), [1000, 10_000, 100_000]);
    }
}
