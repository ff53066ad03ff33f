//! The linear arm: `x'' = k (T - x) - 2 omega x'` on a line, critically damped,
//! behind a target at `sin t`. It begins one away from its target, so that both the
//! way in and the steady chase count.

use super::super::oscillator::{Spring, times};
use super::super::real::Real;
use super::problem::{Arm, Course, Samples, State, parabola};

#[derive(Clone, Copy, Debug)]
pub struct Linear<R> {
    pub spring: Spring<R>,
    pub friction: R,
}

/// Place, speed and half the acceleration of a target.
#[derive(Clone, Copy, Debug)]
pub struct Line<R> {
    pub base: R,
    pub speed: R,
    pub bend: R,
}

impl<R: Real> Line<R> {
    /// Through samples of a number.
    pub fn through(samples: &Samples<f64>, seconds: f64) -> Line<R> {
        // Samples come as R: what they lose is lost to every method.
        let rounded = |place: f64| R::of(place).wide();
        let base = rounded(samples.start);
        let middle = samples.middle.map(|middle| rounded(middle) - base);
        let [speed, bend] = parabola(middle, rounded(samples.end) - base, seconds);
        Line {
            base: R::of(base),
            speed: R::of(speed),
            bend: R::of(bend),
        }
    }

    #[inline(always)]
    pub fn place(&self, t: R) -> R {
        self.base + t * (self.speed + t * self.bend)
    }

    pub fn held(&self, seconds: R) -> Line<R> {
        Line {
            base: self.place(seconds),
            speed: R::of(0.0),
            bend: R::of(0.0),
        }
    }

    /// The exact chase of this target from `t` on.
    pub fn chased(&self, spring: &Spring<R>, t: R, [x, v]: [R; 2], h: R) -> [R; 2] {
        let acceleration = R::of(2.0) * self.bend;
        let steady = |t: R| {
            let speed = self.speed + t * acceleration;
            spring.steady(self.place(t), speed, acceleration)
        };
        let (from, to) = (steady(t), steady(t + h));
        let [x, v] = times(spring.transition(h), [x - from[0], v - from[1]]);
        [to[0] + x, to[1] + v]
    }
}

/// Friction of a critically damped spring.
pub fn critical<R: Real>(stiffness: f64) -> R {
    R::of(2.0 * stiffness.sqrt())
}

impl<R> Course<2> for Linear<R> {
    type Place = f64;
    const POSITION: usize = 1;

    fn at(t: f64) -> f64 {
        libm::sin(t)
    }

    fn start() -> [f64; 2] {
        [1.0, 0.0]
    }

    fn apart(a: &[f64; 2], b: &[f64; 2]) -> [f64; 2] {
        [(a[0] - b[0]).abs(), (a[1] - b[1]).abs()]
    }
}

impl<R: Real> Arm<R, 2> for Linear<R> {
    type Target = Line<R>;
    const LINEAR: bool = true;

    fn new(stiffness: f64) -> Self {
        Linear {
            spring: Spring {
                stiffness: R::of(stiffness),
                damping_ratio: R::of(1.0),
            },
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
        [
            v,
            self.spring.stiffness * (target.place(t) - x) - self.friction * v,
        ]
    }

    #[inline(always)]
    fn moved(&self, &[x, v]: &State<R, 2>, h: R) -> State<R, 2> {
        [x + h * v, v]
    }

    #[inline(always)]
    fn solve(
        &self,
        _: &Line<R>,
        _: R,
        _: &State<R, 2>,
        g: R,
        residual: &State<R, 2>,
    ) -> State<R, 2> {
        eliminated(self.spring.stiffness, self.friction, g, residual)
    }

    fn closed(&self, target: &Line<R>, t: R, y: &State<R, 2>, h: R) -> State<R, 2> {
        target.chased(&self.spring, t, *y, h)
    }
}

/// `(I - g J)^-1 residual` for `x' = v`, `v' = -k x - c v`.
#[inline(always)]
pub fn eliminated<R: Real>(k: R, c: R, g: R, &[x, v]: &[R; 2]) -> [R; 2] {
    let v = (v - g * k * x) / (R::of(1.0) + g * (c + g * k));
    [x + g * v, v]
}
