//! The lecture's zoom in both of its senses: first the eye moves along the
//! look, then it rests and the field of view narrows.

use glam::DVec3;

use super::{PathError, Pose, Stage};
use crate::spec::Spec;

/// `power` (default 8): how many times the view is magnified at the end.
pub(super) fn frames(stage: &Stage, spec: &mut Spec) -> Result<Vec<Pose>, PathError> {
    let power = spec.number_between("power", 8.0, 1.0, 1e6)?;
    let forward = DVec3::new(0.8, 0.5, -0.3).normalize();
    let from = stage.centre() - forward * stage.radius();
    let pose = |t: f64| {
        // From the rim to a tenth of the way before the centre.
        let travelled = (2.0 * t).min(1.0) * 0.9 * stage.radius();
        let magnification = libm::pow(power, (2.0 * t - 1.0).max(0.0));
        Pose {
            magnification,
            ..Pose::new(from + forward * travelled, forward)
        }
    };
    Ok(stage.turns().map(pose).collect())
}
