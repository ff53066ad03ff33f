//! Methods that keep a camera basis while it is rotated step by step.
//!
//! A walk takes many equal steps and records the basis on the way; walks are tasks of the timed
//! pass.

use std::f64::consts::PI;
use std::hint::black_box;
use std::ops::RangeInclusive;

use glam::{DMat3, DVec3, Quat, Vec3};
use single::{DEGREE, WORLD_AXES, rotated, sin_cos, to_f64};

use crate::camera::{self, look_at};
use crate::kernel::each;
use crate::measure::TimedTask;

/// Yaw, pitch and roll of each step, in degrees about the camera's own axes.
///
/// In this order, as [`camera::Frame`] rotates. The doubles count as exact.
pub type YawPitchRoll = [f64; 3];

/// A slow rotation about no special axis.
pub const STEADY: YawPitchRoll = [0.7, 0.3, 0.1];

/// Takes equal steps; returns the axes after each of these numbers of steps.
pub type BasisWalk = fn(RangeInclusive<u64>) -> Vec<DMat3>;

/// Runs a [`BasisWalk`]: `step` advances the walker, `axes` reads its axes.
pub fn walk<W>(
    mut walker: W,
    samples: RangeInclusive<u64>,
    step: impl Fn(&mut W, &YawPitchRoll),
    axes: impl Fn(&W) -> DMat3,
) -> Vec<DMat3> {
    let mut taken = 0;
    let mut all = Vec::new();
    for sample in samples {
        for _ in taken..sample {
            // `black_box`, so that nothing is computed once for all steps.
            step(&mut walker, black_box(&STEADY));
        }
        taken = sample;
        all.push(axes(&walker));
    }
    all
}

/// Queries in a round of the timed pass, all alike.
pub const QUERIES: usize = 8;

/// Steps of a basis in one query.
pub const QUERY_STEPS: u64 = 500;

/// Task of the timed pass without an answer.
pub fn task(run: impl Fn() + 'static) -> TimedTask<'static> {
    TimedTask::new(vec![0; QUERIES], move |_, _| run())
}

/// Task of [`QUERY_STEPS`] equal steps.
pub fn task_of(walk: BasisWalk) -> TimedTask<'static> {
    task(move || drop(walk(QUERY_STEPS..=QUERY_STEPS)))
}

/// No correction of the axes of a basis.
pub const NONE: u8 = 0;
pub const GRAM_SCHMIDT: u8 = 1;
pub const POLAR: u8 = 2;

/// Rotations between two polar corrections, as in the toolkit's camera.
pub const CORRECT_EVERY: u32 = 100;

/// Defines the same code in both precisions.
macro_rules! precision {
    ($module:ident, $real:ident, $vector:ident, $matrix:ident, $sin:path, $cos:path) => {
        pub mod $module {
            use glam::{$matrix, $vector};

            use crate::drift::bases::*;

            #[inline(always)]
            pub fn sin_cos(radians: $real) -> ($real, $real) {
                ($sin(radians), $cos(radians))
            }

            /// Degrees to radians, by one rounded factor.
            pub const DEGREE: $real = PI as $real / 180.0;

            pub const WORLD_AXES: [$vector; 3] = [$vector::X, $vector::Y, $vector::Z];

            pub fn to_f64(axes: [$vector; 3]) -> DMat3 {
                DMat3::from_cols_array_2d(&axes.map(|axis| axis.to_array().map(f64::from)))
            }

            /// Axes u, v and n after yaw, pitch and roll in radians.
            ///
            /// The formulas of `camera::controls`, inlined like those.
            #[inline(always)]
            pub fn rotated([mut u, mut v, mut n]: [$vector; 3], by: [$real; 3]) -> [$vector; 3] {
                let [(sin, cos), pitch, roll] = each(by, sin_cos);
                (n, u) = (n * cos + u * sin, u * cos - n * sin);
                let (sin, cos) = pitch;
                (v, n) = (v * cos + n * sin, n * cos - v * sin);
                let (sin, cos) = roll;
                (u, v) = (u * cos + v * sin, v * cos - u * sin);
                [u, v, n]
            }

            /// Rotates the axes in place.
            ///
            /// Each step receives its angles as if from a mouse, and takes their sines and cosines.
            pub fn basis<const CORRECTION: u8>(samples: RangeInclusive<u64>) -> Vec<DMat3> {
                let step = |(axes, rotations): &mut ([$vector; 3], u32), turn: &YawPitchRoll| {
                    *axes = rotated(*axes, each(*turn, |angle| angle as $real * DEGREE));
                    if CORRECTION == GRAM_SCHMIDT {
                        let [u, _, n] = *axes;
                        let n = n.normalize();
                        let u = (u - n * u.dot(n)).normalize();
                        *axes = [u, n.cross(u), n];
                    }
                    if CORRECTION == POLAR {
                        *rotations += 3;
                        if *rotations >= CORRECT_EVERY {
                            *rotations = 0;
                            let x = $matrix::from_cols(axes[0], axes[1], axes[2]);
                            let three = $matrix::from_diagonal($vector::splat(3.0));
                            let x = x * (three - x.transpose() * x) * 0.5;
                            *axes = [x.x_axis, x.y_axis, x.z_axis];
                        }
                    }
                };
                walk((WORLD_AXES, 0), samples, step, |(axes, _)| to_f64(*axes))
            }
        }
    };
}

