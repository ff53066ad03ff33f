//! The study: every method with every effort in both precisions, on every arm,
//! stiffness and frame rate, with its errors. How long each takes is timed in
//! `timing`, what follows is in `choice`.

use serde::Serialize;

use super::super::real::Real;
use super::course::{Frame, FrameTimes, Way, frames, linear_way, samples, way};
use super::limited::Limited;
use super::linear::Linear;
use super::methods::{Effort, Information, METHODS, Method, Scheme, follow};
use super::problem::Arm;
use super::turning::Turning;

named! {
    /// What the camera hangs on.
    #[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum ArmKind, ARMS {
        Linear = "linear", "a spring on a line behind sin t";
        Collision = "collision", "a spring that stiffens as it is stretched, and a stop at 0.6 that takes all velocity";
        Quaternion = "quaternion", "an orientation on a torsional spring behind a target that yaws and pitches";
    }
}

/// What is to be studied.
#[derive(Clone, PartialEq, Debug)]
pub struct ArmOptions {
    /// Kinds of arm, each with every stiffness and rate.
    pub arms: Vec<ArmKind>,
    /// k in 1/s^2.
    pub stiffnesses: Vec<f64>,
    /// Frames per second.
    pub rates_hz: Vec<f64>,
    /// Simulated time that errors are the maxima of.
    pub seconds: f64,
    /// What a recommended method's position may be off.
    pub tolerance: f64,
}

/// An arm at a frame rate.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Setting {
    /// The kind of arm.
    pub arm: ArmKind,
    /// k in 1/s^2, critically damped.
    pub stiffness: f64,
    /// Frames per second.
    pub rate_hz: f64,
    /// sqrt(k) in units of the frame rate: how stiff the arm is to a frame.
    pub omega_h: f64,
}

/// One method with one effort on one arm.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct ArmPoint {
    /// The arm and its frame rate.
    #[serde(flatten)]
    pub setting: Setting,
    /// Whether frames are evenly spaced.
    pub frame_times: FrameTimes,
    /// Name of the method.
    pub method: &'static str,
    /// What a step is told of the target's way.
    pub information: Information,
    /// The numbers that steps are computed in.
    pub arithmetic: &'static str,
    /// Equal steps per frame; null for methods that choose their own.
    pub substeps: Option<u32>,
    /// What these keep a step's error below.
    pub step_tolerance: Option<f64>,
    /// Mean over the frames.
    pub steps_per_frame: f64,
    /// Largest over the ends of all frames, from the arm's true way: a length, or
    /// radians; null if it blew up.
    pub position_error: Option<f64>,
    /// The same of the velocity, per second.
    pub velocity_error: Option<f64>,
    /// From the exact answer to what the method was told of the target: its own
    /// share of `position_error`.
    pub own_error: Option<f64>,
    /// By how many powers of the step `own_error` fell from the effort before; null
    /// without one, and where it is rounding alone.
    pub observed_order: Option<f64>,
    /// That order is half a power or more below the method's classical one.
    pub order_reduced: bool,
    /// Thread CPU time per simulated second, with its 95 % interval; null where it
    /// is not timed (steady frames, and what blew up) or has no interval.
    pub us_per_second: Option<f64>,
    /// Lower end of the interval.
    pub us_per_second_lower: Option<f64>,
    /// Upper end of the interval.
    pub us_per_second_upper: Option<f64>,
    /// Another point of the setting that is no worse in position or time and better
    /// in one.
    pub dominated_by: Option<String>,
    /// It is dominated, but by times that the processes do not tell apart.
    pub is_tie: bool,
    /// Timed, told of frame ends alone, and not dominated.
    pub on_front: bool,
}

impl ArmPoint {
    /// As it is named in sentences: "rk4 x4 f32".
    pub fn label(&self) -> String {
        let effort = match (self.substeps, self.step_tolerance) {
            (Some(1), _) => String::new(),
            (Some(count), _) => format!(" x{count}"),
            (None, Some(tolerance)) => format!(" at {tolerance:e}"),
            (None, None) => String::new(),
        };
        format!("{}{effort} {}", self.method, self.arithmetic)
    }
}

/// How far the exact answer to what methods are told is from the arm's true way.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct InformationError {
    /// The arm and its frame rate.
    #[serde(flatten)]
    pub setting: Setting,
    /// Whether frames are evenly spaced.
    pub frame_times: FrameTimes,
    /// What a step is told of the target's way.
    pub information: Information,
    /// Largest over the ends of all frames.
    pub position_error: f64,
    /// The same of the velocity.
    pub velocity_error: f64,
    /// Bound of what the references themselves are off, by their own estimate.
    pub reference_error: f64,
}

