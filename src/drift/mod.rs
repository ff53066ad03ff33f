//! Small errors that add up, in bases, orbits and spring arms of cameras: the
//! methods that are compared, their references, and which method to take.

mod arm;
mod arm_study;
mod exact;
mod frames;
mod rated;
mod rotation;

use serde::Serialize;

pub use arm::Method as ArmMethod;
pub use arm::{ARMS, ArmKind};
pub use arm_study::{ArmChoice, ArmOptions, ArmPoint, StabilityLimit};
pub use frames::{ORBIT_RADIUS, Turn};
pub use rated::{Rated, Recommendation};
pub use rotation::{OrbitDrift, PERIOD, RotationDrift, SWING_DEG, TurnDrift};

use crate::measure::{
    OverProcesses, ProcessTimes, Protocol, Schedule, TimedTask, timed_rounds, timed_to_end,
};
use exact::larger;
use frames::{QUERIES, QUERY_STEPS, walking};
use rated::rated;
use rotation::{CARRIERS, METHODS, Method, STEADY, SWING, moments};

/// The most steps: beyond, an f32 frame overflows and a run takes hours.
pub const MOST_STEPS: u64 = 1_000_000_000;

/// Numbers of whole turns to measure, in steps of one degree.
const TURNS: [u64; 2] = [1, 1000];

/// Scope of the study.
#[derive(Clone, Debug)]
pub struct DriftOptions {
    /// Up to how many steps.
    pub steps: u64,
    /// Largest error of a recommended method after all of them: a frame's angle
    /// in radians and orthogonality, an eye's distance in radii.
    pub tolerance_rad: f64,
    /// Which spring arms are studied.
    pub arm: ArmOptions,
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
    /// The turn of one step.
    pub turn_per_step: Turn,
    /// Steps that the figures of `rotation` are the maxima of.
    pub period_steps: u64,
    /// Ways to turn, by method and number of steps.
    pub rotation: Vec<RotationDrift>,
    /// The same in whole turns of steps of one degree.
    pub one_degree_turns: Vec<TurnDrift>,
    /// Ways to carry an eye around, by method and number of steps.
    pub orbit: Vec<OrbitDrift>,
    /// Ways to turn, error against time.
    pub rotation_methods: Vec<Rated>,
    /// Ways to carry an eye, error against time.
    pub orbit_methods: Vec<Rated>,
    /// Which way to turn.
    pub recommended_rotation: Recommendation,
    /// Which way to carry an eye.
    pub recommended_orbit: Recommendation,
    /// The spring arms.
    pub arm: ArmReport,
}

/// Number of jobs that [`prepare`] reports to `progress`.
pub fn jobs(options: &DriftOptions) -> usize {
    METHODS.len() + CARRIERS.len() + arm_study::settings(&options.arm).len()
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
    let looks = looks(options.steps);
    let moments = moments(&looks);
    let mut report = DriftReport {
        steps: options.steps,
        tolerance_rad: options.tolerance_rad,
        turn_per_step: STEADY,
        period_steps: PERIOD,
        ..DriftReport::default()
    };
    for method in METHODS {
        begin(method.name);
        report.rotation.extend(method.drift(&moments));
        let turns = method.turn_drift(&TURNS);
        report.one_degree_turns.extend(turns);
    }
    for carrier in CARRIERS {
        begin(carrier.name);
        report.orbit.extend(rotation::orbit_drift(carrier, &looks));
    }
    let mut points = Vec::new();
    for setting in arm_study::settings(&options.arm) {
        let (arm, k) = (setting.arm.name(), setting.stiffness);
        begin(&format!("{arm} arm, k = {k:e}"));
        points.extend(arm_study::errors(setting, options.arm.seconds));
    }
    report.arm = ArmReport {
        seconds: options.arm.seconds,
        tolerance: options.arm.tolerance,
        methods: arm::METHODS,
        points,
        stability: arm_study::limits(),
        choices: Vec::new(),
    };
    report
}

