//! The scene's own camera places: where its author put something to look
//! from. For a Doom map these are its things, at eye height.

use super::{PathError, Pose, Stage};
use crate::scene::CameraPlace;
use crate::spec::Spec;

pub(super) fn frames(stage: &Stage, _: &mut Spec) -> Result<Vec<Pose>, PathError> {
    if stage.scene.places.is_empty() {
        let reason = format!(
            "scene '{}' has no camera places of its own; expected one with places, such as a Doom map",
            stage.scene.name
        );
        return Err(PathError::unfit("places", reason));
    }
    let places = stage.scene.places.iter();
    let pose = |place: &CameraPlace| {
        let [eye, forward] = [place.eye, place.forward].map(|v| stage.up.to_z_up(v));
        Pose::new(eye, forward)
    };
    Ok(places.map(pose).collect())
}
