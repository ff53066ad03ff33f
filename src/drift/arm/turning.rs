//! The turning arm: an orientation on a torsional spring, `w' = k log(T q^-1) -
//! 2 omega w` with unit inertia, behind a target that yaws and pitches. A state is a
//! unit quaternion (scalar first) and the angular velocity in the world.

use super::super::oscillator::{Spring, times};
use super::super::real::Real;
use super::linear::{critical, eliminated};
use super::problem::{Arm, Course, Samples, State, parabola};

type Quaternion<R> = [R; 4];

/// Hamilton's product.
#[inline(always)]
fn product<R: Real>(a: &Quaternion<R>, b: &Quaternion<R>) -> Quaternion<R> {
    let ([a, b, c, d], [e, f, g, h]) = (*a, *b);
    [
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    ]
}

#[inline(always)]
fn conjugate<R: Real>(&[w, x, y, z]: &Quaternion<R>) -> Quaternion<R> {
    [w, -x, -y, -z]
}

#[inline(always)]
fn length<R: Real>([x, y, z]: [R; 3]) -> R {
    (x * x + y * y + z * z).sqrt()
}

/// The turn by a rotation vector.
#[inline(always)]
fn exp<R: Real>(turn: [R; 3]) -> Quaternion<R> {
    let half = length(turn) / R::of(2.0);
    // sin(half)/half, 1 to the last digit where it cannot be divided.
    let share = match half > R::of(1e-9) {
        true => half.sin() / half,
        false => R::of(1.0),
    };
    let [x, y, z] = turn.map(|entry| entry * share / R::of(2.0));
    [half.cos(), x, y, z]
}

/// The rotation vector of a quaternion of any length, the shorter way round.
#[inline(always)]
fn log<R: Real>(&[w, x, y, z]: &Quaternion<R>) -> [R; 3] {
    let sign = if w < R::of(0.0) {
        -R::of(1.0)
    } else {
        R::of(1.0)
    };
    let axis = [x * sign, y * sign, z * sign];
    let (sin, cos) = (length(axis), w * sign);
    let share = match sin > R::of(1e-9) * cos {
        true => R::of(2.0) * sin.atan2(cos) / sin,
        false => R::of(2.0) / cos,
    };
    axis.map(|entry| entry * share)
}

#[inline(always)]
fn cross<R: Real>([a, b, c]: [R; 3], [d, e, f]: [R; 3]) -> [R; 3] {
    [b * f - c * e, c * d - a * f, a * e - b * d]
}

/// A vector turned by a quaternion of length one.
fn rotated<R: Real>(q: &Quaternion<R>, [x, y, z]: [R; 3]) -> [R; 3] {
    let turned = product(&product(q, &[R::of(0.0), x, y, z]), &conjugate(q));
    [turned[1], turned[2], turned[3]]
}

/// The rate at which a rotation vector d changes while `exp(d)` has the angular velocity
/// w (Iserles, Munthe-Kaas, Nørsett and Zanna 2000, "Lie-group methods", Acta Numerica
/// 9, p. 215, app. B): `w - d x w/2 + (1 - a/2 cot(a/2))/a^2 d x (d x w)`.
fn dexp_inverse<R: Real>(d: [R; 3], w: [R; 3]) -> [R; 3] {
    let angle = length(d);
    let (one, square) = (R::of(1.0), angle * angle);
    let half = angle / R::of(2.0);
    let second = match angle > R::of(0.1) {
        true => (one - half * half.cos() / half.sin()) / square,
        false => R::of(1.0 / 12.0) + square * (R::of(1.0 / 720.0) + square * R::of(1.0 / 30240.0)),
    };
    let once = cross(d, w);
    let twice = cross(d, once);
    std::array::from_fn(|i| w[i] - R::of(0.5) * once[i] + second * twice[i])
}

#[inline(always)]
fn parts<R: Real>(&[w, x, y, z, ..]: &State<R, 7>) -> Quaternion<R> {
    [w, x, y, z]
}

#[inline(always)]
fn velocity<R: Real>(&[_, _, _, _, x, y, z]: &State<R, 7>) -> [R; 3] {
    [x, y, z]
}

#[inline(always)]
fn state<R: Real>([w, x, y, z]: Quaternion<R>, [a, b, c]: [R; 3]) -> State<R, 7> {
    [w, x, y, z, a, b, c]
}

/// `q'` of an orientation with an angular velocity.
#[inline(always)]
fn turned_by<R: Real>([x, y, z]: [R; 3], q: &Quaternion<R>) -> Quaternion<R> {
    let half = R::of(0.5);
    product(&[R::of(0.0), half * x, half * y, half * z], q)
}

