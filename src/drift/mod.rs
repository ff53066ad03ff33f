//! Small errors that add up: frames that are turned step by step, eyes that
//! are carried around, and a chase camera on a spring arm. It owns the methods
//! that are compared, their exact references and what follows
//! from the figures; how those look on a terminal is the program's business.

mod arm;
mod exact;
mod frames;
mod orbit;
mod oscillator;
mod rated;
mod real;
mod rotation;
mod stability;
mod walk;

use serde::{Deserialize, Serialize};

pub use arm::Method as ArmMethod;
pub use arm::{
    ARMS, ArmChoice, ArmKind, ArmOptions, ArmPoint, FrameTimes, Information, InformationError,
    Setting,
};
pub use frames::Turn;
pub use orbit::{OrbitDrift, SWING_DEG};
pub use rated::{Rated, Recommendation};
pub use rotation::{ORBIT_RADIUS, PERIOD, RotationDrift, TurnDrift};
pub use stability::StabilityLimit;

use crate::measure::{OverProcesses, ProcessTimes, Protocol, Schedule, TimedTask, timed};
use orbit::CARRIERS;
use rated::{Row, cheapest, rated};
use rotation::{Exact, METHODS, Method, STEADY};
use walk::{QUERIES, QUERY_STEPS, Repeated};

/// The most steps: beyond, an f32 frame overflows and a run takes hours.
pub const MOST_STEPS: u64 = 1_000_000_000;

/// Whole turns that are looked at, in steps of one degree.
const TURNS: [u64; 2] = [1, 1000];

/// What is asked.
#[derive(Clone, PartialEq, Debug)]
pub struct DriftOptions {
    /// Up to how many steps.
    pub steps: u64,
    /// What a recommended method may be off after all of them: a frame's angle
    /// in radians and orthogonality, an eye's distance in radii.
    pub tolerance_rad: f64,
    /// Which spring arms are studied.
    pub arm: ArmOptions,
}

/// The study of spring arms.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct ArmReport {
    /// Simulated time.
    pub seconds: f64,
    /// What a recommended method's position may be off.
    pub tolerance: f64,
    /// All methods, timed or not.
    pub methods: &'static [ArmMethod],
    /// Every method with every effort on every arm.
    pub points: Vec<ArmPoint>,
    /// Error of the information that steps have, before any method adds its own.
    pub information: Vec<InformationError>,
    /// Limits of stability of every method.
    pub stability: Vec<StabilityLimit>,
    /// One of every setting.
    pub choices: Vec<ArmChoice>,
    /// All of them in a sentence.
    pub conclusion: String,
}

impl ArmReport {
    /// Names of the methods that have points, in their order.
    pub fn method_names(&self) -> Vec<&'static str> {
        let mut names: Vec<&str> = Vec::new();
        for point in &self.points {
            if !names.contains(&point.method) {
                names.push(point.method);
            }
        }
        names
    }

    /// A figure of all settings, ascending, each once.
    pub fn settings(&self, figure: fn(&Setting) -> f64) -> Vec<f64> {
        let mut figures: Vec<f64> = self.choices.iter().map(|c| figure(&c.setting)).collect();
        figures.sort_by(f64::total_cmp);
        figures.dedup();
        figures
    }

    /// The frame rate in the middle, which is shown where there is room for one.
    pub fn middle_rate_hz(&self) -> Option<f64> {
        let rates = self.settings(|setting| setting.rate_hz);
        rates.get(rates.len() / 2).copied()
    }
}

/// Everything `cullbench drift` finds.
#[derive(Clone, PartialEq, Debug, Serialize)]
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

/// What all processes time: the plan is the same for each.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DriftPlan {
    schedule: Schedule,
    /// Points of the arms that are timed, by their place among all.
    arms: Vec<usize>,
}

/// All errors, without times.
pub struct Prepared {
    /// What the other processes are to measure.
    pub plan: DriftPlan,
    options: DriftOptions,
    units: Vec<f64>,
    rotation: Vec<RotationDrift>,
    one_degree_turns: Vec<TurnDrift>,
    orbit: Vec<OrbitDrift>,
    points: Vec<ArmPoint>,
    information: Vec<InformationError>,
}

