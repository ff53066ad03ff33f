//! The whole scene from outside: everything is visible, so the cost of the
//! answer itself shows.

use glam::DVec3;

use super::{PathError, Pose, Stage};
use crate::spec::Spec;

/// Eyes on a Fibonacci spiral over the sphere, far enough away for any field
/// of view above 30 degrees to take in the scene's bounding sphere.
pub(super) fn frames(stage: &Stage, _: &mut Spec) -> Result<Vec<Pose>, PathError> {
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    // 1/sin(15 degrees) = 3.86 radii.
    let distance = 4.0 * stage.radius();
    let pose = |turn: f64| {
        let i = turn * stage.count as f64;
        let z = 0.98 * (1.0 - 2.0 * turn);
        let ring = (1.0 - z * z).sqrt();
        let arm = DVec3::new(
            ring * libm::cos(i * GOLDEN_ANGLE),
            ring * libm::sin(i * GOLDEN_ANGLE),
            z,
        );
        Pose::new(stage.centre() + arm * distance, -arm)
    };
    Ok(stage.turns().map(pose).collect())
}
