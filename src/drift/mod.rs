//! Small errors that add up: frames that are turned step by step, eyes that
//! are carried around, and a chase camera on a spring arm. It owns the methods
//! and integrators that are compared, their exact references and what follows
//! from the figures; how those look on a terminal is the program's business.

mod exact;
mod frames;
mod orbit;
mod oscillator;
mod rotation;
mod spring;
mod stability;
mod walk;

use serde::Serialize;

pub use frames::Turn;
pub use orbit::{OrbitDrift, SWING_DEG};
pub use rotation::{ORBIT_RADIUS, RotationDrift, TurnDrift};
pub use spring::SpringError;
pub use stability::StabilityLimit;

use crate::statistics::{Tradeoff, dominated_by};
use orbit::CARRIERS;
use rotation::{Exact, METHODS, Method, STEADY};
use spring::{INTEGRATORS, STIFFNESSES};

/// The most steps: beyond, an f32 frame overflows and a run takes hours.
pub const MOST_STEPS: u64 = 1_000_000_000;

/// Whole turns that are looked at, in steps of one degree.
const TURNS: [u64; 2] = [1, 1000];

/// Steps in one sample of the clock.
const TIMED_STEPS: u64 = 20_000;

/// What is asked.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct DriftOptions {
    /// Up to how many steps.
    pub steps: u64,
    /// What a recommended method may be off after all of them: a frame's angle
    /// in radians and orthogonality, an eye's distance in radii.
    pub tolerance_rad: f64,
}

/// A method or an integrator as a point of error against time.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Rated {
    pub name: &'static str,
    pub summary: &'static str,
    /// What this toolkit's camera does.
    pub is_default: bool,
    /// A frame's or an eye's worst error after the most steps: the larger of
    /// angle and orthogonality, or the distance in radii. An arm's largest
    /// error over all stiffnesses. `None` where it has none that is finite.
    pub error: Option<f64>,
    /// Median thread CPU time.
    pub ns_per_step: f64,
    /// Good enough to be recommended.
    pub qualifies: bool,
    /// Another that is no worse in error or time and better in one.
    pub dominated_by: Option<&'static str>,
    /// Has an error, and nothing dominates it.
    pub on_front: bool,
}

/// A choice, and why.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Recommendation {
    /// `None` if nothing is good enough.
    pub name: Option<&'static str>,
    pub reason: String,
}

/// Everything `cullbench drift` finds.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct DriftReport {
    pub steps: u64,
    pub tolerance_rad: f64,
    pub turn_per_step: Turn,
    pub rotation: Vec<RotationDrift>,
    pub one_degree_turns: Vec<TurnDrift>,
    pub orbit: Vec<OrbitDrift>,
    pub spring: Vec<SpringError>,
    pub stability: Vec<StabilityLimit>,
    pub rotation_methods: Vec<Rated>,
    pub orbit_methods: Vec<Rated>,
    pub integrators: Vec<Rated>,
    pub recommended_rotation: Recommendation,
    pub recommended_orbit: Recommendation,
    pub recommended_integrator: Recommendation,
}

/// Jobs that `progress` of [`measure`] is told of.
pub fn jobs() -> usize {
    METHODS.len() + CARRIERS.len() + 2
}

/// Powers of ten from a thousand on, and the most steps themselves.
fn looks(most: u64) -> Vec<u64> {
    let powers = (3..=18).map(|power| 10u64.pow(power));
    let below = powers.take_while(|&power| power < most);
    below.chain([most]).collect()
}