/// A method with an effort, in one precision.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    pub setting: Setting,
    pub frame_times: FrameTimes,
    pub method: &'static Method,
    pub effort: Effort,
    pub is_single: bool,
}

/// Every arm, stiffness and rate.
pub fn settings(options: &ArmOptions) -> Vec<Setting> {
    let of = |arm: ArmKind| {
        let stiffnesses = options.stiffnesses.iter();
        stiffnesses.flat_map(move |&stiffness| {
            options.rates_hz.iter().map(move |&rate_hz| Setting {
                arm,
                stiffness,
                rate_hz,
                omega_h: stiffness.sqrt() / rate_hz,
            })
        })
    };
    options.arms.iter().copied().flat_map(of).collect()
}

/// Most steps per frame of the arm whose steps are dear.
const MOST_TURNING: u32 = 16;

/// The efforts that make a difference on an arm.
fn efforts(arm: ArmKind, method: &Method) -> impl Iterator<Item = Effort> {
    let is_exact = arm == ArmKind::Linear && method.scheme == Scheme::Closed;
    method
        .efforts
        .iter()
        .copied()
        .filter(move |effort| match effort {
            Effort::Substeps(1) | Effort::Tolerance(_) => true,
            Effort::Substeps(count) => {
                !is_exact && (arm != ArmKind::Quaternion || *count <= MOST_TURNING)
            }
        })
}

/// All points of a setting, in the order of their efforts.
pub fn keys(setting: Setting) -> Vec<Key> {
    let mut all = Vec::new();
    for frame_times in FrameTimes::ALL {
        for is_single in [false, true] {
            for method in METHODS {
                all.extend(efforts(setting.arm, method).map(|effort| Key {
                    setting,
                    frame_times,
                    method,
                    effort,
                    is_single,
                }));
            }
        }
    }
    all
}

/// The errors of all points of a setting, and of what they are told.
pub fn errors(setting: Setting, seconds: f64) -> (Vec<ArmPoint>, Vec<InformationError>) {
    match setting.arm {
        ArmKind::Linear => judged::<Linear<f64>, Linear<f32>, 2>(setting, seconds, linear_way),
        ArmKind::Collision => {
            judged::<Limited<f64>, Limited<f32>, 2>(setting, seconds, way::<Limited<f64>, 2>)
        }
        ArmKind::Quaternion => {
            judged::<Turning<f64>, Turning<f32>, 7>(setting, seconds, way::<Turning<f64>, 7>)
        }
    }
}

/// The true way of an arm, or the one behind what a method is told.
type WayOf<const N: usize> = fn(f64, &[Frame], Option<Information>) -> Way<N>;

fn judged<A: Arm<f64, N>, B: Arm<f32, N>, const N: usize>(
    setting: Setting,
    seconds: f64,
    way: WayOf<N>,
) -> (Vec<ArmPoint>, Vec<InformationError>) {
    let (mut points, mut told): (Vec<ArmPoint>, Vec<InformationError>) = Default::default();
    let keys = keys(setting);
    for frame_times in FrameTimes::ALL {
        let frames = frames(setting.rate_hz, frame_times, seconds);
        let way = |information| way(setting.stiffness, &frames, information);
        let (truth, ways) = (way(None), Information::ALL.map(|told| way(Some(told))));
        for key in keys.iter().filter(|key| key.frame_times == frame_times) {
            let run = match key.is_single {
                true => run::<B, f32, N>(key, &frames),
                false => run::<A, f64, N>(key, &frames),
            };
            let from = |way| run.states.as_ref().map(|own| largest::<A, N>(own, way));
            let own = from(&ways[key.method.information as usize]);
            let mut point = key.point(from(&truth), own, run.steps_per_frame);
            if let Some(last) = points.last() {
                point.compare(last, key.method.order);
            }
            points.push(point);
        }
        told.extend(
            Information::ALL
                .into_iter()
                .zip(&ways)
                .map(|(information, way)| {
                    let [position_error, velocity_error] = largest::<A, N>(&way.states, &truth);
                    InformationError {
                        setting,
                        frame_times,
                        information,
                        position_error,
                        velocity_error,
                        reference_error: truth.error.max(way.error),
                    }
                }),
        );
    }
    (points, told)
}

