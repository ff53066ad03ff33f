//! Embedded pairs of explicit Runge-Kutta methods that choose their own steps
//! within a frame, by a PI controller.

use super::super::real::Real;
use super::problem::{Arm, Frames, State, along};

/// A pair of S stages, the last of which is the first of the next step. `b` is the
/// last row of `a`.
pub struct Pair<const S: usize> {
    a: [[f64; S]; S],
    c: [f64; S],
    /// Weights of the solution less those of the one of lower order.
    error: [f64; S],
    /// Of the solution that is kept.
    order: i32,
}

/// Orders 3 and 2 in four stages (Bogacki and Shampine 1989, "A 3(2) pair of
/// Runge-Kutta formulas", Applied Mathematics Letters 2, p. 321).
pub const BOGACKI_SHAMPINE: Pair<4> = Pair {
    a: [
        [0.0; 4],
        [1.0 / 2.0, 0.0, 0.0, 0.0],
        [0.0, 3.0 / 4.0, 0.0, 0.0],
        [2.0 / 9.0, 1.0 / 3.0, 4.0 / 9.0, 0.0],
    ],
    c: [0.0, 1.0 / 2.0, 3.0 / 4.0, 1.0],
    error: [-5.0 / 72.0, 1.0 / 12.0, 1.0 / 9.0, -1.0 / 8.0],
    order: 3,
};

/// Orders 5 and 4 in seven stages (Dormand and Prince 1980, "A family of embedded
/// Runge-Kutta formulae", Journal of Computational and Applied Mathematics 6, p. 19;
/// table 5.2 in Hairer, Nørsett and Wanner 1993, "Solving Ordinary Differential
/// Equations I", II.5).
pub const DORMAND_PRINCE: Pair<7> = Pair {
    a: [
        [0.0; 7],
        [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0, 0.0],
        [
            19372.0 / 6561.0,
            -25360.0 / 2187.0,
            64448.0 / 6561.0,
            -212.0 / 729.0,
            0.0,
            0.0,
            0.0,
        ],
        [
            9017.0 / 3168.0,
            -355.0 / 33.0,
            46732.0 / 5247.0,
            49.0 / 176.0,
            -5103.0 / 18656.0,
            0.0,
            0.0,
        ],
        [
            35.0 / 384.0,
            0.0,
            500.0 / 1113.0,
            125.0 / 192.0,
            -2187.0 / 6784.0,
            11.0 / 84.0,
            0.0,
        ],
    ],
    c: [0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0],
    error: [
        71.0 / 57600.0,
        0.0,
        -71.0 / 16695.0,
        71.0 / 1920.0,
        -17253.0 / 339200.0,
        22.0 / 525.0,
        -1.0 / 40.0,
    ],
    order: 5,
};

/// The exponents of the controller, over the order of the error's estimate plus one,
/// and its safety factor (Gustafsson 1991; Hairer and Wanner 1996, IV.2: beta = 0.4/k
/// and alpha = 0.7/k).
const ALPHA: f64 = 0.7;
const BETA: f64 = 0.4;
const SAFETY: f64 = 0.9;
/// A step may be so much longer or shorter than the last.
const FASTEST: [f64; 2] = [0.2, 5.0];

/// Most steps in a frame: a run that needs more has blown up, or its estimate is the
/// rounding of f32.
const MOST_STEPS: u32 = 20_000;