/// Measures everything; `progress` is told each job's name before it starts.
pub fn measure(options: &DriftOptions, mut progress: impl FnMut(&str)) -> DriftReport {
    let looks = looks(options.steps);
    let exact = Exact::new(&looks);
    let (mut rotation, mut one_degree_turns, mut orbit) = (Vec::new(), Vec::new(), Vec::new());
    for method in METHODS {
        progress(method.name);
        rotation.extend(method.drift(&exact));
        one_degree_turns.extend(method.turn_drift(&TURNS));
    }
    for carrier in CARRIERS {
        progress(carrier.name);
        orbit.extend(carrier.drift(&looks));
    }
    progress("spring arm");
    let pairs = INTEGRATORS.iter().flat_map(|i| STIFFNESSES.map(|k| (i, k)));
    let spring: Vec<SpringError> = pairs.map(|(i, k)| i.error(k)).collect();
    let stability = stability::limits();
    progress("clock");
    let methods: Vec<&Method> = METHODS.iter().collect();
    let rotation_methods = rate_rotations(&methods, &rotation, options);
    let orbit_methods = rate_orbits(&orbit, options);
    let integrators = rate_integrators(&spring);
    DriftReport {
        steps: options.steps,
        tolerance_rad: options.tolerance_rad,
        turn_per_step: STEADY,
        recommended_rotation: cheapest(&rotation_methods, options),
        recommended_orbit: cheapest(&orbit_methods, options),
        recommended_integrator: best_product(&integrators),
        rotation,
        one_degree_turns,
        orbit,
        spring,
        stability,
        rotation_methods,
        orbit_methods,
        integrators,
    }
}

/// How some ways to turn a frame fare after so many steps: what [`measure`] says
/// of them, by themselves.
pub fn rotations(names: &[&str], options: &DriftOptions) -> Vec<Rated> {
    let exact = Exact::new(&[options.steps]);
    let named = METHODS.iter().filter(|method| names.contains(&method.name));
    let methods: Vec<&Method> = named.collect();
    let drifts: Vec<_> = methods.iter().flat_map(|m| m.drift(&exact)).collect();
    rate_rotations(&methods, &drifts, options)
}

fn rate_rotations(
    methods: &[&Method],
    drifts: &[RotationDrift],
    options: &DriftOptions,
) -> Vec<Rated> {
    let times = walk::ns_per_step(methods, TIMED_STEPS, |method| {
        (method.walk)(&STEADY, &[TIMED_STEPS]);
    });
    let rows = methods.iter().map(|method| {
        let last = |d: &&RotationDrift| d.method == method.name && d.steps == options.steps;
        // NaN is no maximum to `max`: a frame that is lost has no error.
        let error = drifts.iter().find(last).and_then(|d| {
            let lost = d.angle_error_rad.is_nan() || d.orthogonality_error.is_nan();
            (!lost).then(|| d.angle_error_rad.max(d.orthogonality_error))
        });
        (method.name, method.summary, error)
    });
    rated(rows, times, options.tolerance_rad)
}

fn rate_orbits(drifts: &[OrbitDrift], options: &DriftOptions) -> Vec<Rated> {
    let times = walk::ns_per_step(CARRIERS, TIMED_STEPS, |carrier| {
        (carrier.walk)(&SWING_DEG, &[TIMED_STEPS]);
    });
    let rows = CARRIERS.iter().map(|carrier| {
        let last = |d: &&OrbitDrift| d.method == carrier.name && d.steps == options.steps;
        let last = drifts.iter().find(last);
        let error = last.map(|d| d.position_error / ORBIT_RADIUS);
        (carrier.name, carrier.summary, error)
    });
    rated(rows, times, options.tolerance_rad)
}

fn rate_integrators(errors: &[SpringError]) -> Vec<Rated> {
    let rows = INTEGRATORS.iter().map(|integrator| {
        let own = errors.iter().filter(|e| e.integrator == integrator.name);
        // None of them if one is missing.
        let all: Option<Vec<f64>> = own.map(|e| e.rms_error).collect();
        let error = all.map(|errors| errors.into_iter().fold(0.0, f64::max));
        (integrator.name, integrator.summary, error)
    });
    rated(rows, spring::times(), f64::INFINITY)
}

/// Names with summaries and errors, and the time of each: good enough below the
/// tolerance.
fn rated(
    rows: impl Iterator<Item = (&'static str, &'static str, Option<f64>)>,
    times: Vec<f64>,
    tolerance: f64,
) -> Vec<Rated> {
    let rated = rows.zip(times).map(|((name, summary, error), time)| Rated {
        name,
        summary,
        is_default: [rotation::TOOLKIT, orbit::TOOLKIT].contains(&name),
        error,
        ns_per_step: time,
        qualifies: error.is_some_and(|error| error < tolerance),
        dominated_by: None,
        on_front: false,
    });
    with_front(rated.collect())
}

