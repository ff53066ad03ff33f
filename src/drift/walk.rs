//! Walks of many equal steps with looks on the way, and such steps as tasks of the
//! timed pass.

use std::hint::black_box;

use glam::DMat3;

use crate::measure::TimedTask;
use serde::Serialize;

/// The turn of every step: yaw, pitch and roll in degrees about the camera's
/// own axes, in this order, as [`crate::camera::Frame`] turns. The doubles are taken
/// as exact.
#[derive(Clone, Copy, Default, Debug, Serialize)]
pub struct Turn {
    /// About the camera's v, degrees per step.
    pub yaw_deg: f64,
    /// About the camera's u, degrees per step.
    pub pitch_deg: f64,
    /// About the camera's n, degrees per step.
    pub roll_deg: f64,
}

impl Turn {
    /// A turn by yaw, pitch and roll in degrees.
    pub const fn new(yaw_deg: f64, pitch_deg: f64, roll_deg: f64) -> Turn {
        Turn {
            yaw_deg,
            pitch_deg,
            roll_deg,
        }
    }
}

/// Takes equal steps: the axes after each of the ascending numbers of them.
pub type Walk = fn(&Turn, &[u64]) -> Vec<DMat3>;

/// A [`Walk`] by what a step does to the walker and where that is then.
pub fn walk<W, S, P>(
    mut walker: W,
    by: &S,
    looks: &[u64],
    step: impl Fn(&mut W, &S),
    place: impl Fn(&W) -> P,
) -> Vec<P> {
    let mut taken = 0;
    let mut places = Vec::with_capacity(looks.len());
    for &look in looks {
        for _ in taken..look {
            // Hidden, so that nothing is computed once for all steps.
            step(&mut walker, black_box(by));
        }
        taken = look;
        places.push(place(&walker));
    }
    places
}

/// Queries of a round of the timed pass: all the same.
pub const QUERIES: usize = 8;

/// Steps of a frame or an eye in one query.
pub const QUERY_STEPS: u64 = 500;

/// A task of the timed pass that asks for nothing.
pub fn task(run: impl Fn() + 'static) -> TimedTask<'static> {
    TimedTask::new(vec![0; QUERIES], move |_, _| run())
}

/// The task of [`QUERY_STEPS`] equal steps.
pub fn walking(walk: Walk, by: Turn) -> TimedTask<'static> {
    task(move || drop(walk(&by, &[QUERY_STEPS])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looks_are_taken_after_exactly_so_many_steps() {
        let by = Turn {
            yaw_deg: 3.0,
            ..Turn::default()
        };
        let step = |at: &mut f64, by: &Turn| *at += by.yaw_deg;
        let places = walk(5.0, &by, &[0, 1, 10, 10, 12], step, |at| *at);
        assert_eq!(places, [5.0, 8.0, 35.0, 35.0, 41.0]);
    }
}
