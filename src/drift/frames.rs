//! Ways to keep a camera's frame while it is turned step by step. It owns the
//! arithmetic in both precisions; how wrong it gets is found in `rotation`.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

pub use super::walk::Turn;
use super::walk::walk;
use crate::camera::{self, look_at};

/// How the axes of a frame are corrected.
pub const NONE: u8 = 0;
pub const GRAM_SCHMIDT: u8 = 1;
pub const POLAR: u8 = 2;

/// Rotations between two polar corrections, as in the toolkit's camera.
pub const CORRECT_EVERY: u32 = 100;

/// How angles are summed.
pub const RADIANS: u8 = 0;
pub const DEGREES: u8 = 1;
pub const WRAPPED: u8 = 2;

/// The same text in both precisions. Every step is handed its angles anew, as
/// a mouse would do, and takes their sines and cosines.
macro_rules! precision {
    ($module:ident, $real:ident, $vector:ident, $quaternion:ident, $matrix:ident, $sin:path, $cos:path) => {
        pub mod $module {
            use glam::{$matrix, $quaternion, $vector};

            use crate::drift::frames::*;

            fn sin_cos(radians: $real) -> ($real, $real) {
                ($sin(radians), $cos(radians))
            }

            /// Degrees to radians, by one rounded factor.
            const DEGREE: $real = std::f64::consts::PI as $real / 180.0;

            fn wide(axes: [$vector; 3]) -> DMat3 {
                DMat3::from_cols_array_2d(&axes.map(|axis| axis.to_array().map(f64::from)))
            }

            /// u, v and n after yaw, pitch and roll with these sines and
            /// cosines: the formulas of `camera::controls`.
            fn turned(
                [mut u, mut v, mut n]: [$vector; 3],
                by: [($real, $real); 3],
            ) -> [$vector; 3] {
                let [(sin, cos), pitch, roll] = by;
                (n, u) = (n * cos + u * sin, u * cos - n * sin);
                let (sin, cos) = pitch;
                (v, n) = (v * cos + n * sin, n * cos - v * sin);
                let (sin, cos) = roll;
                (u, v) = (u * cos + v * sin, v * cos - u * sin);
                [u, v, n]
            }

            fn degrees(turn: &Turn) -> [$real; 3] {
                [turn.yaw_deg, turn.pitch_deg, turn.roll_deg].map(|angle| angle as $real)
            }

            const LEVEL: [$vector; 3] = [$vector::X, $vector::Y, $vector::Z];

            /// Axes that are turned in place.
            pub fn frame<const CORRECTION: u8>(turn: &Turn, looks: &[u64]) -> Vec<DMat3> {
                let step = |(axes, rotations): &mut ([$vector; 3], u32), turn: &Turn| {
                    let by = degrees(turn).map(|angle| sin_cos(angle * DEGREE));
                    *axes = turned(*axes, by);
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
                walk((LEVEL, 0), turn, looks, step, |(axes, _)| wide(*axes))
            }

            /// A quaternion that is multiplied by the step's.
            pub fn quaternion(turn: &Turn, looks: &[u64]) -> Vec<DMat3> {
                let step = |q: &mut $quaternion, turn: &Turn| {
                    let half = degrees(turn).map(|angle| sin_cos(angle * DEGREE * 0.5));
                    let yaw = $quaternion::from_xyzw(0.0, half[0].0, 0.0, half[0].1);
                    let pitch = $quaternion::from_xyzw(half[1].0, 0.0, 0.0, half[1].1);
                    let roll = $quaternion::from_xyzw(0.0, 0.0, half[2].0, half[2].1);
                    *q = (*q * (yaw * pitch * roll)).normalize();
                };
                let axes = |q: &$quaternion| wide(LEVEL.map(|axis| *q * axis));
                walk($quaternion::IDENTITY, turn, looks, step, axes)
            }

            /// Sums of angles, and the axes that follow from them.
            pub fn angles<const KIND: u8>(turn: &Turn, looks: &[u64]) -> Vec<DMat3> {
                let step = |(sums, axes): &mut ([$real; 3], [$vector; 3]), turn: &Turn| {
                    for (sum, angle) in sums.iter_mut().zip(degrees(turn)) {
                        *sum += angle * if KIND == RADIANS { DEGREE } else { 1.0 };
                        if KIND == WRAPPED && sum.abs() >= 360.0 {
                            // No rounding: the rest needs no more bits.
                            *sum %= 360.0;
                        }
                    }
                    let unit = if KIND == RADIANS { 1.0 } else { DEGREE };
                    *axes = turned(LEVEL, sums.map(|sum| sin_cos(sum * unit)));
                };
                walk(([0.0; 3], LEVEL), turn, looks, step, |(_, axes)| {
                    wide(*axes)
                })
            }
        }
    };
}

precision!(single, f32, Vec3, Quat, Mat3, libm::sinf, libm::cosf);
precision!(double, f64, DVec3, DQuat, DMat3, libm::sin, libm::cos);

/// The camera of this toolkit.
pub fn toolkit(turn: &Turn, looks: &[u64]) -> Vec<DMat3> {
    stretched(turn, looks, 1.0)
}

/// The same, with angles as the lecture's programs have them.
pub fn lecture(turn: &Turn, looks: &[u64]) -> Vec<DMat3> {
    #[expect(clippy::approx_constant, reason = "it is what is measured")]
    const STRETCH: f64 = 3.142 / PI;
    stretched(turn, looks, STRETCH)
}

#[inline(always)]
fn stretched(turn: &Turn, looks: &[u64], stretch: f64) -> Vec<DMat3> {
    let level = look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y);
    let level = level.expect("two points and an up vector make a frame");
    let step = |frame: &mut camera::Frame, turn: &Turn| {
        frame.yaw(turn.yaw_deg * stretch);
        frame.pitch(turn.pitch_deg * stretch);
        frame.roll(turn.roll_deg * stretch);
    };
    let axes = |frame: &camera::Frame| DMat3::from_cols(frame.u(), frame.v(), frame.n());
    walk(level, turn, looks, step, axes)
}
