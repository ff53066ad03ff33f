//! Drift of camera bases, and of eyes carried round a centre, from the exact turn.
//!
//! One row of [`METHODS`] or [`CARRIERS`] for each way to keep one.

use std::collections::BTreeMap;

use serde::Serialize;

use super::exact::{Matrix, larger};
use super::frames::{
    CORRECT_EVERY, DEGREES, GRAM_SCHMIDT, NONE, ORBIT_RADIUS, POLAR, RADIANS, Turn, WRAPPED, Walk,
    double, lecture, single, summed_orbit, toolkit, toolkit_orbit,
};
use crate::arithmetic::Expansion;

/// Slow and about no axis in particular.
pub const STEADY: Turn = Turn::new(0.7, 0.3, 0.1);

/// A 360th of a turn to the left.
pub const ONE_DEGREE: Turn = Turn::new(1.0, 0.0, 0.0);

/// Yaw, pitch and roll by `times` times [`STEADY`], to more than 40 digits.
fn turned(times: u64) -> Matrix {
    let about = |axis, degrees| Matrix::about(axis, &Expansion::product(degrees, times as f64));
    let turned = about(1, STEADY.yaw_deg).times(&about(0, STEADY.pitch_deg));
    turned.times(&about(2, STEADY.roll_deg))
}

/// The sum of the steps of a method. The two differ, since turns do not commute;
/// each method is compared with its own.
#[derive(Clone, Copy)]
pub enum Sum {
    /// One turn after another, about the axes as they then are.
    Turns,
    /// The angles; the frame is yaw, pitch and roll by their sums.
    Angles,
}

/// One way to keep a frame, or to carry an eye around.
pub struct Method {
    pub name: &'static str,
    pub summary: &'static str,
    pub sum: Sum,
    /// The frame's axes u, v, n after each of the ascending numbers of steps.
    pub walk: Walk,
}

/// The toolkit's own camera.
pub const TOOLKIT: &str = "f64-polar-100";

pub const METHODS: &[Method] = rows! { Method { name, summary, sum, walk }
    "f32", "f32 axes, turned and never corrected", Sum::Turns, single::frame::<NONE>;
    "f32-gram-schmidt", "f32 axes, Gram-Schmidt after each step",
        Sum::Turns, single::frame::<GRAM_SCHMIDT>;
    "f32-polar-100", "f32 axes, a Newton step to the polar factor after 100 rotations",
        Sum::Turns, single::frame::<POLAR>;
    "f32-quaternion", "f32 quaternion, normalised after each step", Sum::Turns, single::quaternion;
    "f32-radians", "f32 angles summed in radians, axes recomputed by sine and cosine",
        Sum::Angles, single::angles::<RADIANS>;
    "f32-degrees", "the same in degrees", Sum::Angles, single::angles::<DEGREES>;
    "f32-degrees-wrapped", "the same in degrees, modulo 360",
        Sum::Angles, single::angles::<WRAPPED>;
    "f64", "f64 axes, turned and never corrected", Sum::Turns, double::frame::<NONE>;
    "f64-gram-schmidt", "f64 axes, Gram-Schmidt after each step",
        Sum::Turns, double::frame::<GRAM_SCHMIDT>;
    TOOLKIT,
        "f64 axes, a Newton step to the polar factor after 100 rotations: this toolkit's camera",
        Sum::Turns, toolkit;
    "f64-quaternion", "f64 quaternion, normalised after each step", Sum::Turns, double::quaternion;
    "f64-radians", "f64 angles summed in radians", Sum::Angles, double::angles::<RADIANS>;
    "f64-degrees-wrapped", "f64 angles summed in degrees, modulo 360",
        Sum::Angles, double::angles::<WRAPPED>;
    "f64-lecture", "this toolkit's camera with the lecture's 3.142/180 for pi/180",
        Sum::Turns, lecture;
};

/// Steps that figures are the maxima of: a period between two corrections of those
/// methods that correct now and then. The moment after one says nothing of what a
/// camera is off by.
pub const PERIOD: u64 = (CORRECT_EVERY as u64).div_ceil(ROTATIONS);

/// Rotations of a step: yaw, pitch and roll.
const ROTATIONS: u64 = 3;

/// Largest errors of a method in the [`PERIOD`] that ends after a number of steps.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct RotationDrift {
    /// Name of the method.
    pub method: &'static str,
    /// Steps taken.
    pub steps: u64,
    /// Largest entry of `X^T X - I` for the axes X.
    pub orthogonality_error: f64,
    /// Between the rotation nearest to the axes and the exact one.
    pub angle_error_rad: f64,
    /// Position error of an eye ten away from the centre that the camera looks at.
    pub orbit_position_error: f64,
    /// Difference of that eye's radius from ten.
    pub orbit_radius_error: f64,
}