/// Steps through all frames; the step at the end of one is where the next begins.
/// `tolerance` is absolute for positions and relative for what is larger than one:
/// velocities of a stiff arm. A run that gives up ends in NaN.
pub fn follow<A: Arm<R, N>, R: Real, const N: usize, const S: usize>(
    pair: &Pair<S>,
    arm: &A,
    frames: &Frames<A::Target, R>,
    tolerance: R,
    start: State<R, N>,
    mut keep: impl FnMut(State<R, N>, u32),
) {
    let mut y = start;
    let mut step = frames.first().map_or(R::of(0.0), |(_, seconds)| *seconds);
    let mut last_error = R::of(1.0);
    for (target, seconds) in frames {
        let (mut t, mut steps) = (R::of(0.0), 0);
        let mut first = arm.slope(target, t, &y);
        while t < *seconds {
            let rest = *seconds - t;
            // No sliver is left for a last step.
            let is_last = step * R::of(1.01) > rest;
            let h = if is_last { rest } else { step };
            let tried = tried(pair, arm, target, t, &y, &first, h);
            let error = scaled(&tried.off, &y, &tried.y, tolerance);
            steps += 1;
            if steps == MOST_STEPS {
                // All frames that are left are lost.
                frames.iter().for_each(|_| keep([R::of(f64::NAN); N], 0));
                return;
            }
            // Asked this way round so that NaN is refused.
            let is_good = error <= R::of(1.0);
            if !is_good {
                step = h * changed(error, R::of(1.0), pair.order).min(R::of(1.0));
                continue;
            }
            t = if is_last { *seconds } else { t + h };
            let settled = arm.settled(tried.y);
            first = match settled == tried.y {
                true => tried.last,
                false => arm.slope(target, t, &settled),
            };
            y = settled;
            let longer = h * changed(error, last_error, pair.order);
            // What a frame's end has cut short says nothing of the step.
            step = if is_last { step.max(longer) } else { longer };
            last_error = error.max(R::of(1e-4));
        }
        keep(y, steps);
    }
}

struct Tried<R, const N: usize> {
    y: State<R, N>,
    /// The solution less the one of lower order.
    off: State<R, N>,
    /// Slope at the end.
    last: State<R, N>,
}

#[inline(always)]
fn tried<A: Arm<R, N>, R: Real, const N: usize, const S: usize>(
    pair: &Pair<S>,
    arm: &A,
    target: &A::Target,
    t: R,
    y: &State<R, N>,
    first: &State<R, N>,
    h: R,
) -> Tried<R, N> {
    let mut slopes = [*first; S];
    let mut at = *y;
    for i in 1..S {
        at = *y;
        for (slope, &weight) in slopes.iter().zip(&pair.a[i]).take(i) {
            if weight != 0.0 {
                at = along(&at, h * R::of(weight), slope);
            }
        }
        slopes[i] = arm.slope(target, t + R::of(pair.c[i]) * h, &at);
    }
    let mut off = [R::of(0.0); N];
    for (slope, &weight) in slopes.iter().zip(&pair.error) {
        off = along(&off, h * R::of(weight), slope);
    }
    Tried {
        y: at,
        off,
        last: slopes[S - 1],
    }
}

/// The largest entry in tolerances.
fn scaled<R: Real, const N: usize>(
    off: &State<R, N>,
    before: &State<R, N>,
    after: &State<R, N>,
    tolerance: R,
) -> R {
    let one = R::of(1.0);
    let mut most = R::of(0.0);
    for i in 0..N {
        let size = before[i].abs().max(after[i].abs()).max(one);
        let share = off[i].abs() / (tolerance * size);
        // NaN is no maximum to `max`.
        let is_less = share <= most;
        if !is_less {
            most = share;
        }
    }
    most
}

/// How much longer the next step may be: `safety error^-alpha last^beta`.
fn changed<R: Real>(error: R, last_error: R, order: i32) -> R {
    let order = f64::from(order);
    let (error, last) = (error.wide().max(1e-10), last_error.wide());
    let factor = SAFETY * libm::pow(error, -ALPHA / order) * libm::pow(last, BETA / order);
    let [least, most] = FASTEST;
    R::of(if factor.is_nan() {
        least
    } else {
        factor.clamp(least, most)
    })
}

#[cfg(test)]
mod tests {
    use super::super::limited::Limited;
    use super::super::linear::{Line, Linear};
    use super::*;