precision!(single, f32, Vec3, Mat3, libm::sinf, libm::cosf);
precision!(double, f64, DVec3, DMat3, libm::sin, libm::cos);

/// Multiplies an f32 quaternion by that of the step.
pub fn quaternion(samples: RangeInclusive<u64>) -> Vec<DMat3> {
    let step = |q: &mut Quat, turn: &YawPitchRoll| {
        let half = each(*turn, |angle| sin_cos(angle as f32 * DEGREE * 0.5));
        let yaw = Quat::from_xyzw(0.0, half[0].0, 0.0, half[0].1);
        let pitch = Quat::from_xyzw(half[1].0, 0.0, 0.0, half[1].1);
        let roll = Quat::from_xyzw(0.0, 0.0, half[2].0, half[2].1);
        *q = (*q * (yaw * pitch * roll)).normalize();
    };
    let axes = |q: &Quat| to_f64(WORLD_AXES.map(|axis| *q * axis));
    walk(Quat::IDENTITY, samples, step, axes)
}

/// Sums f32 angles in radians; computes the axes from the sums.
pub fn radians(samples: RangeInclusive<u64>) -> Vec<DMat3> {
    let step = |(sums, axes): &mut ([f32; 3], [Vec3; 3]), turn: &YawPitchRoll| {
        *sums = each([0, 1, 2], |k| sums[k] + turn[k] as f32 * DEGREE);
        *axes = rotated(WORLD_AXES, *sums);
    };
    let axes = |(_, axes): &([f32; 3], [Vec3; 3])| to_f64(*axes);
    walk(([0.0; 3], WORLD_AXES), samples, step, axes)
}

/// Uses this toolkit's camera basis, with angles multiplied by `stretch`.
#[inline(always)]
pub fn toolkit(samples: RangeInclusive<u64>, stretch: f64) -> Vec<DMat3> {
    let level = look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y);
    let level = level.expect("two points and an up vector make a frame");
    let step = |frame: &mut camera::Frame, turn: &YawPitchRoll| {
        frame.yaw(turn[0] * stretch);
        frame.pitch(turn[1] * stretch);
        frame.roll(turn[2] * stretch);
    };
    let axes = |frame: &camera::Frame| DMat3::from_cols(frame.u(), frame.v(), frame.n());
    walk(level, samples, step, axes)
}

/// Ratio of the lecture's value of pi to pi.
#[expect(clippy::approx_constant, reason = "it is what is measured")]
pub const LECTURE_PI_RATIO: f64 = 3.142 / PI;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looks_are_taken_after_exactly_so_many_steps() {
        let step = |at: &mut f64, _: &YawPitchRoll| *at += 3.0;
        let place = |at: &f64| DMat3::from_diagonal(DVec3::splat(*at));
        let places = walk(5.0, 10..=12, step, place);
        assert_eq!(places, [35.0, 38.0, 41.0].map(|at| place(&at)));
    }
}