/// Error of a method after whole turns in steps of one degree.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct TurnDrift {
    /// Name of the method.
    pub method: &'static str,
    /// Whole turns taken.
    pub turns: u64,
    /// Angle to the frame that it began with.
    pub angle_error_rad: f64,
}

/// The frames that methods ought to have at one step of a period.
pub struct Moment {
    /// The last step of the period, which its figures are named for.
    last: u64,
    steps: u64,
    turns: Matrix,
    angles: Matrix,
}

/// Every moment of the periods that end at these numbers of steps, in order.
pub fn moments(looks: &[u64]) -> Vec<Moment> {
    let step = turned(1);
    let period = |&last: &u64| {
        let steps = last.saturating_sub(PERIOD - 1).max(1)..=last;
        let mut turns = step.power(steps.start() - 1);
        let moment = |steps| {
            turns = turns.times(&step);
            Moment {
                last,
                steps,
                turns: turns.clone(),
                angles: turned(steps),
            }
        };
        steps.map(moment).collect::<Vec<_>>()
    };
    let mut all: Vec<Moment> = looks.iter().flat_map(period).collect();
    all.sort_by_key(|moment| moment.steps);
    all
}

impl Method {
    /// Largest errors of every period.
    pub fn drift(&self, moments: &[Moment]) -> Vec<RotationDrift> {
        let steps: Vec<u64> = moments.iter().map(|moment| moment.steps).collect();
        let mut worst: BTreeMap<u64, [f64; 4]> = BTreeMap::new();
        for (moment, axes) in moments.iter().zip((self.walk)(&STEADY, &steps)) {
            let ideal = match self.sum {
                Sum::Turns => &moment.turns,
                Sum::Angles => &moment.angles,
            };
            let axes = Matrix::from(axes);
            let (position, longer) = axes.column_error(ideal, 2);
            let now = [
                axes.orthogonality_error(),
                axes.angle_to(ideal),
                ORBIT_RADIUS * position,
                (ORBIT_RADIUS * longer).abs(),
            ];
            let worst = worst.entry(moment.last).or_default();
            *worst = std::array::from_fn(|i| larger(worst[i], now[i]));
        }
        let row = |(steps, worst): (u64, [f64; 4])| RotationDrift {
            method: self.name,
            steps,
            orthogonality_error: worst[0],
            angle_error_rad: worst[1],
            orbit_position_error: worst[2],
            orbit_radius_error: worst[3],
        };
        worst.into_iter().map(row).collect()
    }

    /// Errors after ascending numbers of whole turns, which end where they began.
    /// They hold at that moment alone, since no other is a whole turn.
    pub fn turn_drift(&self, turns: &[u64]) -> Vec<TurnDrift> {
        let steps: Vec<u64> = turns.iter().map(|turns| 360 * turns).collect();
        let reached = (self.walk)(&ONE_DEGREE, &steps);
        let rows = turns.iter().zip(reached);
        rows.map(|(&turns, axes)| TurnDrift {
            method: self.name,
            turns,
            angle_error_rad: Matrix::from(axes).angle_to(&Matrix::identity()),
        })
        .collect()
    }
}

/// Degrees about the z axis through the centre, every step: the golden ratio's
/// share, so that no two steps end at the same place. At 0.7 the f32 eye comes
/// round to where it was after 3600 steps, and its errors with it.
pub const SWING_DEG: f64 = 0.618_033_988_749_894_9;

/// The turn of every step.
pub const SWING: Turn = Turn::new(SWING_DEG, 0.0, 0.0);

/// The toolkit's own orbit.
pub const TOOLKIT_ORBIT: &str = "f64-carried";

/// Ways to carry the eye. Column u of their results is the eye less the centre, in
/// radii.
pub const CARRIERS: &[Method] = rows! { Method { name, summary, sum, walk }
    "f32-carried", "the f32 eye turned about the centre each step",
        Sum::Turns, single::carried::<false>;
    "f32-carried-radius", "the same, moved back to its distance each step",
        Sum::Turns, single::carried::<true>;
    TOOLKIT_ORBIT, "the f64 eye and its axes turned each step, around and over: this toolkit's orbit",
        Sum::Turns, toolkit_orbit;
    "f64-carried-radius", "the f64 eye alone, moved back to its distance each step",
        Sum::Turns, double::carried::<true>;
    "f64-angle", "the eye recomputed from an f64 angle in degrees, modulo 360",
        Sum::Angles, summed_orbit;
};

