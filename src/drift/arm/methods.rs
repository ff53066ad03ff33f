//! The methods that step a spring arm: one row of [`METHODS`] each, and the steps
//! themselves for any arm and any numbers. The pairs that choose their own steps
//! are in `adaptive`.

use super::super::real::Real;
use super::adaptive::{self, BOGACKI_SHAMPINE, DORMAND_PRINCE};
use super::problem::{Arm, Frames, State, along};

named! {
    /// What a method is told of the target.
    #[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Serialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Information {
        /// Where it is when a frame begins and ends: a line in between.
        FrameEnds = "frame-ends",
        /// Also where it is in the middle: a parabola.
        Midpoints = "midpoints",
    }
}

/// How much work a method does.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Effort {
    /// Equal steps per frame.
    Substeps(u32),
    /// What a step may be off, by its own estimate.
    Tolerance(f64),
}

/// How a state is stepped through a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Scheme {
    ExplicitEuler,
    SemiImplicitEuler,
    Verlet,
    Rk4,
    ImplicitEuler,
    ImplicitMidpoint,
    TrBdf2,
    BogackiShampine,
    DormandPrince,
    Held,
    Closed,
}

/// One row of the study.
#[derive(PartialEq, Debug, serde::Serialize)]
pub struct Method {
    /// As in tables and JSON.
    pub name: &'static str,
    /// What it does, in one line.
    pub summary: &'static str,
    /// How a step is made.
    #[serde(skip)]
    pub scheme: Scheme,
    /// Classical order: of the error for steps far below 1/omega. Of the closed forms on
    /// an arm that is not linear, by the nonlinearity that they freeze.
    pub order: u32,
    /// What a step is told of the target's way.
    pub information: Information,
    /// How much work it is measured with, least first.
    #[serde(skip)]
    pub efforts: &'static [Effort],
}

const ONE: &[Effort] = &[Effort::Substeps(1)];
const FEW: &[Effort] = &[
    Effort::Substeps(1),
    Effort::Substeps(2),
    Effort::Substeps(4),
    Effort::Substeps(16),
];
const MANY: &[Effort] = &[
    Effort::Substeps(1),
    Effort::Substeps(4),
    Effort::Substeps(16),
    Effort::Substeps(64),
];
const TOLERANCES: &[Effort] = &[
    Effort::Tolerance(1e-2),
    Effort::Tolerance(1e-3),
    Effort::Tolerance(1e-4),
    Effort::Tolerance(1e-6),
];

use Information::{FrameEnds, Midpoints};

pub const METHODS: &[Method] = rows! { Method { name, summary, scheme, order, information, efforts }
    "explicit-euler", "position and velocity by the values before the step",
        Scheme::ExplicitEuler, 1, FrameEnds, MANY;
    "semi-implicit-euler", "velocity first, position by the new velocity",
        Scheme::SemiImplicitEuler, 1, FrameEnds, MANY;
    "verlet", "half a kick, a drift, half a kick; friction in the second one implicit",
        Scheme::Verlet, 2, FrameEnds, MANY;
    "rk4", "the classical Runge-Kutta method of order 4", Scheme::Rk4, 4, FrameEnds, FEW;
    "rk4-midpoints", "the same, told where the target is in the middle of a frame",
        Scheme::Rk4, 4, Midpoints, FEW;
    "bogacki-shampine", "embedded pair of orders 3 and 2 with steps of its own",
        Scheme::BogackiShampine, 3, FrameEnds, TOLERANCES;
    "dormand-prince", "embedded pair of orders 5 and 4 with steps of its own",
        Scheme::DormandPrince, 5, FrameEnds, TOLERANCES;
    "implicit-euler", "position and velocity by the values after the step; L-stable",
        Scheme::ImplicitEuler, 1, FrameEnds, MANY;
    "implicit-midpoint", "by the mean of the values before and after; A-stable",
        Scheme::ImplicitMidpoint, 2, FrameEnds, FEW;
    "tr-bdf2", "trapezoidal rule to 0.59 of a step, then backward differences; L-stable",
        Scheme::TrBdf2, 2, FrameEnds, FEW;
    "exact-held", "the closed form for the newest target, held still",
        Scheme::Held, 1, FrameEnds, ONE;
    "exact-linear", "the closed form for a target on a straight line between frames",
        Scheme::Closed, 1, FrameEnds, FEW;
    "exact-midpoints", "the closed form for a parabola through ends and middle of a frame",
        Scheme::Closed, 1, Midpoints, FEW;
};