    /// The conditions for the sums of a tableau up to order 3, to which all further
    /// ones are held by the convergence that `methods` looks for.
    fn holds_its_conditions<const S: usize>(pair: &Pair<S>) {
        let near = |found: f64, wanted: f64| (found - wanted).abs() < 1e-15;
        for (row, &c) in pair.a.iter().zip(&pair.c) {
            assert!(near(row.iter().sum(), c), "{row:?} {c}");
        }
        let sum = |weights: &[f64; S], of: &dyn Fn(usize) -> f64| -> f64 {
            (0..S).map(|i| weights[i] * of(i)).sum()
        };
        let (b, c) = (pair.a[S - 1], pair.c);
        assert!(near(sum(&b, &|i| c[i]), 1.0 / 2.0));
        assert!(near(sum(&b, &|i| c[i] * c[i]), 1.0 / 3.0));
        let inner = |i: usize| sum(&pair.a[i], &|j| c[j]);
        assert!(near(sum(&b, &inner), 1.0 / 6.0));
        // The other solution has the lower order, so its weights hold them, too.
        assert!(near(sum(&pair.error, &|_| 1.0), 0.0));
        assert!(near(sum(&pair.error, &|i| c[i]), 0.0));
        assert_eq!(
            near(sum(&pair.error, &|i| c[i] * c[i]), 0.0),
            pair.order > 3
        );
        assert!(!near(sum(&pair.error, &|i| c[i].powi(4)), 0.0));
    }

    #[test]
    fn tableaux_hold_their_order_conditions() {
        holds_its_conditions(&BOGACKI_SHAMPINE);
        holds_its_conditions(&DORMAND_PRINCE);
        let (b, c) = (DORMAND_PRINCE.a[6], DORMAND_PRINCE.c);
        for power in 0..5 {
            let sum: f64 = b.iter().zip(c).map(|(b, c)| b * c.powi(power)).sum();
            assert!((sum - 1.0 / f64::from(power + 1)).abs() < 1e-15, "{power}");
        }
    }

    fn released(stiffness: f64, tolerance: f64, pair: &Pair<7>) -> (f64, u32) {
        let arm = Linear::<f64>::new(stiffness);
        let rest = Line {
            base: 0.0,
            speed: 0.0,
            bend: 0.0,
        };
        let (mut worst, mut all) = (0.0f64, 0);
        let mut t = 0.0;
        follow(
            pair,
            &arm,
            &[(rest, 0.1); 10],
            tolerance,
            [1.0, 0.0],
            |[x, _], steps| {
                t += 0.1;
                let omega_t = stiffness.sqrt() * t;
                worst = worst.max((x - (1.0 + omega_t) * (-omega_t).exp()).abs());
                all += steps;
            },
        );
        (worst, all)
    }

    #[test]
    fn the_error_follows_the_tolerance_and_stiffness_costs_steps() {
        let mut last = (1.0, 0);
        for tolerance in [1e-3, 1e-5, 1e-7, 1e-9] {
            let found = released(100.0, tolerance, &DORMAND_PRINCE);
            assert!(
                found.0 < 30.0 * tolerance && found.0 < last.0,
                "{tolerance}: {found:?}"
            );
            assert!(found.1 > last.1, "{tolerance}: {found:?}");
            last = found;
        }
        // At rest a step is as long as it is stable (3.3 / omega), not as it is precise.
        let (error, steps) = released(1e6, 1e-3, &DORMAND_PRINCE);
        assert!(error < 1e-2 && (200..2000).contains(&steps), "{steps}");
    }

    #[test]
    fn a_run_that_cannot_go_on_ends() {
        let line = Line {
            base: f64::NAN,
            speed: 0.0,
            bend: 0.0,
        };
        let mut ends = Vec::new();
        let arm = Limited::<f64>::new(1.0);
        let frames = [(line, 0.1); 3];
        follow(&BOGACKI_SHAMPINE, &arm, &frames, 1e-3, [0.0; 2], |y, _| {
            ends.push(y)
        });
        assert!(
            ends.len() >= 3 && ends.iter().all(|end| end[0].is_nan()),
            "{ends:?}"
        );
    }
}