/// Jobs that `progress` of [`prepare`] is told of.
pub fn jobs(options: &DriftOptions) -> usize {
    METHODS.len() + CARRIERS.len() + arm::settings(&options.arm).len()
}

/// Powers of ten from a thousand on, and the most steps themselves.
fn looks(most: u64) -> Vec<u64> {
    let powers = (3..=18).map(|power| 10u64.pow(power));
    let below = powers.take_while(|&power| power < most);
    below.chain([most]).collect()
}

/// Finds all errors and plans how everything is timed; `progress` is told each job's
/// name before it starts, and ends the work early if it says so.
pub fn prepare(
    options: &DriftOptions,
    protocol: &Protocol,
    mut progress: impl FnMut(&str) -> bool,
) -> Option<Prepared> {
    let looks = looks(options.steps);
    let exact = Exact::new(&looks);
    let (mut rotation, mut one_degree_turns, mut orbit) = (Vec::new(), Vec::new(), Vec::new());
    for method in METHODS {
        if progress(method.name) {
            return None;
        }
        rotation.extend(method.drift(&exact));
        one_degree_turns.extend(method.turn_drift(&TURNS));
    }
    for carrier in CARRIERS {
        if progress(carrier.name) {
            return None;
        }
        orbit.extend(carrier.drift(&looks));
    }
    let (mut points, mut information) = (Vec::new(), Vec::new());
    for setting in arm::settings(&options.arm) {
        if progress(&format!(
            "{} arm, k = {:e}",
            setting.arm.name(),
            setting.stiffness
        )) {
            return None;
        }
        let (found, told) = arm::errors(setting, options.arm.seconds);
        points.extend(found);
        information.extend(told);
    }
    // Real frames are never steady, and what has blown up is no choice.
    let is_timed =
        |p: &ArmPoint| p.frame_times == FrameTimes::Jittered && p.position_error.is_some();
    let arms: Vec<usize> = (0..points.len())
        .filter(|&i| is_timed(&points[i]))
        .collect();
    let (tasks, units) = tasks(options, &arms);
    Some(Prepared {
        plan: DriftPlan {
            schedule: Schedule::new(QUERIES, &tasks, protocol),
            arms,
        },
        options: options.clone(),
        units,
        rotation,
        one_degree_turns,
        orbit,
        points,
        information,
    })
}

/// All that is timed, with the units of a query: frames, eyes, arms.
fn tasks(options: &DriftOptions, arms: &[usize]) -> (Vec<TimedTask<'static>>, Vec<f64>) {
    let frames = METHODS.iter().map(of_frame);
    let eyes = CARRIERS.iter().map(|carrier| {
        let walk = carrier.walk;
        Repeated::new(QUERY_STEPS as f64, move || {
            walk(&SWING_DEG, &[QUERY_STEPS]);
        })
    });
    let settings = arm::settings(&options.arm).into_iter();
    let keys: Vec<_> = settings.flat_map(arm::keys).collect();
    let arms = arms.iter().map(|&i| arm::task(&keys[i]));
    let all = frames.chain(eyes).chain(arms);
    all.map(|repeated| (repeated.task, repeated.units)).unzip()
}

fn of_frame(method: &Method) -> Repeated {
    let walk = method.walk;
    Repeated::new(QUERY_STEPS as f64, move || {
        walk(&STEADY, &[QUERY_STEPS]);
    })
}

/// Times in this process what was planned; `None` if stopped.
pub fn time(
    options: &DriftOptions,
    plan: &DriftPlan,
    protocol: &Protocol,
    stop: &dyn Fn() -> bool,
) -> Option<ProcessTimes> {
    let (tasks, _) = tasks(options, &plan.arms);
    let timed = timed(&tasks, &plan.schedule, protocol, &|_| stop())?;
    Some(ProcessTimes::of(&timed))
}

