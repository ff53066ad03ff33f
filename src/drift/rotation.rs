//! Drift of camera bases from the exact rotation.
//!
//! [`METHODS`] has a row for each method that keeps a basis.

use std::array::from_fn;
use std::ops::RangeInclusive;

use serde::Serialize;

use super::bases::{
    BasisWalk, CORRECT_EVERY, GRAM_SCHMIDT, LECTURE_PI_RATIO, NONE, POLAR, STEADY, double,
    quaternion, radians, single, toolkit,
};
use super::exact::{Matrix, errors, larger};
use crate::arithmetic::Expansion;

/// Yaw, pitch and roll by `times` times [`STEADY`], to more than 40 digits.
fn rotated(times: u64) -> Matrix {
    let about = |axis, degrees| Matrix::rotation(axis, &Expansion::product(degrees, times as f64));
    let rotated = about(1, STEADY[0]).times(&about(0, STEADY[1]));
    rotated.times(&about(2, STEADY[2]))
}

/// A method that keeps a camera basis.
#[derive(Debug, Serialize)]
pub struct Method {
    /// Name in tables and JSON.
    pub name: &'static str,
    /// One-line description.
    pub summary: &'static str,
    /// True if the method rotates by the sums of all yaw, pitch and roll angles.
    ///
    /// Otherwise it rotates step by step about the current axes. The results differ, since
    /// rotations do not commute; each method is compared with its own reference.
    #[serde(skip)]
    pub sums_angles: bool,
    /// Axes u, v, n after each of some numbers of steps.
    #[serde(skip)]
    pub walk: BasisWalk,
}

pub const METHODS: &[Method] = rows! { Method { name, summary, sums_angles, walk }
    "f32", "f32 axes, turned and never corrected", false, single::basis::<NONE>;
    "f32-gram-schmidt", "f32 axes, Gram-Schmidt after each step", false, single::basis::<GRAM_SCHMIDT>;
    "f32-polar-100", "f32 axes, a Newton step to the polar factor after 100 rotations",
        false, single::basis::<POLAR>;
    "f32-quaternion", "f32 quaternion, normalised after each step", false, quaternion;
    "f32-radians", "f32 angles summed in radians, axes recomputed by sine and cosine",
        true, radians;
    "f64", "f64 axes, turned and never corrected", false, double::basis::<NONE>;
    "f64-gram-schmidt", "f64 axes, Gram-Schmidt after each step", false, double::basis::<GRAM_SCHMIDT>;
    "f64-polar-100",
        "f64 axes, a Newton step to the polar factor after 100 rotations: this toolkit's camera",
        false, |samples| toolkit(samples, 1.0);
    "f64-lecture", "this toolkit's camera with the lecture's 3.142/180 for pi/180",
        false, |samples| toolkit(samples, LECTURE_PI_RATIO);
};

/// Steps over which errors are maximized: one period between two corrections.
///
/// Some methods correct periodically, and the error just after a correction is not that of a camera
/// in use. A step has three rotations: yaw, pitch and roll.
const PERIOD: u64 = (CORRECT_EVERY as u64).div_ceil(3);

/// Reference bases in the [`PERIOD`] up to a number of steps.
pub struct Period {
    steps: RangeInclusive<u64>,
    /// Exact bases after successive rotations, and after sums of angles.
    exact: [Vec<Matrix>; 2],
}

impl Period {
    pub fn new(last: u64) -> Period {
        let steps = last.saturating_sub(PERIOD - 1).max(1)..=last;
        let (step, mut turns) = (rotated(1), rotated(1).power(steps.start() - 1));
        let turn = |_| {
            turns = turns.times(&step);
            turns.clone()
        };
        let turns = steps.clone().map(turn).collect();
        let exact = [turns, steps.clone().map(rotated).collect()];
        Period { steps, exact }
    }
}

impl Method {
    /// Largest errors of a period, orthogonality and angle; NaN if a basis is lost.
    pub fn errors(&self, period: &Period) -> [f64; 2] {
        let exact = &period.exact[usize::from(self.sums_angles)];
        let walked = (self.walk)(period.steps.clone()).into_iter().zip(exact);
        let all = walked.map(|(axes, exact)| errors(axes, exact));
        all.fold([0.0; 2], |worst, now| from_fn(|i| larger(worst[i], now[i])))
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
        // After a few steps only the rounding of the precision is left, and for the lecture's
        // constant its 1.3e-4 of all angles.
        for method in METHODS {
            let mut found = 0.0;
            for steps in [1, 20] {
                let (most_angle, most_off) = match method.name {
                    "f64-lecture" => (2e-6 * steps as f64, 4e-15),
                    name if name.starts_with("f32") => (1e-6, 2e-6),
                    _ => (1e-14, 4e-15),
                };
                let [off, angle] = method.errors(&Period::new(steps));
                assert!(angle < most_angle, "{}: {angle:e}", method.name);
                assert!(off < most_off, "{}: {off:e}", method.name);
                found = angle;
            }
            let rough = method.name.starts_with("f32") || method.name == "f64-lecture";
            assert_eq!(found > 1e-9, rough, "{}: {found:e}", method.name);
        }
    }

    #[test]
    fn only_corrected_frames_stay_orthonormal() {
        let exact = Period::new(100_000);
        for method in METHODS {
            let [found, _] = method.errors(&exact);
            // Values of uncorrected f32 are pinned; mpmath gives 9.716e-12 for the power of the
            // three f64 rotations.
            let (low, high) = match method.name {
                "f32" => (2e-3, 1e-2),
                "f64" => (9.6e-12, 9.8e-12),
                name if name.starts_with("f32") => (0.0, 5e-6),
                _ => (0.0, 1e-14),
            };
            assert!((low..high).contains(&found), "{}: {found:e}", method.name);
        }
    }

    /// Corrected every hundred rotations, a basis is best just after a correction.
    ///
    /// The best error was 1.5e-16 after 1e5 steps, where the worst is 30 times as large.
    #[test]
    fn figures_are_the_worst_of_a_period_between_corrections() {
        assert_eq!(PERIOD, 34);
        let toolkit = method("f64-polar-100");
        let found = |steps| toolkit.errors(&Period::new(steps))[0];
        let all: Vec<f64> = (100_000..100_040).step_by(13).map(found).collect();
        for worst in &all {
            assert!((3e-15..8e-15).contains(worst), "{all:?}");
        }
        let moments = (toolkit.walk)(99_966..=100_000).into_iter();
        let mut moments = moments.map(|axes| errors(axes, &Matrix::from(glam::DMat3::IDENTITY))[0]);
        assert!(moments.any(|error| error < 1e-15));
    }

    /// The lecture's 3.142/180 makes every angle too large.
    ///
    /// 1000 steps of 0.7 degrees yaw, with the other angles of a step.
    #[test]
    fn the_lectures_constant_is_the_largest_error_of_f64() {
        let period = Period::new(1000);
        let [_, lecture] = method("f64-lecture").errors(&period);
        let [_, toolkit] = method("f64-polar-100").errors(&period);
        assert!(lecture > 1e-4 && toolkit < 1e-12, "{lecture} {toolkit}");
    }
}