/// All timed tasks: bases, eyes, arms.
fn tasks(options: &DriftOptions) -> Vec<TimedTask<'static>> {
    let frames = METHODS.iter().map(|method| walking(method.walk, STEADY));
    let eyes = CARRIERS.iter().map(|carrier| walking(carrier.walk, SWING));
    let settings = arm_study::settings(&options.arm).into_iter();
    let arms = settings.flat_map(arm_study::tasks).map(|(task, _)| task);
    frames.chain(eyes).chain(arms).collect()
}

/// Plans the timed pass, the same in every process.
pub fn plan(options: &DriftOptions, protocol: &Protocol) -> Schedule {
    Schedule::new(QUERIES, &tasks(options), protocol)
}

/// Times the planned tasks in this process.
pub fn time(options: &DriftOptions, schedule: &Schedule, protocol: &Protocol) -> ProcessTimes {
    ProcessTimes::of(&timed_to_end(&tasks(options), schedule, protocol))
}

impl DriftReport {
    /// Fills in the times of all processes, `rounds` in each, and the choices.
    pub fn conclude(&mut self, processes: &[ProcessTimes], rounds: u32) {
        let times = OverProcesses::of(processes);
        (self.processes, self.rounds) = (processes.len(), rounds as usize);
        let turned = self.rotation.chunk_by(|a, b| a.method == b.method);
        let turned = METHODS.iter().zip(turned.map(frame_error));
        let carried = self.orbit.chunk_by(|a, b| a.method == b.method);
        let carried = carried.map(|own| Some(own.last()?.position_error / ORBIT_RADIUS));
        let carried = CARRIERS.iter().zip(carried);
        let limit = (self.tolerance_rad, self.steps);
        let turned = rated(turned, &times, 0, limit);
        let carried = rated(carried, &times, METHODS.len(), limit);
        (self.rotation_methods, self.recommended_rotation) = turned;
        (self.orbit_methods, self.recommended_orbit) = carried;
        let mut first = METHODS.len() + CARRIERS.len();
        let settings = self.arm.points.chunk_by_mut(|a, b| a.setting == b.setting);
        for points in settings {
            let choice = arm_study::conclude(points, &times, first, self.arm.tolerance);
            self.arm.choices.extend(choice);
            first += points.len();
        }
    }
}

/// Errors of ways to turn after a number of steps, and their ns per step.
///
/// Times are those of this process alone. The error of a basis that is lost is `None`;
/// names without a method are left out.
pub fn rotations(names: &[&str], steps: u64) -> Vec<(Option<f64>, f64)> {
    let protocol = Protocol {
        rounds: [5, 5],
        task_ns: 0.0,
        cameras: QUERIES,
        cold: false,
        seed: 1,
        cache_bytes: 0,
    };
    let of = |name: &&str| METHODS.iter().find(|method| method.name == *name);
    let methods: Vec<&Method> = names.iter().filter_map(of).collect();
    let moments = moments(&[steps]);
    let tasks: Vec<TimedTask> = methods.iter().map(|m| walking(m.walk, STEADY)).collect();
    let timed = timed_rounds(QUERIES, &tasks, &protocol);
    let times = OverProcesses::of(&[ProcessTimes::of(&timed)]);
    let row = |(task, method): (usize, &&Method)| {
        let ns = times.ns(task).map(|ns| ns.per(QUERY_STEPS as f64).value);
        (frame_error(&method.drift(&moments)), ns.unwrap_or(f64::NAN))
    };
    methods.iter().enumerate().map(row).collect()
}

/// The larger error of the last drift; `None` for a basis that is lost.
fn frame_error(drifts: &[RotationDrift]) -> Option<f64> {
    let last = drifts.last()?;
    let error = larger(last.angle_error_rad, last.orthogonality_error);
    (!error.is_nan()).then_some(error)
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
