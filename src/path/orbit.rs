//! A circle about the scene: everything turns past, the whole scene in view
//! or half of it, depending on the radius.

use glam::DVec3;

use super::{PathError, Pose, Stage};
use crate::spec::Spec;

/// `radius` (in half diagonals, default 0.6) and `height` (of the eye above
/// the centre, in radii, default 0.35).
pub(super) fn frames(stage: &Stage, spec: &mut Spec) -> Result<Vec<Pose>, PathError> {
    let radius = spec.number_between("radius", 0.6, 0.0, 1e6)? * stage.radius();
    let height = spec.number("height", 0.35)? * radius;
    let pose = |turn: f64| {
        let angle = std::f64::consts::TAU * turn;
        let arm = DVec3::new(libm::cos(angle) * radius, libm::sin(angle) * radius, height);
        Pose::new(stage.centre() + arm, -arm)
    };
    Ok(stage.turns().map(pose).collect())
}
