//! Up to which `omega h` each integrator of the spring arm is stable: found by
//! trying the very step that runs, and by formula.

use serde::Serialize;

use super::oscillator::{Spring, State};
use super::spring::{FRAME_RATE_HZ, INTEGRATORS, Integrator, STIFFNESSES, Step, Target};

/// Damping ratios that limits are found for.
pub const DAMPING_RATIOS: [f64; 4] = [0.1, 0.5, 1.0, 2.0];

/// What is stable up to here is stable always.
const ALWAYS: f64 = 1e4;

/// Slack of the conditions of stability, for rounding.
const SLACK: f64 = 1e-12;

/// Where |R(z)| = 1 on the negative axis for the Runge-Kutta method of order
/// 4: the real root of z^3 + 4 z^2 + 12 z + 24 (Hairer and Wanner 1996,
/// "Solving Ordinary Differential Equations II", IV.2).
const RK4_REAL_LIMIT: f64 = 2.785_293_563_405_282;

/// A step of the arm at rest is linear: its matrix. `omega` is one and `h` is
/// `omega_h`.
fn matrix(step: Step, damping_ratio: f64, omega_h: f64) -> [[f64; 2]; 2] {
    let spring = Spring {
        stiffness: 1.0,
        damping_ratio,
    };
    let column = |position, velocity| {
        let state = State { position, velocity };
        step(&spring, state, &Target::AT_REST, omega_h)
    };
    let (x, v) = (column(1.0, 0.0), column(0.0, 1.0));
    [[x.position, v.position], [x.velocity, v.velocity]]
}

fn trace_and_determinant([[a, b], [c, d]]: [[f64; 2]; 2]) -> (f64, f64) {
    (a + d, a * d - b * c)
}

/// Whether both eigenvalues lie in the unit circle: Jury's conditions
/// `|trace| <= 1 + det` and `det <= 1`, which need no square root.
fn is_stable(step: Step, damping_ratio: f64, omega_h: f64) -> bool {
    let (trace, determinant) = trace_and_determinant(matrix(step, damping_ratio, omega_h));
    trace.abs() <= 1.0 + determinant + SLACK && determinant <= 1.0 + SLACK
}

/// The share of an error that is left after one step, by the eigenvalue of
/// largest size: negative if the error changes sign with every step.
fn left_per_step(step: Step, damping_ratio: f64, omega_h: f64) -> f64 {
    let (trace, determinant) = trace_and_determinant(matrix(step, damping_ratio, omega_h));
    let discriminant = trace * trace / 4.0 - determinant;
    if discriminant < 0.0 {
        return determinant.sqrt();
    }
    trace / 2.0 + discriminant.sqrt().copysign(trace)
}

/// The first place above zero where `holds` ends, by growing steps and
/// bisection; `None` if it holds up to [`ALWAYS`].
fn end_of(holds: impl Fn(f64) -> bool) -> Option<f64> {
    let (mut good, mut bad) = (1e-3, 1e-3);
    while holds(bad) {
        good = bad;
        bad *= 1.01;
        if bad > ALWAYS {
            return None;
        }
    }
    for _ in 0..60 {
        let middle = (good + bad) / 2.0;
        if holds(middle) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    Some(good)
}

/// The limit of `omega h` by formula; `None` where there is none, for the
/// methods that are stable always.
///
/// The eigenvalues of the arm are `omega (-zeta +- sqrt(zeta^2 - 1))`; explicit
/// Euler and Runge-Kutta are stable while `|R(h lambda)| <= 1`, and
/// semi-implicit Euler by Jury's conditions on its trace and determinant.
fn formula(name: &str, zeta: f64) -> Option<f64> {
    let fast = zeta + (zeta * zeta - 1.0).max(0.0).sqrt();
    match name {
        "explicit-euler" if zeta <= 1.0 => Some(2.0 * zeta),
        "explicit-euler" => Some(2.0 / fast),
        "semi-implicit-euler" => Some(2.0 * ((1.0 + zeta * zeta).sqrt() - zeta)),
        "rk4" if zeta >= 1.0 => Some(RK4_REAL_LIMIT / fast),
        "rk4" => end_of(|omega_h| rk4_growth(zeta, omega_h) <= 1.0),
        _ => None,
    }
}

/// `|1 + z + z^2/2 + z^3/6 + z^4/24|^2` at `z = omega h (-zeta + i sqrt(1 -
/// zeta^2))`.
fn rk4_growth(zeta: f64, omega_h: f64) -> f64 {
    let (re, im) = (-zeta * omega_h, (1.0 - zeta * zeta).sqrt() * omega_h);
    // Horner: 1 + z(1 + z/2(1 + z/3(1 + z/4))).
    let (mut x, mut y) = (1.0, 0.0);
    for divisor in [4.0, 3.0, 2.0, 1.0] {
        (x, y) = (
            1.0 + (re * x - im * y) / divisor,
            (re * y + im * x) / divisor,
        );
    }
    x * x + y * y
}

/// One integrator at one damping.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct StabilityLimit {
    pub integrator: &'static str,
    pub damping_ratio: f64,
    /// Found by trying; `None` if it is stable always.
    pub limit_omega_h: Option<f64>,
    /// The same by formula.
    pub formula_omega_h: Option<f64>,
    /// The share of an error that one step leaves at the highest stiffness:
    /// negative if its sign alternates (the camera rings), above one in size
    /// if unstable.
    pub stiffest_left_per_step: f64,
}