#[derive(Clone, Copy, Debug)]
pub struct Turning<R> {
    spring: Spring<R>,
    friction: R,
}

/// The target `exp(t speed + t^2 bend) base`.
#[derive(Clone, Copy, Debug)]
pub struct Swing<R> {
    base: Quaternion<R>,
    speed: [R; 3],
    bend: [R; 3],
}

impl<R: Real> Swing<R> {
    #[inline(always)]
    fn place(&self, t: R) -> Quaternion<R> {
        let turn = std::array::from_fn(|i| t * (self.speed[i] + t * self.bend[i]));
        product(&exp(turn), &self.base)
    }
}

impl<R> Course<7> for Turning<R> {
    type Place = Quaternion<f64>;
    const POSITION: usize = 4;

    /// Yaw by `sin t` and pitch by `sin(1.7 t)/2`: no fixed axis.
    fn at(t: f64) -> Quaternion<f64> {
        let yaw = exp([0.0, libm::sin(t), 0.0]);
        product(&yaw, &exp([libm::sin(1.7 * t) / 2.0, 0.0, 0.0]))
    }

    /// One radian away from the target, about a slanted axis.
    fn start() -> State<f64, 7> {
        state(exp([0.6, 0.0, 0.8]), [0.0; 3])
    }

    fn apart(a: &State<f64, 7>, b: &State<f64, 7>) -> [f64; 2] {
        let between = log(&product(&parts(a), &conjugate(&parts(b))));
        let speed = std::array::from_fn(|i| a[4 + i] - b[4 + i]);
        [length(between), length(speed)]
    }
}

impl<R: Real> Arm<R, 7> for Turning<R> {
    type Target = Swing<R>;
    const LINEAR: bool = false;

    fn new(stiffness: f64) -> Self {
        Turning {
            spring: Spring {
                stiffness: R::of(stiffness),
                damping_ratio: R::of(1.0),
            },
            friction: critical(stiffness),
        }
    }

    fn target(samples: &Samples<Quaternion<f64>>, seconds: f64) -> Swing<R> {
        // Samples come as R: what they lose is lost to every method.
        let rounded = |q: &Quaternion<f64>| q.map(|entry| R::of(entry).wide());
        let base = rounded(&samples.start);
        let since = |q: &Quaternion<f64>| log(&product(&rounded(q), &conjugate(&base)));
        let (middle, end) = (samples.middle.as_ref().map(since), since(&samples.end));
        let axis = |i: usize| parabola(middle.map(|turn| turn[i]), end[i], seconds);
        Swing {
            base: base.map(R::of),
            speed: std::array::from_fn(|i| R::of(axis(i)[0])),
            bend: std::array::from_fn(|i| R::of(axis(i)[1])),
        }
    }

    fn held(target: &Swing<R>, seconds: R) -> Swing<R> {
        Swing {
            base: target.place(seconds),
            speed: [R::of(0.0); 3],
            bend: [R::of(0.0); 3],
        }
    }

    fn friction(&self) -> R {
        self.friction
    }

    #[inline(always)]
    fn slope(&self, target: &Swing<R>, t: R, y: &State<R, 7>) -> State<R, 7> {
        let (q, w) = (parts(y), velocity(y));
        let stretch = log(&product(&target.place(t), &conjugate(&q)));
        let pull = |i: usize| self.spring.stiffness * stretch[i] - self.friction * w[i];
        state(turned_by(w, &q), std::array::from_fn(pull))
    }

    #[inline(always)]
    fn moved(&self, y: &State<R, 7>, h: R) -> State<R, 7> {
        let (q, w) = (parts(y), velocity(y));
        state(product(&exp(w.map(|entry| entry * h)), &q), w)
    }

    /// Each axis as a linear arm of its own: right up to the curvature of the
    /// rotations, so that the iteration converges fast where the arm is close.
    #[inline(always)]
    fn solve(
        &self,
        _: &Swing<R>,
        _: R,
        y: &State<R, 7>,
        g: R,
        residual: &State<R, 7>,
    ) -> State<R, 7> {
        let q = parts(y);
        let [along, x, y, z] = product(&parts(residual), &conjugate(&q));
        let two = R::of(2.0);
        let turn = [two * x, two * y, two * z];
        let rest = velocity(residual);
        let solved: [[R; 2]; 3] = std::array::from_fn(|i| {
            eliminated(self.spring.stiffness, self.friction, g, &[turn[i], rest[i]])
        });
        let [x, y, z] = solved.map(|[turn, _]| turn / two);
        state(product(&[along, x, y, z], &q), solved.map(|[_, w]| w))
    }

