//! A turn in place: the eye rests, the view changes. Built with the camera's
//! own yaw, as the lectures do.

use glam::DVec3;

use super::{PathError, Pose, Stage};
use crate::camera::Frame;
use crate::spec::Spec;

pub(super) fn frames(stage: &Stage, _: &mut Spec) -> Result<Vec<Pose>, PathError> {
    let eye = stage.centre().with_z(stage.flight_level(0.3));
    let level = Frame::looking_along(eye, DVec3::X, DVec3::Z);
    let mut frame = level.map_err(|error| PathError::unfit("spin", error))?;
    let step = 360.0 / stage.count as f64;
    let poses = (0..stage.count).map(|_| {
        let pose = Pose::new(frame.eye, frame.forward());
        frame.yaw(step);
        pose
    });
    Ok(poses.collect())
}