/// Steps through all frames and hands on the state at the end of each, and how
/// many steps that frame took.
pub fn follow<A: Arm<R, N>, R: Real, const N: usize>(
    arm: &A,
    frames: &Frames<A::Target, R>,
    scheme: Scheme,
    effort: Effort,
    start: State<R, N>,
    keep: impl FnMut(State<R, N>, u32),
) {
    let tolerance = match effort {
        Effort::Substeps(_) => R::of(f64::INFINITY),
        Effort::Tolerance(tolerance) => R::of(tolerance),
    };
    let by = Steps {
        arm,
        frames,
        start,
        count: match effort {
            Effort::Substeps(count) => count,
            Effort::Tolerance(_) => 1,
        },
    };
    match scheme {
        Scheme::ExplicitEuler => by.steps(keep, Steps::explicit_euler),
        Scheme::SemiImplicitEuler => by.steps(keep, Steps::semi_implicit_euler),
        Scheme::Verlet => by.steps(keep, Steps::verlet),
        Scheme::Rk4 => by.steps(keep, Steps::rk4),
        Scheme::ImplicitEuler => by.steps(keep, Steps::implicit_euler),
        Scheme::ImplicitMidpoint => by.steps(keep, Steps::implicit_midpoint),
        Scheme::TrBdf2 => by.steps(keep, Steps::tr_bdf2),
        Scheme::Held => by.steps(keep, Steps::held),
        Scheme::Closed => by.steps(keep, |by, target, t, y, h| by.arm.closed(target, t, y, h)),
        Scheme::BogackiShampine => {
            adaptive::follow(&BOGACKI_SHAMPINE, arm, frames, tolerance, start, keep);
        }
        Scheme::DormandPrince => {
            adaptive::follow(&DORMAND_PRINCE, arm, frames, tolerance, start, keep);
        }
    }
}

/// Most iterations of a stage: one that needs more has no solution nearby.
const MOST_ITERATIONS: u32 = 20;

/// Share of a step of TR-BDF2 by the trapezoidal rule: 2 - sqrt(2), for which both
/// stages have the same matrix.
const GAMMA: f64 = 2.0 - std::f64::consts::SQRT_2;

/// Equal steps in every frame.
struct Steps<'f, A: Arm<R, N>, R: Real, const N: usize> {
    arm: &'f A,
    frames: &'f Frames<A::Target, R>,
    start: State<R, N>,
    count: u32,
}