    /// The stretch d, `q = exp(d) T`, and the angular velocity: `w' = -k d - 2 omega w`
    /// is linear in both; `d' = dexp^-1(w - R(d) w_T)` is `w` and a rest, which is frozen.
    /// Exact while target and arm turn about one axis, of order 1 otherwise. With `d' =
    /// w - w_T` instead no step, however small, would lead to the solution.
    fn closed(&self, target: &Swing<R>, t: R, y: &State<R, 7>, h: R) -> State<R, 7> {
        let (q, w) = (parts(y), velocity(y));
        let bent = target.bend.map(|bend| R::of(2.0) * bend);
        let speed = std::array::from_fn(|i| target.speed[i] + t * bent[i]);
        let stretch = log(&product(&q, &conjugate(&target.place(t))));
        let seen = rotated(&exp(stretch), speed);
        let rate = dexp_inverse(stretch, std::array::from_fn(|i| w[i] - seen[i]));
        let transition = self.spring.transition(h);
        let axis = |i: usize| {
            let speed = w[i] - rate[i];
            let steady = |speed: R| self.spring.steady(R::of(0.0), speed, bent[i]);
            let (from, to) = (steady(speed), steady(speed + h * bent[i]));
            let rest = times(transition, [stretch[i] - from[0], w[i] - from[1]]);
            [rest[0] + to[0], rest[1] + to[1]]
        };
        let solved: [[R; 2]; 3] = std::array::from_fn(axis);
        let turn = exp(solved.map(|[turn, _]| turn));
        let q = product(&turn, &target.place(t + h));
        state(q, solved.map(|[_, w]| w))
    }

    #[inline(always)]
    fn settled(&self, y: State<R, 7>) -> State<R, 7> {
        let q = parts(&y);
        let [a, b, c, d] = q;
        let scale = R::of(1.0) / (a * a + b * b + c * c + d * d).sqrt();
        state(q.map(|entry| entry * scale), velocity(&y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const D: [f64; 3] = [0.4, -0.7, 0.2];
    const V: [f64; 3] = [-0.3, 0.5, 1.1];

    #[test]
    fn rotation_vectors_come_back() {
        for scale in [1e-12, 1e-6, 1.0, 3.5] {
            let d = D.map(|entry| entry * scale);
            let back = log(&exp(d).map(|entry| entry * 2.5));
            let apart: [f64; 3] = std::array::from_fn(|i| back[i] - d[i]);
            assert!(length(apart) < 1e-15 * scale.max(1.0), "{scale}: {back:?}");
        }
        // The other quaternion of the same turn.
        assert!(log(&exp([0.0, 0.0, 4.0]))[2] < -2.2);
    }

    #[test]
    fn the_rate_of_a_rotation_vector_is_that_of_central_differences() {
        for scale in [0.01, 0.12, 1.0, 3.0] {
            let d = D.map(|entry| entry * scale);
            let h = 1e-5;
            let at = |t: f64| exp(std::array::from_fn(|i| d[i] + t * V[i]));
            let between = log(&product(&at(h), &conjugate(&at(-h))));
            let w = between.map(|turn| turn / (2.0 * h));
            let found = dexp_inverse(d, w);
            for i in 0..3 {
                assert!((found[i] - V[i]).abs() < 1e-9, "{scale}: {found:?}");
            }
        }
    }

    #[test]
    fn slopes_are_what_states_change_by() {
        // The arm chases its target: pulled along the shorter way, braked.
        let arm = Turning::<f64>::new(9.0);
        let rest = Turning::<f64>::target(
            &Samples {
                start: exp([0.0, 0.5, 0.0]),
                middle: None,
                end: exp([0.0, 0.5, 0.0]),
            },
            1.0,
        );
        let y = state(exp([0.0, 0.2, 0.0]), [0.0, 1.0, 0.0]);
        let slope = arm.slope(&rest, 0.0, &y);
        // k 0.3 - 2 omega w.
        assert!((slope[5] - (9.0 * 0.3 - 6.0)).abs() < 1e-14, "{slope:?}");
        let moved = arm.moved(&y, 0.1);
        assert!((log(&parts(&moved))[1] - 0.3).abs() < 1e-15);
        let ahead = arm.settled(std::array::from_fn(|i| y[i] + 1e-6 * slope[i]));
        assert!((log(&parts(&ahead))[1] - 0.2 - 1e-6).abs() < 1e-12);
    }
}
