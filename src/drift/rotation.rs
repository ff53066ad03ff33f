//! Drift of camera bases from the exact turn.
//!
//! A row of [`METHODS`] for each way to keep one.

use std::array::from_fn;

use serde::Serialize;

use super::exact::{Matrix, errors, larger};
use super::frames::{
    CORRECT_EVERY, GRAM_SCHMIDT, LECTURE, NONE, ONE_DEGREE, POLAR, STEADY, Walk, double,
    quaternion, radians, single, toolkit,
};
use crate::arithmetic::Expansion;

/// Yaw, pitch and roll by `times` times [`STEADY`], to more than 40 digits.
fn turned(times: u64) -> Matrix {
    let about = |axis, degrees| Matrix::about(axis, &Expansion::product(degrees, times as f64));
    let turned = about(1, STEADY[0]).times(&about(0, STEADY[1]));
    turned.times(&about(2, STEADY[2]))
}

/// One way to keep a frame.
pub struct Method {
    pub name: &'static str,
    pub summary: &'static str,
    /// Yaw, pitch and roll by the sums of all angles, instead of one turn after another
    /// about the axes as they then are. The two differ, since turns do not commute; each
    /// method is compared with its own.
    pub sums_angles: bool,
    /// The frame's axes u, v, n after each of the ascending numbers of steps.
    pub walk: Walk,
}

/// The toolkit's own camera.
pub const TOOLKIT: &str = "f64-polar-100";

pub const METHODS: &[Method] = rows! { Method { name, summary, sums_angles, walk }
    "f32", "f32 axes, turned and never corrected", false, single::frame::<NONE>;
    "f32-gram-schmidt", "f32 axes, Gram-Schmidt after each step", false, single::frame::<GRAM_SCHMIDT>;
    "f32-polar-100", "f32 axes, a Newton step to the polar factor after 100 rotations",
        false, single::frame::<POLAR>;
    "f32-quaternion", "f32 quaternion, normalised after each step", false, quaternion;
    "f32-radians", "f32 angles summed in radians, axes recomputed by sine and cosine",
        true, radians;
    "f64", "f64 axes, turned and never corrected", false, double::frame::<NONE>;
    "f64-gram-schmidt", "f64 axes, Gram-Schmidt after each step", false, double::frame::<GRAM_SCHMIDT>;
    TOOLKIT,
        "f64 axes, a Newton step to the polar factor after 100 rotations: this toolkit's camera",
        false, |turn, looks| toolkit(turn, looks, 1.0);
    "f64-lecture", "this toolkit's camera with the lecture's 3.142/180 for pi/180",
        false, |turn, looks| toolkit(turn, looks, LECTURE);
};

/// Steps that figures are the maxima of: a period between two corrections of those
/// methods that correct now and then. The moment after one says nothing of what a
/// camera is off by.
/// A step has three rotations: yaw, pitch and roll.
pub const PERIOD: u64 = (CORRECT_EVERY as u64).div_ceil(3);

/// Distance from the centre of an orbit to the eye.
pub const ORBIT_RADIUS: f64 = 10.0;

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

impl RotationDrift {
    /// The larger error; NaN for a basis that is lost.
    pub(super) fn error(&self) -> f64 {
        larger(self.angle_error_rad, self.orthogonality_error)
    }
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

/// Frames that methods ought to have in the [`PERIOD`] up to a number of steps.
pub struct Period {
    steps: Vec<u64>,
    /// Frames after turns, and after sums of angles.
    exact: [Vec<Matrix>; 2],
}

impl Period {
    pub fn new(last: u64) -> Period {
        let steps = last.saturating_sub(PERIOD - 1).max(1)..=last;
        let (step, mut turns) = (turned(1), turned(1).power(steps.start() - 1));
        let turn = |_| {
            turns = turns.times(&step);
            turns.clone()
        };
        let turns = steps.clone().map(turn).collect();
        Period {
            exact: [turns, steps.clone().map(turned).collect()],
            steps: steps.collect(),
        }
    }
}

impl Method {
    /// Largest errors of a period.
    pub fn drift(&self, period: &Period) -> RotationDrift {
        let exact = &period.exact[usize::from(self.sums_angles)];
        let walked = (self.walk)(&STEADY, &period.steps).into_iter().zip(exact);
        let all = walked.map(|(axes, exact)| errors(axes, exact));
        let [orthogonality_error, angle_error_rad, position, radius] =
            all.fold([0.0; 4], |worst, now| from_fn(|i| larger(worst[i], now[i])));
        RotationDrift {
            method: self.name,
            steps: period.steps.last().copied().unwrap_or(0),
            orthogonality_error,
            angle_error_rad,
            orbit_position_error: ORBIT_RADIUS * position,
            orbit_radius_error: ORBIT_RADIUS * radius,
        }
    }

    /// Error after whole turns, which end where they began. It holds at that moment
    /// alone, since no other is a whole turn.
    pub fn turn_drift(&self, turns: u64) -> TurnDrift {
        let axes = (self.walk)(&ONE_DEGREE, &[360 * turns])[0];
        TurnDrift {
            method: self.name,
            turns,
            angle_error_rad: errors(axes, &Matrix::identity())[1],
        }
    }
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
            let drifts = steps.map(|steps| method.drift(&Period::new(steps)));
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
        let exact = Period::new(100_000);
        for method in METHODS {
            let found = method.drift(&exact).orthogonality_error;
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
        let found = |steps| toolkit.drift(&Period::new(steps)).orthogonality_error;
        let all: Vec<f64> = (100_000..100_040).step_by(13).map(found).collect();
        for worst in &all {
            assert!((3e-15..8e-15).contains(worst), "{all:?}");
        }
        let moment = |steps| {
            let axes = (toolkit.walk)(&STEADY, &[steps])[0];
            errors(axes, &Matrix::identity())[0]
        };
        assert!((99_966..=100_000).any(|steps| moment(steps) < 1e-15));
    }

    #[test]
    fn a_thousand_turns_in_summed_radians_end_elsewhere() {
        let radians = method("f32-radians").turn_drift(1000);
        let angle = radians.angle_error_rad;
        assert!((angle - 1.761).abs() < 0.01, "{angle}");
        let lecture = method("f64-lecture");
        let [one, thousand] = [1, 1000].map(|turns| lecture.turn_drift(turns).angle_error_rad);
        // 360 * 3.142/180 - 2 pi.
        assert!((one - 8.146_928e-4).abs() < 1e-9, "{one}");
        assert!((thousand - 0.814_692_8).abs() < 1e-6, "{thousand}");
        let toolkit = method(TOOLKIT).turn_drift(1);
        assert!(toolkit.angle_error_rad < 1e-14, "{toolkit:?}");
    }
}