/// Largest distances at the ends of all frames.
fn largest<A: Arm<f64, N>, const N: usize>(states: &[[f64; N]], from: &Way<N>) -> [f64; 2] {
    let pairs = states.iter().zip(&from.states);
    pairs.fold([0.0, 0.0], |most: [f64; 2], (a, b)| {
        let apart = A::apart(a, b);
        [most[0].max(apart[0]), most[1].max(apart[1])]
    })
}

/// Where a method has led.
struct Run<const N: usize> {
    /// At the ends of all frames; `None` after a blow-up.
    states: Option<Vec<[f64; N]>>,
    steps_per_frame: f64,
}

/// A state that is so many times as large as anything the arm should do has blown up.
const BLOWN_UP: f64 = 1e3;

fn run<A: Arm<R, N>, R: Real, const N: usize>(key: &Key, frames: &[Frame]) -> Run<N> {
    let follower = Follower::<A, R, N>::new(key, frames);
    let largest = BLOWN_UP * key.setting.stiffness.sqrt().max(1.0);
    let (mut states, mut all_steps, mut is_sound) = (Vec::new(), 0.0, true);
    follower.follow(|y, steps| {
        let y = y.map(Real::wide);
        // Asked this way round so that NaN is not sound.
        is_sound &= y.iter().all(|entry| entry.abs() < largest);
        is_sound &= y[..A::POSITION].iter().all(|entry| entry.abs() < BLOWN_UP);
        all_steps += f64::from(steps);
        states.push(y);
    });
    Run {
        states: is_sound.then_some(states),
        steps_per_frame: all_steps / frames.len() as f64,
    }
}

/// An arm and its frames as a method sees them.
pub struct Follower<A: Arm<R, N>, R: Real, const N: usize> {
    arm: A,
    targets: Vec<(A::Target, R)>,
    start: [R; N],
    key: Key,
}

impl<A: Arm<R, N>, R: Real, const N: usize> Follower<A, R, N> {
    pub fn new(key: &Key, frames: &[Frame]) -> Self {
        let target = |frame: &Frame| {
            // A frame's length is a number of the precision, too.
            let seconds = R::of(frame.seconds);
            let told = samples::<A, N>(frame, key.method.information);
            (A::target(&told, seconds.wide()), seconds)
        };
        Follower {
            arm: A::new(key.setting.stiffness),
            targets: frames.iter().map(target).collect(),
            start: A::start().map(R::of),
            key: *key,
        }
    }

    /// Hands on the state at the end of each frame, and its steps.
    pub fn follow(&self, keep: impl FnMut([R; N], u32)) {
        let (scheme, effort) = (self.key.method.scheme, self.key.effort);
        follow(&self.arm, &self.targets, scheme, effort, self.start, keep);
    }
}

/// Errors below this are rounding and have no order.
const LEAST_ORDERED: f64 = 1e-11;
/// So much below the classical order is less than that order.
const REDUCED_BY: f64 = 0.5;

impl Key {
    /// What is known before the clock.
    fn point(&self, error: Option<[f64; 2]>, own: Option<[f64; 2]>, steps: f64) -> ArmPoint {
        let (substeps, step_tolerance) = match self.effort {
            Effort::Substeps(count) => (Some(count), None),
            Effort::Tolerance(tolerance) => (None, Some(tolerance)),
        };
        ArmPoint {
            setting: self.setting,
            frame_times: self.frame_times,
            method: self.method.name,
            information: self.method.information,
            arithmetic: if self.is_single { f32::NAME } else { f64::NAME },
            substeps,
            step_tolerance,
            steps_per_frame: steps,
            position_error: error.map(|error| error[0]),
            velocity_error: error.map(|error| error[1]),
            own_error: own.map(|own| own[0]),
            observed_order: None,
            order_reduced: false,
            us_per_second: None,
            us_per_second_lower: None,
            us_per_second_upper: None,
            dominated_by: None,
            is_tie: false,
            on_front: false,
        }
    }
}

