//! The collision-limited arm: a spring that grows stiffer as it is stretched
//! (Duffing's `k d (1 + d^2)`), against a stop that takes all velocity into it.
//! Neither is solved by a closed form; the stop makes velocity jump.

use super::super::oscillator::Spring;
use super::super::real::Real;
use super::linear::{Line, critical, eliminated};
use super::problem::{Arm, Course, Samples, State};

/// No further than this: the target goes to one.
const STOP: f64 = 0.6;

#[derive(Clone, Copy, Debug)]
pub struct Limited<R> {
    stiffness: R,
    friction: R,
}

impl<R> Course<2> for Limited<R> {
    type Place = f64;
    const POSITION: usize = 1;
    const STOP: Option<f64> = Some(STOP);

    fn at(t: f64) -> f64 {
        libm::sin(t)
    }

    fn start() -> [f64; 2] {
        [-1.0, 0.0]
    }

    fn apart(a: &[f64; 2], b: &[f64; 2]) -> [f64; 2] {
        [(a[0] - b[0]).abs(), (a[1] - b[1]).abs()]
    }
}

impl<R: Real> Arm<R, 2> for Limited<R> {
    type Target = Line<R>;
    const LINEAR: bool = false;

    fn new(stiffness: f64) -> Self {
        Limited {
            stiffness: R::of(stiffness),
            friction: critical(stiffness),
        }
    }

    fn target(samples: &Samples<f64>, seconds: f64) -> Line<R> {
        Line::through(samples, seconds)
    }

    fn held(target: &Line<R>, seconds: R) -> Line<R> {
        target.held(seconds)
    }

    fn friction(&self) -> R {
        self.friction
    }

    #[inline(always)]
    fn slope(&self, target: &Line<R>, t: R, &[x, v]: &State<R, 2>) -> State<R, 2> {
        let stretch = target.place(t) - x;
        let pull = self.stiffness * stretch * (R::of(1.0) + stretch * stretch);
        [v, pull - self.friction * v]
    }

    #[inline(always)]
    fn moved(&self, &[x, v]: &State<R, 2>, h: R) -> State<R, 2> {
        [x + h * v, v]
    }

    #[inline(always)]
    fn solve(
        &self,
        target: &Line<R>,
        t: R,
        y: &State<R, 2>,
        g: R,
        residual: &State<R, 2>,
    ) -> State<R, 2> {
        let stretch = target.place(t) - y[0];
        let tangent = self.stiffness * (R::of(1.0) + R::of(3.0) * stretch * stretch);
        eliminated(tangent, self.friction, g, residual)
    }

    fn closed(&self, target: &Line<R>, t: R, y: &State<R, 2>, h: R) -> State<R, 2> {
        let stretch = target.place(t) - y[0];
        let secant = self.stiffness * (R::of(1.0) + stretch * stretch);
        let spring = Spring {
            stiffness: secant,
            damping_ratio: self.friction / (R::of(2.0) * secant.sqrt()),
        };
        target.chased(&spring, t, *y, h)
    }

    #[inline(always)]
    fn settled(&self, [x, v]: State<R, 2>) -> State<R, 2> {
        let stop = R::of(STOP);
        match x >= stop {
            true => [stop, v.min(R::of(0.0))],
            false => [x, v],
        }
    }
}
