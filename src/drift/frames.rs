//! Ways to keep a camera basis while it is turned step by step, in both precisions.
//!
//! Also ways to carry an eye around a centre; walks of many equal steps, with looks on the
//! way, as tasks of the timed pass.

use std::f64::consts::PI;
use std::hint::black_box;

use glam::{DMat3, DVec3};
use serde::Serialize;

use crate::camera::{self, look_at};
use crate::measure::TimedTask;

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

/// Corrections of the axes of a frame.
pub const NONE: u8 = 0;
pub const GRAM_SCHMIDT: u8 = 1;
pub const POLAR: u8 = 2;

/// Rotations between two polar corrections, as in the toolkit's camera.
pub const CORRECT_EVERY: u32 = 100;

/// Units of summed angles.
pub const RADIANS: u8 = 0;
pub const DEGREES: u8 = 1;
pub const WRAPPED: u8 = 2;

/// Distance from the centre of the orbit to the eye. A camera that looks at
/// the centre has its eye at `centre + 10 n`.
pub const ORBIT_RADIUS: f64 = 10.0;

const CENTRE: DVec3 = DVec3::new(5.0, -1.0, 2.0);
const START: DVec3 = DVec3::new(CENTRE.x + ORBIT_RADIUS, CENTRE.y, CENTRE.z);

/// The same text in both precisions. Every step gets its angles as if from a mouse,
/// and takes their sines and cosines.
macro_rules! precision {
    ($module:ident, $real:ident, $vector:ident, $quaternion:ident, $matrix:ident, $sin:path, $cos:path) => {
        pub mod $module {
            use glam::{$matrix, $quaternion, $vector};

            use crate::drift::frames::*;

            #[inline(always)]
            fn sin_cos(radians: $real) -> ($real, $real) {
                ($sin(radians), $cos(radians))
            }

            /// Degrees to radians, by one rounded factor.
            const DEGREE: $real = std::f64::consts::PI as $real / 180.0;

            fn wide(axes: [$vector; 3]) -> DMat3 {
                DMat3::from_cols_array_2d(&axes.map(|axis| axis.to_array().map(f64::from)))
            }

            /// u, v and n after yaw, pitch and roll with these sines and
            /// cosines: the formulas of `camera::controls`, inlined as those are.
            #[inline(always)]
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

            #[inline(always)]
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

            /// An eye that is turned about the centre; `RESTORED` corrects its distance.
            pub fn carried<const RESTORED: bool>(turn: &Turn, looks: &[u64]) -> Vec<DMat3> {
                let [centre, start] = [CENTRE, START].map(|p| p.to_array().map(|x| x as $real));
                let (centre, start) = ($vector::from(centre), $vector::from(start));
                let step = |eye: &mut $vector, turn: &Turn| {
                    let (sin, cos) = sin_cos(turn.yaw_deg as $real * DEGREE / 2.0);
                    let turn = $quaternion::from_xyzw(0.0, 0.0, sin, cos);
                    let mut offset = turn * (*eye - centre);
                    if RESTORED {
                        offset = offset.normalize() * ORBIT_RADIUS as $real;
                    }
                    *eye = centre + offset;
                };
                let place = |eye: &$vector| from_centre(eye.to_array().map(f64::from).into());
                walk(start, turn, looks, step, place)
            }
        }
    };
}

precision!(single, f32, Vec3, Quat, Mat3, libm::sinf, libm::cosf);
precision!(double, f64, DVec3, DQuat, DMat3, libm::sin, libm::cos);

/// The offset of an eye from the centre, in radii, as column u.
fn from_centre(eye: DVec3) -> DMat3 {
    DMat3::from_cols((eye - CENTRE) / ORBIT_RADIUS, DVec3::ZERO, DVec3::ZERO)
}

/// Orbit of this toolkit's camera.
pub fn toolkit_orbit(by: &Turn, looks: &[u64]) -> Vec<DMat3> {
    let frame = look_at(START, CENTRE, DVec3::Z);
    let frame = frame.expect("two points and an up vector make a frame");
    let step = |frame: &mut camera::Frame, by: &Turn| {
        let turned = frame.orbit(CENTRE, DVec3::Z, by.yaw_deg, 0.0);
        turned.expect("the z axis is an axis");
    };
    walk(frame, by, looks, step, |frame| from_centre(frame.eye))
}

/// An eye that is computed from the sum of its angles.
pub fn summed_orbit(by: &Turn, looks: &[u64]) -> Vec<DMat3> {
    let step = |(sum, eye): &mut (f64, DVec3), by: &Turn| {
        *sum = (*sum + by.yaw_deg) % 360.0;
        let angle = sum.to_radians();
        let direction = DVec3::new(libm::cos(angle), libm::sin(angle), 0.0);
        *eye = CENTRE + direction * ORBIT_RADIUS;
    };
    walk((0.0, START), by, looks, step, |(_, eye)| from_centre(*eye))
}

/// Basis of this toolkit's camera.
pub fn toolkit(turn: &Turn, looks: &[u64]) -> Vec<DMat3> {
    stretched(turn, looks, 1.0)
}

/// The same with the angles of the lecture's programs.
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
