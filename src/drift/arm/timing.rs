//! The time of every point of the study, as a task of the timed pass.

use std::hint::black_box;

use super::super::real::Real;
use super::super::walk::Repeated;
use super::course::{FrameTimes, frames};
use super::limited::Limited;
use super::linear::Linear;
use super::problem::Arm;
use super::study::{ArmKind, Follower, Key};
use super::turning::Turning;

/// Simulated time of one run of a task: the arm on its way in, a hitch among its
/// frames.
const SECONDS: f64 = 1.0;

/// Steps of one query, about: a round is some tens of microseconds.
const STEPS: f64 = 750.0;
/// The same of an arm that takes some twenty times as long for each.
const DEAR_STEPS: f64 = 40.0;

/// The task of a point, in simulated seconds.
pub fn task(key: &Key) -> Repeated {
    match (key.setting.arm, key.is_single) {
        (ArmKind::Linear, false) => of::<Linear<f64>, f64, 2>(key),
        (ArmKind::Linear, true) => of::<Linear<f32>, f32, 2>(key),
        (ArmKind::Collision, false) => of::<Limited<f64>, f64, 2>(key),
        (ArmKind::Collision, true) => of::<Limited<f32>, f32, 2>(key),
        (ArmKind::Quaternion, false) => of::<Turning<f64>, f64, 7>(key),
        (ArmKind::Quaternion, true) => of::<Turning<f32>, f32, 7>(key),
    }
}

fn of<A, R: Real, const N: usize>(key: &Key) -> Repeated
where
    A: Arm<R, N> + 'static,
    A::Target: 'static,
{
    let frames = frames(key.setting.rate_hz, FrameTimes::Jittered, SECONDS);
    let simulated: f64 = frames.iter().map(|frame| frame.seconds).sum();
    let follower = Follower::<A, R, N>::new(key, &frames);
    // Counted, so that it is the same in every process.
    let mut steps = 0.0;
    follower.follow(|_, of_frame| steps += f64::from(of_frame));
    let wanted = match key.setting.arm {
        ArmKind::Quaternion => DEAR_STEPS,
        _ => STEPS,
    };
    let repeats = (wanted / steps).ceil().max(1.0) as usize;
    Repeated::new(simulated * repeats as f64, move || {
        for _ in 0..repeats {
            black_box(&follower).follow(|y, _| {
                black_box(y);
            });
        }
    })
}
