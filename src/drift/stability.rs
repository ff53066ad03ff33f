//! Up to which `omega h` each method of the spring arm is stable, and how far an
//! error can grow on the way down: found by trying the very step that runs, and by
//! formula. Pairs that choose their own steps have no such limit.

use serde::Serialize;

use super::arm::linear::{Line, Linear};
use super::arm::methods::{Effort, Information, METHODS, Scheme, follow};
use super::oscillator::Spring;

/// Damping ratios that limits are found for.
const DAMPING_RATIOS: [f64; 4] = [0.1, 0.5, 1.0, 2.0];

/// `omega h` of the stiffest arm of interest: k = 1e6 at 60 frames per second.
const STIFFEST: f64 = 1e3 / 60.0;

/// What is stable up to here is stable always.
const ALWAYS: f64 = 1e4;

/// Slack of the conditions of stability, for rounding.
const SLACK: f64 = 1e-12;

/// Where |R(z)| = 1 on the negative axis for the Runge-Kutta method of order
/// 4: the real root of z^3 + 4 z^2 + 12 z + 24 (Hairer and Wanner 1996,
/// "Solving Ordinary Differential Equations II", IV.2).
const RK4_REAL_LIMIT: f64 = 2.785_293_563_405_282;

type Matrix = [[f64; 2]; 2];

/// A step of the arm whose target rests at zero is linear: its matrix. `omega` is
/// one and `h` is `omega_h`, so that the length of a state is its energy.
fn matrix(scheme: Scheme, damping_ratio: f64, omega_h: f64) -> Matrix {
    let spring = Spring {
        stiffness: 1.0,
        damping_ratio,
    };
    let arm = Linear {
        spring,
        friction: 2.0 * damping_ratio,
    };
    let at_rest = Line {
        base: 0.0,
        speed: 0.0,
        bend: 0.0,
    };
    let column = |start: [f64; 2]| {
        let (frames, mut end) = ([(at_rest, omega_h)], start);
        follow(&arm, &frames, scheme, Effort::Substeps(1), start, |y, _| {
            end = y
        });
        end
    };
    let ([a, c], [b, d]) = (column([1.0, 0.0]), column([0.0, 1.0]));
    [[a, b], [c, d]]
}

fn trace_and_determinant([[a, b], [c, d]]: Matrix) -> (f64, f64) {
    (a + d, a * d - b * c)
}

/// Whether both eigenvalues lie in the unit circle: Jury's conditions
/// `|trace| <= 1 + det` and `det <= 1`, which need no square root.
fn is_stable(scheme: Scheme, damping_ratio: f64, omega_h: f64) -> bool {
    let (trace, determinant) = trace_and_determinant(matrix(scheme, damping_ratio, omega_h));
    trace.abs() <= 1.0 + determinant + SLACK && determinant <= 1.0 + SLACK
}

/// The share of an error that is left after one step, by the eigenvalue of
/// largest size: negative if the error changes sign with every step. Two that are
/// complex, if only by rounding, have the sign of their real part.
fn left_per_step(scheme: Scheme, damping_ratio: f64, omega_h: f64) -> f64 {
    let (trace, determinant) = trace_and_determinant(matrix(scheme, damping_ratio, omega_h));
    let discriminant = trace * trace / 4.0 - determinant;
    if discriminant < 0.0 {
        return determinant.sqrt().copysign(trace);
    }
    trace / 2.0 + discriminant.sqrt().copysign(trace)
}

/// Steps that transient growth is looked for in.
const STEPS: usize = 200;

/// The most that an error's energy norm grows to in any number of steps: 1 for an arm,
/// whose energy only falls. Above 1 a step that is stable in the end is not on the way
/// (the matrix is not normal: Trefethen and Embree 2005, "Spectra and
/// Pseudospectra", ch. 14).
fn growth(scheme: Scheme, damping_ratio: f64, omega_h: f64) -> f64 {
    let step = matrix(scheme, damping_ratio, omega_h);
    let (mut power, mut most) = (step, norm(step));
    for _ in 1..STEPS {
        power = product(power, step);
        most = most.max(norm(power));
    }
    most
}

fn product([[a, b], [c, d]]: Matrix, [[e, f], [g, h]]: Matrix) -> Matrix {
    [
        [a * e + b * g, a * f + b * h],
        [c * e + d * g, c * f + d * h],
    ]
}

