//! Ways to keep a camera's frame while it is turned step by step. It owns the
//! arithmetic in both precisions; how wrong it gets is found in `rotation`.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use serde::Serialize;

use super::walk::Walker;
use crate::camera::{self, look_at};

/// The turn of every step: yaw, pitch and roll in degrees about the camera's
/// own axes, in this order, as [`camera::Frame`] turns. The doubles are taken
/// as exact.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Turn {
    pub yaw_deg: f64,
    pub pitch_deg: f64,
    pub roll_deg: f64,
}

/// How the axes of a frame are corrected.
pub const NONE: u8 = 0;
pub const GRAM_SCHMIDT: u8 = 1;
pub const POLAR: u8 = 2;

/// Rotations between two polar corrections, as in the toolkit's camera.
const CORRECT_EVERY: u32 = 100;

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

            use super::*;

            fn sin_cos(radians: $real) -> ($real, $real) {
                ($sin(radians), $cos(radians))
            }

            /// Degrees to radians, by one rounded factor.
            const DEGREE: $real = std::f64::consts::PI as $real / 180.0;

            fn wide(axes: [$vector; 3]) -> DMat3 {
                let [u, v, n] =
                    axes.map(|a| DVec3::new(f64::from(a.x), f64::from(a.y), f64::from(a.z)));
                DMat3::from_cols(u, v, n)
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
            pub struct Frame<const CORRECTION: u8> {
                axes: [$vector; 3],
                rotations: u32,
            }

            impl<const CORRECTION: u8> Walker for Frame<CORRECTION> {
                type Step = Turn;
                type Place = DMat3;

                fn start() -> Self {
                    let (axes, rotations) = (LEVEL, 0);
                    Frame { axes, rotations }
                }

                fn step(&mut self, turn: &Turn) {
                    let by = degrees(turn).map(|angle| sin_cos(angle * DEGREE));
                    self.axes = turned(self.axes, by);
                    if CORRECTION == GRAM_SCHMIDT {
                        let [u, _, n] = self.axes;
                        let n = n.normalize();
                        let u = (u - n * u.dot(n)).normalize();
                        self.axes = [u, n.cross(u), n];
                    }
                    if CORRECTION == POLAR {
                        self.rotations += 3;
                        if self.rotations >= CORRECT_EVERY {
                            self.rotations = 0;
                            let [u, v, n] = self.axes;
                            let x = $matrix::from_cols(u, v, n);
                            let three = $matrix::from_diagonal($vector::splat(3.0));
                            let x = x * (three - x.transpose() * x) * 0.5;
                            self.axes = [x.x_axis, x.y_axis, x.z_axis];
                        }
                    }
                }

                fn place(&self) -> DMat3 {
                    wide(self.axes)
                }
            }

            /// A quaternion that is multiplied by the step's.
            pub struct Quaternion($quaternion);

            impl Walker for Quaternion {
                type Step = Turn;
                type Place = DMat3;

                fn start() -> Self {
                    Quaternion($quaternion::IDENTITY)
                }

                fn step(&mut self, turn: &Turn) {
                    let half = degrees(turn).map(|angle| sin_cos(angle * DEGREE * 0.5));
                    let [(yaw, yaw_cos), (pitch, pitch_cos), (roll, roll_cos)] = half;
                    let yaw = $quaternion::from_xyzw(0.0, yaw, 0.0, yaw_cos);
                    let pitch = $quaternion::from_xyzw(pitch, 0.0, 0.0, pitch_cos);
                    let roll = $quaternion::from_xyzw(0.0, 0.0, roll, roll_cos);
                    self.0 = (self.0 * (yaw * pitch * roll)).normalize();
                }

                fn place(&self) -> DMat3 {
                    wide(LEVEL.map(|axis| self.0 * axis))
                }
            }

            /// Sums of angles, and the axes that follow from them.
            pub struct Angles<const KIND: u8> {
                sums: [$real; 3],
                axes: [$vector; 3],
            }

            impl<const KIND: u8> Walker for Angles<KIND> {
                type Step = Turn;
                type Place = DMat3;

                fn start() -> Self {
                    let (sums, axes) = ([0.0; 3], LEVEL);
                    Angles { sums, axes }
                }

                fn step(&mut self, turn: &Turn) {
                    for (sum, angle) in self.sums.iter_mut().zip(degrees(turn)) {
                        *sum += if KIND == RADIANS {
                            angle * DEGREE
                        } else {
                            angle
                        };
                        if KIND == WRAPPED && sum.abs() >= 360.0 {
                            // No rounding: the rest needs no more bits.
                            *sum %= 360.0;
                        }
                    }
                    let unit = if KIND == RADIANS { 1.0 } else { DEGREE };
                    self.axes = turned(LEVEL, self.sums.map(|sum| sin_cos(sum * unit)));
                }

                fn place(&self) -> DMat3 {
                    wide(self.axes)
                }
            }
        }
    };
}

precision!(single, f32, Vec3, Quat, Mat3, libm::sinf, libm::cosf);
precision!(double, f64, DVec3, DQuat, DMat3, libm::sin, libm::cos);

/// The camera of this toolkit.
pub struct Toolkit(camera::Frame);

impl Walker for Toolkit {
    type Step = Turn;
    type Place = DMat3;

    fn start() -> Self {
        let level = look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y);
        Toolkit(level.expect("two points and an up vector make a frame"))
    }

    fn step(&mut self, turn: &Turn) {
        self.0.yaw(turn.yaw_deg);
        self.0.pitch(turn.pitch_deg);
        self.0.roll(turn.roll_deg);
    }

    fn place(&self) -> DMat3 {
        DMat3::from_cols(self.0.u(), self.0.v(), self.0.n())
    }
}

/// The same, with angles as the lecture's programs have them.
pub struct Lecture(Toolkit);

impl Walker for Lecture {
    type Step = Turn;
    type Place = DMat3;

    fn start() -> Self {
        Lecture(Toolkit::start())
    }

    fn step(&mut self, turn: &Turn) {
        #[expect(clippy::approx_constant, reason = "it is what is measured")]
        const STRETCH: f64 = 3.142 / PI;
        self.0.step(&Turn {
            yaw_deg: turn.yaw_deg * STRETCH,
            pitch_deg: turn.pitch_deg * STRETCH,
            roll_deg: turn.roll_deg * STRETCH,
        });
    }

    fn place(&self) -> DMat3 {
        self.0.place()
    }
}