pub fn limits() -> Vec<StabilityLimit> {
    let rows = INTEGRATORS
        .iter()
        .flat_map(|i| DAMPING_RATIOS.map(|zeta| (i, zeta)));
    rows.map(|(Integrator { name, step, .. }, zeta)| {
        let [.., stiffest] = STIFFNESSES;
        StabilityLimit {
            integrator: name,
            damping_ratio: zeta,
            limit_omega_h: end_of(|omega_h| is_stable(*step, zeta, omega_h)),
            formula_omega_h: formula(name, zeta),
            stiffest_left_per_step: left_per_step(*step, zeta, stiffest.sqrt() / FRAME_RATE_HZ),
        }
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_found_are_the_limits_of_the_formulas() {
        let known = [
            ("explicit-euler", [0.2, 1.0, 2.0, 0.536]),
            ("semi-implicit-euler", [1.810, 1.236, 0.828, 0.472]),
            ("rk4", [2.95, 2.62, 2.785, 0.746]),
        ];
        let limits = limits();
        assert_eq!(limits.len(), INTEGRATORS.len() * DAMPING_RATIOS.len());
        for row in &limits {
            let at = DAMPING_RATIOS.iter().position(|z| *z == row.damping_ratio);
            let known = known.iter().find(|k| k.0 == row.integrator);
            let wanted = known.zip(at).map(|(k, at)| k.1[at]);
            let (found, formula) = (row.limit_omega_h, row.formula_omega_h);
            assert_eq!(found.is_some(), wanted.is_some(), "{row:?}");
            assert_eq!(formula.is_some(), wanted.is_some(), "{row:?}");
            if let (Some(found), Some(formula), Some(wanted)) = (found, formula, wanted) {
                assert!((found / formula - 1.0).abs() < 1e-6, "{row:?}");
                assert!((found / wanted - 1.0).abs() < 3e-3, "{row:?}: {wanted}");
            }
        }
    }

    #[test]
    fn the_arm_blows_up_exactly_beyond_its_limit() {
        for integrator in INTEGRATORS {
            let limit = end_of(|z| is_stable(integrator.step, 1.0, z)).unwrap_or(f64::INFINITY);
            for stiffness in STIFFNESSES {
                let error = integrator.error(stiffness);
                assert_eq!(
                    error.rms_error.is_some(),
                    error.omega_h < limit,
                    "{error:?}"
                );
            }
        }
    }

    #[test]
    fn only_the_midpoint_rule_rings_when_stiff() {
        let left = |name: &str| {
            let row = |l: &&StabilityLimit| l.integrator == name && l.damping_ratio == 1.0;
            let limits = limits();
            let row = limits.iter().find(row).map(|l| l.stiffest_left_per_step);
            row.expect(name)
        };
        // (1 - z/2)/(1 + z/2) and 1/(1 + z) for z = 1000/60.
        assert!((left("implicit-midpoint") + 22.0 / 28.0).abs() < 1e-6);
        assert!((left("implicit-euler") - 3.0 / 53.0).abs() < 1e-6);
        for name in ["exact-held", "exact-linear"] {
            assert!((0.0..1e-6).contains(&left(name)), "{}", left(name));
        }
    }
}
