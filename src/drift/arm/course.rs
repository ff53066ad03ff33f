//! The frames of a run: how long each one takes, and where a target is in them; the
//! arm's true way, and its way behind what methods are told of the target.

use super::exponential::{Chase, Double, Law};
use super::extrapolation::Reference;
use super::linear::{Line, Linear};
use super::methods::Information;
use super::problem::{Arm, Course, Samples};

named! {
    /// How long frames take.
    #[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Serialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum FrameTimes {
        /// All the same.
        Steady = "steady",
        /// 30 % more or less, and every fiftieth four times as long.
        Jittered = "jittered",
    }
}

/// Largest change of a jittered frame.
const JITTER: f64 = 0.3;
/// Every so many-th frame is a hitch, and so many times as long.
const HITCH: (usize, f64) = (50, 4.0);
/// The fractional parts of its multiples are spread evenly (Weyl).
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// One frame.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Frame {
    pub start: f64,
    pub seconds: f64,
}

impl Frame {
    fn end(&self) -> f64 {
        self.start + self.seconds
    }
}

/// Frames until `seconds` are over.
pub fn frames(rate_hz: f64, times: FrameTimes, seconds: f64) -> Vec<Frame> {
    let mut all: Vec<Frame> = Vec::new();
    let mut start = 0.0;
    while start < seconds * (1.0 - 1e-9) {
        let n = all.len() + 1;
        let share = match times {
            FrameTimes::Steady => 1.0,
            FrameTimes::Jittered if n.is_multiple_of(HITCH.0) => HITCH.1,
            FrameTimes::Jittered => 1.0 - JITTER + 2.0 * JITTER * (n as f64 * GOLDEN).fract(),
        };
        let frame = Frame {
            start,
            seconds: share / rate_hz,
        };
        start = frame.end();
        all.push(frame);
    }
    all
}

/// Where the target is in a frame, as far as a method is told.
pub fn samples<C: Course<N>, const N: usize>(
    frame: &Frame,
    information: Information,
) -> Samples<C::Place> {
    let middle = match information {
        Information::FrameEnds => None,
        Information::Midpoints => Some(C::at(frame.start + frame.seconds / 2.0)),
    };
    Samples {
        start: C::at(frame.start),
        middle,
        end: C::at(frame.end()),
    }
}

/// The states at the end of every frame.
pub struct Way<const N: usize> {
    pub states: Vec<[f64; N]>,
    /// Bound of what these are off.
    pub error: f64,
}

/// The arm behind its target, or behind what `information` says of it.
pub fn way<A: Arm<f64, N>, const N: usize>(
    stiffness: f64,
    frames: &[Frame],
    information: Option<Information>,
) -> Way<N> {
    let arm = A::new(stiffness);
    let mut reference = Reference::new(A::start(), A::POSITION, stiffness.sqrt(), A::STOP);
    let mut states = Vec::with_capacity(frames.len());
    for frame in frames {
        match information {
            None => {
                let f = |t: f64, y: &[f64; N]| {
                    let place = A::at(t);
                    let target = A::target(
                        &Samples {
                            start: place,
                            middle: None,
                            end: place,
                        },
                        1.0,
                    );
                    arm.slope(&target, 0.0, y)
                };
                reference.follow(&f, frame.start, frame.end());
            }
            Some(information) => {
                let told = samples::<A, N>(frame, information);
                let target = A::target(&told, frame.seconds);
                let f = |t: f64, y: &[f64; N]| arm.slope(&target, t, y);
                reference.follow(&f, 0.0, frame.seconds);
            }
        }
        states.push(reference.y);
    }
    Way {
        states,
        error: reference.error.max(ROUNDING),
    }
}

/// What rounding leaves of such a way: two references differ by less.
const ROUNDING: f64 = 1e-12;

/// Bound of the rounding of a step in double-double arithmetic, far below what a
/// double can say.
const DOUBLED: f64 = 1e-25;

/// The same of the linear arm, by the matrix exponential.
pub fn linear_way(stiffness: f64, frames: &[Frame], information: Option<Information>) -> Way<2> {
    let law = match information {
        None => Law::Sine,
        Some(_) => Law::Parabola,
    };
    let mut chase = Chase::new(stiffness, law);
    let mut arm = Linear::<f64>::start().map(Double::from);
    // sin and its derivatives at zero.
    let mut target = [0.0, 1.0, 0.0].map(Double::from);
    let mut states = Vec::with_capacity(frames.len());
    for frame in frames {
        if let Some(information) = information {
            let told = samples::<Linear<f64>, 2>(frame, information);
            let line = Line::<f64>::through(&told, frame.seconds);
            target = [line.base, line.speed, 2.0 * line.bend].map(Double::from);
        }
        (arm, target) = chase.step(arm, target, frame.seconds);
        states.push(arm.map(f64::from));
    }
    Way {
        states,
        error: DOUBLED * frames.len() as f64,
    }
}
