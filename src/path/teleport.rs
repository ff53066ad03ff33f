//! Unrelated views: the eye jumps, so nothing of the last frame helps.

use glam::DVec3;

use super::{PathError, Pose, Stage};
use crate::spec::Spec;

pub(super) fn frames(stage: &Stage, _: &mut Spec) -> Result<Vec<Pose>, PathError> {
    let mut rng = stage.rng();
    let poses = (0..stage.count).map(|_| {
        let share = rng.point();
        let z = stage.flight_level(share.z);
        let eye = (stage.bounds.min + stage.extent() * share).with_z(z);
        // Normal components: every direction is equally likely.
        let forward = rng.normal3();
        let forward = if forward == DVec3::ZERO {
            DVec3::X
        } else {
            forward
        };
        Pose::new(eye, forward)
    });
    Ok(poses.collect())
}