impl ArmPoint {
    /// The order that shows from the effort before, if that is of the same method.
    fn compare(&mut self, last: &ArmPoint, classical: u32) {
        let is_same = (self.method, self.arithmetic) == (last.method, last.arithmetic);
        let steps = self.substeps.zip(last.substeps).filter(|_| is_same);
        let errors = self.own_error.zip(last.own_error);
        let (Some((more, fewer)), Some((now, before))) = (steps, errors) else {
            return;
        };
        let is_rounding = self.arithmetic != f64::NAME || now < LEAST_ORDERED;
        if more > fewer && !is_rounding {
            let order = libm::log(before / now) / libm::log(f64::from(more) / f64::from(fewer));
            self.observed_order = Some(order);
            self.order_reduced = order < f64::from(classical) - REDUCED_BY;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn setting(arm: ArmKind, stiffness: f64) -> Setting {
        Setting {
            arm,
            stiffness,
            rate_hz: 60.0,
            omega_h: stiffness.sqrt() / 60.0,
        }
    }

    fn find<'p>(points: &'p [ArmPoint], method: &str, substeps: u32) -> &'p ArmPoint {
        let is_it = |p: &&ArmPoint| {
            (p.method, p.substeps, p.arithmetic) == (method, Some(substeps), "f64")
                && p.frame_times == FrameTimes::Steady
        };
        points.iter().find(is_it).expect(method)
    }

    #[test]
    fn keys_and_points_are_in_one_order() {
        for arm in ArmKind::ALL {
            let setting = setting(arm, 1e2);
            let (points, told) = errors(setting, 1.0);
            let keys = keys(setting);
            assert_eq!((points.len(), told.len()), (keys.len(), 4));
            for (point, key) in points.iter().zip(keys) {
                let alone = key.point(None, None, 0.0);
                assert_eq!(
                    (point.label(), point.frame_times, point.information),
                    (alone.label(), alone.frame_times, alone.information)
                );
            }
        }
    }

    #[test]
    fn explicit_methods_blow_up_exactly_beyond_their_limits() {
        for (stiffness, limit_names) in [
            (1e3, &[][..]),
            (1e4, &["semi-implicit-euler"]),
            (
                1e5,
                &["semi-implicit-euler", "explicit-euler", "rk4", "verlet"],
            ),
        ] {
            let (points, _) = errors(setting(ArmKind::Linear, stiffness), 10.0);
            for method in METHODS {
                let first = points
                    .iter()
                    .find(|p| p.method == method.name)
                    .expect("a point");
                let name = method.name.trim_end_matches("-midpoints");
                let unstable = limit_names.contains(&name);
                assert_eq!(first.position_error.is_none(), unstable, "{first:?}");
            }
        }
    }

    #[test]
    fn exact_methods_have_the_error_of_what_they_are_told() {
        let (points, told) = errors(setting(ArmKind::Linear, 1e4), 2.0);
        for (method, told) in [("exact-linear", &told[0]), ("exact-midpoints", &told[1])] {
            let point = find(&points, method, 1);
            let apart = point.position_error.expect("stable") - told.position_error;
            assert!(apart.abs() < 1e-14, "{point:?} {told:?}");
            assert!(point.own_error < Some(1e-14));
        }
        assert!(told[1].position_error < 0.1 * told[0].position_error);
        // Nothing is more precise than what it is told.
        let rk4 = find(&points, "rk4", 16).position_error.expect("stable");
        assert!((rk4 / told[0].position_error - 1.0).abs() < 0.1, "{rk4:e}");
    }

    #[test]
    fn orders_show_and_are_reduced_where_steps_are_long() {
        let (soft, _) = errors(setting(ArmKind::Linear, 1e2), 2.0);
        let (stiff, _) = errors(setting(ArmKind::Linear, 1e6), 2.0);
        for (method, order) in [("implicit-euler", 1.0), ("tr-bdf2", 2.0), ("rk4", 4.0)] {
            let point = find(&soft, method, 4);
            let found = point.observed_order.expect("an order");
            assert!(
                (found - order).abs() < 0.3 && !point.order_reduced,
                "{point:?}"
            );
        }
        // Which rings instead.
        let point = find(&stiff, "implicit-midpoint", 4);
        assert!(
            point.observed_order < Some(1.5) && point.order_reduced,
            "{point:?}"
        );
        assert!(!find(&soft, "implicit-midpoint", 4).order_reduced);
    }

    #[test]
    fn a_stop_takes_orders_away() {
        let reduced = |arm| {
            let (points, _) = errors(setting(arm, 1e2), 4.0);
            [2, 4, 16].map(|steps| find(&points, "rk4", steps).order_reduced)
        };
        assert_eq!(reduced(ArmKind::Linear), [false; 3]);
        assert!(reduced(ArmKind::Collision).contains(&true));
    }
}
