//! An eye that is itself carried around a point, as [`Frame::orbit`] carries
//! it: how far off its circle and its place it gets. Frames are in `rotation`.

use glam::{DMat3, DQuat, DVec3, Quat, Vec3};
use serde::Serialize;

use super::exact::Matrix;
use super::frames::Turn;
use super::rotation::{Method, ORBIT_RADIUS, Sum};
use super::walk::walk;
use crate::arithmetic::Expansion;
use crate::camera::{Frame, look_at};

/// Degrees about the z axis through the centre, every step: the golden ratio's
/// share, so that no two steps end at the same place. At 0.7 the f32 eye comes
/// round to where it was after 3600 steps, and its errors with it.
pub const SWING_DEG: f64 = 0.618_033_988_749_894_9;

/// The turn of every step.
pub const SWING: Turn = Turn {
    yaw_deg: SWING_DEG,
    pitch_deg: 0.0,
    roll_deg: 0.0,
};

const CENTRE: DVec3 = DVec3::new(5.0, -1.0, 2.0);

/// Ways to carry the eye: the column u of what they reach is the eye less the centre, in
/// radii.
pub const CARRIERS: &[Method] = rows! { Method { name, summary, sum, walk }
    "f32-carried", "the f32 eye turned about the centre each step",
        Sum::Turns, single::<false>;
    "f32-carried-radius", "the same, put back to its distance each step",
        Sum::Turns, single::<true>;
    TOOLKIT, "the f64 eye and its axes turned each step, around and over: this toolkit's orbit",
        Sum::Turns, toolkit;
    "f64-carried-radius", "the f64 eye alone, put back to its distance each step",
        Sum::Turns, restored;
    "f64-angle", "the eye made anew from an f64 angle in degrees, whole turns taken off",
        Sum::Angles, angle;
};

/// What the toolkit's own orbit does.
pub const TOOLKIT: &str = "f64-carried";

const START: DVec3 = DVec3::new(CENTRE.x + ORBIT_RADIUS, CENTRE.y, CENTRE.z);

fn from_centre(eye: &DVec3) -> DMat3 {
    DMat3::from_cols((*eye - CENTRE) / ORBIT_RADIUS, DVec3::ZERO, DVec3::ZERO)
}

/// An f32 eye; `RESTORED` says whether its distance is put right.
fn single<const RESTORED: bool>(by: &Turn, looks: &[u64]) -> Vec<DMat3> {
    let step = |eye: &mut Vec3, by: &Turn| {
        let half = by.yaw_deg as f32 * (std::f32::consts::PI / 180.0) / 2.0;
        let turn = Quat::from_xyzw(0.0, 0.0, libm::sinf(half), libm::cosf(half));
        let mut offset = turn * (*eye - CENTRE.as_vec3());
        if RESTORED {
            offset = offset.normalize() * ORBIT_RADIUS as f32;
        }
        *eye = CENTRE.as_vec3() + offset;
    };
    walk(START.as_vec3(), by, looks, step, |eye| {
        from_centre(&eye.as_dvec3())
    })
}

/// The camera of this toolkit.
fn toolkit(by: &Turn, looks: &[u64]) -> Vec<DMat3> {
    let frame = look_at(START, CENTRE, DVec3::Z);
    let frame = frame.expect("two points and an up vector make a frame");
    let step = |frame: &mut Frame, by: &Turn| {
        let turned = frame.orbit(CENTRE, DVec3::Z, by.yaw_deg, 0.0);
        turned.expect("the z axis is an axis");
    };
    walk(frame, by, looks, step, |frame| from_centre(&frame.eye))
}

/// An f64 eye whose distance is put right.
fn restored(by: &Turn, looks: &[u64]) -> Vec<DMat3> {
    let step = |eye: &mut DVec3, by: &Turn| {
        let half = by.yaw_deg * (std::f64::consts::PI / 180.0) / 2.0;
        let turn = DQuat::from_xyzw(0.0, 0.0, libm::sin(half), libm::cos(half));
        let offset = turn * (*eye - CENTRE);
        *eye = CENTRE + offset.normalize() * ORBIT_RADIUS;
    };
    walk(START, by, looks, step, from_centre)
}

/// No eye but its angle.
fn angle(by: &Turn, looks: &[u64]) -> Vec<DMat3> {
    let step = |(sum, eye): &mut (f64, DVec3), by: &Turn| {
        *sum = (*sum + by.yaw_deg) % 360.0;
        let angle = sum.to_radians();
        let direction = DVec3::new(libm::cos(angle), libm::sin(angle), 0.0);
        *eye = CENTRE + direction * ORBIT_RADIUS;
    };
    walk((0.0, START), by, looks, step, |(_, eye)| from_centre(eye))
}

/// How far a carried eye is off after so many steps, ten away from its centre.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct OrbitDrift {
    /// Name of the method.
    pub method: &'static str,
    /// Steps taken.
    pub steps: u64,
    /// Distance from the exact eye.
    pub position_error: f64,
    /// Difference from the exact radius.
    pub radius_error: f64,
}

/// How far a way to carry the eye is off after ascending numbers of steps.
pub fn drift(carrier: &Method, steps: &[u64]) -> Vec<OrbitDrift> {
    let rows = steps.iter().zip((carrier.walk)(&SWING, steps));
    rows.map(|(&steps, offset)| {
        let exact = Matrix::about(2, &Expansion::product(SWING_DEG, steps as f64));
        // Column u of the turn is where the unit vector x has gone.
        let (position, longer) = Matrix::from(offset).column_error(&exact, 0);
        OrbitDrift {
            method: carrier.name,
            steps,
            position_error: ORBIT_RADIUS * position,
            radius_error: (ORBIT_RADIUS * longer).abs(),
        }
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_precision_leaves_its_circle_and_a_restored_radius_does_not() {
        let after = |name: &str, steps| {
            let carrier = CARRIERS.iter().find(|c| c.name == name).expect(name);
            drift(carrier, &[steps]).remove(0)
        };
        let worn = after("f32-carried", 100_000);
        assert!((1e-3..0.1).contains(&worn.radius_error), "{worn:?}");
        let kept = after("f32-carried-radius", 100_000);
        assert!(kept.radius_error < 1e-5, "{kept:?}");
        for name in [TOOLKIT, "f64-carried-radius", "f64-angle"] {
            let off = after(name, 100_000);
            assert!(off.radius_error < 1e-9, "{off:?}");
            assert!(off.position_error < 1e-7, "{off:?}");
        }
        for name in ["f64-carried-radius", "f64-angle"] {
            let kept = after(name, 100_000);
            assert!(kept.radius_error < 1e-13, "{kept:?}");
        }
        // All of them go the same way round.
        for carrier in CARRIERS {
            let off = drift(carrier, &[0, 100]).remove(1);
            assert!(off.position_error < 1e-3, "{off:?}");
        }
    }
}