impl<A: Arm<R, N>, R: Real, const N: usize> Steps<'_, A, R, N> {
    /// One step takes the target, the time since the frame began, the
    /// state, and how long the step is.
    #[inline(always)]
    fn steps(
        self,
        mut keep: impl FnMut(State<R, N>, u32),
        step: impl Fn(&Self, &A::Target, R, &State<R, N>, R) -> State<R, N>,
    ) {
        let mut y = self.start;
        for (target, seconds) in self.frames {
            let h = *seconds / R::of(f64::from(self.count));
            for i in 0..self.count {
                let t = h * R::of(f64::from(i));
                y = self.arm.settled(step(&self, target, t, &y, h));
            }
            keep(y, self.count);
        }
    }

    #[inline(always)]
    fn explicit_euler(&self, target: &A::Target, t: R, y: &State<R, N>, h: R) -> State<R, N> {
        along(y, h, &self.arm.slope(target, t, y))
    }

    /// The velocity alone along a slope.
    #[inline(always)]
    fn kicked(y: &State<R, N>, h: R, slope: &State<R, N>) -> State<R, N> {
        let mut kicked = *y;
        for i in A::POSITION..N {
            kicked[i] = y[i] + h * slope[i];
        }
        kicked
    }

    /// Euler-Cromer, also called symplectic Euler.
    #[inline(always)]
    fn semi_implicit_euler(&self, target: &A::Target, t: R, y: &State<R, N>, h: R) -> State<R, N> {
        let kicked = Self::kicked(y, h, &self.arm.slope(target, t, y));
        self.arm.moved(&kicked, h)
    }

    /// Velocity Verlet with friction, explicit in the first half kick and implicit in
    /// the second, which keeps order 2 (Brünger, Brooks and Karplus 1984, "Stochastic
    /// boundary conditions for molecular dynamics simulations of ST2 water", Chemical
    /// Physics Letters 105, p. 495, without its noise).
    #[inline(always)]
    fn verlet(&self, target: &A::Target, t: R, y: &State<R, N>, h: R) -> State<R, N> {
        let half = h / R::of(2.0);
        let first = Self::kicked(y, half, &self.arm.slope(target, t, y));
        let mut last = self.arm.moved(&first, h);
        let (slope, c) = (self.arm.slope(target, t + h, &last), self.arm.friction());
        for i in A::POSITION..N {
            let pull = slope[i] + c * last[i];
            last[i] = (last[i] + half * pull) / (R::of(1.0) + half * c);
        }
        last
    }

    #[inline(always)]
    fn rk4(&self, target: &A::Target, t: R, y: &State<R, N>, h: R) -> State<R, N> {
        let half = h / R::of(2.0);
        let first = self.arm.slope(target, t, y);
        let second = self.arm.slope(target, t + half, &along(y, half, &first));
        let third = self.arm.slope(target, t + half, &along(y, half, &second));
        let fourth = self.arm.slope(target, t + h, &along(y, h, &third));
        let two = R::of(2.0);
        let sum = std::array::from_fn(|i| first[i] + two * (second[i] + third[i]) + fourth[i]);
        along(y, h / R::of(6.0), &sum)
    }

    /// `Y = base + g F(t, Y)` by Newton's iteration from `guess`.
    #[inline(always)]
    fn stage(
        &self,
        target: &A::Target,
        t: R,
        base: &State<R, N>,
        guess: &State<R, N>,
        g: R,
    ) -> State<R, N> {
        let mut y = *guess;
        for _ in 0..MOST_ITERATIONS {
            let slope = self.arm.slope(target, t, &y);
            let residual = std::array::from_fn(|i| base[i] + g * slope[i] - y[i]);
            let change = self.arm.solve(target, t, &y, g, &residual);
            y = along(&y, R::of(1.0), &change);
            if A::LINEAR {
                break;
            }
            let size = |all: &State<R, N>| all.iter().fold(R::of(0.0), |most, x| most.max(x.abs()));
            // Asked this way round so that NaN ends it.
            let goes_on = size(&change) > R::NEGLIGIBLE * (R::of(1.0) + size(&y));
            if !goes_on {
                break;
            }
        }
        y
    }

    #[inline(always)]
    fn implicit_euler(&self, target: &A::Target, t: R, y: &State<R, N>, h: R) -> State<R, N> {
        self.stage(target, t + h, y, y, h)
    }

    /// Half a step of implicit Euler to the middle and as far again: the Gauss method
    /// of one stage (Hairer and Wanner 1996, "Solving Ordinary Differential Equations
    /// II", IV.5).
    #[inline(always)]
    fn implicit_midpoint(&self, target: &A::Target, t: R, y: &State<R, N>, h: R) -> State<R, N> {
        let half = h / R::of(2.0);
        let middle = self.stage(target, t + half, y, y, half);
        std::array::from_fn(|i| R::of(2.0) * middle[i] - y[i])
    }

    /// The trapezoidal rule to `t + GAMMA h`, then the backward differentiation formula
    /// of order 2 through both ends (Bank, Coughran, Fichtner, Grosse, Rose and Smith
    /// 1985, "Transient simulation of silicon devices and circuits", IEEE Transactions
    /// on Computer-Aided Design 4, p. 436; Hosea and Shampine 1996, "Analysis and
    /// implementation of TR-BDF2", Applied Numerical Mathematics 20, p. 21).
    #[inline(always)]
    fn tr_bdf2(&self, target: &A::Target, t: R, y: &State<R, N>, h: R) -> State<R, N> {
        let g = R::of(GAMMA / 2.0) * h;
        let trapezoid = along(y, g, &self.arm.slope(target, t, y));
        let middle = self.stage(target, t + R::of(GAMMA) * h, &trapezoid, y, g);
        let newer = R::of(1.0 / (GAMMA * (2.0 - GAMMA)));
        let older = R::of((1.0 - GAMMA) * (1.0 - GAMMA) / (GAMMA * (2.0 - GAMMA)));
        let base = std::array::from_fn(|i| newer * middle[i] - older * y[i]);
        // (1 - gamma)/(2 - gamma) = gamma/2 for this gamma.
        self.stage(target, t + h, &base, &middle, g)
    }

    /// The closed form for the place that the target has at the end of the step.
    #[inline(always)]
    fn held(&self, target: &A::Target, t: R, y: &State<R, N>, h: R) -> State<R, N> {
        self.arm.closed(&A::held(target, t + h), t, y, h)
    }
}