/// Error of a carried eye after a number of steps, ten away from its centre.
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

/// Errors of a way to carry the eye after ascending numbers of steps.
pub fn orbit_drift(carrier: &Method, steps: &[u64]) -> Vec<OrbitDrift> {
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

    fn method(name: &str) -> &'static Method {
        METHODS.iter().find(|m| m.name == name).expect(name)
    }

    #[test]
    fn every_method_turns_the_documented_way() {
        // A few steps: only the rounding of the precision is left, and for the
        // lecture's constant its 1.3e-4 of all angles.
        for method in METHODS {
            let steps = [1, 20];
            let drifts = method.drift(&moments(&steps));
            for (drift, steps) in drifts.iter().zip(steps) {
                let (angle, orthogonality) = match method.name {
                    "f64-lecture" => (2e-6 * steps as f64, 4e-15),
                    name if name.starts_with("f32") => (1e-6, 2e-6),
                    _ => (1e-14, 4e-15),
                };
                assert!(drift.angle_error_rad < angle, "{drift:?}");
                assert!(drift.orthogonality_error < orthogonality, "{drift:?}");
                assert!(drift.orbit_position_error < 15.0 * angle, "{drift:?}");
                assert_eq!(drift.steps, steps);
            }
            let rough = method.name.starts_with("f32") || method.name == "f64-lecture";
            let found = drifts[1].angle_error_rad;
            assert_eq!(found > 1e-9, rough, "{}: {found:e}", method.name);
        }
    }

    #[test]
    fn only_corrected_frames_stay_orthonormal() {
        let exact = moments(&[100_000]);
        for method in METHODS {
            let found = method.drift(&exact)[0].orthogonality_error;
            // Uncorrected f32 as found when this was written; mpmath has
            // 9.716e-12 for the power of the three f64 turns.
            let (low, high) = match method.name {
                "f32" => (2e-3, 1e-2),
                "f64" => (9.6e-12, 9.8e-12),
                name if name.starts_with("f32") => (0.0, 5e-6),
                _ => (0.0, 1e-14),
            };
            assert!((low..high).contains(&found), "{}: {found:e}", method.name);
        }
    }

    /// Corrected every hundred rotations, a frame is best the moment after: that was
    /// 1.5e-16 after 1e5 steps, where the worst moment is 30 times as bad.
    #[test]
    fn figures_are_the_worst_of_a_period_between_corrections() {
        assert_eq!(PERIOD, 34);
        let toolkit = method(TOOLKIT);
        let found = |steps| toolkit.drift(&moments(&[steps]))[0].orthogonality_error;
        let all: Vec<f64> = (100_000..100_040).step_by(13).map(found).collect();
        for worst in &all {
            assert!((3e-15..8e-15).contains(worst), "{all:?}");
        }
        let moment = |steps| {
            let axes = (toolkit.walk)(&STEADY, &[steps])[0];
            Matrix::from(axes).orthogonality_error()
        };
        assert!((99_966..=100_000).any(|steps| moment(steps) < 1e-15));
    }

    #[test]
    fn a_thousand_turns_in_summed_radians_end_elsewhere() {
        let radians = method("f32-radians").turn_drift(&[1000]);
        let angle = radians[0].angle_error_rad;
        assert!((angle - 1.761).abs() < 0.01, "{angle}");
        let lecture = method("f64-lecture").turn_drift(&[1, 1000]);
        let [one, thousand] = [0, 1].map(|i| lecture[i].angle_error_rad);
        // 360 * 3.142/180 - 2 pi.
        assert!((one - 8.146_928e-4).abs() < 1e-9, "{one}");
        assert!((thousand - 0.814_692_8).abs() < 1e-6, "{thousand}");
        let toolkit = method(TOOLKIT).turn_drift(&[1]);
        assert!(toolkit[0].angle_error_rad < 1e-14, "{toolkit:?}");
    }

    #[test]
    fn single_precision_leaves_its_circle_and_a_restored_radius_does_not() {
        let after = |name: &str, steps| {
            let carrier = CARRIERS.iter().find(|c| c.name == name).expect(name);
            orbit_drift(carrier, &[steps]).remove(0)
        };
        let worn = after("f32-carried", 100_000);
        assert!((1e-3..0.1).contains(&worn.radius_error), "{worn:?}");
        let kept = after("f32-carried-radius", 100_000);
        assert!(kept.radius_error < 1e-5, "{kept:?}");
        for name in [TOOLKIT_ORBIT, "f64-carried-radius", "f64-angle"] {
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
            let off = orbit_drift(carrier, &[0, 100]).remove(1);
            assert!(off.position_error < 1e-3, "{off:?}");
        }
    }
}
