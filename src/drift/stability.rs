//! Stability limits of the spring arm's methods, in `omega h`.
//!
//! Also the share of an error that remains after one step at large `omega h`. Both are found
//! numerically, with the same step function as the study.

use serde::Serialize;

use super::arm::{Arm, Chase, Line, METHODS, Method};

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