#[cfg(test)]
mod tests {
    use super::super::course::{Frame, FrameTimes, Way, frames, linear_way, samples, way};
    use super::super::linear::Linear;
    use super::super::problem::Samples;
    use super::super::turning::Turning;
    use super::*;

    /// Largest errors in a second of steady frames at such rates, one step per frame,
    /// from a way.
    fn errors<A: Arm<f64, N>, const N: usize>(
        method: &Method,
        rates: [f64; 2],
        way: impl Fn(&[Frame]) -> Way<N>,
    ) -> [f64; 2] {
        rates.map(|rate| {
            let frames = frames(rate, FrameTimes::Steady, 1.0);
            let told = |frame| A::target(&samples::<A, N>(frame, method.information), 1.0 / rate);
            let targets: Vec<_> = frames.iter().map(|f| (told(f), f.seconds)).collect();
            let way = way(&frames).states;
            let (mut worst, mut wanted) = (0.0f64, way.iter());
            // Any error is good enough: each frame is one step of the pairs, too.
            let effort = match method.efforts[0] {
                Effort::Tolerance(_) => Effort::Tolerance(1e9),
                fixed => fixed,
            };
            let arm = A::new(20.0);
            let keep = |y, _| {
                let apart = wanted.next().map(|wanted| A::apart(&y, wanted)[0]);
                worst = worst.max(apart.unwrap_or(f64::NAN));
            };
            follow(&arm, &targets, method.scheme, effort, A::start(), keep);
            worst
        })
    }

    #[test]
    fn every_method_converges_at_its_order_on_a_linear_arm() {
        for method in METHODS {
            let told = |frames: &[_]| linear_way(20.0, frames, Some(method.information));
            let [coarse, fine] = errors::<Linear<f64>, 2>(method, [32.0, 64.0], told);
            if method.scheme == Scheme::Closed {
                assert!(
                    coarse.max(fine) < 1e-14,
                    "{}: {coarse:e} {fine:e}",
                    method.name
                );
                continue;
            }
            let order = (coarse / fine).log2();
            let wanted = f64::from(method.order);
            assert!((order - wanted).abs() < 0.3, "{}: {order}", method.name);
        }
    }

    #[test]
    fn every_method_converges_at_its_order_on_a_turning_arm() {
        for method in METHODS {
            let told =
                |frames: &[_]| way::<Turning<f64>, 7>(20.0, frames, Some(method.information));
            let [coarse, fine] = errors::<Turning<f64>, 7>(method, [32.0, 64.0], told);
            let (order, wanted) = ((coarse / fine).log2(), f64::from(method.order));
            assert!((order - wanted).abs() < 0.4, "{}: {order}", method.name);
        }
    }

    /// One step of a very stiff arm whose target rests: L-stable methods are at it,
    /// the midpoint rule is as far beyond it, and explicit ones are far away.
    #[test]
    fn one_stiff_step_tells_l_stable_from_a_stable_and_explicit() {
        let rest = Samples {
            start: 0.0,
            middle: None,
            end: 0.0,
        };
        for method in METHODS {
            if matches!(method.efforts[0], Effort::Tolerance(_)) {
                continue;
            }
            let arm = Linear::<f64>::new(1e12);
            let frames = [(Linear::<f64>::target(&rest, 0.1), 0.1)];
            let mut end = [1.0, 0.0];
            follow(&arm, &frames, method.scheme, ONE[0], end, |y, _| end = y);
            let left = end[0].abs();
            match method.scheme {
                Scheme::ImplicitEuler | Scheme::TrBdf2 | Scheme::Held | Scheme::Closed => {
                    assert!(left < 1e-4, "{}: {left:e}", method.name);
                }
                Scheme::ImplicitMidpoint => assert!((left - 1.0).abs() < 1e-4, "{left:e}"),
                // The first Euler step leaves the position and kicks the velocity.
                Scheme::ExplicitEuler => assert!(end[1].abs() > 1e10, "{end:?}"),
                _ => assert!(left > 1e6, "{}: {left:e}", method.name),
            }
        }
    }
}