/// Largest singular value.
fn norm([[a, b], [c, d]]: Matrix) -> f64 {
    // The eigenvalues of M^T M by its trace and determinant.
    let (trace, root) = (a * a + b * b + c * c + d * d, a * d - b * c);
    let apart = (trace * trace - 4.0 * root * root).max(0.0).sqrt();
    ((trace + apart) / 2.0).sqrt()
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
/// semi-implicit Euler by Jury's conditions on its trace and determinant; Verlet as
/// without friction (Hairer, Lubich and Wanner 2006, "Geometric Numerical
/// Integration", I.5.2), which a kick that is half explicit and half implicit leaves
/// alone.
fn formula(name: &str, zeta: f64) -> Option<f64> {
    let fast = zeta + (zeta * zeta - 1.0).max(0.0).sqrt();
    match name {
        "explicit-euler" if zeta <= 1.0 => Some(2.0 * zeta),
        "explicit-euler" => Some(2.0 / fast),
        "semi-implicit-euler" => Some(2.0 * ((1.0 + zeta * zeta).sqrt() - zeta)),
        "verlet" => Some(2.0),
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

/// One method at one damping.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct StabilityLimit {
    /// Name of the method.
    pub method: &'static str,
    /// Damping / critical damping.
    pub damping_ratio: f64,
    /// Found by trying; `None` if it is stable always.
    pub limit_omega_h: Option<f64>,
    /// The same by formula.
    pub formula_omega_h: Option<f64>,
    /// The share of an error that one step leaves at the highest stiffness:
    /// negative if its sign alternates (the camera rings), above one in size
    /// if unstable.
    pub stiffest_left_per_step: f64,
    /// The most that an error's energy norm grows to before it falls (1 if it never
    /// grows), for `omega h` up to 0.9 of the limit or 100, and where.
    pub largest_growth: f64,
    /// `omega h` at which it grows most.
    pub growth_omega_h: f64,
}

/// The last `omega h` that growth is looked for at.
const WIDEST: f64 = 100.0;
/// Share of a limit up to which it is: at the limit itself it has no end where two
/// eigenvalues meet, as they do at critical damping.
const INSIDE: f64 = 0.9;

pub fn limits() -> Vec<StabilityLimit> {
    let fixed = METHODS.iter().filter(|method| {
        let own_steps = method
            .efforts
            .iter()
            .any(|e| matches!(e, Effort::Tolerance(_)));
        // What it is told of the target makes no difference to a step at rest.
        !own_steps && method.information == Information::FrameEnds
    });
    let rows = fixed.flat_map(|method| DAMPING_RATIOS.map(|zeta| (method, zeta)));
    rows.map(|(method, zeta)| {
        let scheme = method.scheme;
        let limit = end_of(|omega_h| is_stable(scheme, zeta, omega_h));
        let last = limit.map_or(WIDEST, |limit| (INSIDE * limit).min(WIDEST));
        let places = (0..200).map(|i| last * libm::exp2(-f64::from(i) / 16.0));
        let grown = places.map(|omega_h| (growth(scheme, zeta, omega_h), omega_h));
        let most = grown.max_by(|a, b| a.0.total_cmp(&b.0));
        let (largest_growth, growth_omega_h) = most.unwrap_or((1.0, last));
        StabilityLimit {
            method: method.name,
            damping_ratio: zeta,
            limit_omega_h: limit,
            formula_omega_h: formula(method.name, zeta),
            stiffest_left_per_step: left_per_step(scheme, zeta, STIFFEST),
            largest_growth,
            growth_omega_h,
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
            ("verlet", [2.0, 2.0, 2.0, 2.0]),
            ("rk4", [2.95, 2.62, 2.785, 0.746]),
        ];
        let limits = limits();
        assert_eq!(limits.len(), 9 * DAMPING_RATIOS.len());
        for row in &limits {
            let at = DAMPING_RATIOS.iter().position(|z| *z == row.damping_ratio);
            let known = known.iter().find(|k| k.0 == row.method);
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

    fn critical(name: &str) -> StabilityLimit {
        let mut limits = limits().into_iter();
        let row = limits.find(|l| l.method == name && l.damping_ratio == 1.0);
        row.expect(name)
    }

    #[test]
    fn only_l_stable_methods_forget_at_once() {
        let left = |name: &str| critical(name).stiffest_left_per_step;
        // (1 - z/2)/(1 + z/2) and 1/(1 + z) for z = 1000/60.
        assert!((left("implicit-midpoint") + 22.0 / 28.0).abs() < 1e-6);
        assert!((left("implicit-euler") - 3.0 / 53.0).abs() < 1e-6);
        // (1 - c z)/(1 + (1 - c) z/2)^2, c = sqrt(2) - 1, at the same z.
        assert!(
            (left("tr-bdf2") + 0.170_4).abs() < 1e-3,
            "{}",
            left("tr-bdf2")
        );
        for name in ["exact-held", "exact-linear"] {
            assert!((0.0..1e-6).contains(&left(name)), "{}", left(name));
        }
        let far = |name: &str, omega_h: f64| {
            let method = METHODS.iter().find(|m| m.name == name).expect(name);
            left_per_step(method.scheme, 1.0, omega_h).abs()
        };
        for name in ["implicit-euler", "tr-bdf2"] {
            assert!(far(name, 1e6) < 1e-4, "{name} is L-stable");
        }
        assert!(far("implicit-midpoint", 1e6) > 0.99, "A-stable only");
    }

    #[test]
    fn errors_grow_on_the_way_where_a_step_is_not_normal() {
        // The energy of an arm falls; implicit Euler, the midpoint rule (both
        // B-stable) and the closed form keep that.
        for name in [
            "implicit-euler",
            "implicit-midpoint",
            "exact-held",
            "exact-linear",
        ] {
            let growth = critical(name).largest_growth;
            assert!((0.9..1.0 + 1e-9).contains(&growth), "{name}: {growth}");
        }
        for name in ["explicit-euler", "rk4", "verlet"] {
            let row = critical(name);
            assert!(row.largest_growth > 1.05, "{row:?}");
            assert!(Some(row.growth_omega_h) <= row.limit_omega_h, "{row:?}");
        }
        // A Jordan block of 1/2: n (1/2)^(n-1) 4 has its most at n = 1 or 2.
        let block = [[0.5, 4.0], [0.0, 0.5]];
        assert!((norm(block) - 4.062).abs() < 1e-3, "{}", norm(block));
        assert!((norm(product(block, block)) - 4.015_6).abs() < 1e-3);
    }
}