impl Prepared {
    /// The report from the times of all processes.
    pub fn conclude(mut self, processes: &[ProcessTimes]) -> DriftReport {
        let times = OverProcesses::of(processes);
        let options = &self.options;
        let rotation_methods = rate_rotations(
            METHODS.iter(),
            &self.rotation,
            options.steps,
            options.tolerance_rad,
            &times,
        );
        let orbit_methods = rate_orbits(&self.orbit, options, &times);
        let rule = format!(
            "an error below {:e} after {:e} steps",
            options.tolerance_rad, options.steps as f64
        );
        let mut tasks = vec![None; self.points.len()];
        let first = METHODS.len() + CARRIERS.len();
        for (task, &point) in (first..).zip(&self.plan.arms) {
            tasks[point] = Some((task, self.units[task]));
        }
        let tolerance = options.arm.tolerance;
        let of_setting = |points: &mut [ArmPoint], from: usize| {
            let tasks = &tasks[from..from + points.len()];
            arm::conclude(points, tasks, &times, tolerance)
        };
        let (mut choices, mut from) = (Vec::new(), 0);
        for points in self.points.chunk_by_mut(|a, b| a.setting == b.setting) {
            choices.extend(of_setting(points, from));
            from += points.len();
        }
        DriftReport {
            steps: options.steps,
            tolerance_rad: options.tolerance_rad,
            processes: processes.len(),
            rounds: self.plan.schedule.rounds as usize,
            turn_per_step: STEADY,
            period_steps: PERIOD,
            rotation: self.rotation,
            one_degree_turns: self.one_degree_turns,
            orbit: self.orbit,
            recommended_rotation: cheapest(&rotation_methods, &rule),
            recommended_orbit: cheapest(&orbit_methods, &rule),
            rotation_methods: rotation_methods.into_iter().map(|row| row.rated).collect(),
            orbit_methods: orbit_methods.into_iter().map(|row| row.rated).collect(),
            arm: ArmReport {
                seconds: options.arm.seconds,
                tolerance,
                methods: arm::METHODS,
                points: self.points,
                information: self.information,
                stability: stability::limits(),
                conclusion: arm::conclusion(&choices, tolerance),
                choices,
            },
        }
    }
}

/// How some ways to turn a frame fare after so many steps, timed in this process: what
/// a report says of them, by themselves.
pub fn rotations(names: &[&str], steps: u64, tolerance_rad: f64) -> Vec<Rated> {
    let protocol = Protocol {
        rounds: [5, 5],
        task_ns: 0.0,
        cameras: QUERIES,
        cold: false,
        seed: 1,
        cache_bytes: 0,
    };
    let methods = || METHODS.iter().filter(|method| names.contains(&method.name));
    let exact = Exact::new(&[steps]);
    let drifts: Vec<_> = methods().flat_map(|m| m.drift(&exact)).collect();
    let tasks: Vec<TimedTask> = methods().map(|method| of_frame(method).task).collect();
    let timed = crate::measure::timed_rounds(QUERIES, &tasks, &protocol, &|| false);
    let times = OverProcesses::of(&[ProcessTimes::of(&timed.unwrap_or_default())]);
    let rows = rate_rotations(methods(), &drifts, steps, tolerance_rad, &times);
    rows.into_iter().map(|row| row.rated).collect()
}

fn rate_rotations<'m>(
    methods: impl Iterator<Item = &'m Method>,
    drifts: &[RotationDrift],
    steps: u64,
    tolerance: f64,
    times: &OverProcesses,
) -> Vec<Row> {
    let rows = methods.map(|method| {
        let last = |d: &&RotationDrift| d.method == method.name && d.steps == steps;
        // NaN is no maximum to `max`: a frame that is lost has no error.
        let error = drifts.iter().find(last).and_then(|d| {
            let lost = d.angle_error_rad.is_nan() || d.orthogonality_error.is_nan();
            (!lost).then(|| d.angle_error_rad.max(d.orthogonality_error))
        });
        (method.name, method.summary, error)
    });
    rated(rows, times, 0, tolerance)
}

fn rate_orbits(drifts: &[OrbitDrift], options: &DriftOptions, times: &OverProcesses) -> Vec<Row> {
    let rows = CARRIERS.iter().map(|carrier| {
        let last = |d: &&OrbitDrift| d.method == carrier.name && d.steps == options.steps;
        let last = drifts.iter().find(last);
        let error = last.map(|d| d.position_error / ORBIT_RADIUS);
        (carrier.name, carrier.summary, error)
    });
    rated(rows, times, METHODS.len(), options.tolerance_rad)
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