/// Fills in who dominates whom. What has no error that is finite is left out:
/// being the fastest does not put it on the front.
fn with_front(mut rated: Vec<Rated>) -> Vec<Rated> {
    let (mut names, mut points) = (Vec::new(), Vec::new());
    for row in &rated {
        if let Some(error) = row.error {
            names.push(row.name);
            points.push(Tradeoff {
                error,
                time: row.ns_per_step,
            });
        }
    }
    let with_error = rated.iter_mut().filter(|row| row.error.is_some());
    for (row, by) in with_error.zip(dominated_by(&points)) {
        row.dominated_by = by.map(|by| names[by]);
        row.on_front = by.is_none();
    }
    rated
}

/// The cheapest of the methods that are good enough.
fn cheapest(rated: &[Rated], options: &DriftOptions) -> Recommendation {
    let rule = format!(
        "an error below {:e} after {:e} steps",
        options.tolerance_rad, options.steps as f64
    );
    let why = |count| format!("the cheapest of {count} methods with {rule}");
    least(
        rated,
        |rated| rated.ns_per_step,
        why,
        || format!("no method has {rule}"),
    )
}

/// The least product of error and time among the stable.
fn best_product(rated: &[Rated]) -> Recommendation {
    let stable = "stable at every stiffness";
    let product = |rated: &Rated| rated.error.unwrap_or(f64::INFINITY) * rated.ns_per_step;
    let why =
        |count| format!("the least error times cost of {count} integrators that are {stable}");
    least(rated, product, why, || format!("no integrator is {stable}"))
}

/// The least of what qualifies; why that, of so many, or why none.
fn least(
    rated: &[Rated],
    by: impl Fn(&Rated) -> f64,
    why: impl FnOnce(usize) -> String,
    why_none: impl FnOnce() -> String,
) -> Recommendation {
    let good: Vec<&Rated> = rated.iter().filter(|rated| rated.qualifies).collect();
    let best = good.iter().min_by(|a, b| by(a).total_cmp(&by(b)));
    Recommendation {
        name: best.map(|best| best.name),
        reason: best.map_or_else(why_none, |_| why(good.len())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fast and rough, slow and precise, slower and no better, faster and lost.
    fn four(tolerance: f64) -> Vec<Rated> {
        let rows = [
            ("lost", "", None),
            ("rough", "", Some(1e-3)),
            ("precise", "", Some(1e-12)),
            ("slow", "", Some(1e-9)),
        ];
        rated(rows.into_iter(), vec![1.0, 5.0, 9.0, 30.0], tolerance)
    }

    #[test]
    fn the_cheapest_within_the_tolerance_is_recommended() {
        let choose = |tolerance_rad| {
            let steps = 1000;
            let options = DriftOptions {
                steps,
                tolerance_rad,
            };
            cheapest(&four(tolerance_rad), &options)
        };
        assert_eq!(choose(1e-2).name, Some("rough"));
        assert_eq!(choose(1e-6).name, Some("precise"));
        assert!(choose(1e-6).reason.contains("of 2 methods"));
        let none = choose(1e-15);
        assert_eq!(none.name, None);
        assert!(
            none.reason.contains("below 1e-15 after 1e3 steps"),
            "{none:?}"
        );
    }

    #[test]
    fn what_is_lost_is_neither_on_the_front_nor_recommended() {
        let rated = four(1.0);
        let dominated: Vec<_> = rated.iter().map(|r| (r.dominated_by, r.on_front)).collect();
        let front = (None, true);
        assert_eq!(
            dominated,
            [(None, false), front, front, (Some("precise"), false)]
        );
        assert_eq!(best_product(&rated).name, Some("precise"));
        assert_eq!(best_product(&rated[..1]).name, None);
    }

    #[test]
    fn figures_are_taken_at_powers_of_ten_and_at_the_end() {
        assert_eq!(looks(7), [7]);
        assert_eq!(looks(1000), [1000]);
        assert_eq!(looks(20_000), [1000, 10_000, 20_000]);
        assert_eq!(looks(100_000), [1000, 10_000, 100_000]);
    }
}
